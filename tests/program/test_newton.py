"""Newton's method for many motions: its parts beside differences, its optima beside IPOPT's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.problem.costs import integrals, objective_values, velocities
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.confirm import Confirm
from pipeline.program.newton import stencils
from pipeline.program.newton.bounds import Bounds
from pipeline.program.newton.clear import Clear
from pipeline.program.newton.knots import Knots
from pipeline.program.newton.momentum import Momentum
from pipeline.program.newton.newton import Newton
from pipeline.program.newton.serve import Solver, why_not
from pipeline.search.roadmap import Roadmap
from tests.support import composed, dense, differences

BOUNDARIES = list(Boundary)
# the description with spheres and cylinders, whose distances are smooth
ROUND = "robot.urdf=package://example-robot-data/robots/panda_description/urdf/panda_collision.urdf"


def small(boundary: Boundary, *words: str) -> Problem:
    problem = prepare(composed("robot=planar4r", "path=circle", "path.radius=0.05", "timing.steps=6", *words))
    objective = Objective({"kinetic_energy": 0.7, "velocity_norm": 0.02})
    return replace(problem, boundary=boundary, objective=objective)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_derivatives_of_whole_motions(boundary: Boundary, rng: np.random.Generator) -> None:
    problem = small(boundary)
    newton = Solver(problem).on(problem.times)
    motions, knots, n = newton.motions, newton.knots, problem.task.arm.n
    q = rng.normal(size=(2, len(problem.times), n))
    x, begin = knots.unknown(q), q[:, :1]
    point = motions.differentiate(x, begin)
    for s in range(2):

        def at(flat: Array, s: int = s) -> Array:
            return flat.reshape(1, knots.count, n)

        def cost(flat: Array, s: int = s) -> Array:
            return motions.value(at(flat), begin[s : s + 1])[0][0]

        def gradient(flat: Array, s: int = s) -> Array:
            return motions.differentiate(at(flat), begin[s : s + 1]).gradient.ravel()

        flat = x[s].ravel()
        scale = float(np.abs(point.gradient[s]).max())
        np.testing.assert_allclose(point.gradient[s].ravel(), differences(cost, flat), atol=1e-7 * scale)
        hessian = dense(tuple(block[s] for block in point.hessian), knots.cyclic)
        np.testing.assert_allclose(hessian, differences(gradient, flat), atol=1e-7 * np.abs(hessian).max())
    value, error, *_ = motions.value(x, begin)
    np.testing.assert_allclose(value, point.cost, rtol=1e-13)
    np.testing.assert_array_equal(error, point.error)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_rows_of_limits_and_their_transpose(boundary: Boundary, rng: np.random.Generator) -> None:
    problem = small(boundary, "limits=joint")
    lower = np.array([-1.0, -np.inf, -2.0, -3.0])
    problem = replace(problem, limits=replace(problem.bounds, lower=lower, upper=-lower, velocity=np.full(4, 3.0)))
    knots = Knots(boundary, problem.times)
    bounds = Bounds(knots, problem.bounds)
    q = rng.normal(size=(2, 7, 4))
    x, begin = knots.unknown(q), q[:, :1]
    whole = knots.whole(x, begin)
    speed = np.abs(np.diff(whole, axis=1) / np.diff(problem.times)[:, None])
    slack = np.sort(np.concatenate([3.0 - speed, 3.0 + speed], axis=1).ravel()) * problem.times[1]
    kept = bounds.values(x, begin)
    np.testing.assert_allclose(
        np.sort(kept[:, np.isclose(bounds.offset, -3.0 * problem.times[1])].ravel()), slack, atol=1e-12
    )
    d, z = rng.normal(size=x.shape), rng.normal(size=kept.shape)
    np.testing.assert_allclose(bounds.values(x + d, begin) - kept, bounds.change(d), atol=1e-12)
    np.testing.assert_allclose((bounds.change(d) * z).sum(axis=1), (d * bounds.pull(z)).sum(axis=(1, 2)))
    on, above = bounds.weigh(z)
    blocks = on[..., None] * np.eye(4), above[..., None] * np.eye(4)
    np.testing.assert_allclose((d * knots.product(blocks, d)).sum(axis=(1, 2)), (z * bounds.change(d) ** 2).sum(axis=1))


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("reach", [0, 1, 2])
def test_rows_of_intervals_and_their_transpose(boundary: Boundary, reach: int, rng: np.random.Generator) -> None:
    """Beside a dense Jacobian; what comes before the first unknown does not count."""
    knots, n, rows = Knots(boundary, np.arange(8.0)), 2, 3
    count = knots.count
    by = tuple(rng.normal(size=(2, count, rows, n)) for _ in range(reach + 1))
    whole = np.zeros((2, count, rows, count, n))
    for k in range(count):
        for s in range(reach + 1):
            if k >= s or knots.cyclic:
                whole[:, k, :, k - s] += by[s][:, k]
    d, z = rng.normal(size=(2, count, n)), rng.random((2, count, rows))
    np.testing.assert_allclose(stencils.change(knots, by, d), np.einsum("skrjn,sjn->skr", whole, d), atol=1e-12)
    np.testing.assert_allclose(stencils.pull(knots, by, z), np.einsum("skrjn,skr->sjn", whole, z), atol=1e-12)
    np.testing.assert_array_equal(stencils.dense(knots, by), whole.reshape(2, count * rows, -1))
    squares = np.einsum("skria,skr,skrjb->siajb", whole, z, whole).reshape(2, count * n, -1)
    for s in range(2):
        found = dense(tuple(block[s] for block in stencils.weigh(knots, by, z)), knots.cyclic)
        np.testing.assert_allclose(found, squares[s], atol=1e-12)


def test_clearance_rows_are_drakes(rng: np.random.Generator) -> None:
    problem = prepare(composed("+experiment=panda_obstacle", "timing.steps=6", ROUND))
    assert problem.obstacles is not None
    rows = Clear(Clearance(problem.task.arm, problem.obstacles).rows())
    near = np.array([-1.35, 0.04, 0.4, -2.1, -2.3, 1.2, 0.7])
    x = near + rng.normal(scale=0.02, size=(1, 3, 7))
    *_, kept, (by,) = rows.differentiate(x, x)
    assert (np.abs(by).max(axis=(1, 2, 3)) > 0.1).all()
    slope = differences(lambda flat: rows.values(flat.reshape(x.shape), x)[1].ravel(), x.ravel())
    np.testing.assert_allclose(by[0, :, 0], np.einsum("kkn->kn", slope.reshape(3, 3, 7)), atol=1e-6)
    np.testing.assert_array_equal(rows.values(x, x)[1], kept)


@pytest.mark.slow
@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("enters", ["rest", "speed", "velocity"])
def test_derivatives_of_torques(boundary: Boundary, enters: str, rng: np.random.Generator) -> None:
    """Cost and limits beside Drake's torques; gradients, and the Hessian of the whole Lagrangian, by differences."""
    timing = "constant_speed" if enters == "speed" else "raised_cosine"
    words = ("limits=joint_torque_power", f"timing={timing}", "timing.steps=7", "path=circle", "path.radius=0.05")
    problem = prepare(composed("robot=planar4r", *words))
    given = np.array([0.1, -0.2, 0.3, 0.1]) if enters == "velocity" else None
    objective = Objective({"kinetic_energy": 0.7, "torque": 0.3})
    problem = replace(problem, boundary=boundary, objective=objective, qd_init=given)
    newton = Solver(problem).on(problem.times)
    motions, knots, scale = newton.motions, newton.knots, 1.7
    x = knots.unknown(problem.q_init + 0.1 * rng.normal(size=(1, 8, 4)))
    begin = np.zeros((1, 1, 4)) if knots.cyclic else problem.q_init[None, None]
    point, whole = motions.differentiate(x, begin), knots.whole(x, begin)
    assert point.cost == pytest.approx(objective_values(problem, problem.times, whole), rel=1e-9)
    tau, qd = integrals(problem, problem.times, whole[0]).tau[1:], velocities(problem, problem.times, whole[0])[1:]
    bounds = problem.bounds
    load, power = tau / bounds.torque, tau * qd / bounds.power
    owned = np.concatenate([1 - load, 1 + load, 1 - power, 1 + power], axis=1)
    kept = np.roll(point.kept[0], -1, axis=0) if knots.cyclic else point.kept[0, -len(tau) :]
    np.testing.assert_allclose(kept, owned, atol=1e-8)

    z, shape = rng.normal(size=point.kept.shape), (1, knots.count, 4)
    flat = x.ravel()
    gradient = differences(lambda y: motions.value(y.reshape(shape), begin)[0][0], flat)
    np.testing.assert_allclose(point.gradient.ravel(), gradient, atol=1e-7 * np.abs(gradient).max())
    slope = differences(lambda y: (motions.value(y.reshape(shape), begin)[2] * z).sum(), flat)
    pull = stencils.pull(knots, point.by, z).ravel()
    np.testing.assert_allclose(pull, slope, atol=1e-7 * np.abs(slope).max())

    def lagrangian(y: Array) -> Array:
        at = motions.differentiate(y.reshape(shape), begin)
        return (scale * at.gradient - stencils.pull(knots, at.by, z)).ravel()

    hessian = differences(lagrangian, flat)
    more = motions.terms.curvature(x, begin, z, np.array([scale]))
    found = dense(tuple(scale * a[0] + b[0] for a, b in zip(point.hessian, more, strict=True)), knots.cyclic)
    np.testing.assert_allclose(found, hessian, atol=1e-7 * np.abs(hessian).max())


@pytest.mark.parametrize("name", ["floating3r", "floating_panda"])
def test_momentum_rows_and_their_derivatives(name: str, rng: np.random.Generator) -> None:
    """Values beside Drake's arm; derivatives by differences."""
    problem = prepare(composed(f"+experiment={name}", "timing.steps=3"))
    arm, knots = problem.task.arm, Knots(problem.boundary, problem.times)
    rows = Momentum(arm, Chain.of(arm), knots)
    q = problem.q_init + 0.2 * rng.normal(size=(1, 4, arm.n))
    x, begin, dt = knots.unknown(q), knots.begin(q), np.diff(problem.times)
    tie = rows.values(x, begin)
    right = arm.base.mean_momentum_residual(arm, q[0, :-1], np.diff(q[0], axis=0) / dt[:, None], dt)[0]
    np.testing.assert_allclose(tie[0], right, atol=1e-12)
    nu = rng.normal(size=tie.shape)

    def pull(flat: Array) -> Array:
        return stencils.pull(knots, rows.differentiate(flat.reshape(x.shape), begin)[1], nu).ravel()

    slope = differences(lambda flat: (rows.values(flat.reshape(x.shape), begin) * nu).sum(), x.ravel())
    np.testing.assert_allclose(pull(x.ravel()), slope, atol=1e-7 * np.abs(slope).max())
    hessian = differences(pull, x.ravel())
    found = dense(tuple(block[0] for block in rows.curvature(x, begin, nu)), knots.cyclic)
    np.testing.assert_allclose(found, hessian, atol=1e-7 * np.abs(hessian).max())


def solved(*words: str) -> tuple[Problem, Newton, Array]:
    problem = prepare(composed(*words, "timing.steps=25"))
    return (
        problem,
        Solver(problem).on(problem.times),
        Roadmap(problem, problem.times, np.random.default_rng(1)).cheapest(64),
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sim1", "sim2", "sim5", "traj4", "panda_pose"])
def test_ipopt_confirms_every_optimum(name: str) -> None:
    problem, newton, starts = solved(f"+experiment={name}")
    answer = newton.solve(starts[:24])
    assert answer.converged.sum() > 5
    costs = answer.cost[answer.converged]
    for s in np.flatnonzero(answer.converged)[[np.argmin(costs), np.argmax(costs)]]:
        told = Confirm(problem, problem.times, 1e-8, 20)(answer.q[s], answer.cost[s])
        assert told.converged
        assert told.iterations <= 2
        assert told.moved < 1e-6
        assert answer.residual[s] < 1e-9


@pytest.mark.slow
def test_ipopt_confirms_an_optimum_beside_an_obstacle() -> None:
    """Without the rows' curvature the last digits of the multipliers are IPOPT's to find."""
    problem = prepare(composed("+experiment=panda_obstacle", "timing.steps=12", ROUND, "collision.self=false"))
    starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=60).cheapest(4)
    answer = Solver(problem).on(problem.times).solve(starts)
    assert answer.converged.sum() >= 2
    best = np.flatnonzero(answer.converged)[np.argmin(answer.cost[answer.converged])]
    q = answer.q[best]
    told = Confirm(problem, problem.times, 1e-8, 20)(q, answer.cost[best])
    assert told.converged
    assert told.iterations <= 5
    assert told.moved < 1e-6
    assert problem.obstacles is not None
    clearance = Clearance(problem.task.arm, problem.obstacles)
    least = min(close.distance for one in q for close in clearance.closest(one))
    assert 0.0 <= least - problem.obstacles.margin < 1e-3  # the obstacle is in the way; p is a smooth bound


def best_confirmed(problem: Problem, nodes: int, most: int) -> Array:
    """The best of a few starts (N + 1, n), which IPOPT leaves where it is after `most` iterations at most."""
    starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=nodes).cheapest(4)
    answer = Solver(problem).on(problem.times).solve(starts)
    assert answer.converged.any()
    best = np.flatnonzero(answer.converged)[np.argmin(answer.cost[answer.converged])]
    q: Array = answer.q[best]
    told = Confirm(problem, problem.times, 1e-8, 20)(q, answer.cost[best])
    assert told.converged
    assert told.iterations <= most
    assert told.moved < 1e-6
    return q


@pytest.mark.slow
@pytest.mark.parametrize("words", [("base.angular_momentum=[0,0,0.02]",), ("limits=joint",)])
def test_ipopt_confirms_optima_of_an_arm_that_floats(words: tuple[str, ...]) -> None:
    problem = prepare(composed("+experiment=floating3r", "timing.steps=12", *words))
    best_confirmed(problem, nodes=60, most=2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sim3", "sim4"])
def test_ipopt_confirms_optima_of_torques(name: str) -> None:
    """Squares of torques, and in sim4 limits of torques and powers that matter."""
    problem = prepare(composed(f"+experiment={name}", "timing.steps=25"))
    q = best_confirmed(problem, nodes=100, most=4)
    tau, qd = np.abs(integrals(problem, problem.times, q).tau), np.abs(velocities(problem, problem.times, q))
    most = max((tau / problem.bounds.torque).max(), (tau * qd / problem.bounds.power).max())
    assert most == pytest.approx({"sim3": 0.0, "sim4": 1.0}[name], abs=1e-6)


def test_a_start_is_solved_alone_as_among_others() -> None:
    _, newton, starts = solved("+experiment=sim2")
    together, alone = newton.solve(starts[:8]), newton.solve(starts[5:6])
    assert together.converged[5]
    np.testing.assert_allclose(alone.q[0], together.q[5], atol=1e-9)
    assert alone.iterations[0] == together.iterations[5]


def test_limits_that_nothing_keeps_are_not_kept_silently() -> None:
    problem, _, starts = solved("+experiment=sim1")
    slow = replace(problem, limits=replace(problem.bounds, velocity=np.full(3, 0.5)))
    answer = Solver(slow).on(problem.times).solve(starts[:4])
    assert not answer.converged.any()


@pytest.mark.slow
def test_what_is_not_served_has_a_reason() -> None:
    for name in ("sim4", "floating3r"):
        assert why_not(prepare(composed(f"+experiment={name}"))) is None
    obstacle = prepare(composed("+experiment=panda_obstacle"))
    assert why_not(replace(obstacle, limits=None)) is None
    assert "clearances and torques" in str(why_not(obstacle))
    for words, word in ((("boundary=free",), "not fixed"), (("objective=base_rotation",), "rotation")):
        assert word in str(why_not(prepare(composed("+experiment=floating3r", *words))))


def test_starts_that_will_be_dear_are_given_up() -> None:
    """Earlier than they converge, and none but those; what is cheap ends as it does without."""
    problem = prepare(composed("+experiment=sim1", "timing.steps=12"))
    starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=60).random(48)
    newton = Solver(problem).on(problem.times)
    whole = newton.solve(starts)
    most = 1.5 * whole.cost[whole.converged].min()
    some = newton.solve(starts, dear=most)
    assert 5 < some.dear.sum() < 43
    assert not (some.dear & some.converged).any()
    assert (whole.cost[some.dear] > most).all()
    assert some.iterations[some.dear].sum() < 0.9 * whole.iterations[some.dear].sum()
    cheap = whole.converged & (whole.cost < most)
    assert some.converged[cheap].all()
    np.testing.assert_allclose(some.cost[cheap], whole.cost[cheap], rtol=1e-10)
