"""The readings are written out of the papers alone: where they read as the project does, both give the same numbers."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.compose import experiment
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.pmke.predictive import pmke as ours
from tests.readings import nedungadi, pmke
from tests.readings.__main__ import FILE, marked
from tests.readings.planar import Q_INIT, SIMULATION, TRAJECTORIES, bias, inertia


@pytest.mark.slow
def test_pmke_read_as_the_project_reads_it() -> None:
    config = experiment("traj1")
    problem = prepare(config)
    recomputed = evaluate(problem, ours(problem, config.method.pmke)[0])
    followed = pmke.follow(TRAJECTORIES[1], pmke.Reading())
    assert followed.energy == pytest.approx(recomputed.energy_integral[-1], rel=1e-6)
    np.testing.assert_allclose(followed.q, recomputed.q, atol=1e-6)
    row = next(line for line in FILE.read_text(encoding="utf-8").splitlines() if line.startswith("| the project's |"))
    printed = [text for number, _, text in pmke.PRINTED if number == 1]
    cells = marked([followed.value(quantity) for number, quantity, _ in pmke.PRINTED if number == 1], printed)
    assert [cell.strip() for cell in row.split("|")][2:5] == [cells[0], *cells[1:]]


def test_the_equation_of_the_calculus_of_variations_is_stationary() -> None:
    """M qdd + n is in the range of J' with the minus sign and the inverse alone."""
    q, qd = np.array([0.3, -0.4, 0.8]), np.array([0.5, -1.0, 2.0])
    null = np.linalg.svd(pmke.jacobian(q))[2][2]
    left = {
        sign: abs(null @ (inertia(q) @ nedungadi.rate(*how)(0.3, q, qd) + bias(q, qd)))
        for sign, how in nedungadi.SIGNS.items()
    }
    assert left["- M^-1 n"] < 1e-12
    assert all(value > 1e-3 for sign, value in left.items() if sign != "- M^-1 n")
    assert SIMULATION.at(np.array(0.0))[0] == pytest.approx(TRAJECTORIES[1].at(np.array(0.0))[0])
    assert Q_INIT.shape == (3,)
