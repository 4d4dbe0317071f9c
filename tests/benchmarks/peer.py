"""The independent peer: the same programs in CasADi + IPOPT with exact Hessians, for planar arms read from the URDF.

It shares no code with the pipeline: the dynamics are written here from the link parameters, so that it also serves the
tests as a check of Drake's numbers and of the optima.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PROJECT = Path(__file__).resolve().parents[2]
ROBOT = PROJECT / "robots" / "planar3r.urdf"
QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


@dataclass(frozen=True)
class PlanarArm:
    """Lengths and centres of gravity [m], masses [kg] and barycentric moments of inertia [kg m^2], one per link."""

    length: Array
    center: Array
    mass: Array
    inertia: Array

    @classmethod
    def from_urdf(cls, file: Path) -> PlanarArm:
        root = ET.parse(file).getroot()
        joints = list(root.findall("joint"))
        shift = [float(joint.find("origin").get("xyz").split()[0]) for joint in joints]  # type: ignore[union-attr]
        links = [link for link in root.findall("link") if link.find("inertial") is not None]

        def value(path: str, key: str) -> Array:
            return np.array([float(link.find(path).get(key).split()[0]) for link in links])  # type: ignore[union-attr]

        return cls(
            np.array(shift[1:]),
            value("inertial/origin", "xyz"),
            value("inertial/mass", "value"),
            value("inertial/inertia", "izz"),
        )

    @property
    def n(self) -> int:
        return len(self.length)

    def rows(self, q: ca.SX, target: ca.SX) -> ca.SX:
        return self.end_effector(q) - target

    def end_effector(self, q: ca.MX) -> ca.MX:
        angle = ca.cumsum(q)
        return ca.vertcat(ca.dot(self.length, ca.cos(angle)), ca.dot(self.length, ca.sin(angle)))

    def kinetic_energy(self, q: ca.MX, qd: ca.MX) -> ca.MX:
        angle, rate = ca.cumsum(q), ca.cumsum(qd)
        energy, vx, vy = 0, 0, 0
        for i in range(len(self.length)):
            cx = vx - rate[i] * self.center[i] * ca.sin(angle[i])
            cy = vy + rate[i] * self.center[i] * ca.cos(angle[i])
            energy += 0.5 * self.mass[i] * (cx**2 + cy**2) + 0.5 * self.inertia[i] * rate[i] ** 2
            vx -= rate[i] * self.length[i] * ca.sin(angle[i])
            vy += rate[i] * self.length[i] * ca.cos(angle[i])
        return energy


def kinetic_energy_program(
    arm: PlanarArm, intervals: int, dt: float, tolerance: float = 1e-8, *, expand: bool = False
) -> ca.Function:
    """nlpsol over q_1..q_N (N n,), parameters q_0 and the path (2 N); backward differences, M at the interval's end.

    expand: SX graphs in place of MX, which take half the time to evaluate and longer to build.
    """
    n = len(arm.length)
    state, rate = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    energy = ca.Function("T", [state, rate], [arm.kinetic_energy(state, rate)])
    tip = ca.Function("x", [state], [arm.end_effector(state)])
    q, start, path = ca.MX.sym("q", n, intervals), ca.MX.sym("q0", n), ca.MX.sym("x", 2, intervals)
    before = ca.horzcat(start, q[:, :-1])
    cost = ca.sum2(energy.map(intervals)(q, (q - before) / dt)) * dt
    rows = ca.vec(tip.map(intervals)(q) - path)
    program = {"x": ca.vec(q), "p": ca.vertcat(start, ca.vec(path)), "f": cost, "g": rows}
    return ca.nlpsol("peer", "ipopt", program, {**QUIET, "expand": expand, "ipopt.tol": tolerance})


def solve(program: ca.Function, start: Array, path: Array, guess: Array) -> tuple[Array, float, dict]:
    """q (N, n), the cost, and CasADi's statistics, from `guess` (N, n) along `path` (N, 2)."""
    result = program(x0=guess.ravel(), p=np.concatenate([start, path.ravel()]), lbg=0.0, ubg=0.0)
    return np.array(result["x"]).reshape(guess.shape), float(result["f"]), program.stats()


class Arm(Protocol):
    """What `Program` asks of an arm, all in CasADi's symbols."""

    n: int

    def kinetic_energy(self, q: ca.SX, qd: ca.SX) -> ca.SX:
        """[J]."""

    def rows(self, q: ca.SX, target: ca.SX) -> ca.SX:
        """(m,): zero where the end effector is as the target says."""


def torques(energy: ca.SX, q: ca.SX, qd: ca.SX, qdd: ca.SX) -> ca.SX:
    """Joint torques (n,) [N m] by Lagrange's equations from the kinetic energy, without gravity."""
    momentum = ca.gradient(energy, qd)
    return ca.jtimes(momentum, qd, qdd) + ca.jtimes(momentum, q, qd) - ca.gradient(energy, q)


@dataclass
class Program:
    """min of the integral of T or |tau|^2 over q_0..q_N by backward differences, on even knots, with the limits given.

    boundary: fixed (q_0 given), free (from rest, q_0 unknown) or cyclic (q_N = q_0, and the velocity before the first
    knot is the last). limits: lower, upper, velocity, torque, power, one (n,) each. options: IPOPT's, without the
    prefix. Of those tried (scalings, starting barriers, barrier strategies, SX and MX graphs) the expansion to SX is
    the fastest, by up to a factor of two, and a small starting barrier finds the best optima from the same starts.
    """

    arm: Arm
    times: Array
    path: Array  # (N + 1, coordinates of a target)
    start: Array  # (n,)
    torque: bool
    boundary: str
    limits: tuple[Array, Array, Array, Array, Array]
    options: dict[str, Any]

    def __post_init__(self) -> None:
        n, intervals = self.arm.n, len(self.times) - 1
        dt = float(self.times[-1] - self.times[0]) / intervals
        lower, upper, velocity, torque, power = self.limits
        self.first, cyclic = int(self.boundary == "fixed"), self.boundary == "cyclic"
        self.last = intervals if cyclic else intervals + 1  # unknown are the knots from `first` to before it
        state, rate, acceleration = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
        kept = [(rate, velocity)]
        if self.torque or np.isfinite([torque, power]).any():
            tau = torques(self.arm.kinetic_energy(state, rate), state, rate, acceleration)
            kept += [(tau, torque), (tau * rate, power)]
        term = ca.sumsqr(tau) if self.torque else self.arm.kinetic_energy(state, rate)
        limited = [(quantity[i], bound[i]) for quantity, bound in kept for i in range(n) if np.isfinite(bound[i])]
        stage = ca.Function("stage", [state, rate, acceleration], [term, ca.vertcat(*(row for row, _ in limited))])
        target = ca.SX.sym("x", self.path.shape[1])
        tip = ca.Function("tip", [state, target], [self.arm.rows(state, target)])

        free = self.last - self.first
        unknown, scale = ca.MX.sym("q", n, free), ca.MX.sym("scale")
        q = unknown
        if cyclic:
            q = ca.horzcat(unknown, unknown[:, 0])
        elif self.first:
            q = ca.horzcat(ca.DM(self.start), unknown)
        qd = (q[:, 1:] - q[:, :-1]) / dt
        qdd = (qd - ca.horzcat(qd[:, -1] if cyclic else ca.MX.zeros(n), qd[:, :-1])) / dt
        terms, rows = stage.map(intervals)(q[:, 1:], qd, qdd)
        gaps = ca.vec(tip.map(free)(unknown, ca.DM(self.path[self.first : self.last].T)))
        bound = np.tile([value for _, value in limited], intervals)
        exact = np.zeros(gaps.shape[0])
        self.bounds = {
            "lbx": np.tile(lower, free),
            "ubx": np.tile(upper, free),
            "lbg": np.concatenate([exact, -bound]),
            "ubg": np.concatenate([exact, bound]),
        }
        cost = ca.sum2(terms) * dt
        program = {"x": ca.vec(unknown), "p": scale, "f": cost / scale, "g": ca.vertcat(gaps, ca.vec(rows))}
        names = {f"ipopt.{key}": value for key, value in self.options.items()}
        self.solver = ca.nlpsol("peer", "ipopt", program, {**QUIET, "expand": True, **names})
        self.evaluate = ca.Function("evaluate", [program["x"]], [cost, program["g"]])

    def solve(self, guess: Array) -> tuple[Array, float, dict]:
        """q (N + 1, n), its cost, and CasADi's statistics; the objective is divided by its value at the guess."""
        start = guess[self.first : self.last].ravel()
        result = self.solver(x0=start, p=float(self.evaluate(start)[0]), **self.bounds)
        q = np.array(result["x"]).reshape(self.last - self.first, -1)
        cost = float(self.evaluate(q.ravel())[0])
        before, after = [self.start] * self.first, [q[0]] * (len(guess) - self.last)
        return np.vstack([*before, q, *after]), cost, self.solver.stats()

    def check(self, q: Array) -> tuple[float, float]:
        """The cost of q (N + 1, n) and by how much it misses its path or exceeds a limit, in their units."""
        x = q[self.first : self.last].ravel()
        cost, rows = self.evaluate(x)
        parts = (
            (np.array(rows).ravel(), self.bounds["lbg"], self.bounds["ubg"]),
            (x, self.bounds["lbx"], self.bounds["ubx"]),
        )
        excess = max(float(np.maximum(low - value, value - high).max()) for value, low, high in parts)
        return float(cost), excess
