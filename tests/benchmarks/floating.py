"""The peer's program of a planar arm on a base that floats, at rest as a whole, from a given start.

Unknowns are the base's x, y, yaw and the joints at every knot but the first. Over each interval the centre of mass
stays where it is and the angular momentum in the middle is zero, as in the pipeline's program; shared is no code.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import casadi as ca
import numpy as np

from tests.benchmarks.peer import PROJECT, QUIET, Array

ROBOT = PROJECT / "robots" / "planar3r_base.urdf"


class FloatingArm:
    """A body with the arm's first joint at its origin, and the arm."""

    def __init__(self) -> None:
        root = ET.parse(ROBOT).getroot()
        links = [link for link in root.findall("link") if link.find("inertial") is not None]
        numbers = [
            [float(link.find(path).get(key).split()[0]) for link in links]  # type: ignore[union-attr]
            for path, key in (
                ("inertial/origin", "xyz"),
                ("inertial/mass", "value"),
                ("inertial/inertia", "izz"),
            )
        ]
        self.center, self.mass, self.inertia = map(np.array, numbers)
        places = [joint.find("origin") for joint in root.findall("joint")]
        # The first joint stands at the body's origin, and the end effector at the end of the last link.
        self.length = np.array([0.0, *(float(place.get("xyz").split()[0]) for place in places if place is not None)])

    def points(self, q: ca.SX) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """Every link's centre of gravity, the links' angles, and the end effector."""
        angle, at, centers = ca.cumsum(q[2:]), q[:2], []
        for i in range(len(self.mass)):
            along = ca.vertcat(ca.cos(angle[i]), ca.sin(angle[i]))
            centers.append(at + self.center[i] * along)
            at = at + self.length[i] * along
        return centers, angle, at

    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function, ca.Function]:
        """T(q, qd), the angular momentum's conjugate (q, qd), the centre of mass (q) and the end effector (q)."""
        q, qd = ca.SX.sym("q", 6), ca.SX.sym("qd", 6)
        centers, _, tip = self.points(q)
        rate = ca.cumsum(qd[2:])
        energy = sum(
            0.5 * m * ca.sumsqr(ca.jtimes(c, q, qd)) + 0.5 * inertia * rate[i] ** 2
            for i, (m, inertia, c) in enumerate(zip(self.mass, self.inertia, centers, strict=True))
        )
        whole = sum(m * c for m, c in zip(self.mass, centers, strict=True)) / self.mass.sum()
        return (
            ca.Function("T", [q, qd], [energy]),
            ca.Function("L", [q, qd], [ca.gradient(energy, qd)[2]]),
            ca.Function("c", [q], [whole]),
            ca.Function("x", [q], [tip]),
        )


class Program:
    """min of the integral of T over q_1 .. q_N, on even knots; answers like `peer.Program`."""

    def __init__(self, times: Array, path: Array, start: Array, options: dict[str, Any]) -> None:
        intervals = len(times) - 1
        dt, self.start = float(times[-1] - times[0]) / intervals, start
        energy, angular, center, tip = FloatingArm().functions()
        unknown, scale = ca.MX.sym("q", 6, intervals), ca.MX.sym("scale")
        before = ca.horzcat(ca.DM(start), unknown[:, :-1])
        qd = (unknown - before) / dt
        rows = [
            ca.vec(tip.map(intervals)(unknown) - path[1:].T),
            ca.vec(angular.map(intervals)((unknown + before) / 2, qd)),
            ca.vec(center.map(intervals)(unknown) - center.map(intervals)(before)) / dt,
        ]
        cost = ca.sum2(energy.map(intervals)(unknown, qd)) * dt
        program = {"x": ca.vec(unknown), "p": scale, "f": cost / scale, "g": ca.vertcat(*rows)}
        names = {f"ipopt.{key}": value for key, value in options.items()}
        self.solver = ca.nlpsol("peer", "ipopt", program, {**QUIET, "expand": True, **names})
        self.evaluate = ca.Function("evaluate", [program["x"]], [cost, program["g"]])

    def solve(self, guess: Array) -> tuple[Array, float, dict]:
        """q (N + 1, 6), its cost, and CasADi's statistics."""
        first = guess[1:].ravel()
        result = self.solver(x0=first, p=float(self.evaluate(first)[0]), lbg=0.0, ubg=0.0)
        q = np.array(result["x"]).reshape(-1, 6)
        return np.vstack([self.start, q]), float(self.evaluate(q.ravel())[0]), self.solver.stats()

    def check(self, q: Array) -> tuple[float, float]:
        """The cost of q (N + 1, 6), and by how much it misses its path and its momentum."""
        cost, rows = self.evaluate(q[1:].ravel())
        return float(cost), float(np.abs(np.array(rows)).max())
