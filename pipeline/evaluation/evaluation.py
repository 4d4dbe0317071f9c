"""Every reported number, recomputed from q(t) and the arm alone: nothing here comes from a solver.

The plant is a single arm loaded on its own, evaluated knot by knot through Drake's own energy, torque and pose calls,
so that a mistake in the stacked evaluations or their scaling cannot hide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.evaluation.base import BaseMotion, angle_between, base_motion, entered_cycle
from pipeline.evaluation.between import between_knots, tool_pace
from pipeline.evaluation.certified import Near, near, said
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.curve import OffPath, off_path
from pipeline.evaluation.limits import LIMITS, limit_excess
from pipeline.evaluation.plant import SinglePlant
from pipeline.evaluation.sums import derivatives, running_integral, weighted_sum
from pipeline.problem.curve import turns_of_cycle, whole
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.resolution import steps_needed, strays
from pipeline.problem.solution import Solution, Status


@dataclass(frozen=True)
class Evaluation:
    """One motion and all that is known of it. Shapes: N + 1 knots, n joints; SI units. What the base does is in `base`.

    Velocities, accelerations and torques are backward differences at the knots (Global paper Section 4): the sum
    1/2 qd_i' M(q_i) qd_i dt_i is the kinetic-energy integral that the documents print. Those of a motion that is a
    spline are its derivatives, and its integrals are those of the curve.
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
    integrals: dict[str, Array]  # (N + 1,) running, by the names in the catalogue (`problem/integrals.py`)
    secondary: Array  # (N + 1,) w, the sum of the objective's secondary criteria; zero without one
    objective: float  # the weighted sum of the integrals, less k0 times the trapezoidal integral of w
    objective_spline: float  # the same of the cubic spline through the knots; nan if torques count
    singular_value: Array  # (N + 1,) smallest of the task Jacobian
    spectral_radius: Array  # (N + 1,) of M
    energy_integral_spline: float  # of the cubic spline through the knots, independent of the grid's quadrature
    tracking_error_between: float  # largest along the curve that is exported, between knots too
    orientation_error_between: float
    on_path: bool  # whether both are within the tolerances of the path
    clearance: Array  # (N + 1,) [m] smallest distance of a moving link from an obstacle; infinite without obstacles
    near: Near  # what the curve that is exported comes nearest to, certified
    limit_excess: dict[str, float]  # by kind, at the knots, relative; see limit_excess()
    limit_excess_between: dict[str, float]  # the same along that spline
    base: BaseMotion

    @property
    def method(self) -> str:
        return self.solution.method

    @property
    def label(self) -> str:
        """`global`, `global 2`, ...: the method and, from the second on, its optimum."""
        return self.method if self.solution.optimum == 1 else f"{self.method} {self.solution.optimum}"

    @property
    def clearance_between(self) -> float:
        """[m] What a moving link keeps from every obstacle along the curve that is exported, at least."""
        return self.near.obstacles.bound

    @property
    def energy_integral(self) -> Array:
        """(N + 1,) of T, running."""
        return self.integrals["kinetic_energy"]

    @property
    def torque_integral(self) -> Array:
        """(N + 1,) of tau'tau, running."""
        return self.integrals["torque"]

    @property
    def velocity_norm_integral(self) -> Array:
        """(N + 1,) of qd'qd, running."""
        return self.integrals["velocity_norm"]

    def integral(self, name: str) -> float:
        """One of them at the end of the motion."""
        return float(self.integrals[name][-1])

    def to_frame(self) -> pd.DataFrame:
        """A row per knot: time [s], q_1..n [rad or m], qd_1.., qdd_1.., tau_1.. [N m or N], the effector's x, y, z [m].

        Of a floating base also its position base_x, .. [m] and its rotation vector base_rx, .. [rad] in the world.
        """
        columns: dict[str, Array] = {"time": self.time}
        for name, values in (("q", self.q), ("qd", self.qd), ("qdd", self.qdd), ("tau", self.tau)):
            columns |= {f"{name}_{j + 1}": values[:, j] for j in range(values.shape[1])}
        columns |= dict(zip("xyz", self.position.T, strict=True))
        if self.base.reaction is None:
            turned = Rotation.from_matrix(self.base.rotation).as_rotvec()
            columns |= {f"base_{axis}": column for axis, column in zip("xyz", self.base.position.T, strict=True)}
            columns |= {f"base_r{axis}": column for axis, column in zip("xyz", turned.T, strict=True)}
        return pd.DataFrame(columns)

    @property
    def confirmed(self) -> bool:
        """Whether the run may call itself successful: a baseline that meets a singularity has done its work."""
        return self.status in (Status.SOLVED, Status.SINGULAR)


def evaluate(problem: Problem, solution: Solution) -> Evaluation:
    """Recompute everything about `solution`; a motion that breaks its method's promise gets the status UNCONFIRMED."""
    problem = solution.posed(problem)
    arm, task, trajectory = problem.task.arm, problem.task, solution.trajectory
    time, q = trajectory.time, trajectory.q
    dt = np.diff(time)
    qd, qdd, jerk = derivatives(trajectory, problem.boundary, problem.reference.timing.at_rest)
    plant = SinglePlant(arm)
    if arm.base.kind == "floating" and problem.boundary is Boundary.CYCLIC:
        qd, qdd = entered_cycle(plant, trajectory, qd)
    count, n = q.shape
    tau, energy = np.full((count, n), np.nan), np.full(count, np.nan)
    skeleton, radius, singular = np.full((count, n - arm.base.count + 1, 3), np.nan), *np.full((2, count), np.nan)
    place, way = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    tracking, turned, targets = np.full(count, np.nan), np.full(count, np.nan), problem.reference.position(time)
    finite = np.flatnonzero(np.isfinite(np.hstack([q, qd, qdd])).all(axis=1))  # Drake refuses other values
    inertia, jacobian = [], []
    for i in finite:
        plant.at(q[i], qd[i])
        energy[i] = plant.kinetic_energy()
        tau[i] = plant.torque(qdd[i])
        spread = plant.motion_map()
        inertia.append(spread.T @ plant.mass_matrix() @ spread)
        jacobian.append(plant.task_jacobian(task) @ spread)
        skeleton[i], (place[i], way[i]) = plant.skeleton(), plant.base()
        tracking[i], turned[i] = plant.task_error(task, targets[i])
    if len(finite):
        radius[finite] = np.linalg.eigvalsh(inertia)[:, -1]
        singular[finite] = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    # By differences nothing has been spent yet at the first knot: an interval's values stand at its end.
    smooth = trajectory.ends is not None
    tau[0] = tau[0] if problem.boundary is Boundary.CYCLIC or smooth else 0.0
    position = skeleton[:, -1]
    distances = Clearance(arm, problem.obstacles, problem.own)
    clearance = distances(q)
    clear = near(problem, distances, whole(problem, trajectory), time) if np.all(np.isfinite(q)) else Near()
    turn = angle_between(plant.start, way)
    own = own_at_knots(problem, distances, clear, q)
    pace = tool_pace(problem, plant, trajectory, position, (qd, qdd))
    nearest, most = float(clearance.min()), float(turn.max())
    excess = limit_excess(problem, q, qd, tau, nearest, most, own=own, qdd=qdd, jerk=jerk, pace=pace)
    between = between_knots(problem, plant, clear, trajectory, qd[0])
    off = off_path(problem, plant, trajectory)
    secondary = np.array([plant.secondary(problem, qi) for qi in q]) if problem.objective.secondary else np.zeros(count)
    moving = q
    q, qd, qdd, tau = (values[:, arm.joints] for values in (q, qd, qdd, tau))
    base = base_motion(problem, solution, place, way, turn, (q, qd, qdd))
    rates = {"kinetic_energy": energy, "torque": (tau**2).sum(axis=1), "velocity_norm": (qd**2).sum(axis=1)}
    integrals = {name: running_integral(rate, dt) for name, rate in rates.items()} | base.integrals
    if smooth:
        integrals |= {name: between.running[name] for name in rates}

    status, message = solution.status, solution.message
    if status in (Status.SOLVED, Status.SINGULAR):
        judged = between.limit_excess if smooth else excess
        if solution.clear_between:
            judged = judged | {kind: v for kind, v in between.limit_excess.items() if kind.endswith("clearance")}
        status, message = _judge(moving, tracking, turned, judged, solution, clear)
    if status is Status.SOLVED:
        status, message = _judge_between(problem, off, tracking, turned, solution, message)
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
        integrals=integrals,
        secondary=secondary,
        objective=between.objective
        if smooth
        else weighted_sum(
            problem,
            {name: float(running[-1]) for name, running in integrals.items()},
            float(np.trapezoid(secondary, time)),
        ),
        objective_spline=between.objective,
        singular_value=singular,
        spectral_radius=radius,
        energy_integral_spline=between.energy,
        tracking_error_between=off.distance,
        orientation_error_between=off.angle,
        on_path=all(
            error <= allowed * (1 + LIMITS)
            for error, allowed in zip((off.distance, off.angle), problem.reference.tolerances, strict=True)
        ),
        clearance=clearance,
        near=clear,
        limit_excess=excess,
        limit_excess_between=between.limit_excess,
        base=base,
    )


def own_at_knots(problem: Problem, distances: Clearance, clear: Near, q: Array) -> float:
    """The smallest distance [m] between links at the knots q (N + 1, n), where it is not enough between them too."""
    own = problem.own
    if own is None or not own.kept or clear.own.bound >= own.margin:
        return clear.own.bound
    return float(distances.smallest(distances.own, q).min())


def _judge(
    q: Array, tracking: Array, turned: Array, excess: dict[str, float], solution: Solution, clear: Near
) -> tuple[Status, str]:
    promised = solution.trajectory.time <= solution.until
    if not np.all(np.isfinite(q[promised])):
        return Status.UNCONFIRMED, "the motion holds values that are not finite"
    for error, unit in ((tracking[promised], "m"), (turned[promised], "rad")):
        worst = int(np.argmax(error))
        if error[worst] > solution.tracking_tolerance:
            return Status.UNCONFIRMED, (
                f"the end effector is {error[worst]:.2e} {unit} off its path at "
                f"t = {solution.trajectory.time[worst]:.2f} s; "
                f"{solution.method} promises {solution.tracking_tolerance:.0e} {unit}"
            )
    for kind in solution.limits_kept:
        if excess.get(kind, 0.0) > LIMITS:
            whose = {"clearance": clear.obstacles, "self_clearance": clear.own}.get(kind)
            where = "" if whose is None else f" ({said(whose)})"
            return Status.UNCONFIRMED, f"a {kind} limit is exceeded by {100 * excess[kind]:.2g} %{where}"
    notes = [solution.message] if solution.message else []
    if clear.own.bound < 0 and "self_clearance" not in solution.limits_kept:
        notes.append(f"the arm collides with itself ({said(clear.own)})")
    return solution.status, "; ".join(notes)


def _judge_between(
    problem: Problem, off: OffPath, tracking: Array, turned: Array, solution: Solution, message: str
) -> tuple[Status, str]:
    """The curve that is exported: between the knots it may be off by the tolerances of the path more than at them,
    where the method's own promise holds; and what there is to say of a cycle that winds.
    """
    notes = [message] if message else []
    reference, arm = problem.reference, problem.task.arm
    for which, (error, own, allowed, unit, key) in enumerate(
        (
            (off.distance, tracking, reference.tolerance, "m", "tolerance"),
            (off.angle, turned, reference.orientation_tolerance, "rad", "orientation_tolerance"),
        )
    ):
        where = (
            f"between its knots the motion is up to {error:.2g} {unit} off its path (at t = {off.when[which]:.3g} s)"
        )
        if not reference.exact:
            if error > allowed * (1 + LIMITS):
                said = f"up to {error:.3g} {unit} off its path (at t = {off.when[which]:.3g} s)"
                said = f"{said}, outside the tube of path.{key} = {allowed:g} {unit}"
                return Status.UNCONFIRMED, "; ".join([said, *notes])
            continue
        if solution.knots_only and error > own.max() + max(allowed, strays(problem)[which]):
            return Status.UNCONFIRMED, "; ".join([f"{where}: too few knots to show it ({solution.grid})", *notes])
        if error > own.max() + allowed and not solution.knots_only:
            said = f"{where}, more than path.{key} = {allowed:g} {unit}; {_advice(problem, solution, error, which)}"
            return Status.UNCONFIRMED, "; ".join([said, *notes])
        if error > allowed:
            promise = (
                "which promises its knots alone" if solution.knots_only else "within what it promises at its knots"
            )
            notes.append(f"up to {error:.2g} {unit} off its path, {promise}")
    turns = (
        turns_of_cycle(problem, solution.trajectory.q[:, arm.joints]) if problem.boundary is Boundary.CYCLIC else None
    )
    if turns is not None and np.any(turns):
        names = arm.description.joints[arm.base.count :]
        wound = [f"{name} {turn / (2 * np.pi):+.0f}" for name, turn in zip(names, turns, strict=True) if turn]
        notes.append(f"the cycle closes up to full turns: {', '.join(wound)}")
    return Status.SOLVED, "; ".join(notes)


def _advice(problem: Problem, solution: Solution, error: float, which: int) -> str:
    """Which knots would do, by the key that they come from: a number of intervals, or a step [s]."""
    needed = steps_needed(problem, solution.trajectory.time, error, which)
    if needed is None:
        return "no finer grid helps: the motion does not follow the path between its knots"
    counts = solution.grid == "timing.steps"
    return f"{solution.grid} = {needed if counts else f'{problem.reference.duration / needed:.2g}'} would do"
