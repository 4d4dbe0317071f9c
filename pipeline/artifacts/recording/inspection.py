"""The recording of `python -m pipeline.describe`: the arm alone, each joint in turn moved through its range."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pipeline.artifacts.recording.arm import columns, draw_arm
from pipeline.artifacts.recording.blueprint import BACKGROUND, GRID, pixels
from pipeline.artifacts.recording.stream import record
from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.studies import style

COLOR = (70, 120, 170, 255)


def write(file: Path, arm: Arm, time: Array, q: Array, *, name: str) -> None:
    """Write `file` (.rrd), or raise and leave nothing behind. time (K,) [s], q (K, n)."""
    tip = arm.position(q)
    around = np.vstack([tip, arm.mounting.base_position])
    center = (around.min(axis=0) + around.max(axis=0)) / 2
    size = float(np.linalg.norm(around - center, axis=1).max())
    eye = center + 2.2 * size * np.array([1.0, -1.2, 0.7]) / np.linalg.norm([1.0, -1.2, 0.7])
    space = rrb.Spatial3DView(
        origin="/",
        contents=["/arm/**", "/end_effector"],
        name=name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1, color=GRID),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=center, eye_up=(0.0, 0.0, 1.0)),
    )
    joints = rrb.TimeSeriesView(origin="/joint_position", name="Joint positions [rad or m]")
    layout = rrb.Blueprint(
        rrb.Horizontal(space, joints, column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="playing", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )

    def fill(recording: Any) -> None:
        recording.send_recording_name(name)
        recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        draw_arm(recording, arm, "arm", COLOR, columns(time), q)
        recording.log("end_effector", rr.Points3D.from_fields(radii=pixels(6.0), colors=(200, 40, 40)), static=True)
        recording.send_columns("end_effector", columns(time), rr.Points3D.columns(positions=tip))
        names = list(arm.description.joints)
        shades = [tuple(int(style.joint_color(j)[i : i + 2], 16) for i in (1, 3, 5)) for j in range(arm.n)]
        lines = rr.SeriesLines(names=names, colors=shades, widths=2.0)
        recording.log("joint_position", lines, static=True)
        recording.send_columns("joint_position", columns(time), rr.Scalars.columns(scalars=q))

    record(file, name, layout, fill)
