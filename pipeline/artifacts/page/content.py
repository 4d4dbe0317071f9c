"""What a page shows, as JSON: a run's scene, its motions, and the plane of costs in which they can be chosen.

Numbers over time are little-endian 32-bit floats in base64: a fifth of what digits take, and read at once.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.artifacts.bands import Band, bands
from pipeline.artifacts.figures.solids import surface
from pipeline.artifacts.report import Report
from pipeline.artifacts.scene import around, corners, hull, limbs, path_in_world, tool_poses
from pipeline.artifacts.table import rows
from pipeline.artifacts.verdict import first, verdict, weighs
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.robot.shapes import Shape
from pipeline.studies import style
from pipeline.studies.front import Front, cost, label

KNOTS = 401  # most of a motion: more than a plot has pixels
FLAT = 1e-6  # relative: an arm in space that never leaves a plane is seen from above it


def run(report: Report) -> dict[str, Any]:
    """One run, ready for JSON."""
    motions = report.motions
    problem, config = motions.problem, motions.config
    arm = problem.task.arm
    own = [e for e in motions.evaluations if e.solution.found]
    points = np.concatenate([path_in_world(problem), *(e.skeleton.reshape(-1, 3) for e in own)])
    opens, table = first(report), rows(report)
    shown = {e.label for e in report.shown}
    return {
        "name": config.name,
        "verdict": verdict(report),
        "facts": f"{arm.description.name}, {len(arm.description.actuated)} joints, r = {problem.task.redundancy}; "
        f"objective {config.objective.kind}, limits {config.limits.kind}, boundary {config.boundary.kind}",
        "joints": [{"name": name, "color": style.joint_color(j)} for j, name in enumerate(arm.description.actuated)],
        "bands": [_band(band) for band in bands(problem)],
        "margin": None if problem.obstacles is None else problem.obstacles.margin,
        "foot": None if arm.base.count else list(arm.mounting.base_position),
        "path": packed(path_in_world(problem)),
        "obstacles": [_solid(shape) for shape in around(problem, points)],
        "limbs": [_solid(shape) for shape in limbs(problem)],
        "tool": [_solid(shape) for shape in arm.description.attached],
        "flat": _flat(problem, own),
        "table": table,
        "motions": [_motion(problem, e, e.label in shown, opens is e) for e in own],
        "plane": _plane(report, own),
    }


def packed(values: Array) -> str:
    """Any array, row by row."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def unpacked(text: str) -> Array:
    """The same, without its shape."""
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def _band(band: Band) -> dict[str, Any]:
    def known(bound: Array) -> list[float | None]:
        return [float(value) if np.isfinite(value) else None for value in bound]

    return {"kind": band.kind, "unit": band.unit, "lower": known(band.lower), "upper": known(band.upper)}


def _motion(problem: Problem, e: Evaluation, shown: bool, opens: bool) -> dict[str, Any]:
    """Its numbers at no more than KNOTS knots: joint values knot by knot, points (n + 1, 3) knot by knot."""
    arm = problem.task.arm
    keep = np.linspace(0, len(e.time) - 1, min(len(e.time), KNOTS)).round().astype(int)
    lines = {
        "kinetic energy": e.kinetic_energy,
        "kinetic-energy integral": e.energy_integral,
        "squared-torque integral": e.torque_integral,
        "path error": e.tracking_error,
    }
    if problem.obstacles is not None:
        lines["clearance"] = e.clearance
    if arm.base.kind == "floating":
        lines["turn of the base"] = e.base.turn
        lines["base-rotation integral"] = e.integrals["base_rotation"]
    return {
        "label": e.label,
        "title": style.name(e.label),
        "color": style.color(e.label),
        "on": shown,
        "first": opens,
        "until": e.solution.event_time,
        "costs": {label(name): cost(e, name) for name in dict.fromkeys([weighs(problem), "kinetic_energy", "torque"])},
        "time": packed(e.time[keep]),
        "joints": {band.kind: packed(band.values(e)[keep]) for band in bands(problem)},
        "lines": {name: packed(values[keep]) for name, values in lines.items()},
        "points": packed(e.skeleton[keep]),
        "box": packed(corners(arm, e.base)[keep]) if arm.base.count else None,
        "frame": packed(_frame(tool_poses(arm, e, keep))) if arm.description.attached else None,
    }


def _frame(poses: tuple[Array, Array]) -> Array:
    """The origin of frames and their unit points along x, y and z: (K, 4, 3) [m]."""
    rotation, position = poses
    return position[:, None] + np.concatenate([np.zeros((len(position), 1, 3)), rotation.swapaxes(1, 2)], axis=1)


def _flat(problem: Problem, evaluations: Sequence[Evaluation]) -> int | None:
    """Which coordinate of the world never changes, if one does not."""
    points = np.concatenate([path_in_world(problem), *(e.skeleton.reshape(-1, 3) for e in evaluations)])
    size = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    return int(size.argmin()) if size.min() <= FLAT * size.max() else None


def _solid(shape: Shape) -> dict[str, Any]:
    """A ball or a rod by its ends and radius, anything else by its corners and faces."""
    if shape.kind in ("sphere", "capsule"):
        half = np.array([0.0, 0.0, shape.size[1] / 2 if shape.kind == "capsule" else 0.0])
        return {"name": shape.name, "ends": shape.placed(np.array([-half, half])).tolist(), "radius": shape.size[0]}
    corners = surface(shape)
    ground = {"ground": True} if shape.kind == "half_space" else {}
    return {"name": shape.name, "corners": corners.tolist(), "faces": hull(corners), **ground}


def _plane(report: Report, evaluations: Sequence[Evaluation]) -> dict[str, Any] | None:
    """Two costs of every motion: those of a front, else both integrals that each motion has; None for one alone."""
    front = report.find(Front)
    if front is None and len(evaluations) < 2:
        return None
    names = ["kinetic_energy", "torque"] if front is None else front.objectives
    table = None if front is None else front.table.set_index("point")
    points = []
    for number, e in enumerate(evaluations):
        if e.solution.event_time is not None:
            continue
        marks, good = [], True
        if table is not None and e.method == "pareto":
            row = table.loc[e.solution.optimum]
            marks = [mark for mark in ("extreme", "knee") if row[mark]]
            good = bool(row["status"] == "optimal")
        x, y = (cost(e, name) for name in names)
        points.append({"motion": number, "x": x, "y": y, "mark": ", ".join(marks), "good": good})
    title = "Costs of the motions" if front is None else f"Pareto front, hypervolume {front.share:.3f}"
    return {"title": title, "x": label(names[0]), "y": label(names[1]), "step": front is not None, "points": points}
