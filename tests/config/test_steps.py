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
    "front": (
        ["methods=[pareto]", "method.global.layers=58"],
        r"nodes x layers x layers is 1\.01e\+06; at most 1e\+06",
    ),
    "knots": (["timing.steps=20001"], r"timing\.steps = 20001: .* at most 2e\+04 intervals of planned motions"),
    "starts at once": (
        ["timing.steps=2000", "method.global.coarse_steps=1563"],
        r"method\.global\.optimised = 64, method\.global\.coarse_steps = 1563: .* is 1e\+05; at most 1e\+05 knots",
    ),
    "many starts": (
        ["method.global.optimised=4001"],
        r"optimised = 4001, method\.global\.coarse_steps = null: .* is 1e\+05",
    ),
    "cells": (
        ["methods=[lower_bound]", "method.lower_bound.cells=448"],
        r"lower_bound\.cells = 448, method\.lower_bound\.intervals = 50: cells x cells x intervals is 1e\+07; at most",
    ),
    "grid": (
        ["methods=[dynamic_programming]", "method.dynamic_programming.nodes=6325"],
        r"dynamic_programming\.nodes = 6325, .*\.intervals = 25: nodes x nodes x intervals is 1e\+09; at most 1e\+09",
    ),
    "grid of the planner": (
        ["method.global.starts=[roadmap,dynamic_programming]", "method.dynamic_programming.nodes=10000"],
        r"nodes x nodes x intervals is 2\.5e\+09",
    ),
    "seed": (["seed=100000000000000000000000"], r"seed = .*<= 1"),
    "workers": (["parallel.workers=100000"], r"parallel\.workers = 100000: .*<= 1024"),
}


@pytest.mark.parametrize("case", ENDLESS)
def test_what_would_not_end_is_refused(case: str) -> None:
    words, line = ENDLESS[case]
    with pytest.raises(ConfigError, match=line):
        composed(*words)


@pytest.mark.slow
def test_what_does_not_run_is_not_counted() -> None:
    assert composed("methods=[lsv]", "method.pmke.dt=1e-9", "method.global.layers=58").timing.duration == 10.0
    assert composed("timing.steps=20000", "method.global.optimised=4000").timing.steps == 20000
    assert composed("methods=[lsv]", "timing.steps=100000").timing.steps == 100000
    within = ("method.global.layers=57", "method.lower_bound.cells=447", "method.dynamic_programming.nodes=6324")
    assert composed("methods=[global,lower_bound,dynamic_programming]", *within).timing.duration == 10.0
    assert composed("methods=[global]", "timing.duration=1e5", "export.method=none").timing.duration == 1e5
