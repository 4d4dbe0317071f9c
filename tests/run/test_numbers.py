"""The numbers of the PMKE paper, recomputed from q(t)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.solution import Status
from pipeline.reproduce.results import Results
from tests.reproduce.printed import runs_in

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(reproduced: Path) -> dict[str, Results]:
    return runs_in(reproduced)


def test_lsv_on_trajectories_without_a_singularity(runs: dict[str, Results]) -> None:
    for number, energy in ((1, 8.81e-4), (2, 5.37e-3), (4, 5.17e-2)):
        motion = runs[f"traj{number}"].evaluation("lsv")
        assert motion.status is Status.SOLVED
        assert motion.energy_integral[-1] == pytest.approx(energy, rel=5e-3)


def test_lsv_meets_a_singularity_on_trajectory_3(runs: dict[str, Results]) -> None:
    motion = runs["traj3"].evaluation("lsv")
    assert motion.status is Status.SINGULAR
    assert motion.confirmed
    assert motion.solution.event_time == pytest.approx(6.5, abs=0.1)


def test_lsv_peaks(runs: dict[str, Results]) -> None:
    peaks = [np.abs(runs[name].evaluation("lsv").qd).max(axis=0) for name in ("traj1", "traj4")]
    assert peaks[0][[0, 2]] == pytest.approx([0.063, 0.197], abs=6e-4)
    assert peaks[1][0] == pytest.approx(0.512, abs=6e-4)


def test_least_spectral_radius_on_trajectory_4(runs: dict[str, Results]) -> None:
    motion = runs["traj4"].evaluation("lsv")
    least = int(np.argmin(motion.spectral_radius))
    assert motion.spectral_radius[least] == pytest.approx(0.0998, abs=1e-4)
    assert motion.time[least] == pytest.approx(5.71, abs=0.02)


def test_pmke_is_at_most_one_percent_above_the_paper(runs: dict[str, Results]) -> None:
    for number, energy in ((1, 5.98e-4), (2, 4.08e-3), (3, 7.57e-3), (4, 3.97e-2)):
        run = runs[f"traj{number}"]
        motion = run.evaluation("pmke")
        assert motion.status is Status.SOLVED
        assert motion.energy_integral[-1] <= 1.01 * energy
        # And no better than what is best: that would be another motion or another sum.
        assert motion.energy_integral_spline > 0.99 * run.evaluation("global").energy_integral_spline


def optima(run: Results) -> list[Evaluation]:
    return [run.evaluation("global", k) for k in run.summary.query("method == 'global'")["optimum"]]


def test_global(runs: dict[str, Results]) -> None:
    for number, energy in ((1, 5.97e-4), (2, 3.87e-3), (3, 6.09e-3), (4, 3.03e-2)):
        run = runs[f"traj{number}"]
        motions = optima(run)
        assert all(motion.status is Status.SOLVED for motion in motions)
        assert motions[0].energy_integral[-1] == pytest.approx(energy, rel=5e-3)
        for motion in motions:
            assert motion.tracking_error.max() <= 1e-8
            np.testing.assert_allclose(motion.q[0], run.problem.q_init, atol=1e-9)
