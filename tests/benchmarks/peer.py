"""The independent peer: the same programs in CasADi + IPOPT with exact Hessians, for planar arms read from the URDF.

It shares no code with the pipeline: the dynamics are written here from the link parameters, so that it also serves the
tests as a check of Drake's numbers and of the optima.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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


def kinetic_energy_program(arm: PlanarArm, intervals: int, dt: float, tolerance: float = 1e-8) -> ca.Function:
    """nlpsol over q_1..q_N (N n,), parameters q_0 and the path (2 N); backward differences, mass matrix at the interval's end."""
    n = len(arm.length)
    state, rate = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    energy = ca.Function("T", [state, rate], [arm.kinetic_energy(state, rate)])
    tip = ca.Function("x", [state], [arm.end_effector(state)])
    q, start, path = ca.MX.sym("q", n, intervals), ca.MX.sym("q0", n), ca.MX.sym("x", 2, intervals)
    before = ca.horzcat(start, q[:, :-1])
    cost = ca.sum2(energy.map(intervals)(q, (q - before) / dt)) * dt
    rows = ca.vec(tip.map(intervals)(q) - path)
    program = {"x": ca.vec(q), "p": ca.vertcat(start, ca.vec(path)), "f": cost, "g": rows}
    return ca.nlpsol("peer", "ipopt", program, {**QUIET, "ipopt.tol": tolerance})


def solve(program: ca.Function, start: Array, path: Array, guess: Array) -> tuple[Array, float, dict]:
    """q (N, n), the cost, and CasADi's statistics, from `guess` (N, n) along `path` (N, 2)."""
    result = program(x0=guess.ravel(), p=np.concatenate([start, path.ravel()]), lbg=0.0, ubg=0.0)
    return np.array(result["x"]).reshape(guess.shape), float(result["f"]), program.stats()
