"""PMKE's Table 1, read in every way that its open steps allow: which of them give the printed numbers.

Written out of the paper alone, with SciPy's SLSQP for fmincon's SQP; `pipeline/methods/pmke` is not used.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import minimize

from tests.readings.planar import (
    Q_INIT,
    STEP,
    TRAJECTORIES,
    Motion,
    Values,
    inertia,
    jacobian,
    kinetic_energy,
    least_velocities,
    tip,
)

DT, SPACING, UPDATE, HORIZON = 0.01, 1.0, 0.5, 2  # Table 2
KNOTS = {"quartic": (0.75, 1.25), "quartic, at midpoints": (0.5, 1.5), "quartic, double": (1.0, 1.0)}  # [s] inside


@dataclass(frozen=True)
class Reading:
    """One way to read the open steps. The first values are the project's."""

    spline: str = "quartic"  # step 6; KNOTS, quintic or cubic
    acceleration: str = "of the arm"  # step 6, at the start: of its last two steps, of the spline before, or zero
    guess: str = "both"  # step 4: roll-out, previous prediction, both, or the arm at rest
    energy: str = "end"  # eq. (4), M of an interval: at its end, begin, or the mean of both
    velocity: str = "end"  # eq. (2), xd of a step: at its end, begin, or what leads back to the path
    last: str = "T - T_p"  # step 9, the last prediction: at T - T_p, or an interval I before it

    @property
    def name(self) -> str:
        """What differs from the first reading."""
        values = ((f.name, str(getattr(self, f.name)), f.default) for f in fields(self))
        other = [value if name == "spline" else f"{name}: {value}" for name, value, usual in values if value != usual]
        return "; ".join(other) or "the project's"


VALUES = {
    "spline": (*KNOTS, "quintic", "cubic"),
    "acceleration": ("of the arm", "of the spline before", "zero"),
    "guess": ("both", "roll-out", "previous prediction", "at rest"),
    "energy": ("end", "begin", "mean"),
    "velocity": ("end", "begin", "to the path"),
    "last": ("T - T_p", "T - T_p - I"),
}


def readings() -> Iterator[Reading]:
    """The first, all that differ from it in one step, then all others; guesses alone, as they change nothing."""
    first = Reading()
    single = [replace(first, **{name: value}) for name, values in VALUES.items() for value in values[1:]]
    every = {**VALUES, "guess": ("both",)}
    product_ = (Reading(**dict(zip(every, values, strict=True))) for values in product(*every.values()))
    yield from dict.fromkeys((first, *single, *product_))


@dataclass(frozen=True)
class Followed:
    """A motion (N + 1, 3) at t (N + 1,) and its velocities."""

    t: Values
    q: Values
    qd: Values

    @property
    def energy(self) -> float:
        """[J s] of all steps."""
        return float(DT * kinetic_energy(self.q[1:], self.qd[1:]).sum())

    def value(self, quantity: str) -> float:
        """The energy, the peak velocity of a joint [rad/s], the least spectral radius of M [kg m^2], or its time."""
        if quantity == "energy":
            return self.energy
        if quantity.startswith("joint"):
            return float(np.abs(self.qd[:, int(quantity[-1]) - 1]).max())
        radius = np.linalg.eigvalsh(inertia(self.q))[:, -1]
        return float(radius.min() if quantity == "radius" else self.t[radius.argmin()])


# Trajectory, quantity, as printed: what the open steps bear on. The exponent of trajectory 1 is read as -4.
PRINTED: tuple[tuple[int, str, str], ...] = (
    (1, "energy", "5.98e-4"),
    (1, "joint 1", "0.017"),
    (1, "joint 3", "0.203"),
    (2, "energy", "4.08e-3"),
    (2, "joint 1", "0.095"),
    (2, "joint 3", "0.613"),
    (3, "energy", "7.57e-3"),
    (3, "joint 1", "0.250"),
    (3, "joint 2", "0.261"),
    (4, "energy", "3.97e-2"),
    (4, "joint 1", "0.780"),
    (4, "radius", "0.0556"),
    (4, "its time", "6.33"),
)


def numbers(reading: Reading) -> list[float]:
    """What it gives for each of PRINTED."""
    runs = {number: follow(motion, reading) for number, motion in TRAJECTORIES.items()}
    return [runs[number].value(quantity) for number, quantity, _ in PRINTED]


def follow(motion: Motion, reading: Reading) -> Followed:
    """Steps 1 to 10."""
    t = np.arange(round(motion.duration / DT) + 1) * DT
    x, xd, _ = motion.at(t)
    q, qd = np.empty((len(t), 3)), np.zeros((len(t), 3))
    q[0] = Q_INIT
    previous: tuple[Values, Values] | None = None
    spline: BSpline | None = None
    window = HORIZON * SPACING
    for i in range(1, len(t)):
        now = t[i - 1]
        room = UPDATE if reading.last == "T - T_p - I" else 0.0
        if (i - 1) % round(UPDATE / DT) == 0 and now + window + room <= motion.duration + 1e-9:
            times = now + SPACING * np.arange(HORIZON + 1)
            points = np.vstack([q[i - 1], predict(motion, reading, times, q[i - 1], previous)])
            acceleration = np.zeros(3)
            if reading.acceleration == "of the arm" and i > 1:
                acceleration = (qd[i - 1] - qd[i - 2]) / DT
            if reading.acceleration == "of the spline before" and spline is not None:
                acceleration = spline(now, 2)
            spline, previous = interpolate(reading.spline, times, points, qd[i - 1], acceleration), (times, points)
        inverse, j = least_velocities(q[i - 1]), jacobian(q[i - 1])
        assert spline is not None
        toward = (spline(min(t[i], spline.t[-1])) - q[i - 1]) / DT
        wanted = {"end": xd[i], "begin": xd[i - 1], "to the path": (x[i] - tip(q[i - 1])) / DT}[reading.velocity]
        qd[i] = toward + inverse @ (wanted - j @ toward)
        q[i] = q[i - 1] + DT * qd[i]
    return Followed(t, q, qd)


def interpolate(how: str, times: Values, points: Values, qd: Values, qdd: Values) -> BSpline:
    """Step 6."""
    rest = np.zeros(3)
    if how == "cubic":
        return make_interp_spline(times, points, k=3, bc_type=([(1, qd)], [(1, rest)]))
    ends: Any = ([(1, qd), (2, qdd)], [(1, rest), (2, rest)])
    if how == "quintic":
        return make_interp_spline(times, points, k=5, bc_type=ends)
    knots = np.concatenate([[times[0]] * 5, times[0] + np.array(KNOTS[how]), [times[-1]] * 5])
    return make_interp_spline(times, points, k=4, t=knots, bc_type=ends)


def predict(
    motion: Motion, reading: Reading, times: Values, q: Values, previous: tuple[Values, Values] | None
) -> Values:
    """Steps 4 and 5: the knots (h, 3) after q."""
    x = motion.at(times[1:])[0]
    guesses = []
    if reading.guess in ("both", "roll-out") or (reading.guess == "previous prediction" and previous is None):
        guesses.append(roll_out(q, x))
    if previous is not None and reading.guess in ("both", "previous prediction"):
        guesses.append(np.stack([np.interp(times[1:], previous[0], joint) for joint in previous[1].T], axis=-1))
    if reading.guess == "at rest":
        guesses.append(np.tile(q, (HORIZON, 1)))
    found = [optimise(reading.energy, q, x, guess) for guess in guesses]
    return min(found, key=lambda one: one[0])[1]


def roll_out(q: Values, x: Values) -> Values:
    """The inertia-weighted pseudoinverse through the points x (h, 2)."""
    out = []
    for point in x:
        for _ in range(50):
            q = q + least_velocities(q, inertia(q)) @ (point - tip(q))
        out.append(q)
    return np.array(out)


def optimise(rule: str, q: Values, x: Values, guess: Values) -> tuple[float, Values]:
    """Expression (4) from one guess: its value relative to the guess's, nan if not feasible, and the knots."""
    share = {"end": (0.0, 1.0), "begin": (1.0, 0.0), "mean": (0.5, 0.5)}[rule]

    def cost(u: Values) -> Values:
        knots = np.concatenate([np.broadcast_to(q, (*u.shape[:-1], 1, 3)), u.reshape(*u.shape[:-1], HORIZON, 3)], -2)
        step = np.diff(knots, axis=-2) / SPACING
        ends = (knots[..., :-1, :], knots[..., 1:, :])
        return SPACING * sum(w * kinetic_energy(end, step).sum(-1) for w, end in zip(share, ends, strict=True) if w)

    turn = 1j * STEP * np.eye(HORIZON * 3)
    path = {
        "type": "eq",
        "fun": lambda u: (tip(u.reshape(HORIZON, 3)) - x).ravel(),
        "jac": lambda u: (tip((u + turn).reshape(-1, HORIZON, 3)).imag / STEP).reshape(len(turn), -1).T,
    }
    scale = float(cost(guess.ravel())) or 1e-6
    found = minimize(
        lambda u: cost(u) / scale,
        guess.ravel(),
        jac=lambda u: cost(u + turn).imag / STEP / scale,
        constraints=[path],
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 200},
    )
    off = np.abs(path["fun"](found.x)).max()  # type: ignore[operator]
    return (float(cost(found.x)) if off < 1e-6 else np.inf), found.x.reshape(HORIZON, 3)
