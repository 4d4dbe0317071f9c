"""The planner and its program on real and on more redundant arms: all derivatives, all methods, independent optima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.files import shipped
from pipeline.config.methods import CalculusOfVariationsOptions
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.calculus_of_variations.stationary import calculus_of_variations
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.pmke.predictive import pmke
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PoseTask, PositionTask
from pipeline.path.curves import Line
from pipeline.path.orientation import Orientation
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.costs import objective_values
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Status
from pipeline.program.transcription import transcribe
from pipeline.robot.mounting import Mounting
from pipeline.robot.shapes import Shape
from pipeline.search.population import population
from pipeline.search.selection import diverse
from tests.benchmarks.peer import PlanarArm, kinetic_energy_program, solve
from tests.program.test_program import program_jacobian, program_value
from tests.support import BALL, FEW, ROBOTS, composed, robot, with_shapes, within_limits


def everything(name: str, rng: np.random.Generator) -> Problem:
    """100 knots, gravity, rotor inertia, every kind of limit, an obstacle, both integrals bounded."""
    base = with_shapes(name)
    arm = Arm(base.description, Mounting(gravity=(1.0, -2.0, -9.8), armature=0.01, payload=0.3))
    task = PoseTask(arm) if arm.n > 6 else PositionTask(arm)
    q = within_limits(arm, 1, rng)[0]
    start = task.value(q[None])[0]
    line = Line(start[: len(task.axes)], np.eye(len(task.axes))[0], 0.1)
    turning = None
    if isinstance(task, PoseTask):
        first = Rotation.from_rotvec(start[3:])
        turning = Orientation(
            np.array([0.0, 0.1]), Rotation.concatenate([first, Rotation.from_rotvec([0, 0.3, 0]) * first])
        )
    ones = np.ones(arm.n)
    return Problem(
        task,
        Reference(line, RaisedCosine(2.0), turning),
        q,
        np.linspace(0.0, 2.0, 100),
        objective=Objective({"kinetic_energy": 0.5, "torque": 0.5}),
        limits=Limits(-3 * ones, 3 * ones, ones, 50 * ones, 20 * ones),
        boundary=Boundary.FREE,
        bounds_of_integrals={"kinetic_energy": 1.0, "torque": 1e3},
        obstacles=Obstacles((BALL,), 0.03, 0.2),
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_every_row_of_the_program_at_100_random_configurations(name: str, rng: np.random.Generator) -> None:
    """Along random directions, all constraints at once: their Jacobian against central differences."""
    problem = everything(name, rng)
    made = transcribe(problem, problem.times, within_limits(problem.task.arm, 100, rng))
    x = 0.3 * rng.normal(size=made.drake.num_vars())
    x[: made.y.size] = 0.03 * within_limits(problem.task.arm, 100, rng).ravel()
    jacobian = program_jacobian(made, x)
    for _ in range(4):
        way = rng.normal(size=len(x))
        way[: made.y.size] *= 0.03
        h = 1e-6
        expected = (program_value(made, x + h * way) - program_value(made, x - h * way)) / (2 * h)
        got = jacobian @ way
        scale = np.abs(jacobian) @ np.abs(way) + 1e-9 * np.abs(program_value(made, x)) / h + 1e-12
        off = np.abs(got - expected) / scale
        assert np.quantile(off, 0.99) < 1e-6
        assert off.max() < 2e-3, int(np.argmax(off))  # a link's closest point may leap to another link


@pytest.mark.parametrize("name", ROBOTS)
def test_dynamics_with_gravity_payload_and_rotors(name: str, rng: np.random.Generator) -> None:
    arm = Arm(robot(name).description, Mounting(gravity=(0.5, 1.0, -9.8), armature=0.02, payload=0.7))
    q = within_limits(arm, 100, rng)
    qd, qdd = rng.normal(size=(2, 100, arm.n))
    tau, *gradients = arm.inverse_dynamics_gradient(q, qd, qdd)
    h = 1e-5
    for which, gradient in enumerate(gradients):
        for j, unit in enumerate(np.eye(arm.n)):
            ahead, behind = [q, qd, qdd], [q, qd, qdd]
            ahead[which], behind[which] = ahead[which] + h * unit, behind[which] - h * unit
            expected = (arm.inverse_dynamics(*ahead) - arm.inverse_dynamics(*behind)) / (2 * h)
            np.testing.assert_allclose(gradient[:, :, j], expected, atol=1e-6 * (1 + np.abs(tau).max()))
    # Energy: the power of the torques is the rate of kinetic and potential energy, found along a short motion.
    weight = np.array([arm.gravity_torque(one[None])[0] for one in q])
    power = ((tau + weight) * qd).sum(axis=1)
    step = 1e-6
    rate = (arm.kinetic_energy(q + step * qd, qd + step * qdd) - arm.kinetic_energy(q - step * qd, qd - step * qdd)) / (
        2 * step
    )
    np.testing.assert_allclose(power, rate, atol=1e-6 * (1 + np.abs(rate).max()))


def test_gravity_torque_is_the_slope_of_the_potential(rng: np.random.Generator) -> None:
    """A payload on an arm adds m g' dx/dq: the difference of two arms that differ in it alone."""
    description, g = robot("panda").description, (0.3, -0.2, -9.8)
    light = Arm(description, Mounting(gravity=g))
    heavy = Arm(description, Mounting((0.1, 0.0, 0.2), gravity=g, payload=2.0))
    q = within_limits(light, 10, rng)
    added = 2.0 * np.einsum("i,kij->kj", g, heavy.jacobian(q))
    np.testing.assert_allclose(heavy.gravity_torque(q) - light.gravity_torque(q), added, atol=1e-10)


def test_a_placed_base_moves_the_whole_arm(rng: np.random.Generator) -> None:
    for name in ("panda", "xarm7"):  # the xArm's root is called `world`
        plain = robot(name)
        standing = replace(plain.mounting, base_position=(1.0, 2.0, 3.0), base_rpy=(0.3, -0.4, 0.5))
        placed = Arm(plain.description, standing)
        q = within_limits(plain, 5, rng)
        turn = Rotation.from_euler("xyz", (0.3, -0.4, 0.5))
        shift = np.array([1.0, 2.0, 3.0])
        np.testing.assert_allclose(placed.position(q), turn.apply(plain.position(q)) + shift, atol=1e-12)
        np.testing.assert_allclose(placed.mass_matrix(q), plain.mass_matrix(q), atol=1e-10)


# --- optima ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_planar_4r_equals_the_peer() -> None:
    """r = 2, fixed start: CasADi's exact Hessians from the same candidates find no better, and the same."""
    problem = prepare(
        composed("robot=planar4r", "path.length=0.5", "path.direction=150", "timing.duration=2", "timing.steps=30")
    )
    best = global_planner(problem, FEW)[0]
    ours = evaluate(problem, best)
    rng = np.random.default_rng(3)
    guesses = population(problem, problem.times, problem.q_init[None], 200, rng)
    guesses = guesses[diverse(guesses, objective_values(problem, problem.times, guesses), 12, 0.1, np.ones(4, bool))]
    peer = PlanarArm.from_urdf(shipped("robots/planar4r.urdf"))
    program = kinetic_energy_program(peer, 30, 2 / 30)
    path = problem.reference.position(problem.times[1:])
    costs = [solve(program, problem.q_init, path, guess[1:])[1] for guess in guesses]
    assert ours.energy_integral[-1] == pytest.approx(min(costs), rel=1e-6)
    assert ours.energy_integral[-1] < 0.8 * evaluate(problem, lsv(problem)[0]).energy_integral[-1]


@pytest.mark.slow
def test_the_panda_on_a_line() -> None:
    """The documents' next step, a real arm: 20 % below the pseudoinverse within every limit of its description."""
    problem = prepare(composed("+experiment=panda"))
    best = evaluate(problem, global_planner(problem, FEW)[0])
    plain = evaluate(problem, lsv(problem)[0])
    weighted = evaluate(problem, inertia_weighted(problem)[0])
    assert best.status is plain.status is weighted.status is Status.SOLVED
    assert best.objective < weighted.objective < plain.objective
    assert best.objective < 0.8 * plain.objective
    assert max(best.limit_excess.values()) <= 1e-6
    assert set(best.limit_excess) == {"position", "velocity", "torque", "self_clearance"}


@pytest.mark.slow
def test_the_panda_holds_its_hand_and_keeps_off_a_ball() -> None:
    problem = prepare(composed("+experiment=panda_pose_obstacle", "timing.steps=24"))
    best = evaluate(problem, global_planner(problem, replace(FEW, optimised=1, refine_to=None))[0])
    plain = evaluate(problem, lsv(problem)[0])
    assert plain.clearance.min() < 0
    assert best.status is Status.SOLVED
    assert best.orientation_error.max() < 1e-8
    assert best.orientation_error_between < 1e-4
    assert best.clearance.min() >= 0.02
    assert best.clearance_between >= 0.02
    assert max(best.limit_excess_between.values()) <= 1e-3


@pytest.mark.slow
def test_a_pose_task_by_the_calculus_of_variations_and_by_the_planner() -> None:
    """r = 1 on seven joints, from a fixed start and without limits: two methods that share nothing but the arm."""
    problem = prepare(composed("+experiment=panda_pose", "limits=none", "timing.steps=50", "path.turn=[0,0.4,0.2]"))
    best = evaluate(problem, global_planner(problem, FEW)[0])
    found = calculus_of_variations(problem, CalculusOfVariationsOptions(spacing=0.15, max_speed=0.5, tolerance=1e-5))
    stationary = min(float(motion.statistics["integral"]) for motion in found)
    assert best.energy_integral_spline == pytest.approx(stationary, rel=0.02)
    nearest = min(np.abs(motion.trajectory.q - best.q).max() for motion in found)
    assert nearest < 0.05


@pytest.mark.slow
def test_pmke_and_pointing() -> None:
    problem = prepare(
        composed(
            "robot=panda",
            "robot.orientation=pointing",
            "path.direction=[0,1,0]",
            "path.length=0.2",
            "timing.duration=4",
            "timing.steps=20",
            "boundary.rest=[]",
        )
    )
    for solution in (
        lsv(problem)[0],
        inertia_weighted(problem)[0],
        pmke(problem)[0],
        global_planner(problem, FEW)[0],
    ):
        judged = evaluate(problem, solution)
        assert judged.status is Status.SOLVED, judged.message
        assert judged.orientation_error.max() < 2e-3
        # The hand spins about its axis: it holds a direction, not an orientation.
    rotation = problem.task.arm.pose(judged.q)[1]
    assert np.abs(rotation[-1] - rotation[0]).max() > 0.005
    assert np.abs(rotation[-1][:, 2] - rotation[0][:, 2]).max() < 1e-8
    cost = objective_values(replace(problem, limits=None), problem.times, judged.q[None])[0]
    assert cost == pytest.approx(judged.objective, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "freedom", "words"),
    [("ur5", 1, ("robot.orientation=pointing",)), ("kinova", 3, ()), ("tiago", 4, ("methods=[global]",))],
)
def test_other_arms_keep_off_a_ball_and_themselves(name: str, freedom: int, words: tuple[str, ...]) -> None:
    """The ball is 3 cm from where the arm begins, beside the path."""
    line = ("path.direction=[0,0,-1]", "path.length=0.1", "timing.duration=3", "timing.steps=8", "boundary.rest=[]")
    problem = prepare(composed(f"robot={name}", "path.tolerance=0.001", *line, *words))
    assert problem.task.arm.n - problem.task.m == freedom
    assert problem.own is not None
    assert problem.own.kept
    start = problem.reference.position(np.zeros(1))[0]
    point = Shape("ball", "sphere", (0.001,), tuple(map(float, start[:3] + 0.3 * np.eye(3)[2])))
    away = float(Clearance(problem.task.arm, Obstacles((point,), 0.02))(problem.q_init[None]).min())
    around = replace(problem, obstacles=Obstacles((replace(point, size=(away - 0.029,)),), 0.02))
    best = evaluate(around, global_planner(around, replace(FEW, optimised=2, refine_to=None))[0])
    assert best.status is Status.SOLVED, best.message
    assert best.clearance[0] == pytest.approx(0.03, abs=1e-5)
    assert best.clearance_between >= 0.02
    assert best.near.own.bound >= problem.own.margin
