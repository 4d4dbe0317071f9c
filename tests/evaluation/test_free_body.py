"""Motions on a floating base: momentum and path found again from the joints, limits, starts, heavy bases, reactions."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pydrake.math import RollPitchYaw, RotationMatrix
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.config.methods import LsvOptions
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.evaluation.free_body import BasePlant, FreeMotion, integrate, reactions
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.method import Context
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.registry import METHODS
from pipeline.model.arm import Arm
from pipeline.model.coordinates import SPACE
from pipeline.model.floating import Floating
from pipeline.problem.costs import integrals
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.feasibility import least_violation, violations
from pipeline.robot.spacecraft import Spacecraft
from tests.support import composed, robot, within_limits

SIZES = ("starts=population", "configurations=8", "candidates=100", "optimised=2", "refine_to=null")
FEW = tuple(f"method.global.{key}" for key in SIZES)
SHORT = ("timing.duration=4", "timing.steps=30", *FEW)
BETWEEN = "path.tolerance=1e-3"  # the grids are coarse
ON_BASE = ("robot=planar3r_base", "base=free", BETWEEN, *SHORT)
CIRCLE = ("path=circle", "path.radius=0.05", "boundary=cyclic")


@cache
def stated(*overrides: str) -> tuple[Problem, Solution]:
    """A problem and the planner's best motion."""
    config = composed(*overrides)
    problem = prepare(config)
    return problem, global_planner(problem, config.method.global_, Context(config.seed))[0]


def solved(*overrides: str) -> tuple[Problem, Evaluation]:
    problem, solution = stated(*overrides)
    return problem, evaluate(problem, solution)


STARTS = {"fixed": (), "free": ("boundary=free",), "cyclic": CIRCLE}


@pytest.mark.slow
@pytest.mark.parametrize("start", STARTS)
def test_momentum_and_path_of_the_planner(start: str) -> None:
    e = solved(*ON_BASE, *STARTS[start])[1]
    assert e.status is Status.SOLVED, e.message
    assert e.base.floating is not None
    assert e.base.floating.linear < 1e-6
    assert e.base.floating.angular < 1e-6
    assert e.base.floating.path_error < 1e-4
    assert e.base.turn.max() > 1e-3, "the base hardly turns: the test shows nothing"
    assert e.tracking_error.max() < 1e-8
    if start == "cyclic":
        assert np.abs(e.q[-1] - e.q[0]).max() < 1e-9
        # In the plane closed joints and a closed path leave the base no choice but to come back too.
        assert e.base.turn[-1] < 1e-7
    # The base that the solver found at its knots is the one that the joints alone bring about.
    last = e.base.floating
    np.testing.assert_allclose(last.position[-1], e.base.position[-1], atol=1e-4)
    np.testing.assert_allclose(last.rotation[-1].as_matrix(), e.base.rotation[-1], atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["lsv", "inertia_weighted", "pmke"])
def test_momentum_and_path_of_the_other_methods(method: str) -> None:
    config = composed(*ON_BASE, "method.pmke.prediction_step=0.4", "method.pmke.update_interval=0.4")
    problem = prepare(config)
    (solution,) = METHODS[method](problem, config.method.of(method))
    e = evaluate(problem, solution)
    assert e.status is Status.SOLVED, e.message
    assert e.base.floating is not None
    assert max(e.base.floating.linear, e.base.floating.angular) < 1e-6
    assert e.base.floating.path_error < (5e-3 if method == "pmke" else 1e-4)  # PMKE integrates by Euler
    best = solved(*ON_BASE)[1]
    assert best.energy_integral[-1] < 0.95 * e.energy_integral[-1]


@pytest.mark.slow
def test_the_path_error_is_of_second_order_in_the_step() -> None:
    errors = []
    for steps in (20, 40, 80):
        problem, solution = stated(
            *ON_BASE, f"timing.steps={steps}", "method.global.optimised=1", "method.global.candidates=20"
        )
        joints = solution.trajectory.q[:, problem.task.arm.joints]
        found = integrate(problem, solution.trajectory.time, joints)
        errors.append(found.path_error)
        moved = CubicSpline(solution.trajectory.time, joints)(found.time)
        tip = found.position + found.rotation.apply(problem.task.arm.on_fixed_base.position(moved))
        off = np.linalg.norm(tip[:, :2] - problem.reference.position(found.time), axis=1)
        assert found.path_error == pytest.approx(off.max(), rel=1e-9)
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 5e-6
    assert np.all((order > 1.8) & (order < 2.4)), order


@pytest.mark.slow
def test_a_base_that_was_moved_is_noticed() -> None:
    """By the tracking of the knots; and the motion that the joints give stays what it was."""
    problem, solution = stated(*ON_BASE)
    q = solution.trajectory.q.copy()
    q[:, 2] += np.linspace(0.0, 0.01, len(q))
    spoiled = evaluate(problem, replace(solution, trajectory=Trajectory(solution.trajectory.time, q)))
    assert spoiled.status is Status.UNCONFIRMED
    assert "off its path" in spoiled.message
    honest = evaluate(problem, solution)
    assert spoiled.base.floating is not None
    assert honest.base.floating is not None
    assert spoiled.base.floating.path_error == pytest.approx(honest.base.floating.path_error)


def test_a_craft_has_its_mass_where_it_is_said_to_be() -> None:
    """In the root link's frame, which stands turned."""
    where, moments = (0.05, -0.02, 0.1), []
    for com in (where, (0.0, 0.0, 0.0)):
        craft = Spacecraft(20.0, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), com)
        fixed = robot("panda", base_rpy=(0.3, -0.4, 0.5))
        free = BasePlant(Arm(fixed.description, fixed.mounting, Floating(craft, SPACE)))
        free.at(np.zeros(3), free.start[0], np.zeros(7), np.zeros(13))
        mass = free.plant.CalcTotalMass(free.context)
        moments.append(mass * free.plant.CalcCenterOfMassPositionInWorld(free.context))
    turned = RotationMatrix(RollPitchYaw(0.3, -0.4, 0.5)).matrix()
    np.testing.assert_allclose(moments[0] - moments[1], 20.0 * turned @ where, atol=1e-12)


def test_the_turn_is_from_the_start_on() -> None:
    turned = Rotation.from_rotvec([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    motion = FreeMotion(np.arange(3.0), np.zeros((3, 3)), turned, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(motion.turn, [0.0, 0.2, 0.4], atol=1e-12)


@pytest.mark.slow
def test_momentum_that_is_given_is_kept() -> None:
    problem, e = solved(*ON_BASE, "base.linear_momentum=[0.05,0,0]", "base.angular_momentum=[0,0,0.02]")
    assert e.status is Status.SOLVED
    assert e.base.floating is not None
    assert max(e.base.floating.linear, e.base.floating.angular) < 1e-6
    assert e.base.floating.path_error < 2e-3  # 0.0096 m if the linear momentum is not counted
    plant, last = BasePlant(problem.task.arm), e.base.floating
    ((alone,), (adds,)), given = plant.driven(e.q[:1], np.zeros((1, 3))), np.array([0.05, 0, 0, 0, 0, 0.02])
    moving = plant.velocity(last.position[0], last.rotation[0].as_quat(), alone, adds, given)
    assert np.abs(moving).max() > 1e-3  # before the joints move, the base does


@pytest.mark.slow
def test_limits_are_kept_and_felt() -> None:
    free = solved(*ON_BASE, "boundary=free")[1]
    limits = ("limits=joint", "limits.velocity=1.0", "limits.torque=0.03", "limits.power=0.02", "limits.attitude=0.05")
    e = solved(*ON_BASE, "boundary=free", "method.global.optimised=4", *limits)[1]
    assert e.status is Status.SOLVED, e.message
    assert set(e.limit_excess) == {"position", "velocity", "torque", "power", "attitude"}
    assert max(e.limit_excess.values()) <= 1e-6
    assert e.limit_excess_between["attitude"] < 1e-3
    assert e.energy_integral[-1] > free.energy_integral[-1]


@pytest.mark.slow
def test_a_bound_on_the_attitude() -> None:
    free = solved(*ON_BASE)[1]
    most = 0.6 * free.base.turn.max()
    bounded = solved(*ON_BASE, f"limits.attitude={most}")[1]
    assert bounded.status is Status.SOLVED
    assert bounded.base.turn.max() == pytest.approx(most, rel=1e-5)
    assert bounded.limit_excess_between["attitude"] == pytest.approx(0.0, abs=5e-3)
    assert bounded.energy_integral[-1] > free.energy_integral[-1]
    assert free.limit_excess == {}


def test_an_attitude_that_is_exceeded_is_named() -> None:
    problem, solution = stated(*ON_BASE)
    bounded = replace(problem, limits=replace(problem.bounds, attitude=0.01))
    (found,) = [v for v in violations(bounded, problem.times, solution.trajectory.q) if v.kind == "attitude"]
    e = evaluate(bounded, solution)
    assert found.reached == pytest.approx(e.base.turn.max(), rel=1e-6)
    assert found.relative == pytest.approx(e.limit_excess["attitude"], rel=1e-6)
    assert found.bound == "the attitude limit of the base (0.01 rad)"
    assert e.status is Status.UNCONFIRMED
    assert "attitude limit is exceeded" in e.message
    relaxed = least_violation(bounded, problem.times, [solution.trajectory.q])
    assert relaxed is not None
    assert relaxed.feasible  # there is a way to turn less


@pytest.mark.slow
def test_a_fine_grid_does_not_make_a_cycle_harder() -> None:
    """Closed joints leave the base turns about the centre of mass alone: rows that these cannot change must go."""
    _, solution = stated(*ON_BASE, *CIRCLE, "timing.steps=100", "method.global.optimised=1")
    assert solution.status is Status.SOLVED, solution.message
    assert solution.statistics["solves"][-1]["iterations"] < 30


@pytest.mark.slow
@pytest.mark.parametrize("orientation", ["none", "full"])
def test_cycles_in_space(orientation: str) -> None:
    """Closed joints and position leave the base a turn about the line from the centre of mass to the end effector."""
    words = ("robot=panda", "base=free", "base.mass=60", "base.inertia=4.9", "base.com=[0,0,-0.35]", *CIRCLE)
    around = ("path.center_direction=[0,1,0]", "path.normal=[1,0,0]", f"robot.orientation={orientation}")
    e = solved(
        *words,
        *around,
        "timing.duration=4",
        "timing.steps=24",
        "collision.self=false",  # the cheapest one folds into itself, and what is asked here is of the base
        BETWEEN,
        *(f"method.global.{word}" for word in ("starts=population", "refine_to=null", "candidates=40", "optimised=2")),
    )[1]
    assert e.status is Status.SOLVED, e.message
    assert np.abs(e.q[-1] - e.q[0]).max() < 1e-9
    assert e.base.turn.max() > 1e-3
    if orientation == "full":
        assert e.base.turn[-1] < 1e-6


@pytest.mark.slow
def test_a_cycle_with_torques() -> None:
    problem, e = solved(*ON_BASE, *CIRCLE, "objective=torque")
    assert e.status is Status.SOLVED, e.message
    assert np.abs(e.q[-1] - e.q[0]).max() < 1e-9
    costs = integrals(problem, problem.times, e.solution.trajectory.q)
    assert e.torque_integral[-1] == pytest.approx(costs.integrals["torque"], rel=1e-6)
    energy = solved(*ON_BASE, *CIRCLE)[1]
    assert e.torque_integral[-1] < energy.torque_integral[-1]


# --- heavy bases, and a base that is held -----------------------------------------------------------------------------


@pytest.mark.slow
def test_heavy_bases_are_fixed_ones_in_the_limit() -> None:
    """Energies differ from the fixed base's in proportion to 1 / mass, the base turns in proportion to it."""
    words = (
        *SHORT,
        "path.length=0.2",
        "timing.steps=8",
        "method.global.optimised=1",
        "method.pmke.prediction_step=0.8",
        "method.pmke.update_interval=0.8",
        "method.pmke.dt=0.05",
    )

    def energies(*base: str) -> tuple[Array, float]:
        config = composed(*words, *base)
        problem = prepare(config)
        found = [
            lsv(problem, LsvOptions(dt=0.05))[0],
            inertia_weighted(problem, LsvOptions(dt=0.05))[0],
            pmke(problem, config.method.pmke)[0],
            global_planner(problem, config.method.global_, Context(config.seed))[0],
        ]
        results = [evaluate(problem, solution) for solution in found]
        return np.array([e.energy_integral[-1] for e in results]), float(results[-1].base.turn.max())

    fixed, _ = energies()
    masses, gaps, turns = (10.0, 1e3, 1e6), [], []
    for mass in masses:
        own, turn = energies("base=free", f"base.mass={mass}", f"base.inertia={0.02 * mass}")
        gaps.append(np.abs(own / fixed - 1))
        turns.append(turn)
    assert np.all(gaps[0] > 1e-2), gaps
    assert np.all(gaps[1] < 0.05), gaps
    assert np.all(gaps[2] < 5e-5), gaps
    order = np.log10(gaps[1] / gaps[2]) / 3  # 1: in proportion to 1 / mass
    np.testing.assert_allclose(order, 1.0, atol=0.15)
    assert turns[1] / turns[2] == pytest.approx(1e3, rel=0.05)


def test_reactions_are_the_rate_of_momentum(rng: np.random.Generator) -> None:
    """Of a motion of the joints on a base that stands still: by central differences of Drake's momentum."""
    problem, e = solved(*SHORT)
    assert e.base.reaction is not None
    plant, h = BasePlant(problem.task.arm), 1e-5
    rotation, position = plant.start
    for i in (4, 13, 25):
        sides = []
        for sign in (1, -1):
            qd = e.qd[i] + sign * h * e.qdd[i]
            q = e.q[i] + sign * h * e.qd[i] + h * h * e.qdd[i] / 2
            plant.at(position, rotation, q, np.concatenate([np.zeros(6), qd]))
            sides.append(plant.momentum())
        np.testing.assert_allclose(e.base.reaction[i], (sides[0] - sides[1]) / (2 * h), atol=1e-7)


def test_an_arm_at_rest_pulls_at_its_base_by_its_weight(rng: np.random.Generator) -> None:
    """Placed and turned: the weight of all its bodies, and its moment about the root link."""
    where, gravity = (0.3, -0.2, 0.5), np.array([0.5, -1.0, -9.5])
    arm = robot("panda", base_position=where, base_rpy=(0.3, -0.4, 0.5), gravity=tuple(gravity))
    q, plant = within_limits(arm, 2, rng), BasePlant(arm)
    np.testing.assert_allclose(
        Rotation.from_quat(plant.start[0]).as_matrix(),
        RotationMatrix(RollPitchYaw(0.3, -0.4, 0.5)).matrix(),
        atol=1e-15,
    )
    for row, found in zip(q, reactions(arm, q, 0 * q, 0 * q), strict=True):
        plant.at(np.array(where), plant.start[0], row, np.zeros(6 + arm.n))
        weight = plant.plant.CalcTotalMass(plant.context) * gravity
        lever = plant.plant.CalcCenterOfMassPositionInWorld(plant.context) - where
        np.testing.assert_allclose(found, -np.concatenate([weight, np.cross(lever, weight)]), atol=1e-10)


@pytest.mark.slow
def test_least_reaction_on_a_held_base() -> None:
    words = (*SHORT, "boundary=free", "objective=reaction", "objective.force=0.1")
    problem, e = solved(*words)
    plain, energy = solved(*SHORT, "boundary=free")
    assert problem.task.arm.base.kind == "held"
    assert e.status is Status.SOLVED, e.message
    assert e.objective == pytest.approx(0.1 * e.integral("reaction_force") + e.integral("reaction_torque"))
    costs = integrals(problem, problem.times, e.solution.trajectory.q)
    assert e.integral("reaction_force") == pytest.approx(costs.integrals["reaction_force"], rel=1e-6)
    assert e.integral("reaction_torque") == pytest.approx(costs.integrals["reaction_torque"], rel=1e-6)
    assert e.objective < 0.8 * (0.1 * energy.integral("reaction_force") + energy.integral("reaction_torque"))
    # The same joints on the plain fixed base: the same energies and torques.
    again = evaluate(plain, Solution("x", Trajectory(e.time, e.q), Status.SOLVED))
    np.testing.assert_allclose(again.energy_integral, e.energy_integral, rtol=1e-9)
    np.testing.assert_allclose(again.tau, e.tau, atol=1e-9)


@pytest.mark.slow
def test_least_turning_brings_the_base_to_rest() -> None:
    """A planar arm with r = 1 can follow the path and turn its base by nothing."""
    e = solved(*ON_BASE, "objective=base_rotation", "method.global.optimised=4")[1]
    energy = solved(*ON_BASE)[1]
    assert e.status is Status.SOLVED, e.message
    assert e.integral("base_rotation") < 1e-6 * energy.integral("base_rotation")
    assert e.energy_integral[-1] > energy.energy_integral[-1]
