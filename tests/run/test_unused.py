"""What a command line asks for that has no effect."""

from __future__ import annotations

import pytest

from pipeline.common.errors import ConfigError
from pipeline.run.unused import require_motion, unused
from tests.support import composed


@pytest.mark.parametrize(
    ("word", "others", "why"),
    [
        ("method.pmke.dt=0.02", (), "pmke does not run"),
        ("method.global.candidates=9", (), "global does not run"),
        ("closed_loop.bandwidth=3", (), "closed_loop.run = false"),
        ("export.rate=50", ("export.method=none",), "export.method = none"),
        ("robot.pointing=[1,0,0]", (), "robot.orientation = none"),
        ("obstacles.margin=0.1", (), "there are no obstacles"),
    ],
)
def test_a_word_without_effect_is_named(word: str, others: tuple[str, ...], why: str) -> None:
    words = ("methods=[lsv]", *others, word)
    (line,) = unused(words, composed(*words))
    assert line.startswith(f"{word}: without effect, since {why}")


@pytest.mark.parametrize(
    "words",
    [
        ("methods=[lsv,pmke]", "method.pmke.dt=0.02", "method.lsv.gain=1"),
        ("methods=[pareto]", "method.global.candidates=9"),
        ("methods=[lsv]", "candidate_study.run=true", "method.global.candidates=9"),
        ("methods=[global]", "closed_loop.run=true", "closed_loop.bandwidth=3", "export.rate=50"),
        ("+experiment=traj1", "methods=[lsv]", "path.length=0.1"),
    ],
)
def test_what_is_used_is_not_complained_about(words: tuple[str, ...]) -> None:
    assert unused(words, composed(*words)) == []


def test_an_export_of_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"export\.method = pmke: that method does not run \(methods = \[lsv\]\)"):
        require_motion(composed("methods=[lsv]", "export.method=pmke"))
    with pytest.raises(ConfigError, match=r"closed_loop\.run = true: .* export\.method = none"):
        require_motion(composed("closed_loop.run=true", "export.method=none"))
    require_motion(composed("closed_loop.run=true", "export.method=global"))
