"""The Global paper's Table 4, Nedungadi's column: which integrator, sign and step give its six numbers.

Eq. (20) is integrated from the planner's configurations, at rest, as the paper says; the planner's motions are the
only thing taken from `pipeline`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from tests.readings.planar import SIMULATION, Values, bias, inertia, jacobian, kinetic_energy, least_velocities

STEP = 1e-30
PRINTED = {"energies": (0.0532, 0.0567, 0.0673), "differences": (8.5e-3, 2.2e-2, 3.8e-3)}
SIGNS = {"- M^-1 n": (-1, True), "+ M^-1 n": (1, True), "- M n": (-1, False), "+ M n, as printed": (1, False)}
STEPS = (0.01, 0.005, 0.001)  # [s]
Rate = Callable[[float, Values, Values], Values]  # qdd of t, q (.., 3), qd (.., 3)


def rate(sign: int, inverse: bool) -> Rate:
    """Eq. (20), its second term with the sign and with or without the inverse of M."""

    def qdd(t: float, q: Values, qd: Values) -> Values:
        m, j = inertia(q), jacobian(q)
        weighted = least_velocities(q, m)
        turning = (jacobian(q + 1j * STEP * qd).imag / STEP @ qd[..., None])[..., 0]
        forced = (np.linalg.inv(m) if inverse else m) @ bias(q, qd)[..., None]
        free = sign * (forced - weighted @ (j @ forced))
        return np.asarray((weighted @ (SIMULATION.at(np.array(t))[2] - turning)[..., None] + free)[..., 0])

    return qdd


def euler(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    return q + h * v, v + h * f(t, q, v)


def euler_new_velocity(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    after = v + h * f(t, q, v)
    return q + h * after, after


def euler_taylor(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    a = f(t, q, v)
    return q + h * v + h**2 / 2 * a, v + h * a


def euler_at_the_end(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    after = v + h * f(t + h, q, v)
    return q + h * after, after


def backward_euler(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    p, w = q, v
    for _i in range(12):
        w = v + h * f(t + h, p, w)
        p = q + h * w
    return p, w


def trapezoid(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    a, p, w = f(t, q, v), q, v
    for _i in range(12):
        w = v + h / 2 * (a + f(t + h, p, w))
        p = q + h / 2 * (v + w)
    return p, w


def midpoint(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    w = v + h / 2 * f(t, q, v)
    return q + h * w, v + h * f(t + h / 2, q + h / 2 * v, w)


def heun(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    a = f(t, q, v)
    b = f(t + h, q + h * v, v + h * a)
    return q + h * v + h**2 / 2 * a, v + h / 2 * (a + b)


def adams_bashforth(f: Rate, t: float, h: float, q: Values, v: Values, past: list[Values]) -> tuple[Values, Values]:
    past.append(np.stack([v, f(t, q, v)]))
    move = past[-1] if len(past) == 1 else 1.5 * past[-1] - 0.5 * past[-2]
    return q + h * move[0], v + h * move[1]


def runge_kutta(f: Rate, t: float, h: float, q: Values, v: Values, _: list[Values]) -> tuple[Values, Values]:
    a = f(t, q, v)
    b = f(t + h / 2, q + h / 2 * v, v + h / 2 * a)
    c = f(t + h / 2, q + h / 2 * v + h**2 / 4 * a, v + h / 2 * b)
    d = f(t + h, q + h * v + h**2 / 2 * b, v + h * c)
    return q + h * v + h**2 / 6 * (a + b + c), v + h / 6 * (a + 2 * b + 2 * c + d)


INTEGRATORS = {
    "Euler": euler,
    "Euler, q by the new velocity": euler_new_velocity,
    "Euler, q to second order": euler_taylor,
    "Euler, xdd at the end": euler_at_the_end,
    "backward Euler": backward_euler,
    "trapezoid": trapezoid,
    "midpoint": midpoint,
    "Heun": heun,
    "Adams-Bashforth 2": adams_bashforth,
    "Runge-Kutta 4": runge_kutta,
}


def follow(integrator: str, sign: str, step: float, planned: Values) -> tuple[Values, Values]:
    """From the first configurations of the planner's motions (K, N + 1, 3), at rest: the kinetic-energy integrals (K,)
    by the sum over the steps [J s], and the mean absolute differences (K,) from these motions at their knots [rad].
    """
    f, advance, past = rate(*SIGNS[sign]), INTEGRATORS[integrator], list[Values]()
    q, v = planned[:, 0], np.zeros((len(planned), 3))
    energy, path = np.zeros(len(planned)), [q]
    count = round(SIMULATION.duration / step)
    for i in range(count):
        q, v = advance(f, i * step, step, q, v, past)
        energy += step * kinetic_energy(q, v)
        path.append(q)
    every = count // (planned.shape[1] - 1)
    return energy, np.abs(np.stack(path[::every], axis=1) - planned).mean(axis=(1, 2))


def readings() -> Iterator[tuple[str, str, float]]:
    """Integrator, sign and step."""
    yield from ((i, sign, step) for sign in SIGNS for step in STEPS for i in INTEGRATORS)


def fits(energies: Values, differences: Values) -> int:
    """How many of the six printed numbers come out within their rounding."""
    allowed = np.array([5e-5, 5e-5, 5e-5, 5e-5, 5e-4, 5e-5])
    found, printed = np.concatenate([energies, differences]), np.concatenate(list(PRINTED.values()))
    return int((np.abs(found - printed) <= allowed * (1 + 1e-9)).sum())
