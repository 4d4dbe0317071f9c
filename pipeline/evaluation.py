"""Every reported number, recomputed from q(t) and the arm alone: nothing here comes from a solver.

The plant is a single arm loaded on its own, evaluated knot by knot through Drake's own energy, torque and pose calls,
so that a mistake in the stacked evaluations or their scaling cannot hide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import Array
from pipeline.base_motion import Floating, integrate, reactions
from pipeline.clearance import Clearance
from pipeline.floating import FloatingArm
from pipeline.problem import Boundary, Problem, Solution, Status, Trajectory
from pipeline.single_plant import SinglePlant

LIMITS = 1e-6  # relative: how well a method that promises limits must keep them at its knots
CLEARANCES = 5  # of those at which distances from obstacles are taken
BETWEEN = 10  # sub-intervals per knot interval on which the motion between knots is judged


@dataclass(frozen=True)
class Base:
    """The base: position (N + 1, 3) [m], rotation (N + 1, 3, 3) and turn from the start (N + 1,) [rad] at the knots.

    reaction (N + 1, 6) [N, N m]: what holds a base that stands still; None if it floats. integrals, running (N + 1,):
    base_rotation, reaction_force, reaction_torque. floating: the motion that the joints alone give; None if it stands.
    """

    position: Array
    rotation: Array
    turn: Array
    reaction: Array | None
    integrals: dict[str, Array]
    floating: Floating | None


@dataclass(frozen=True)
class Evaluation:
    """One motion and all that is known of it. Shapes: N + 1 knots, n joints; SI units. What the base does is in `base`.

    Velocities, accelerations and torques are backward differences at the knots (Global paper Section 4): the sum
    1/2 qd_i' M(q_i) qd_i dt_i is the kinetic-energy integral that the documents print.
    """

    solution: Solution
    status: Status
    message: str
    time: Array  # (N + 1,)
    q: Array  # (N + 1, n)
    qd: Array  # (N + 1, n)
    qdd: Array  # (N + 1, n)
    tau: Array  # (N + 1, n)
    power: Array  # (N + 1, n) |tau qd|
    position: Array  # (N + 1, 3) end effector in the world
    skeleton: Array  # (N + 1, n + 1, 3) joint origins and end effector
    tracking_error: Array  # (N + 1,) [m]
    orientation_error: Array  # (N + 1,) [rad] angle to the prescribed orientation or direction; zero without one
    kinetic_energy: Array  # (N + 1,) T
    energy_integral: Array  # (N + 1,) of T, running
    torque_integral: Array  # (N + 1,) of tau'tau, running
    velocity_norm_integral: Array  # (N + 1,) of qd'qd, running
    secondary: Array  # (N + 1,) w, the sum of the objective's secondary criteria; zero without one
    objective: float  # the weighted sum of the integrals, less k0 times the trapezoidal integral of w
    objective_spline: float  # the same of the cubic spline through the knots; nan if torques count
    singular_value: Array  # (N + 1,) smallest of the task Jacobian
    spectral_radius: Array  # (N + 1,) of M
    energy_integral_spline: float  # of the cubic spline through the knots, independent of the grid's quadrature
    tracking_error_between: float  # largest between knots, along that spline
    orientation_error_between: float
    clearance: Array  # (N + 1,) [m] smallest distance of a moving link from an obstacle; infinite without obstacles
    clearance_between: float  # smallest along that spline
    limit_excess: dict[str, float]  # by kind, at the knots, relative; see limit_excess()
    limit_excess_between: dict[str, float]  # the same along that spline
    base: Base

    @property
    def method(self) -> str:
        return self.solution.method

    @property
    def label(self) -> str:
        """`global`, `global 2`, ...: the method and, from the second on, its optimum."""
        return self.method if self.solution.optimum == 1 else f"{self.method} {self.solution.optimum}"

    def integral(self, name: str) -> float:
        """One of problem.INTEGRALS at the end of the motion."""
        own = {"kinetic_energy": self.energy_integral, "torque": self.torque_integral}
        return float((own[name] if name in own else self.base.integrals[name])[-1])

    @property
    def confirmed(self) -> bool:
        """Whether the run may call itself successful: a baseline that meets a singularity has done its work."""
        return self.status in (Status.SOLVED, Status.SINGULAR)


def evaluate(problem: Problem, solution: Solution) -> Evaluation:
    """Recompute everything about `solution`; a motion that breaks its method's promise gets the status UNCONFIRMED."""
    arm, task, trajectory = problem.task.arm, problem.task, solution.trajectory
    time, q = trajectory.time, trajectory.q
    dt = np.diff(time)
    qd, qdd = differences(trajectory, problem.boundary, problem.reference.timing.at_rest)
    plant = SinglePlant(arm)
    if arm.floats and problem.boundary is Boundary.CYCLIC:
        qd, qdd = _entered(plant, trajectory, qd)
    count, n = q.shape
    tau, energy, radius = np.full((count, n), np.nan), np.full(count, np.nan), np.full(count, np.nan)
    skeleton, singular = np.full((count, n - arm.base_coordinates + 1, 3), np.nan), np.full(count, np.nan)
    place, way = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    tracking, turned, targets = np.full(count, np.nan), np.full(count, np.nan), problem.reference.position(time)
    for i in np.flatnonzero(np.isfinite(np.hstack([q, qd, qdd])).all(axis=1)):  # Drake refuses other values
        plant.at(q[i], qd[i])
        energy[i] = plant.kinetic_energy()
        tau[i] = plant.torque(qdd[i])
        spread = plant.motion_map()
        radius[i] = np.linalg.eigvalsh(spread.T @ plant.mass_matrix() @ spread)[-1]
        skeleton[i], (place[i], way[i]) = plant.skeleton(), plant.base()
        singular[i] = np.linalg.svd(plant.task_jacobian(task) @ spread, compute_uv=False)[-1]
        tracking[i], turned[i] = plant.task_error(task, targets[i])
    # At the first knot nothing has been spent yet: the interval's values stand at its end.
    tau[0] = tau[0] if problem.boundary is Boundary.CYCLIC else 0.0
    position = skeleton[:, -1]
    scene = None if problem.obstacles is None else Clearance(arm, problem.obstacles)
    clearance = _clearance(scene, q)
    turn = _angle(plant.start, way)
    excess = limit_excess(problem, q, qd, tau, float(clearance.min()), float(turn.max()))
    spline_integral, spline_objective, between, turned_between, clear_between, excess_between = _between_knots(
        problem, plant, scene, trajectory, qd[0]
    )
    secondary = np.array([plant.secondary(problem, qi) for qi in q]) if problem.objective.secondary else np.zeros(count)
    moving = q
    q, qd, qdd, tau = (values[:, arm.base_coordinates :] for values in (q, qd, qdd, tau))
    base = _base(problem, solution, place, way, turn, (q, qd, qdd))
    energy_integral, torque_integral = _running(energy, dt), _running((tau**2).sum(axis=1), dt)
    velocity_norm_integral = _running((qd**2).sum(axis=1), dt)

    status, message = solution.status, solution.message
    if status is Status.SOLVED:
        status, message = _judge(moving, tracking, turned, excess, solution)
    return Evaluation(
        solution=solution,
        status=status,
        message=message,
        time=time,
        q=q,
        qd=qd,
        qdd=qdd,
        tau=tau,
        power=np.abs(tau * qd),
        position=position,
        skeleton=skeleton,
        tracking_error=tracking,
        orientation_error=turned,
        kinetic_energy=energy,
        energy_integral=energy_integral,
        torque_integral=torque_integral,
        velocity_norm_integral=velocity_norm_integral,
        secondary=secondary,
        objective=_weighted(
            problem,
            float(energy_integral[-1]),
            float(torque_integral[-1]),
            float(velocity_norm_integral[-1]),
            float(np.trapezoid(secondary, time)),
            {name: float(running[-1]) for name, running in base.integrals.items()},
        ),
        objective_spline=spline_objective,
        singular_value=singular,
        spectral_radius=radius,
        energy_integral_spline=spline_integral,
        tracking_error_between=between,
        orientation_error_between=turned_between,
        clearance=clearance,
        clearance_between=clear_between,
        limit_excess=excess,
        limit_excess_between=excess_between,
        base=base,
    )


def _base(
    problem: Problem, solution: Solution, place: Array, way: Array, turn: Array, joints: tuple[Array, Array, Array]
) -> Base:
    """What the base does: pose at the knots, from the solution; the rest from the joint motion alone (`base_motion.py`)."""
    arm, time = problem.task.arm, solution.trajectory.time
    dt, nothing = np.diff(time), np.zeros(len(time))
    if not isinstance(arm, FloatingArm) or not arm.floats:
        reaction = reactions(arm, *joints)
        reaction[0] = reaction[0] if problem.boundary is Boundary.CYCLIC else 0.0
        force, torque = ((reaction[:, part] ** 2).sum(axis=1) for part in (slice(3), slice(3, 6)))
        integrals = {"reaction_force": _running(force, dt), "reaction_torque": _running(torque, dt)}
        return Base(place, way, turn, reaction, {"base_rotation": nothing, **integrals}, None)
    steps = way[1:] @ way[:-1].swapaxes(1, 2)
    rate = np.concatenate([[0.0], _angle(np.eye(3), steps) / dt])
    integrals = {"base_rotation": _running(rate**2, dt), "reaction_force": nothing, "reaction_torque": nothing}
    finite = np.isfinite(joints[0]).all() and len(time) >= 4 and solution.found
    floating = integrate(problem, arm, time, joints[0]) if finite else None
    return Base(place, way, turn, None, integrals, floating)


def _angle(start: Array, rotation: Array) -> Array:
    """The angle (K,) [rad] between rotations (K, 3, 3) and one of them."""
    chord = np.linalg.norm(rotation - start, axis=(1, 2)) / np.sqrt(8)
    return np.asarray(2 * np.arcsin(np.minimum(chord, 1.0)))


def _entered(plant: SinglePlant, trajectory: Trajectory, qd: Array) -> tuple[Array, Array]:
    """Velocities and accelerations of a cycle on a floating base: it is entered with the joints' last velocity, and the
    base's that goes with it at the start.
    """
    qd = qd.copy()
    plant.at(trajectory.q[0], qd[0])
    qd[0] = plant.motion_map() @ qd[0, plant.nb :] + plant.drift()
    change = np.diff(qd, axis=0) / np.diff(trajectory.time)[:, None]
    return qd, np.vstack([change[-1], change])


def differences(trajectory: Trajectory, boundary: Boundary, at_rest: bool) -> tuple[Array, Array]:
    """qd, qdd (N + 1, n) by backward differences: qd_i = (q_i - q_(i-1)) / dt_i, qdd_i = (qd_i - qd_(i-1)) / dt_i.

    qd_0 is zero for a motion from rest, qd_N for a cyclic one, and qd_1 for a path that is entered at speed.
    """
    dt = np.diff(trajectory.time)[:, None]
    step = np.diff(trajectory.q, axis=0) / dt
    if boundary is Boundary.CYCLIC:
        first = step[-1]
    else:
        first = np.zeros_like(step[0]) if at_rest else step[0]
    qd = np.vstack([first, step])
    change = np.diff(qd, axis=0) / dt
    return qd, np.vstack([change[-1] if boundary is Boundary.CYCLIC else np.zeros_like(first), change])


def _weighted(
    problem: Problem, energy: float, torque: float, norm: float, secondary: float, base: Mapping[str, float]
) -> float:
    """The objective from its integrals; a term without weight does not count, even where it is not known."""
    weights = problem.objective
    k0 = weights.secondary.k0 if weights.secondary else 0.0
    terms = (
        (weights.kinetic_energy, energy),
        (weights.torque, torque),
        (weights.velocity_norm, norm),
        (-k0, secondary),
        *((getattr(weights, name), value) for name, value in base.items()),
    )
    return sum(weight * term for weight, term in terms if weight)


def _running(rate: Array, dt: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(rate[1:] * dt)])


def _judge(
    q: Array, tracking: Array, turned: Array, excess: dict[str, float], solution: Solution
) -> tuple[Status, str]:
    if not np.all(np.isfinite(q)):
        return Status.UNCONFIRMED, "the motion holds values that are not finite"
    for error, unit in ((tracking, "m"), (turned, "rad")):
        worst = int(np.argmax(error))
        if error[worst] > solution.tracking_tolerance:
            return Status.UNCONFIRMED, (
                f"the end effector is {error[worst]:.2e} {unit} off its path at t = {solution.trajectory.time[worst]:.2f} s; "
                f"{solution.method} promises {solution.tracking_tolerance:.0e} {unit}"
            )
    for kind in solution.limits_kept:
        if excess.get(kind, 0.0) > LIMITS:
            return Status.UNCONFIRMED, f"a {kind} limit is exceeded by {100 * excess[kind]:.2g} %"
    return Status.SOLVED, solution.message


def _between_knots(
    problem: Problem, plant: SinglePlant, scene: Clearance | None, trajectory: Trajectory, qd_start: Array
) -> tuple[float, float, float, float, float, dict[str, float]]:
    """The cubic spline through the knots: kinetic-energy integral (Simpson), objective, largest tracking and orientation
    errors, smallest clearance, excess of limits.
    """
    if not np.all(np.isfinite(trajectory.q)) or len(trajectory.time) < 4:
        return float("nan"), float("nan"), float("nan"), float("nan"), float("nan"), {}
    # Only torques tie the first velocity to rest; the energy's sum lets it jump, and nothing prescribes the last one.
    torque_counts = problem.objective.second_order or bool(np.isfinite(problem.bounds.torque).any())
    rest = problem.reference.timing.at_rest and problem.boundary is not Boundary.CYCLIC and torque_counts
    ends = ((1, qd_start), "not-a-knot") if rest else "not-a-knot"
    spline = CubicSpline(trajectory.time, trajectory.q, bc_type=ends)
    fraction = np.linspace(0.0, 1.0, BETWEEN + 1)
    weights = np.array([1.0, *([4.0, 2.0] * (BETWEEN // 2))[:-1], 1.0]) / (3 * BETWEEN)
    dt = np.diff(trajectory.time)
    moments = (trajectory.time[:-1, None] + dt[:, None] * fraction).ravel()
    q, qd, qdd, x_ref = spline(moments), spline(moments, 1), spline(moments, 2), problem.reference.position(moments)
    energy, error, turned, secondary, turn = np.zeros((5, len(moments)))
    tau, nb = np.zeros_like(q), plant.nb
    spinning = np.zeros(len(moments))
    for i in range(len(moments)):
        plant.at(q[i], qd[i])
        energy[i] = plant.kinetic_energy()
        error[i], turned[i] = plant.task_error(problem.task, x_ref[i])
        turn[i] = _angle(plant.start, plant.base()[1][None])[0]
        spinning[i] = plant.spin_squared()
        if problem.bounds.any:
            tau[i] = plant.torque(qdd[i])
        if problem.objective.secondary:
            secondary[i] = plant.secondary(problem, q[i])
    rates = (energy, (qd[:, nb:] ** 2).sum(axis=1), secondary, spinning)
    integral, norm, gain, spun = (float(rate.reshape(len(dt), -1) @ weights @ dt) for rate in rates)
    unknown = float("nan")
    of_base = {"base_rotation": spun, "reaction_force": unknown, "reaction_torque": unknown}
    objective = _weighted(problem, integral, unknown, norm, gain, of_base)
    clear = float(_clearance(scene, q[:: BETWEEN // CLEARANCES]).min())
    excess = limit_excess(problem, q, qd, tau, clear, float(turn.max()))
    return integral, objective, float(error.max()), float(turned.max()), clear, excess


def _clearance(scene: Clearance | None, q: Array) -> Array:
    if scene is None:
        return np.full(len(q), np.inf)
    finite = np.isfinite(q).all(axis=1)
    clearance = np.full(len(q), np.nan)
    clearance[finite] = scene.smallest(q[finite])
    return clearance


def limit_excess(
    problem: Problem, q: Array, qd: Array, tau: Array, clearance: float = np.inf, turn: float = 0.0
) -> dict[str, float]:
    """By how much each kind of limit is exceeded, relative to its size (positions: to half the range; clearances: to the
    margin); <= 0 if kept. turn [rad]: of the base from its start.
    """
    if not problem.constrained or not np.all(np.isfinite(q)):
        return {}
    found = {kind: float(excess.max()) for kind, excess in _excesses(problem, q, qd, tau).items()}
    if problem.obstacles is not None:
        found["clearance"] = 1 - clearance / problem.obstacles.margin
    if np.isfinite(problem.bounds.attitude):
        found["attitude"] = turn / problem.bounds.attitude - 1
    return found


def _excesses(problem: Problem, q: Array, qd: Array, tau: Array) -> dict[str, Array]:
    """The same (K, n) for every sample and joint, of the kinds that are limited."""
    limits = problem.bounds
    half = np.where(np.isfinite(limits.upper - limits.lower), (limits.upper - limits.lower) / 2, 1.0)
    kinds = {
        "position": (np.maximum(q - limits.upper, limits.lower - q) / half, limits.upper),
        "velocity": (np.abs(qd) / limits.velocity - 1, limits.velocity),
        "torque": (np.abs(tau) / limits.torque - 1, limits.torque),
        "power": (np.abs(tau * qd) / limits.power - 1, limits.power),
    }
    return {kind: excess for kind, (excess, bound) in kinds.items() if np.isfinite(bound).any()}


@dataclass(frozen=True)
class Audit:
    """What samples of a motion keep: errors [m, rad], excess of limits and, by kind, the sample and joint of the worst."""

    tracking_error: float
    orientation_error: float
    limit_excess: dict[str, float]
    worst: dict[str, tuple[int, int]]


def audit(problem: Problem, time: Array, q: Array, qd: Array, qdd: Array) -> Audit:
    """Judge samples (K, n) that come with their own velocities and accelerations, at times (K,)."""
    plant, targets = SinglePlant(problem.task.arm), problem.reference.position(time)
    error, turned, turn, tau = np.empty(len(time)), np.empty(len(time)), np.empty(len(time)), np.empty_like(q)
    for i in range(len(time)):
        plant.at(q[i], qd[i])
        error[i], turned[i] = plant.task_error(problem.task, targets[i])
        tau[i] = plant.torque(qdd[i])
        turn[i] = _angle(plant.start, plant.base()[1][None])[0]
    scene = None if problem.obstacles is None else Clearance(problem.task.arm, problem.obstacles)
    clearance = _clearance(scene, q)
    worst = {
        kind: tuple(int(place) for place in np.unravel_index(int(np.argmax(excess)), excess.shape))
        for kind, excess in _excesses(problem, q, qd, tau).items()
    }
    if scene is not None:
        worst["clearance"] = (int(np.argmin(clearance)), 0)
    if np.isfinite(problem.bounds.attitude):
        worst["attitude"] = (int(np.argmax(turn)), 0)
    excess = limit_excess(problem, q, qd, tau, float(clearance.min()), float(turn.max()))
    return Audit(float(error.max()), float(turned.max()), excess, worst)  # type: ignore[arg-type]
