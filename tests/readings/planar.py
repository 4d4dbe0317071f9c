"""The documents' planar arm, lines, circle and law of motion in closed form: nothing of `pipeline` is in it.

Arrays end in the three joints; values may be complex, for derivatives by the complex step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Values = np.ndarray[Any, np.dtype[Any]]
LENGTHS = np.array([0.176, 0.176, 0.1375])
CENTRES = np.array([0.0950, 0.0717, 0.0526])
INERTIAS = np.array([0.001811, 0.003173, 0.002103])
MASSES = np.array([0.615, 0.8156, 0.5055])  # identified, see docs/errata.md
Q_INIT = np.array([0.0, 0.327, -0.754])
_CHAIN = np.tril(np.ones((3, 3)))  # the angle of a link is the sum of the joints up to it
_REACH = np.tril(np.tile(LENGTHS, (3, 1)), -1) + np.diag(CENTRES)  # of each link's centre along each link
STEP = 1e-30


def tip(q: Values) -> Values:
    """(.., 2) [m]."""
    angles = q @ _CHAIN.T
    return np.stack([np.cos(angles) @ LENGTHS, np.sin(angles) @ LENGTHS], axis=-1)


def jacobian(q: Values) -> Values:
    """(.., 2, 3) [m/rad]."""
    angles = q @ _CHAIN.T
    return np.stack([-np.sin(angles) * LENGTHS, np.cos(angles) * LENGTHS], axis=-2) @ _CHAIN


def inertia(q: Values) -> Values:
    """M (.., 3, 3) [kg m^2]."""
    angles = q @ _CHAIN.T
    cosines = np.cos(angles[..., :, None] - angles[..., None, :])
    links = cosines * np.einsum("k,ki,kj->ij", MASSES, _REACH, _REACH) + np.diag(INERTIAS)
    return np.asarray(_CHAIN.T @ links @ _CHAIN)


def kinetic_energy(q: Values, qd: Values) -> Values:
    """(..) [J]."""
    return np.asarray(0.5 * np.einsum("...i,...ij,...j->...", qd, inertia(q), qd))


def bias(q: Values, qd: Values) -> Values:
    """n (.., 3) [N m]: Mdot qd - dT/dq, by the complex step."""
    turned = q[..., None, :] + 1j * STEP * np.eye(3)
    by_q = kinetic_energy(turned, np.broadcast_to(qd[..., None, :], turned.shape)).imag / STEP
    rate = inertia(q + 1j * STEP * qd).imag / STEP
    return np.asarray((rate @ qd[..., None])[..., 0] - by_q)


def least_velocities(q: Values, weight: Values | None = None) -> Values:
    """The right pseudoinverse J+ (.., 3, 2), weighted by `weight` (.., 3, 3) where it is given."""
    j = jacobian(q)
    turned = np.swapaxes(j, -1, -2)
    right = turned if weight is None else np.linalg.solve(weight, turned)
    return np.asarray(right @ np.linalg.inv(j @ right))


def law(t: Values, length: float, duration: float) -> tuple[Values, Values, Values]:
    """s, sd, sdd of the documents' law: the acceleration 4 L / T^2 (1 - cos 4 pi t / T), mirrored after T/2."""
    half = np.minimum(t, duration - t)
    late = t > duration / 2
    w = 4 * np.pi / duration
    s = 4 * length / duration**2 * (half**2 / 2 + (np.cos(w * half) - 1) / w**2)
    sd = 4 * length / duration**2 * (half - np.sin(w * half) / w)
    sdd = 4 * length / duration**2 * (1 - np.cos(w * half))
    return np.where(late, length - s, s), sd, np.where(late, -sdd, sdd)


@dataclass(frozen=True)
class Motion:
    """What the end effector does: `at` gives position, velocity and acceleration (.., 2) at times [s]."""

    duration: float
    at: Callable[[Values], tuple[Values, Values, Values]]


def line(length: float, degrees: float, duration: float) -> Motion:
    """From the end effector at Q_INIT."""
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])

    def at(t: Values) -> tuple[Values, Values, Values]:
        s, sd, sdd = (value[..., None] * along for value in law(t, length, duration))
        return tip(Q_INIT) + s, sd, sdd

    return Motion(duration, at)


def circle(radius: float, duration: float) -> Motion:
    """Once round, counter-clockwise, its centre to the left of the end effector at Q_INIT."""
    centre = tip(Q_INIT) - [radius, 0.0]

    def at(t: Values) -> tuple[Values, Values, Values]:
        a, ad, add = (value[..., None] / radius for value in law(t, 2 * np.pi * radius, duration))
        out, along = np.concatenate([np.cos(a), np.sin(a)], -1), np.concatenate([-np.sin(a), np.cos(a)], -1)
        return centre + radius * out, radius * ad * along, radius * (add * along - ad**2 * out)

    return Motion(duration, at)


TRAJECTORIES = {
    1: line(0.10, 157.5, 10.0),
    2: circle(0.05, 10.0),
    3: line(0.40, 157.5, 10.0),
    4: line(0.70, 202.5, 10.0),
}  # of the PMKE paper
SIMULATION = line(0.40, 157.5, 1.0)  # 1 to 4 of the Global paper
