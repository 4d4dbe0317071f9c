"""Work is bounded before it begins."""

from __future__ import annotations

import pytest

from pipeline.common.errors import ConfigError
from tests.support import composed

ENDLESS = {
    "step": (["methods=[pmke]", "method.pmke.dt=1e-9"], r"method\.pmke\.dt = 1e-09: 1e\+10 steps.*at most 100000"),
    "long": (["methods=[global]", "timing.duration=1e5"], r"export\.rate = 100: 1e\+07 steps"),
    "turn": (["path.turn=[1e9,0,0]"], r"path\.turn\[0\] = 1000000000\.0: must be a number >= -1000 and <= 1000"),
    "starts": (["method.global.optimised=1000000000"], r"method\.global\.optimised = 1000000000: .*<= 100000"),
    "roadmap": (
        ["method.global.nodes=10000", "method.global.layers=1000"],
        r"method\.global\.nodes = 10000, method\.global\.layers = 1000: .* is 1e\+11; at most 1e\+07",
    ),
    "layers": (
        ["method.global.layers=58"],
        r"nodes = 300, method\.global\.layers = 58: .* is 1\.01e\+06; at most 1e\+06",
    ),
    "seed": (["seed=100000000000000000000000"], r"seed = .*<= 1"),
    "workers": (["parallel.workers=100000"], r"parallel\.workers = 100000: .*<= 1024"),
}


@pytest.mark.parametrize("case", ENDLESS)
def test_what_would_not_end_is_refused(case: str) -> None:
    words, line = ENDLESS[case]
    with pytest.raises(ConfigError, match=line):
        composed(*words)


def test_what_does_not_run_is_not_counted() -> None:
    assert composed("methods=[lsv]", "method.pmke.dt=1e-9").timing.duration == 10.0
    assert composed("methods=[global]", "timing.duration=1e5", "export.method=none").timing.duration == 1e5
