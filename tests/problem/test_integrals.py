from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, replace

import joblib
import numpy as np
import pytest

from pipeline.common.errors import InputError
from pipeline.config.goal import INTEGRALS as WORDS
from pipeline.problem.costs import integrals, row_kinds
from pipeline.problem.integrals import INTEGRALS, of_order
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from tests.support import free_line


@pytest.fixture(scope="module")
def problem() -> Problem:
    return free_line(6)


def test_the_configuration_knows_the_same_words() -> None:
    assert tuple(INTEGRALS) == WORDS


def test_every_generalized_force_belongs_to_an_integral_of_second_order(problem: Problem) -> None:
    for kind in row_kinds(problem.task.arm):
        assert INTEGRALS[kind].order == 2


def test_a_run_knows_every_integral(problem: Problem) -> None:
    """On a base that stands still nothing turns; a constant velocity's integrals are known."""
    q = problem.q_init + np.linspace(0.0, 0.6, 7)[:, None]
    values = integrals(problem, problem.times, q).integrals
    assert set(values) == set(INTEGRALS)
    assert values["velocity_norm"] == pytest.approx(3 * 0.6**2)  # (0.6 rad/s)^2 of three joints for 1 s
    inertia = problem.task.arm.mass_matrix(q[1:])[:, :].sum(axis=(1, 2))
    assert values["kinetic_energy"] == pytest.approx(0.5 * 0.6**2 * inertia.mean())
    assert values["base_rotation"] == values["reaction_force"] == values["reaction_torque"] == 0.0


def test_an_objective_by_name() -> None:
    assert Objective().weights == {"kinetic_energy": 1.0}
    assert not Objective().second_order
    mixed = Objective({"torque": 0.7, "kinetic_energy": 0.3, "velocity_norm": 0.0})
    assert list(mixed.weights.items()) == [("kinetic_energy", 0.3), ("torque", 0.7)]
    assert (mixed.weight("torque"), mixed.weight("velocity_norm")) == (0.7, 0.0)
    assert mixed.second_order
    assert of_order(mixed.weights, 1) == {"kinetic_energy": 0.3}
    assert Objective({"reaction_force": 1.0}).second_order


def test_an_objective_cannot_be_changed_and_can_be_kept() -> None:
    given = {"torque": 0.7, "kinetic_energy": 0.3}
    objective = Objective(given)
    given["torque"] = 5.0
    other = Objective({"kinetic_energy": 0.3, "torque": 0.7})
    assert objective == other == pickle.loads(pickle.dumps(objective))
    assert hash(objective) == hash(other)
    assert joblib.hash(objective) == joblib.hash(other)
    assert joblib.hash(objective) != joblib.hash(Objective())
    assert objective != Objective()
    with pytest.raises(FrozenInstanceError):
        objective.weights = {}  # type: ignore[misc]
    with pytest.raises(TypeError):
        objective.weights["torque"] = 1.0  # type: ignore[index]


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({"torques": 1.0}, "integral 'torques': must be one of kinetic_energy, torque, "),
        ({"torque": -1.0}, "weight of torque is -1; it must be finite and not negative"),
        ({"torque": np.nan}, "weight of torque is nan"),
        ({"torque": np.inf}, "weight of torque is inf"),
    ],
)
def test_weights_that_mean_nothing_are_refused(weights: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Objective(weights)


def test_bounds_by_name(problem: Problem) -> None:
    stated = replace(problem, bounds_of_integrals={"torque": 2.0, "kinetic_energy": np.inf})
    assert stated.bounds_of_integrals == {"torque": 2.0}
    for bound in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="bound of the integral torque"):
            replace(problem, bounds_of_integrals={"torque": bound})
    with pytest.raises(InputError, match="must be one of"):
        replace(problem, bounds_of_integrals={"energy": 1.0})
