"""The exported motion as files: a CSV table, messages of ROS 2 and MoveIt, a program for Universal Robots."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from pipeline.artifacts.report import Report
from pipeline.common.files import write_beside
from pipeline.studies.export import Resampled

START = 0.01  # [rad] by which every joint may stand off where the motion starts
UR_JOINTS = 6


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
    """What `export.format` asks for in `folder`, where there is a motion to export."""
    arm, motion = report.motions.problem.task.arm.description, report.find(Resampled)
    if motion is not None:
        save_motion(folder, motion, arm.actuated, arm.base, report.motions.config.export.format)


def save_motion(
    folder: str | Path, motion: Resampled, joints: Sequence[str], frame: str, formats: Sequence[str] = ("csv", "ros2")
) -> None:
    """Write a motion (`resample`) of an arm with these joints on the link `frame` into `folder`: motion.csv and, for
    ROS 2, motion.yaml and motion.json; formats may name moveit and urscript too.
    """
    for kind in formats:
        for name, text in FORMATS[kind](motion, joints, frame).items():
            write_beside(Path(folder) / name, partial(_put, text))


def _put(text: str, file: Path) -> None:
    file.write_text(text, encoding="utf-8")


def _csv(motion: Resampled, joints: Sequence[str], frame: str) -> dict[str, str]:
    return {"motion.csv": _head(motion) + table(motion, joints).to_csv(index=False)}


def _ros2(motion: Resampled, joints: Sequence[str], frame: str) -> dict[str, str]:
    message = joint_trajectory(motion, joints, frame)
    return {"motion.json": json.dumps(message, indent=1), "motion.yaml": _yaml(message)}


def _moveit(motion: Resampled, joints: Sequence[str], frame: str) -> dict[str, str]:
    """A moveit_msgs/RobotTrajectory, as ExecuteTrajectory takes it."""
    message = joint_trajectory(motion, joints, frame)
    warned = {key: message.pop(key) for key in ("warning",) if key in message}
    nothing = {"header": message["header"], "joint_names": [], "points": []}
    whole = {**warned, "joint_trajectory": message, "multi_dof_joint_trajectory": nothing}
    return {"motion_moveit.yaml": _yaml(whole)}


def _urscript(motion: Resampled, joints: Sequence[str], frame: str) -> dict[str, str]:
    """A program in Universal Robots' URScript: refuses to start elsewhere, then servoj for every interval."""
    steps = np.diff(motion.time)
    rows = [", ".join(f"{value:.9g}" for value in q) for q in motion.q]
    moves = [
        f"  servoj([{row}], t={step:.6g}, lookahead_time=0.1, gain=300)"
        for row, step in zip(rows[1:], steps, strict=True)
    ]
    check = [
        f"  local start = [{rows[0]}]",
        "  local here = get_actual_joint_positions()",
        "  local j = 0",
        f"  while j < {len(joints)}:",
        f"    if norm(here[j] - start[j]) > {START:g}:",
        '      popup("the arm does not stand where the motion starts", error=True, blocking=True)',
        "      halt",
        "    end",
        "    j = j + 1",
        "  end",
    ]
    program = ["def motion():", *check, *moves, "  stopj(2.0)", "end", "motion()", ""]
    return {"motion.script": _head(motion) + f"# {', '.join(joints)} [rad]\n" + "\n".join(program)}


def why_not(formats: Sequence[str], turning: Sequence[bool]) -> str | None:
    """Why the motion of an arm with these joints cannot be written so, as a line; None if it can."""
    if "urscript" in formats and not (len(turning) == UR_JOINTS and all(turning)):
        return (
            f"export.format = urscript: arms of Universal Robots have {UR_JOINTS} joints that turn, this one has "
            f"{sum(turning)} that turn and {len(turning) - sum(turning)} that slide; csv, ros2 and moveit serve any arm"
        )
    return None


def _head(motion: Resampled) -> str:
    return f"# {warning(motion)}\n" if motion.faults else ""


def _yaml(message: dict[str, Any]) -> str:
    return yaml.dump(message, sort_keys=False, default_flow_style=None, width=10_000, Dumper=_Plain)


class _Plain(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Says a header again where it stands twice: readers of messages need not know anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


FORMATS: dict[str, Callable[[Resampled, Sequence[str], str], dict[str, str]]] = {
    "csv": _csv,
    "ros2": _ros2,
    "moveit": _moveit,
    "urscript": _urscript,
}
