"""What says "solved", or "singular" from some time on, follows its path: every method, by the exported curve."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from tests.support import composed

QUICK = (
    *("method.global.optimised=1", "method.global.nodes=40", "method.pareto.steps=2", "method.pareto.rounds=1"),
    *("method.lsv.dt=0.02", "method.inertia_weighted.dt=0.02"),
    *("method.pontryagin.guesses=2", "method.pontryagin.tolerance=1e-7"),
    *("method.calculus_of_variations.spacing=0.2", "method.calculus_of_variations.tolerance=1e-8"),
)
SHORT = (*QUICK, "path.length=0.2", "timing.duration=2", "timing.steps=12")
CIRCLE = (*QUICK, "path=circle", "path.angle=720", "timing.duration=2", "timing.steps=12")
FLOATING = (*SHORT, "method.global.candidates=8", "robot=planar3r_base", "base=free")
HELD = (*QUICK, "objective=reaction", "timing.steps=12")
STEPS = ("method.pmke.prediction_step=0.4", "method.receding.prediction_step=0.1")

TABLE = {
    "line": (SHORT, ("lsv", "inertia_weighted", "pmke", "receding", "global", "dynamic_programming")),
    "small windows": ((*SHORT, *STEPS), ("pmke", "receding")),
    "variations": ((*SHORT, "boundary=free"), ("calculus_of_variations", "dynamic_programming")),
    "principle": (
        (*SHORT, "objective=velocity_norm", "timing=constant_speed"),
        ("pontryagin", "pontryagin_as_printed"),
    ),
    "front": (SHORT, ("pareto",)),
    "gain": ((*SHORT, "method.lsv.gain=40", "method.lsv.dt=0.04", "method.lsv.integrator=euler"), ("lsv",)),
    "large steps": ((*SHORT, "method.lsv.dt=0.5", "method.lsv.max_drift=1", "method.pmke.dt=0.2"), ("lsv", "pmke")),
    "two turns": (CIRCLE, ("lsv", "pmke", "global", "dynamic_programming")),
    "floating": (FLOATING, ("lsv", "pmke", "global")),
    "held": (HELD, ("lsv", "pmke")),
    "held, quick": ((*HELD, "timing.duration=4", "path.length=0.3"), ("lsv", "pmke")),
}


def off(problem: Problem, motion: Evaluation, until: float) -> Array:
    """Distances [m] of the smooth curve through the knots from the path, by the arm's own kinematics."""
    time, q = motion.solution.trajectory.time, motion.solution.trajectory.q
    fine = np.linspace(0.0, min(until, time[-1]), 1500)
    ends = "clamped" if problem.reference.timing.at_rest else "not-a-knot"
    error = problem.task.error(CubicSpline(time, q, bc_type=ends)(fine), problem.reference.position(fine))
    return np.asarray(np.linalg.norm(error[:, : len(problem.task.axes)], axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("row", TABLE)
def test_what_is_solved_is_on_its_path_or_says_how_far_it_is(row: str) -> None:
    words, methods = TABLE[row]
    config = composed(*words)
    problem = prepare(config)
    for name in methods:
        for solution in METHODS[name](problem, config.method.of(name)):
            motion = evaluate(problem, solution)
            if not motion.confirmed:
                assert motion.message
                continue
            worst = off(problem, motion, solution.until).max()
            if worst > 1.01 * problem.reference.tolerance:
                assert "off its path" in motion.message or motion.status is Status.SINGULAR
                promised = 0.02 if solution.knots_only else solution.tracking_tolerance + problem.reference.tolerance
                assert worst < promised, (name, worst)


def test_a_motion_of_three_knots_is_judged_between_them_too() -> None:
    config = composed(*SHORT)
    problem = prepare(config)
    motion = evaluate(problem, METHODS["receding"](problem, config.method.receding)[0])
    assert len(motion.time) == 3
    assert off(problem, motion, np.inf).max() > 0.01
    assert motion.status is Status.UNCONFIRMED
    assert "method.receding.prediction_step = " in motion.message


@pytest.mark.slow
def test_a_motion_that_has_drifted_before_it_becomes_singular_is_not_confirmed() -> None:
    """Predictions through cubic splines, which meet fewer conditions; the others get to the end."""
    config = composed(*HELD, "method.pmke.interpolation=cubic")
    problem = prepare(config)
    motion = evaluate(problem, METHODS["pmke"](problem, config.method.pmke)[0])
    assert motion.solution.status is Status.SINGULAR
    assert off(problem, motion, motion.solution.until).max() > 0.1
    assert motion.status is Status.UNCONFIRMED
    assert "m off its path at t = " in motion.message
