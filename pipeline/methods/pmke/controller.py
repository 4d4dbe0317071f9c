"""PMKE in a loop that is not ours: at every tick what the arm is to do until the next one.

The reference is a motion of its own: on the path (every step is put back onto it), its null space led by the
predictions, as `predictive.py` integrates it. What is measured enters the torque alone,

    tau = M(q) (qdd_ref + 2 zeta w (qd_ref - qd) + w^2 (q_ref - q)) + n(q, qd) - g(q)   (Siciliano et al. 2009, 8.5.2),

until the arm is farther than `stray` from its reference, by a push, say: the motion then begins anew from where it is.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import PmkeOptions
from pipeline.methods.pmke.predictive import ON_PATH, pmke, velocity
from pipeline.methods.pmke.predictor import Predictor
from pipeline.model.kinematics import project
from pipeline.problem.problem import Boundary, Problem

MOST_STEPS = 50  # periods that one tick catches up with after a stall


@dataclass(frozen=True)
class Command:
    """Reference q, qd, qdd (n,) [rad, rad/s, rad/s^2] at the next tick, and the torque tau (n,) [N m] until then.

    horizon (h + 1, 1 + n): times [s] and joints [rad] of the last prediction, empty before the first. wall_time [s]: of
    this call. status: `follows`, `predicts`, and where something is wrong `late: ..`, `no prediction: ..`,
    `begins anew: ..` or `held: ..`, each with its reason.
    """

    q: Array
    qd: Array
    qdd: Array
    tau: Array
    horizon: Array
    wall_time: float
    status: str


class Controller:
    """One motion along the problem's path, from problem.q_init at time 0, in ticks of `period` [s].

    bandwidth w [rad/s] and damping zeta of the torque; stray [rad]: see above. effort (n,) [N m]: where torques are cut
    off, by default the arm's own limits or the problem's smaller ones. Raises InputError for what it cannot serve, here
    and never in the loop.
    """

    def __init__(
        self,
        problem: Problem,
        options: PmkeOptions = PmkeOptions(),
        *,
        period: float = 0.01,
        bandwidth: float = 25.0,
        damping: float = 1.0,
        stray: float = 0.1,
        effort: Array | None = None,
    ) -> None:
        if not period > 0:
            raise InputError(f"pmke.Controller: period = {period:g} s; it must be positive")
        options = replace(options, dt=period, confirm="none", project=True, gain=0.0)
        problem = replace(problem, boundary=Boundary.FIXED)
        why = pmke.why_not(problem, options)
        self.predictor = Predictor(problem, options, alone=True)
        why = why or (self.predictor.why_not and f"pmke.Controller does not serve {self.predictor.why_not}")
        if why:
            raise InputError(why)
        self.problem, self.task, self.arm, self.options = problem, problem.task, problem.task.arm, options
        self.period, self.stray = period, stray
        self.gains = bandwidth**2, 2 * damping * bandwidth
        own = np.minimum(self.arm.description.effort, problem.bounds.torque)
        self.effort = own if effort is None else np.asarray(effort, dtype=float)
        n = self.arm.n
        self.time = 0.0
        self.q: Array = problem.q_init.copy()
        self.qd: Array = np.zeros(n)
        self.qdd: Array = np.zeros(n)
        self.prediction: BSpline | None = None
        self.due = 0.0  # [s] when the next prediction is
        self.standing = self.hold(self.q)  # of the last tick that was in order
        self.last = Command(self.q, self.qd, self.qdd, self.standing, np.empty((0, 1 + n)), 0.0, "follows")

    def update(self, time: float, q: Array, qd: Array) -> Command:
        """What to do from `time` [s] on, where the arm is at q, qd (n,). Never raises."""
        begin = clock.perf_counter()
        try:
            command = self._update(float(time), np.asarray(q, dtype=float), np.asarray(qd, dtype=float))
        except Exception as error:  # whatever it is: a loop must go on
            still = np.zeros_like(self.q)
            command = replace(self.last, qd=still, qdd=still, tau=self.standing, status=f"held: {error}")
        self.last = replace(command, wall_time=clock.perf_counter() - begin)
        return self.last

    def hold(self, q: Array) -> Array:
        """The torque (n,) [N m] that holds the arm still at q (n,)."""
        still = np.zeros((1, self.arm.n))
        return np.clip(self.arm.inverse_dynamics(q[None], still, still)[0], -self.effort, self.effort)

    def _update(self, time: float, q: Array, qd: Array) -> Command:
        if not (np.isfinite(time) and q.shape == qd.shape == self.q.shape and np.isfinite([q, qd]).all()):
            raise ValueError("what is measured is not finite or of another shape")
        status = "follows"
        away = float(np.abs(q - self.q).max())
        if away > self.stray:
            status = f"begins anew: {away:.2g} {self.arm.description.unit()} from the reference"
            self._begin_anew(time, q)
        missed = round((time + self.period - self.time) / self.period) - 1
        if missed > 0:
            status = f"late: {missed} ticks were missed"
        for _ in range(min(missed, MOST_STEPS) + 1):
            status = self._step(status)
        if away > self.stray:
            self.qdd = np.zeros_like(self.q)  # a reference that jumps has no acceleration
        self.time = max(self.time, time + self.period)
        tau, self.standing = self._torque(q, qd), self.hold(q)
        return Command(self.q, self.qd, self.qdd, tau, self._horizon(), 0.0, status)

    def _begin_anew(self, time: float, q: Array) -> None:
        """The reference goes on from where the arm is, moved onto the path, and at rest: the damping brakes the arm."""
        self.q = self._onto_path(q, min(time, self.problem.reference.duration))
        self.qd, self.qdd, self.time = np.zeros_like(q), np.zeros_like(q), time
        self.predictor.previous, self.due = None, time

    def _step(self, status: str) -> str:
        """The reference of the next tick: steps 4 to 7 of Table 1."""
        reference, now, dt = self.problem.reference, self.time, self.period
        duration = reference.duration
        if now >= self.due - 1e-9 and (self.prediction is None or now + self.predictor.span <= duration + 1e-9):
            self.due = now + self.options.update_interval
            found = self.predictor(now, self.q, self.qd, self.qdd)
            self.predictor.log.clear()
            if found is not None:
                self.prediction, status = found, "predicts" if status == "follows" else status
            else:
                status = "no prediction: Newton's method found none; the last one is followed"
        ahead = min(now + dt, duration)
        x_ref, xd_ref, _ = reference.sample(np.array([min(now, duration), ahead]))
        error, jacobian = self.task.error_and_jacobian(self.q[None], x_ref[:1])
        toward = np.zeros_like(self.q)
        if self.prediction is not None and now < duration:
            toward = (self.prediction(min(ahead, self.prediction.t[-1])) - self.q) / dt
        rate = xd_ref[1] if now < duration else 0 * xd_ref[1]
        step = velocity(self.task, self.q, error[0], jacobian[0], rate, toward, 0.0)
        q = self._onto_path(self.q + dt * step, ahead)
        qd = (q - self.q) / dt
        self.q, self.qdd, self.qd, self.time = q, (qd - self.qd) / dt, qd, now + dt
        return status

    def _onto_path(self, q: Array, time: float) -> Array:
        target = self.problem.reference.position(np.array([time]))
        return project(self.task, q[None], target, tolerance=ON_PATH)[0][0]

    def _torque(self, q: Array, qd: Array) -> Array:
        """Until the next tick; the reference of this tick is one step behind the one of the next."""
        stiffness, damping = self.gains
        before = self.q - self.period * self.qd
        wanted = self.qdd + damping * (self.qd - qd) + stiffness * (before - q)
        tau = self.arm.inverse_dynamics(q[None], qd[None], wanted[None])[0]
        return np.clip(tau, -self.effort, self.effort)

    def _horizon(self) -> Array:
        if self.predictor.previous is None:
            return self.last.horizon
        then, points = self.predictor.previous
        return np.column_stack([then + self.predictor.times, points])
