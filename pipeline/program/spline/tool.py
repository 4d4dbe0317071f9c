"""Limits of the tool's speed and acceleration along its path: of an exact path they are limits of the law s(t),

    |xd| = sd,    |xdd|^2 = kappa(s)^2 sd^4 + sdd^2,

kappa the path's curvature. Under a law that is kept they bound how much a motion must be stretched.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.program.differentiable import DifferentiableConstraint
from pipeline.program.program import Block, blocks
from pipeline.program.spline.program import Law, Spline
from pipeline.program.spline.rows import MOST, pairs, within

STEP = 1e-6  # of the length, over which the curvature's change is taken
FINE = 20  # samples an interval


def limits(program: Spline) -> None:
    """Of the law's unknowns, the speed's between the knots too; or of the stretch where the law is kept."""
    bounds, law = program.limits, program.law
    if not bounds.limits_tool:
        return
    if law is None:
        if program.stretch is not None:
            program.drake.AddBoundingBoxConstraint(least_stretch(program), MOST, program.stretch[:1])
        return
    if np.isfinite(bounds.tool_speed):
        most, h = bounds.tool_speed * program.tightened.tool_speed, program.dt
        within(program, [(sp.eye_array(len(most)), law.sd)], -most, most, program.unit(law.sd), 1)
        between = [(pairs(1.0, 0.0, h), law.sd), (pairs(h / 2, 0.0, h), law.sdd)]
        least = np.minimum(most[1:], most[:-1])
        within(program, between, -least, least, program.unit(law.sd), 1)
    if np.isfinite(bounds.tool_acceleration):
        for knots in blocks(0, program.intervals + 1):
            _acceleration(program, law, knots)


def least_stretch(program: Spline) -> float:
    """By how much the time must be stretched at least, the law kept."""
    speed, acceleration = paces(program.problem, program.times)
    tightened = program.tightened
    return max(
        speed / (program.limits.tool_speed * float(tightened.tool_speed.min())),
        float(np.sqrt(acceleration / (program.limits.tool_acceleration * float(tightened.tool_acceleration.min())))),
        1e-9,
    )


def paces(problem: Problem, times: Array) -> tuple[float, float]:
    """The largest speed [m/s] and acceleration [m/s^2] of the tool on its path."""
    fine = np.interp(np.arange(FINE * (len(times) - 1) + 1) / FINE, np.arange(len(times)), times)
    return problem.reference.paces(fine)


def _acceleration(program: Spline, law: Law, knots: Block) -> None:
    """(kappa^2 sd^4 + sdd^2) / (A^2 r^4) <= 1."""
    geometry, count, own = program.problem.reference.geometry, len(knots), np.arange(len(knots))
    most = program.limits.tool_acceleration * program.tightened.tool_acceleration[knots, 0]
    stretch, step = program.stretch, STEP * geometry.length

    def squared(s: Array) -> Array:
        return np.asarray((geometry.sample(np.clip(s, 0.0, geometry.length))[2] ** 2).sum(axis=1))

    def rows(x: Array) -> tuple[Array, Array]:
        s, sd, sdd = (x[i * count : (i + 1) * count] / unit for i, unit in enumerate(law.units))
        r = 1.0 if stretch is None else x[-1]
        here, scale = squared(s), 1 / (most**2 * r**4)
        change = (squared(s + step) - squared(s - step)) / (2 * step)
        value = (here * sd**4 + sdd**2) * scale
        jacobian = np.zeros((count, len(x)))
        for i, by in enumerate((change * sd**4, 4 * here * sd**3, 2 * sdd)):
            jacobian[own, i * count + own] = by * scale / law.units[i]
        if stretch is not None:
            jacobian[:, -1] = -4 * value / r
        return value, jacobian

    unknowns = np.concatenate([part[knots].ravel() for part in (law.s, law.sd, law.sdd)])
    pattern = [(k, i * count + k) for i in range(3) for k in range(count)]
    if stretch is not None:
        unknowns = np.append(unknowns, stretch[0])
        pattern += [(k, 3 * count) for k in range(count)]
    constraint = DifferentiableConstraint(rows)
    binding = program.drake.AddConstraint(constraint, lb=np.full(count, -np.inf), ub=np.ones(count), vars=unknowns)
    binding.evaluator().SetGradientSparsityPattern(pattern)
