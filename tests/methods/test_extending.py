"""A new method is one file and one line of a tuple: the example of docs/extending.md."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.method import Context, Method, NoOptions, Serves
from pipeline.methods.registry import METHODS
from pipeline.model.kinematics import project
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.run.solve import solve as solve_all
from pipeline.studies import style
from tests.support import composed


def solve(problem: Problem, options: NoOptions, context: Context) -> list[Solution]:
    """The end effector is put on its path knot by knot, from where the joints were, by the least move."""
    rows = [problem.q_init[None]]
    for target in problem.reference.position(problem.times[1:]):
        rows.append(project(problem.task, rows[-1], target[None])[0])
    trajectory = Trajectory(problem.times, np.concatenate(rows))
    return [Solution("knotwise", trajectory, Status.SOLVED, tracking_tolerance=1e-8)]


knotwise = Method("knotwise", "Knot by knot", "#8D5524", NoOptions, Serves(moving_base=False), solve)


@pytest.mark.slow
def test_a_new_method_runs_like_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "knotwise", knotwise)
    problem = prepare(composed("path.length=0.1", "timing.steps=20"))
    config = SimpleNamespace(methods=("lsv", "knotwise"), method=composed().method)
    solutions, seconds = solve_all(problem, config, Context())  # type: ignore[arg-type]
    assert list(seconds) == [solution.method for solution in solutions] == ["lsv", "knotwise"]
    lsv, own = (evaluate(problem, solution) for solution in solutions)
    assert own.status is Status.SOLVED
    assert own.tracking_error.max() < 1e-8
    # Both take the least joint velocities, one at every instant and one over every interval.
    assert own.energy_integral[-1] == pytest.approx(lsv.energy_integral[-1], rel=0.02)
    assert (style.name("knotwise 2"), style.color("knotwise")) == ("Knot by knot 2", "#8D5524")


def test_it_refuses_by_itself_what_it_does_not_serve() -> None:
    floating = prepare(composed("+experiment=floating3r"))
    with pytest.raises(InputError, match=r"^knotwise: the base is floating; supported are arms on a fixed base$"):
        knotwise(floating)
