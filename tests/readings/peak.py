"""The Global paper's largest joint velocities in simulation 1, 1.553, 3.053 and 4.042 rad/s: from which differences.

The optimum is solved for by CasADi and IPOPT with M at either end of an interval or at both, on the printed grid.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from tests.benchmarks.peer import QUIET, PlanarArm
from tests.readings.planar import CENTRES, INERTIAS, LENGTHS, MASSES, SIMULATION, Values

PRINTED = (1.553, 3.053, 4.042)  # [rad/s]
SHARES = {"M at the end": (0.0, 1.0), "M at the begin": (1.0, 0.0), "M at both": (0.5, 0.5)}
RULES = ("backward", "central", "one-sided of second order", "cubic spline")


def optimum(share: tuple[float, float], guess: Values) -> Values:
    """The kinetic-energy optimum (N + 1, 3) near `guess`, free start, unlimited."""
    arm = PlanarArm(LENGTHS, CENTRES, MASSES, INERTIAS)
    steps = len(guess) - 1
    dt, x = SIMULATION.duration / steps, SIMULATION.at(np.linspace(0.0, SIMULATION.duration, steps + 1))[0]
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 3)
    speed = (b - a) / dt
    energy = dt * (share[0] * arm.kinetic_energy(a, speed) + share[1] * arm.kinetic_energy(b, speed))
    interval, tip = ca.Function("e", [a, b], [energy]), ca.Function("x", [a], [arm.end_effector(a)])
    q = ca.MX.sym("q", 3, steps + 1)
    cost = ca.sum2(interval.map(steps)(q[:, :-1], q[:, 1:]))
    rows = ca.vec(tip.map(steps + 1)(q) - x.T)
    solver = ca.nlpsol("s", "ipopt", {"x": ca.vec(q), "f": cost, "g": rows}, {**QUIET, "ipopt.tol": 1e-10})
    found = solver(x0=guess.ravel(), lbg=0.0, ubg=0.0)
    if not solver.stats()["success"]:
        raise RuntimeError(solver.stats()["return_status"])
    return np.array(found["x"]).reshape(steps + 1, 3)


def peaks(q: Values, rule: str) -> Values:
    """(3,) [rad/s] by one rule of differences."""
    t = np.linspace(0.0, SIMULATION.duration, len(q))
    dt = t[1]
    if rule == "backward":
        qd = np.diff(q, axis=0) / dt
    elif rule == "central":
        qd = (q[2:] - q[:-2]) / (2 * dt)
    elif rule == "one-sided of second order":
        qd = (3 * q[2:] - 4 * q[1:-1] + q[:-2]) / (2 * dt)
    else:
        qd = CubicSpline(t, q)(np.linspace(0.0, t[-1], 2001), 1)
    return np.asarray(np.abs(qd).max(axis=0))


def readings(guess: Values) -> Iterator[tuple[str, str, Values]]:
    """Where M stands, the rule of the velocities, and the peaks (3,)."""
    for place, share in SHARES.items():
        q = optimum(share, guess)
        yield from ((place, rule, peaks(q, rule)) for rule in RULES)
