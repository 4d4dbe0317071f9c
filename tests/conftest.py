"""Shared by all tests: the papers' planar arm, their trajectories, and the peer's independent formulas for it."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kinematics import project
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line, circle, direction_vector
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.problem import Problem
from pipeline.robot import urdf
from tests.composing import compose_once
from tests.once import made_once
from tests.support import ROOT

settings.register_profile("project", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("many", deadline=None, max_examples=1000, print_blob=True, database=None)
settings.load_profile("project")


def pytest_collection_finish() -> None:
    """What the imported libraries are made of is no garbage: not to look through it again saves a tenth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def _composed_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        compose_once(patch)
        yield


@pytest.fixture(scope="session")
def planar_file() -> Path:
    return ROOT / "robots" / "planar3r.urdf"


@pytest.fixture(scope="session")
def arm(planar_file: Path) -> Arm:
    return Arm(urdf.read(planar_file, "tip"))


@pytest.fixture(scope="session")
def task(arm: Arm) -> PositionTask:
    return PositionTask(arm)


@pytest.fixture
def q_init() -> Array:
    return np.array([0.0, 0.327, -0.754])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture
def reference(task: PositionTask, q_init: Array) -> Callable[[int], Reference]:
    """Trajectory 1, 2, 3 or 4 of the PMKE paper (10 s)."""
    start = task.value(q_init[None])[0]

    def make(number: int) -> Reference:
        # Their grids are coarse: what a smooth curve does between the knots has tests of its own.
        between = {"tolerance": 0.05}
        if number == 2:
            return Reference(circle(start, 180.0, 0.05), RaisedCosine(10.0), **between)
        length, angle = {1: (0.1, 157.5), 3: (0.4, 157.5), 4: (0.7, 202.5)}[number]
        return Reference(Line(start, direction_vector(angle, 2), length), RaisedCosine(10.0), **between)

    return make


@pytest.fixture
def problem(task: PositionTask, reference: Callable[[int], Reference], q_init: Array) -> Callable[[int, int], Problem]:
    """The papers' problem on a trajectory, on a grid of so many equal intervals."""
    return lambda number, intervals: Problem(task, reference(number), q_init, np.linspace(0.0, 10.0, intervals + 1))


@pytest.fixture
def guess() -> Callable[[Problem], Array]:
    """The inertia-weighted pseudoinverse motion (N + 1, n)."""

    def motion(problem: Problem) -> Array:
        rows = [problem.q_init[None]]
        for point in problem.reference.position(problem.times[1:]):
            inverse_mass = np.linalg.inv(problem.task.arm.mass_matrix(rows[-1]))
            rows.append(project(problem.task, rows[-1], point[None], inverse_mass)[0])
        return np.concatenate(rows)

    return motion


@pytest.fixture(scope="session")
def peer(planar_file: Path) -> SimpleNamespace:
    """The planar arm written out in CasADi: each member maps stacked rows (K, 3) to stacked results."""
    import casadi as ca

    from tests.benchmarks.peer import PlanarArm

    planar = PlanarArm.from_urdf(planar_file)
    q, qd, qdd = (ca.SX.sym(name, 3) for name in ("q", "qd", "qdd"))
    energy, tip = planar.kinetic_energy(q, qd), planar.end_effector(q)
    momentum, jacobian = ca.gradient(energy, qd), ca.jacobian(tip, q)
    bias = ca.jtimes(momentum, q, qd) - ca.gradient(energy, q)  # Lagrange's equations at qdd = 0
    mass = ca.jacobian(momentum, qd)
    torque = mass @ qdd + bias

    def stacked(expression: Any) -> Callable[..., Array]:
        function = ca.Function("f", [q, qd, qdd], [ca.densify(expression)])

        def call(*rows: Array) -> Array:
            filled = [*rows, *[np.zeros_like(rows[0])] * (3 - len(rows))]
            values = np.array([np.array(function(*row)) for row in zip(*filled, strict=True)])
            return values.reshape(len(values), *(size for size in expression.shape if size > 1))

        return call

    return SimpleNamespace(
        arm=planar,
        position=stacked(tip),
        jacobian=stacked(jacobian),
        jacobian_rate=stacked(ca.jtimes(jacobian @ qd, q, qd)),
        energy=stacked(energy),
        energy_by_q=stacked(ca.gradient(energy, q)),
        mass=stacked(mass),
        bias=stacked(bias),
        torque=stacked(torque),
        torque_by_q=stacked(ca.jacobian(torque, q)),
        torque_by_qd=stacked(ca.jacobian(torque, qd)),
    )


@pytest.fixture(scope="session")
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every run that a printed number is found in, with fewer starts and without pictures: the folder above `runs`."""
    return made_once(tmp_path_factory, "reproduced", reproduce_in)


def reproduce_in(folder: Path) -> None:
    from hydra.core.global_hydra import GlobalHydra

    from pipeline.config import documents
    from pipeline.reproduce import __main__ as reproduce
    from pipeline.run import session
    from tests.reports import leave_out_pictures

    few = (
        *(f"method.global.{key}" for key in ("configurations=12", "candidates=150", "optimised=12", "solver=newton")),
        *(f"method.calculus_of_variations.{key}" for key in ("spacing=0.08", "tolerance=1e-8")),
        *("method.pmke.confirm=last", "identification.documents=[global]"),
    )
    # Its law is one of large numbers.
    many = (
        *(f"method.global.{key}" for key in ("candidates=300", "optimised=16", "solver=newton")),
        "candidate_study.repeats=2",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HYDRA_FULL_ERROR", "0")  # the command line sets it; this puts it back
        patch.setattr(session, "exit_code", 0)
        patch.setattr(sys, "argv", ["reproduce"])
        leave_out_pictures(patch)
        printed = [e for name in ("pmke", "global") for e in documents.read(name).experiments]
        for wanted, words in (
            (dict.fromkeys(e for e in printed if e not in ("pareto", "candidate_study")), few),
            (("candidate_study",), many),
            (documents.read("pontryagin").experiments, ("methods=[pontryagin_as_printed]",)),
        ):
            GlobalHydra.instance().clear()
            everywhere = ("export.method=none", "parallel.workers=1")
            assert reproduce.sweep(list(wanted), folder / "runs", (*words, *everywhere)) == 0
    GlobalHydra.instance().clear()
