"""The unknowns of a spline program as a motion: positions, velocities and accelerations at the knots of a C2 spline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.problem.costs import Costs, squares
from pipeline.problem.integrals import INTEGRALS
from pipeline.problem.lagrangian import Lagrangian, trapezoid_weights
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns

EVEN = 1e-9  # of the motion time: intervals that differ by less are of one length


@dataclass(frozen=True)
class Curve:
    """A C2 cubic spline by its knots: times (N + 1,) [s], q [rad], v [rad/s], a [rad/s^2], each (N + 1, n)."""

    times: Array
    q: Array
    v: Array
    a: Array

    @classmethod
    def through(cls, problem: Problem, times: Array, q: Array, ends: Array | None = None) -> Curve:
        """The one through the knots q (N + 1, n): with the velocities `ends` (2, n), or the boundary's."""
        spline = spline_through(problem, times, q, ends)
        return cls(times, q, spline(times, 1), spline(times, 2))

    @property
    def ends(self) -> Array:
        """The velocities (2, n) at both ends, which with the knots say everything."""
        return self.v[[0, -1]]

    def __call__(self, moments: Array, order: int = 0) -> Array:
        """q (K, n) at `moments` (K,), or a derivative of it."""
        ends = ((1, self.v[0]), (1, self.v[-1]))
        return np.asarray(CubicSpline(self.times, self.q, bc_type=ends)(moments, order))

    def stretched(self, by: float) -> Curve:
        """The same motion in `by` times its time."""
        return Curve(self.times * by, self.q, self.v / by, self.a / by**2)


def spline_through(problem: Problem, times: Array, q: Array, ends: Array | None) -> CubicSpline:
    """See `Curve.through`."""
    if ends is not None:
        return CubicSpline(times, q, bc_type=((1, ends[0]), (1, ends[1])))
    if problem.boundary is Boundary.CYCLIC and not any(problem.rest):
        rate = full_turns(problem, q[0], q[-1]) / (times[-1] - times[0])
        closed = q - rate * (times - times[0])[:, None]
        closed[-1] = closed[0]
        slopes = CubicSpline(times, closed, bc_type="periodic")(times[[0, -1]], 1) + rate
        return CubicSpline(times, q, bc_type=((1, slopes[0]), (1, slopes[0])))
    still = (1, np.zeros(q.shape[1]))
    return CubicSpline(times, q, bc_type=tuple(still if rests else "not-a-knot" for rests in problem.rest))


def stations(problem: Problem, curve: Curve) -> tuple[Array, Array, Array]:
    """Where the energy of a spline is summed up: q, qd (S, n) and the weights (S,) [s].

    The midpoint rule where it does: half the stations. A free end needs Simpson's rule: the midpoint rule does not see
    motions that alternate from knot to knot and fade from an end by -3 + 2 sqrt 2 each. So do uneven knots: its errors
    cancel from interval to interval on even ones alone.
    """
    middle = (curve.times[1:] + curve.times[:-1]) / 2
    q, qd, dt = curve(middle), curve(middle, 1), np.diff(curve.times)
    if by_simpson(problem, curve.times):
        weights = np.concatenate([trapezoid_weights(curve.times) / 3, dt * 2 / 3])
        return np.vstack([curve.q, q]), np.vstack([curve.v, qd]), weights
    return q, qd, dt


def by_simpson(problem: Problem, times: Array) -> bool:
    """Whether there is an end at which the velocity is not given, or the knots are uneven."""
    free_ends = problem.boundary is not Boundary.CYCLIC and not all(problem.rest)
    return free_ends or float(np.ptp(np.diff(times))) > EVEN * float(times[-1] - times[0])


def integrals(problem: Problem, curve: Curve) -> Costs:
    """All integrals of a spline as its program sums them up: forces by the trapezoidal rule over the knots."""
    task, arm = problem.task, problem.task.arm
    q, qd, weights = stations(problem, curve)
    tau, own = arm.inverse_dynamics(curve.q, curve.v, curve.a), trapezoid_weights(curve.times)
    values = {}
    for name, integral in INTEGRALS.items():
        only = {name: 1.0}
        rate = squares(arm, tau, only) if integral.order == 2 else Lagrangian(task, Objective(only)).quadratic(q, qd)
        values[name] = float(rate @ (own if integral.order == 2 else weights))
    gain = float(Lagrangian(task, problem.objective).gain_integrals(curve.times, curve.q[None])[0])
    return Costs(values, gain, tau)


def objective(problem: Problem, curve: Curve) -> float:
    """The problem's objective of a spline."""
    found = integrals(problem, curve)
    weighed = sum(weight * found.integrals[name] for name, weight in problem.objective.weights.items())
    return weighed - found.gain
