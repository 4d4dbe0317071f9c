"""The planner's default beside a brute-force search on thirty random problems (`planar.csv`, `planar.py`)."""

from __future__ import annotations

import pandas as pd
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.costs import objective_values
from tests.suite.planar import COUNTS, FILE
from tests.support import composed

KNOWN = pd.read_csv(FILE, quotechar='"')
SAME = 1e-4  # relative: costs of one optimum


def found_of(name: str) -> tuple[list[float], list[float]]:
    """Costs of the known optima, and of the planner's: all on the same knots."""
    row = KNOWN[KNOWN["name"] == name].iloc[0]
    problem = prepare(composed(*(word.strip("'") for word in row["command"].split("' '"))))
    solutions = global_planner(problem, GlobalOptions(refine_to=None))
    return [float(cost) for cost in str(row["optima"]).split()], [
        float(objective_values(problem, problem.times, s.trajectory.q[None])[0]) for s in solutions if s.found
    ]


@pytest.mark.slow
def test_the_best_is_found_and_nearly_all_below_three_times_the_best() -> None:
    listed = total = 0
    for name in KNOWN["name"]:
        known, ours = found_of(name)
        assert ours, name
        assert ours[0] <= known[0] * (1 + SAME), name
        listed += sum(min(abs(cost / other - 1) for other in ours) < SAME for cost in known)
        total += len(known)
    assert len(KNOWN) == sum(COUNTS.values())
    assert listed >= 0.95 * total, f"{listed} of {total}"
