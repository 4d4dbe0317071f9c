"""The program of an arm on a base that moves or is held: its derivatives beside central differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary
from pipeline.program.transcription import transcribe
from tests.program.test_program import program_jacobian, program_value
from tests.support import composed

CIRCLE = ("path=circle", "path.radius=0.05", "boundary=cyclic")
MIXED = Objective({"kinetic_energy": 0.5, "torque": 0.3, "base_rotation": 0.2})


PROGRAMS = {
    "planar, all limits": (
        ("robot=planar3r_base", "base=free", "limits=joint_torque_power", "limits.attitude=0.3"),
        {"objective": MIXED, "bounds_of_integrals": {"kinetic_energy": 1.0, "torque": 1.0, "base_rotation": 0.5}},
    ),
    "planar, cycle, momentum": (
        ("robot=planar3r_base", "base=free", "base.linear_momentum=[0.1,0.2,0]", *CIRCLE, "limits=joint_torque_power"),
        {"objective": Objective({"torque": 1.0})},
    ),
    "panda, all limits": (
        (
            *(
                "robot=panda",
                "base=free",
                "base.mass=20",
                "base.inertia=2",
                "path.direction=[0,1,0]",
                "limits.attitude=0.3",
            ),
            *("limits=joint_torque_power", "base.angular_momentum=[0.1,0,0.2]", "robot.orientation=pointing"),
        ),
        {"objective": MIXED, "bounds_of_integrals": {"base_rotation": 0.5, "velocity_norm": 3.0}},
    ),
    "panda, held": (
        ("robot=panda", "objective=reaction", "path.direction=[0,1,0]", "limits=joint_torque_power"),
        {
            "objective": Objective({"reaction_force": 0.4, "reaction_torque": 0.6}),
            "bounds_of_integrals": {"reaction_torque": 2.0, "torque": 3.0},
        },
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [(), ("attitude", "velocity", "torque")], ids=["hard", "elastic"])
@pytest.mark.parametrize("kind", PROGRAMS)
def test_derivatives_of_the_whole_program(kind: str, elastic: tuple[str, ...], rng: np.random.Generator) -> None:
    words, changes = PROGRAMS[kind]
    problem = prepare(composed(*words, "timing.duration=2", "timing.steps=13"))
    if problem.boundary is not Boundary.CYCLIC:
        problem = replace(problem, boundary=Boundary.FREE)
    problem = replace(problem, **changes)
    guess = problem.q_init + np.cumsum(0.05 * rng.normal(size=(14, problem.task.arm.n)), axis=0)
    made = transcribe(problem, problem.times, guess, elastic=elastic)
    x = 0.3 * rng.normal(size=made.drake.num_vars())
    x[: made.y.size] = 0.03 * (guess + 0.1 * rng.normal(size=guess.shape)).ravel()
    jacobian, h = program_jacobian(made, x), 1e-6
    for _ in range(6):
        way = rng.normal(size=len(x))
        way[: made.y.size] *= 0.03
        expected = (program_value(made, x + h * way) - program_value(made, x - h * way)) / (2 * h)
        scale = np.abs(jacobian) @ np.abs(way) + 1e-9 * np.abs(program_value(made, x)) / h + 1e-12
        assert (np.abs(jacobian @ way - expected) / scale).max() < 1e-5
