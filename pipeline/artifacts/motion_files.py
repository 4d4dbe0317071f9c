"""The exported motion as files: a CSV table, and ROS 2's trajectory_msgs/JointTrajectory as YAML and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from pipeline.artifacts.report import Report
from pipeline.common.files import write_beside
from pipeline.studies.export import Resampled


def table(motion: Resampled, joints: Sequence[str]) -> pd.DataFrame:
    """time, then position, velocity and acceleration of every joint by its name."""
    columns: dict[str, Any] = {"time": motion.time}
    for name, values in (("position", motion.q), ("velocity", motion.qd), ("acceleration", motion.qdd)):
        columns |= {f"{joint}_{name}": values[:, j] for j, joint in enumerate(joints)}
    return pd.DataFrame(columns)


def joint_trajectory(motion: Resampled, joints: Sequence[str], frame: str) -> dict[str, Any]:
    """The fields of a trajectory_msgs/JointTrajectory, times as whole nanoseconds."""
    points = []
    for time, q, qd, qdd in zip(motion.time, motion.q, motion.qd, motion.qdd, strict=True):
        seconds, nanoseconds = divmod(round(float(time) * 1e9), 10**9)
        points.append(
            {
                "positions": q.tolist(),
                "velocities": qd.tolist(),
                "accelerations": qdd.tolist(),
                "effort": [],
                "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
            }
        )
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}
    message = {"header": header, "joint_names": list(joints), "points": points}
    return {"warning": warning(motion), **message} if motion.faults else message


def warning(motion: Resampled) -> str:
    """What the files of a motion say that cannot be sent, and was written all the same."""
    return f"NOT TO BE SENT: this motion {motion.fault}"


def write(report: Report, folder: Path) -> None:
    """motion.csv, motion.json and motion.yaml in `folder`, where there is a motion to export."""
    arm, motion = report.motions.problem.task.arm.description, report.find(Resampled)
    if motion is not None:
        save(folder, motion, arm.actuated, arm.base)


def save(folder: Path, motion: Resampled, joints: Sequence[str], frame: str) -> None:
    """The three files of one motion, of an arm with these joints on the link `frame`."""
    message = joint_trajectory(motion, joints, frame)
    rows = table(motion, joints)
    head = f"# {warning(motion)}\n" if motion.faults else ""
    write_beside(folder / "motion.csv", lambda file: file.write_text(head + rows.to_csv(index=False), encoding="utf-8"))
    write_beside(folder / "motion.json", lambda file: file.write_text(json.dumps(message, indent=1), encoding="utf-8"))
    text = yaml.dump(message, sort_keys=False, default_flow_style=None, width=10_000, Dumper=_DUMPER)
    write_beside(folder / "motion.yaml", lambda file: file.write_text(text, encoding="utf-8"))


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
