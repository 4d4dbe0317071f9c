"""Why the planner has no motion: what was tried and how near it came, and nothing that was not looked at."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.reasons import no_feasible, no_optimum, no_start
from pipeline.methods.method import Context
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.program.feasibility import Relaxed, Violation
from tests.support import composed

INWARD = ("robot.q_init=[0,0,0]", "path.length=0.1", "path.direction=180", "timing.steps=13")


def stated(*words: str) -> Problem:
    return prepare(composed(*words))


def test_motions_that_get_stuck_do_not_move_the_path_out_of_reach() -> None:
    """From a straight arm no least step leads inwards: nothing that the population draws follows such a path."""
    config = composed(*INWARD, "method.global.starts=population", "method.global.candidates=40")
    (only,) = global_planner(prepare(config), config.method.global_, Context(1))
    assert only.status is Status.INFEASIBLE
    assert "none of 40 motions that were drawn" in only.message
    assert "method.global.starts" in only.message
    assert "reach" not in only.message


@pytest.mark.slow
def test_a_path_out_of_reach_is_said_with_where_and_by_how_much() -> None:
    problem = stated("timing.steps=20", "timing=constant_speed", "timing.duration=2")
    start = problem.reference.position(np.zeros(1))[0]
    length = float(np.linalg.norm(problem.task.value(np.zeros((1, 3)))))
    gone = replace(problem, reference=Reference(Line(start, np.array([1.0, 0.0]), 0.5), problem.reference.timing))
    said = no_start(gone, 10)
    far = np.linalg.norm(gone.reference.position(gone.times), axis=1) - length
    assert f"leaves the reach of the arm, first at t = {gone.times[np.argmax(far > 0)]:.3g} s" in said
    assert float(said.split("by up to ")[1].split()[0]) == pytest.approx(far.max(), rel=5e-3)


@pytest.mark.slow
def test_a_place_that_the_joints_limits_forbid_is_named_with_what_lacks() -> None:
    """Held against the closed form of the two outer joints, for every angle of the first one."""
    problem = stated(
        "path.start=[0.3,-0.1]", "path.direction=90", "path.length=0.2", "timing.steps=20", "boundary=free"
    )
    most = np.array([0.3, 1.5, 1.5])
    held = replace(problem, limits=replace(Limits.none(3), lower=-most, upper=most))
    (nothing,) = global_planner(held, GlobalOptions(optimised=4, nodes=40), Context(1))
    assert nothing.status is Status.INFEASIBLE
    said = re.fullmatch(
        r"at (\S+) m along the path .* the nearest is (\S+) beyond that of joint\d \(.*\)", nothing.message
    )
    assert said is not None, nothing.message
    place, excess = map(float, said.groups())
    (a, b, c), q1 = (0.176, 0.176, 0.1375), np.linspace(-np.pi, np.pi, 200_001)
    x, y = 0.3 - a * np.cos(q1), place - 0.1 - a * np.sin(q1)
    cosine = (x**2 + y**2 - b**2 - c**2) / (2 * b * c)
    least = np.inf
    for bent in np.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan)) * np.array([[1.0], [-1.0]]):
        q2 = np.arctan2(y, x) - np.arctan2(c * np.sin(bent), b + c * np.cos(bent)) - q1
        q = np.stack([q1, (q2 + np.pi) % (2 * np.pi) - np.pi, bent])
        least = min(least, float(np.nanmin((np.abs(q) - most[:, None]).max(axis=0))))
    assert excess == pytest.approx(least, abs=5e-3)
    assert excess > 0.05


def test_no_path_through_a_grid() -> None:
    assert no_start(stated(), 0).startswith("no path through the grid of dynamic programming keeps the limits")


@pytest.mark.parametrize(("attempts", "words"), [(1, "the one attempt"), (3, "none of 3 attempts")])
def test_how_many_attempts_there_were(attempts: int, words: str) -> None:
    worst = Violation("velocity", "elbow", 1.0, 1.5, 2.0, 0.5)
    said = no_feasible(64, Relaxed(np.zeros((2, 3)), worst, attempts))
    assert "none of 64 starts led to one" in said
    assert words in said
    assert "the velocity limit of elbow (1 rad/s); the least violation found is 50 % (1.5 rad/s at t = 2 s)" in said
    assert "cannot" not in said


def test_the_best_attempt_that_did_not_converge() -> None:
    """The nearer of two to the path, how far it is from it, and what it exceeds."""
    problem = stated("limits.velocity=0.01", "timing.steps=4")
    wanted = problem.reference.position(problem.times)
    still, bent = np.tile(problem.q_init, (5, 1)), np.tile(problem.q_init + 0.5, (5, 1))
    still[-1, 1] += 0.1
    off = [float(np.abs(problem.task.value(q) - wanted).max()) for q in (still, bent)]
    assert off[0] < off[1]
    lost = np.full((5, 3), np.nan)
    starts = [Optimum(q, 1.0, False, "iteration limit") for q in (bent, still, lost)]
    said = no_optimum(problem, problem.times, starts, [])
    assert said.startswith("none of 3 starts converged (most often: iteration limit)")
    assert (
        f"the best attempt is {off[0]:.2g} m off its path and exceeds the velocity limit of joint2 (0.01 rad/s)" in said
    )
    speed = 0.1 / (problem.times[-1] - problem.times[-2])
    assert f"({speed:.4g} rad/s at t = {problem.times[-1]:.3g} s)" in said
    assert "best attempt" not in no_optimum(problem, problem.times, starts[2:], [])


@pytest.mark.parametrize("method", ["global", "dynamic_programming", "pontryagin"])
def test_motions_are_never_farther_apart_than_half_a_turn(method: str) -> None:
    """With a larger measure of what is the same, no start would differ from the first."""
    with pytest.raises(ConfigError, match=rf"method\.{method}\.same_path = .*: must be a number > 0 and <= 3\.14 rad"):
        composed(f"method.{method}.same_path=1e9")


def test_an_optimum_that_was_lost_says_what_it_could_not_meet() -> None:
    """On which grid, and by how much; of one that the batch has lost there is only its word."""
    problem = stated("timing.steps=4")
    q = np.tile(problem.q_init, (5, 1))
    told = {"intervals": 50, "violation": 2e-3, "optimality": 0.4}
    refined = [Optimum(q, 1.0, False, "iteration limit", solves=[told]), Optimum(q, 1.0, False, "lost")]
    said = no_optimum(problem, problem.times, [Optimum(q, 1.0, True, "success")], refined)
    assert said.startswith("2 optima of the coarse grid were lost on a finer one (")
    assert "iteration limit on 50 intervals: its constraints hold to 2e-03, its optimality to 4e-01" in said
    assert "; lost)" in said
    said = no_optimum(problem, problem.times, [Optimum(q, 1.0, True, "success")], refined[:1])
    assert said.startswith("1 optimum of the coarse grid was lost on a finer one (")
