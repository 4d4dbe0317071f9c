"""Limits as level lines in a recording's plots, on `/limits/joint_velocity` and its like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr

from pipeline.artifacts.bands import Band, bands
from pipeline.artifacts.recording.arm import columns
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.studies import style

ROOT = "limits"
FAR = 2.5  # times the largest value: limits beyond would press the motions flat
KINDS = {"joint_position": "position", "joint_velocity": "velocity", "joint_torque": "torque"}  # entity: band
LEAST = (197, 48, 48)


def levels(problem: Problem, evaluations: Sequence[Evaluation]) -> dict[str, tuple[Array, list[int]]]:
    """What is drawn, by entity: the bounds and the joint of each. Of position, velocity and torque."""
    of = {band.kind: band for band in bands(problem)}
    return {entity: _near(of[kind], evaluations) for entity, kind in KINDS.items() if of[kind].limited}


def outside(problem: Problem, drawn: Mapping[str, tuple[Array, list[int]]]) -> dict[str, str]:
    """What the title of a plot says of limits that are not drawn, by entity."""
    of, said = {band.kind: band for band in bands(problem)}, {}
    for entity, (values, _) in drawn.items():
        band = of[KINDS[entity]]
        every = np.abs(np.concatenate([band.lower, band.upper]))
        far = np.setdiff1d(every[np.isfinite(every)], np.abs(values))
        if far.size:
            said[entity] = f"limits from {far.min():.4g} on, outside"
    return said


def send(recording: Any, problem: Problem, evaluations: Sequence[Evaluation]) -> None:
    """Log the lines: in the colour of the joint, all under one name in the legend; and the least clearance."""
    time = columns(np.array([0.0, max(float(e.time[-1]) for e in evaluations)]))
    drawn = levels(problem, evaluations)
    shades = {entity: [style.joint_color(j) for j in of] for entity, (_, of) in drawn.items()}
    lines = {entity: (values, "limits", shades[entity]) for entity, (values, _) in drawn.items() if len(values)}
    if problem.obstacles is not None:
        least = np.array([problem.obstacles.margin])
        lines["clearance"] = (least, "least allowed", ["#{:02X}{:02X}{:02X}".format(*LEAST)])
    for entity, (values, name, colors) in lines.items():
        channels = [tuple(int(color[i : i + 2], 16) for i in (1, 3, 5)) for color in colors]
        look = rr.SeriesLines(names=[name] * len(values), colors=channels, widths=1.0)
        recording.log(f"{ROOT}/{entity}", look, static=True)
        recording.send_columns(f"{ROOT}/{entity}", time, rr.Scalars.columns(scalars=np.tile(values, (2, 1))))


def _near(band: Band, evaluations: Sequence[Evaluation]) -> tuple[Array, list[int]]:
    """The bounds that lie within FAR of what the motions reach, of those before a singularity if there are such."""
    whole = [e for e in evaluations if e.status is Status.SOLVED] or evaluations
    reach = FAR * max((float(np.nanmax(np.abs(band.values(e)))) for e in whole), default=0.0)
    found = [(bound, j) for j in range(len(band.upper)) for bound in (band.lower[j], band.upper[j])]
    kept = [(float(bound), j) for bound, j in found if np.isfinite(bound) and abs(bound) <= reach]
    return np.array([bound for bound, _ in kept]), [j for _, j in kept]
