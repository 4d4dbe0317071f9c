"""The identified masses: what they are, that they come from the printed ones, and that the bookkeeping is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.common.workers import Workers
from pipeline.config import documents
from pipeline.config.found import Summary
from pipeline.config.studies import IdentificationConfig
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.lsv import lsv
from pipeline.model.arm import Arm
from pipeline.model.base import FIXED
from pipeline.model.floating import Floating
from pipeline.reproduce.results import Results
from pipeline.robot.mounting import Mounting
from pipeline.robot.spacecraft import Spacecraft
from pipeline.studies import identification
from tests.support import ROOT, composed

PRINTED, IDENTIFIED = np.array([0.615, 0.615, 0.307]), np.array([0.615, 0.8156, 0.5055])


@pytest.fixture(scope="module")
def as_printed() -> Arm:
    return Arm.from_urdf(ROOT / "robots" / "planar3r_printed.urdf", "tip")


@pytest.mark.slow
def test_masses_and_their_intervals(reproduced: Path) -> None:
    """From the Global paper's numbers alone."""
    masses = Results(reproduced / "runs" / "identify_masses").table("masses")
    assert np.allclose(masses["printed"], PRINTED)
    found = masses["identified"].to_numpy()
    assert np.abs(found / IDENTIFIED - 1).tolist() <= [0.02, 0.01, 0.01]
    assert np.all(np.abs(found / IDENTIFIED - 1) <= [0.02, 0.01, 0.01])
    width = masses["high"] - masses["low"]
    assert np.all((width > 0) & (width < 0.02))
    assert np.all(masses["low"] > PRINTED * [0.99, 1.2, 1.5])


@pytest.mark.slow
def test_every_fitted_number_comes_out_with_the_identified_masses_only(reproduced: Path) -> None:
    numbers = Results(reproduced / "runs" / "identify_masses").table("identification")
    fitted = numbers[numbers["used"] == "fit"]
    assert len(fitted) >= 12
    assert fitted["residual_identified"].abs().max() < 2.5
    assert fitted["residual_printed"].abs().min() > 100


def test_other_masses_change_the_dynamics_and_nothing_else(as_printed: Arm, rng: np.random.Generator) -> None:
    changed = identification.with_masses(as_printed, IDENTIFIED)
    own = Arm.from_urdf(ROOT / "robots" / "planar3r.urdf", "tip")
    q, qd = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose(changed.mass_matrix(q), own.mass_matrix(q), rtol=1e-12)
    np.testing.assert_allclose(changed.kinetic_energy(q, qd), own.kinetic_energy(q, qd), rtol=1e-12)
    np.testing.assert_allclose(changed.position(q), as_printed.position(q), atol=1e-15)
    assert np.all(np.abs(as_printed.mass_matrix(q)[:, 0, 0] / own.mass_matrix(q)[:, 0, 0] - 1) > 0.1)
    np.testing.assert_allclose(identification.masses_of(changed.description), IDENTIFIED)
    np.testing.assert_allclose(identification.masses_of(as_printed.description), PRINTED)


def test_other_masses_leave_mounting_and_base(as_printed: Arm, rng: np.random.Generator) -> None:
    """Payload, rotors, place and gravity, and a spacecraft under the arm, stay when masses are replaced."""
    mounting = Mounting(
        (0.01, 0.0, 0.02), (0.1, 0.0, 0.2), (0.3, -0.2, 0.1), (0.0, 0.1, 0.4), (0.0, 1.0, -9.8), 0.3, 0.02
    )
    craft = Spacecraft(9.0, ((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5)), (0.0, 0.0, 0.1))
    own = Arm.from_urdf(ROOT / "robots" / "planar3r.urdf", "tip").description
    for base in (FIXED, Floating(craft)):
        changed = identification.with_masses(Arm(as_printed.description, mounting, base), IDENTIFIED)
        assert changed.mounting == mounting
        assert changed.base == base
        expected = Arm(own, mounting, base)
        q, qd, qdd = rng.normal(size=(3, 5, expected.n))
        np.testing.assert_allclose(changed.position(q), expected.position(q), atol=1e-12)
        tau = expected.inverse_dynamics(q, qd, qdd)
        np.testing.assert_allclose(changed.inverse_dynamics(q, qd, qdd), tau, atol=1e-10)


@pytest.mark.slow
def test_numbers_are_those_of_the_evaluation() -> None:
    problem = prepare(composed("+experiment=traj4"))
    solution = lsv(problem)[0]
    e, found = evaluate(problem, solution), identification.quantities(problem, solution.trajectory.q)
    assert found["kinetic_energy_integral"] == pytest.approx(e.energy_integral[-1], rel=1e-9)
    assert found["torque_integral"] == pytest.approx(e.torque_integral[-1], rel=1e-6)
    assert found["min_spectral_radius"] == pytest.approx(e.spectral_radius.min(), rel=1e-12)
    assert found["min_spectral_radius_time"] == pytest.approx(e.time[e.spectral_radius.argmin()])
    for j in range(3):
        assert found[f"peak_velocity_{j + 1}"] == pytest.approx(np.abs(e.qd[:, j]).max(), rel=1e-9)
        assert found[f"peak_power_{j + 1}"] == pytest.approx(e.power[:, j].max(), rel=1e-6)


@pytest.mark.slow
def test_the_fit_starts_at_the_masses_of_the_arm_and_recovers_others(
    as_printed: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numbers made with known masses, of motions that do not depend on them: exact up to their rounding."""
    true = np.array([0.5, 0.9, 0.4])
    wanted = [(name, "lsv", 1) for name in ("traj1", "traj2", "traj4")]
    motions = identification._solve(wanted, true, 1, Workers(1))
    columns = ("kinetic_energy_integral", "peak_torque_1", "min_spectral_radius")
    printed = []
    for key, q in motions.items():
        numbers = identification.quantities(identification._problem(key[0], true), q)
        for column in columns:
            found = Summary(key[0], key[1], key[2], column)
            row = documents.Row(quantity=column, printed=f"{numbers[column]:.6e}", found=found, masses="fit")
            printed.append(identification.Printed("made", key[0], row, found))
    monkeypatch.setattr(identification, "_printed", lambda config: printed)
    found = identification.identify(as_printed, IdentificationConfig(), 1, Workers(1))
    np.testing.assert_allclose(found.masses["printed"], PRINTED)
    np.testing.assert_allclose(found.masses["identified"], true, rtol=1e-3)
    assert np.all((found.masses["low"] <= true) & (true <= found.masses["high"]))
    assert found.numbers["residual_identified"].abs().max() < 1.5
    monkeypatch.setattr(identification, "_printed", lambda config: printed[:3])
    with pytest.raises(ConfigError, match="3 numbers to fit for 3 masses"):
        identification.identify(as_printed, IdentificationConfig(), 1, Workers(1))
