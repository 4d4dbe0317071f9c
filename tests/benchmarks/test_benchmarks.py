"""The benchmarks run, once and small: their times are not judged, what they compare is."""

from __future__ import annotations

import re

import pytest

from tests.benchmarks import __main__ as benchmarks
from tests.benchmarks import planner
from tests.support import FEW_STARTS


def line_of(name: str, out: str) -> list[float]:
    """Our time, the peer's and their ratio."""
    (found,) = re.findall(rf"^{re.escape(name)} +(\S+) +(\S+) +(\S+) ", out, re.M)
    return [float(number) for number in found]


@pytest.mark.slow
def test_small_programs(capsys: pytest.CaptureFixture[str]) -> None:
    benchmarks.predictions(repeats=1)
    benchmarks.fine_solve(repeats=1)
    out = capsys.readouterr().out
    for name in ("PMKE prediction (trajectory 3)", "fine global solve (303 parameters)"):
        assert all(number > 0 for number in line_of(name, out))
    assert float(re.findall(r"costs agree to (\S+)", out)[0]) < 1e-4
    assert float(re.findall(r"motions agree to (\S+) rad", out)[0]) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sim1", "sim5", "floating3r"])
def test_the_planner_beside_its_peer(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """sim1: energy, free; sim5: a cycle with limits; floating3r: momentum."""
    planner.simulation(name, *FEW_STARTS, "method.global.optimised=12", "timing.steps=24")
    out = capsys.readouterr().out
    assert all(number > 0 for number in line_of(name, out))
    costs = {label: float(cost) for label, cost in re.findall(r"^  (ours|peer) +(\S+)", out, re.M)}
    assert costs["ours"] == pytest.approx(costs["peer"], rel=1e-5)
    assert float(re.findall(r"costs within (\S+),", out)[0]) < 1e-9
    assert float(re.findall(r"limits kept to (\S+)", out)[0]) < 1e-6


@pytest.mark.slow
def test_a_bound_from_below(capsys: pytest.CaptureFixture[str]) -> None:
    benchmarks.main(["bound", "traj4:6"])
    out = capsys.readouterr().out
    assert re.search(r"^traj4 +6 +0\.02\S+ +0\.0\S+ % ", out, re.M)


@pytest.mark.parametrize("words", [["large"], ["planner", "sim9"], ["bound", "sim9"]])
def test_an_unknown_part_is_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit, match="not one of"):
        benchmarks.main(words)
