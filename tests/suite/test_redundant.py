"""The planner's default beside a brute-force search where joints or poses leave more than the plane's one loop.

All eleven: python -m tests.suite.test_redundant
"""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.costs import objective_values
from tests.suite.redundant import COUNTS, EXPERIMENTS, FILE
from tests.support import composed

KNOWN = pd.read_csv(FILE, quotechar='"').set_index("name")
SAME = 1e-4  # relative: costs of one optimum
PRINTED = {"panda": 0.070078, "panda_pose": 0.161341, "xarm7": 0.162803}  # [J s], by a planner before this one


def above(names: Iterable[str]) -> dict[str, float]:
    """By how much, relative to the best known, the planner's best is dearer."""
    found = {}
    for name in names:
        problem = prepare(composed(*(word.strip("'") for word in str(KNOWN.loc[name, "command"]).split("' '"))))
        best = global_planner(problem, GlobalOptions(refine_to=None))[0]
        cost = objective_values(problem, problem.times, best.trajectory.q[None])[0] if best.found else float("inf")
        found[name] = float(cost / float(str(KNOWN.loc[name, "optima"]).split()[0]) - 1)
    return found


def test_what_is_known() -> None:
    assert len(KNOWN) == sum(COUNTS.values()) + len(EXPERIMENTS)
    for name, cost in PRINTED.items():
        assert float(str(KNOWN.loc[name, "optima"]).split()[0]) == pytest.approx(cost, abs=1e-6)


@pytest.mark.slow
def test_the_best_is_found() -> None:
    """Of two that are quick: a 4R arm from a given start, and a Panda's pose."""
    assert max(above(["four2", "panda_pose"]).values()) < SAME


if __name__ == "__main__":
    for name, more in above(KNOWN.index).items():
        print(f"{name:<10} {'found' if more < SAME else 'MISSED'} ({more:+.1e})", flush=True)
