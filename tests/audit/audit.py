"""The tables of finished runs, recomputed by pinocchio and coal: one row per motion, one column per kind of number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from tests.audit.library import NODES, WEIGHTS, Robot, Run, base_rates, columns, path, poses
from tests.readings.planar import Values

ALLOWED = 1e-6  # relative; of places and angles in m and rad
KINDS = ("place", "tracking", "torques", "energy", "torque integral", "clearance", "base")


def rows(run: Run) -> Iterator[dict[str, Any]]:
    """Experiment, motion, and by how much each kind of number differs: absolute for lengths and angles, else relative.
    Motions that lose their path are left out.
    """
    kept = run.summary[run.summary["status"] == "solved"]
    for told in kept.to_dict("records"):
        motion = run.motions[
            (run.motions["method"] == told["method"]) & (run.motions["optimum"] == told["optimum"])
        ].reset_index(drop=True)
        yield {
            "experiment": run.folder.name,
            "motion": f"{told['method']} {told['optimum']}",
            **differences(run, motion, told),
        }


def differences(run: Run, motion: pd.DataFrame, told: Mapping[Any, Any]) -> dict[str, float]:
    """By kind."""
    q, qd, qdd, tau = (columns(motion, name) for name in ("q", "qd", "qdd", "tau"))
    time, robot = motion["time"].to_numpy(), Robot(run.composed, q.shape[1])
    bases = poses(motion) if robot.floats else [None] * len(q)
    places = np.array([robot.tip(one, base) for one, base in zip(q, bases, strict=True)])
    found = {"place": float(np.abs(places - motion[["x", "y", "z"]].to_numpy()).max())}
    task = ["xyz".index(axis) for axis in run.composed["robot"]["task"]]
    given, begin = run.composed["path"].get("start"), run.composed["robot"]["q_init"]
    start = robot.tip(q[0] if begin is None else np.array(begin)) if given is None else np.array(given)
    wanted = path(run.composed, start, time)
    if wanted is not None:
        off = np.linalg.norm((places - wanted)[:, task], axis=1).max()
        found["tracking"] = float(abs(off - told["max_tracking_error"]))
    v, a = qd, qdd
    if robot.floats:
        v, a = (np.hstack(pair) for pair in zip(base_rates(motion), (qd, qdd), strict=True))
    torques = np.array([robot.torque(*one) for one in zip(q[1:], v[1:], a[1:], strict=True)])
    found["torques"] = float(np.abs(torques - tau[1:]).max() / max(np.abs(tau).max(), 1e-12))
    energy, squares = integrals(robot, time, q, qd, v, torques)
    found["energy"] = abs(energy / told["kinetic_energy_integral"] - 1)
    found["torque integral"] = abs(squares / told["torque_integral"] - 1)
    if run.composed.get("obstacles") and run.composed["obstacles"].get("shapes"):
        found["clearance"] = abs(robot.clearance(q) - told["min_clearance"])
    if robot.floats:
        free = robot.bases(time, q)
        turn = 2 * np.arcsin(np.linalg.norm(free[-1, 3:6]))
        shift = np.linalg.norm(free[-1, :3] - free[0, :3])
        found["base"] = float(max(abs(turn - told["final_base_turn"]), abs(shift - told["final_base_shift"])))
    return found


def integrals(robot: Robot, time: Values, q: Values, qd: Values, v: Values, torques: Values) -> tuple[float, float]:
    """Of kinetic energy [J s] and squared torques: the documents' backward sums; in continuous time for a motion
    that is a spline, whose velocities are not backward differences.
    """
    dt = np.diff(time)
    if np.abs(np.diff(q, axis=0) / dt[:, None] - qd[1:]).max() < 1e-9 * (1 + np.abs(qd).max()):
        energies = np.array([robot.energy(*one) for one in zip(q[1:], v[1:], strict=True)])
        return float(energies @ dt), float((torques**2).sum(axis=1) @ dt)
    spline = CubicSpline(time, q, bc_type=((1, qd[0]), (1, qd[-1])))
    at = (time[:-1, None] + dt[:, None] * (NODES + 1) / 2).ravel()
    weight = (dt[:, None] * WEIGHTS / 2).ravel()
    inner = [(spline(t), spline(t, 1), spline(t, 2)) for t in at]
    energies = np.array([robot.energy(*one[:2]) for one in inner])
    squares = np.array([(robot.torque(*one) ** 2).sum() for one in inner])
    return float(energies @ weight), float(squares @ weight)
