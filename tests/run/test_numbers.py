"""The numbers of the PMKE paper, recomputed from q(t)."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.method import Context
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.run.solve import solve
from tests.support import FEW_STARTS, composed

# --- the numbers of the PMKE paper -----------------------------------------------------------------------------------


@functools.cache
def solved(number: int, method: str) -> tuple[Problem, list[Evaluation]]:
    config = composed(f"+experiment=traj{number}", f"methods=[{method}]", *FEW_STARTS, "method.lsv.dt=0.02")
    problem = prepare(config)
    solutions, seconds = solve(problem, config, Context())
    assert seconds[method] > 0
    return problem, [evaluate(problem, solution) for solution in solutions]


@pytest.mark.slow
@pytest.mark.parametrize(("number", "energy"), [(1, 8.81e-4), (2, 5.37e-3), (4, 5.17e-2)])
def test_lsv(number: int, energy: float) -> None:
    (motion,) = solved(number, "lsv")[1]
    assert motion.status is Status.SOLVED
    assert motion.energy_integral[-1] == pytest.approx(energy, rel=5e-3)


def test_lsv_meets_a_singularity_on_trajectory_3() -> None:
    (motion,) = solved(3, "lsv")[1]
    assert motion.status is Status.SINGULAR
    assert motion.confirmed
    assert motion.solution.event_time == pytest.approx(6.5, abs=0.1)


@pytest.mark.slow
def test_lsv_peaks() -> None:
    peaks = [np.abs(solved(number, "lsv")[1][0].qd).max(axis=0) for number in (1, 4)]
    assert peaks[0][[0, 2]] == pytest.approx([0.063, 0.197], abs=6e-4)
    assert peaks[1][0] == pytest.approx(0.512, abs=6e-4)


def test_least_spectral_radius_on_trajectory_4() -> None:
    (motion,) = solved(4, "lsv")[1]
    least = int(np.argmin(motion.spectral_radius))
    assert motion.spectral_radius[least] == pytest.approx(0.0998, abs=1e-4)
    assert motion.time[least] == pytest.approx(5.71, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "energy"), [(1, 5.98e-4), (2, 4.08e-3), (3, 7.57e-3), (4, 3.97e-2)])
def test_pmke_is_at_most_one_percent_above_the_paper(number: int, energy: float) -> None:
    (motion,) = solved(number, "pmke")[1]
    assert motion.status is Status.SOLVED
    assert motion.energy_integral[-1] <= 1.01 * energy
    # And no better than what is best: that would be another motion or another sum.
    assert motion.energy_integral_spline > 0.99 * solved(number, "global")[1][0].energy_integral_spline


@pytest.mark.slow
@pytest.mark.parametrize(("number", "energy"), [(1, 5.97e-4), (2, 3.87e-3), (3, 6.09e-3), (4, 3.03e-2)])
def test_global(number: int, energy: float) -> None:
    problem, motions = solved(number, "global")
    assert all(motion.status is Status.SOLVED for motion in motions)
    assert motions[0].energy_integral[-1] == pytest.approx(energy, rel=5e-3)
    for motion in motions:
        assert motion.tracking_error.max() <= 1e-8
        np.testing.assert_allclose(motion.q[0], problem.q_init, atol=1e-9)
