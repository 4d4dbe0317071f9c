"""One Rerun recording per run: all motions overlaid, moving on one time line, with everything that is known of them.

Entities, for a motion with the slug `lsv`: `/lsv/joint_position`, `joint_velocity`, `joint_torque` (one vector each),
`/lsv/kinetic_energy`, `energy_integral`, `tracking_error`, `singular_value`, `spectral_radius` (scalars), and the
pictures `/lsv/stick`, `trace`, `end_effector` and `/lsv/<robot>`. SI units throughout. The motion to look at is drawn
in full colour, the others are its ghosts. Limits are lines on `/limits/...`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from pipeline.artifacts.recording import blueprint, bounds
from pipeline.artifacts.recording.arm import columns, draw_arm
from pipeline.artifacts.recording.blueprint import faded, pixels, rgba, slug
from pipeline.artifacts.recording.solids import send_obstacles, send_tool
from pipeline.artifacts.recording.stream import record
from pipeline.artifacts.report import Report
from pipeline.artifacts.scene import around, box, corners, outlines, path_in_world, tool_poses
from pipeline.artifacts.summary import text
from pipeline.artifacts.verdict import first
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.arm import Arm
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.studies import style

POSES = 12  # of the stroboscopic picture
SOLID = 110  # opacity of the arms, of 255: those behind must shine through
GHOST = 0.35  # how much of its colour and opacity is left of a motion that is not looked at first
REFERENCE = (226, 170, 203)  # the colour that paths have in every picture, mixed with white


def write(report: Report, folder: Path) -> None:
    """recording.rrd in `folder`: all motions, with the figure that a study has chosen to open it."""
    cover = next((result.cover for result in report.results if result.cover), None)
    save(
        folder / "recording.rrd",
        report.motions.problem,
        report.motions.evaluations,
        name=report.motions.config.name,
        summary=text(report),
        properties={key: value for key, value in report.facts.items() if key != "inputs"},
        picture=None if cover is None else folder / "figures" / f"{cover}.png",
        opens="" if (motion := first(report)) is None else motion.label,
    )


def save(
    file: Path,
    problem: Problem,
    evaluations: Sequence[Evaluation],
    *,
    name: str,
    summary: str,
    properties: Mapping[str, Any],
    picture: Path | None = None,
    opens: str = "",
) -> None:
    """Write the recording `file` (.rrd) of all `evaluations`, or raise and leave nothing behind.

    summary: Markdown, shown beside the plots. properties: facts of the run, stored as the recording's property `run`.
    opens: the label of the motion that is looked at first.
    picture: a PNG to show first, such as the Pareto front (2-D views have no axes of their own).
    """

    def fill(recording: Any) -> None:
        recording.send_recording_name(name)
        if facts := _facts(properties):
            recording.send_property("run", facts)
        document = rr.TextDocument(summary, media_type=rr.MediaType.MARKDOWN)
        recording.log("summary", document, static=True)
        if picture is not None:
            recording.log("picture", rr.EncodedImage(path=picture), static=True)
        _send_reference(recording, problem)
        if problem.obstacles is not None:
            points = np.concatenate([path_in_world(problem), *(e.skeleton.reshape(-1, 3) for e in evaluations)])
            send_obstacles(recording, around(problem, points), _planar(problem))
        for evaluation in evaluations:
            _send_series(recording, problem, evaluation)
            _send_motion(recording, problem, evaluation, GHOST if opens not in ("", evaluation.label) else 1.0)
        bounds.send(recording, problem, evaluations)

    record(file, name, _layout(problem, evaluations, picture, opens), fill)


def read_series(file: Path, entity: str) -> tuple[Array, Array]:
    """The time (N,) [s] and the values (N, k) of the scalars on `entity`, for example `/lsv/joint_position`."""
    times, values = [], []
    for chunk in RrdReader(file).stream().filter(content=entity, has_timeline="time"):
        batch = chunk.to_record_batch()
        times.append(batch["time"].to_numpy(zero_copy_only=False).astype("int64") * 1e-9)
        values.append(batch["Scalars:scalars"].flatten().to_numpy().reshape(len(batch), -1))
    if not times:
        raise KeyError(f"{file}: no series on {entity}")
    time, value = np.concatenate(times), np.concatenate(values)
    order = np.argsort(time, kind="stable")
    return time[order], value[order]


def _layout(problem: Problem, evaluations: Sequence[Evaluation], picture: Path | None, opens: str) -> Any:
    points = [np.array([problem.task.arm.mounting.base_position]), path_in_world(problem)]
    if problem.obstacles is not None:
        points.append(np.array([shape.position for shape in problem.obstacles.shapes]))
    points += [evaluation.skeleton[_finite(evaluation)].reshape(-1, 3) for evaluation in evaluations]
    arm = problem.task.arm
    floats = arm.base.kind == "floating"
    if floats:
        points += [corners(arm, e.base)[_finite(e)].reshape(-1, 3) for e in evaluations]
    labels = [evaluation.label for evaluation in evaluations]
    revolute = problem.task.arm.description.turning.tolist()
    tab = "" if picture is None else picture.stem.replace("_", " ").capitalize()
    return blueprint.build(
        labels,
        np.concatenate(points),
        revolute,
        _planar(problem),
        _ranges(evaluations),
        tab,
        floats,
        problem.obstacles is not None,
        opens,
        bounds.outside(problem, bounds.levels(problem, evaluations)),
    )


def _ranges(evaluations: Sequence[Evaluation]) -> dict[str, tuple[float, float]]:
    """What to show of the energies: a motion that met a singularity shoots up there and would flatten the others."""
    usable = [evaluation for evaluation in evaluations if evaluation.status is Status.SOLVED]
    ranges = {}
    for entity in blueprint.ENERGIES if 0 < len(usable) < len(evaluations) else ():
        values = np.concatenate([getattr(evaluation, entity)[_finite(evaluation)] for evaluation in usable])
        high = float(values.max(initial=0.0))
        if high > 0.0:
            ranges[entity] = (-0.04 * high, 1.25 * high)
    return ranges


def _planar(problem: Problem) -> bool:
    return tuple(problem.task.axes) == ("x", "y")


def _finite(evaluation: Evaluation) -> Any:
    """The knots (N + 1,) at which there is a pose to draw: a broken motion may end in values that are not finite."""
    return np.isfinite(evaluation.skeleton).all(axis=(1, 2)) & np.isfinite(evaluation.q).all(axis=1)


class _Fact:
    """One value of a property, typed on its own: `rr.AnyValues` holds a key to its first type for the whole process."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def as_arrow_array(self) -> Any:
        if not isinstance(self.value, str | Mapping):
            try:
                return pa.array(self.value if isinstance(self.value, list | tuple | np.ndarray) else [self.value])
            except (pa.ArrowException, TypeError, OverflowError):
                pass
        return pa.array([str(self.value)])


def _facts(properties: Mapping[str, Any]) -> list[Any]:
    return [
        rr.DescribedComponentBatch(_Fact(value), rr.ComponentDescriptor(key))
        for key, value in properties.items()
        if value is not None
    ]


def _send_reference(recording: Any, problem: Problem) -> None:
    path = path_in_world(problem)
    look = {"colors": REFERENCE, "radii": pixels(3.0)}  # wide and pale: it stays visible under the traces
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("reference", rr.LineStrips3D([path], **look), static=True)
    if _planar(problem):
        recording.log("planar/reference", rr.LineStrips2D([_flat(path)], draw_order=20.0, **look), static=True)


def _send_series(recording: Any, problem: Problem, evaluation: Evaluation) -> None:
    time, label, root = columns(evaluation.time), evaluation.label, slug(evaluation.label)
    joints = list(problem.task.arm.description.actuated)
    colors = [style.joint_color(j) for j in range(len(joints))]
    vectors = {"joint_position": evaluation.q, "joint_velocity": evaluation.qd, "joint_torque": evaluation.tau}
    scalars = {
        "kinetic_energy": evaluation.kinetic_energy,
        "energy_integral": evaluation.energy_integral,
        "tracking_error": evaluation.tracking_error,
        "singular_value": evaluation.singular_value,
        "spectral_radius": evaluation.spectral_radius,
    }
    if problem.obstacles is not None:
        scalars["clearance"] = evaluation.clearance
    if evaluation.base.reaction is None:
        scalars["base_turn"] = evaluation.base.turn
    for entity, values in vectors.items():
        lines = rr.SeriesLines(names=joints, colors=[_channels(color) for color in colors], widths=2.0)
        recording.log(f"{root}/{entity}", lines, static=True)
        recording.send_columns(f"{root}/{entity}", time, rr.Scalars.columns(scalars=values))
    event = evaluation.solution.event_time
    legend = style.name(label) + ("" if event is None else f" (singular at {event:.2f} s)")
    for entity, values in scalars.items():
        lines = rr.SeriesLines(names=legend, colors=rgba(label), widths=2.0)
        recording.log(f"{root}/{entity}", lines, static=True)
        recording.send_columns(f"{root}/{entity}", time, rr.Scalars.columns(scalars=values))


def _channels(color: str) -> tuple[int, ...]:
    return tuple(int(color[i : i + 2], 16) for i in (1, 3, 5))


def _send_motion(recording: Any, problem: Problem, evaluation: Evaluation, keep: float) -> None:
    """The pictures of a motion; keep: how much of its colour is left, 1 but for ghosts."""
    rows = _finite(evaluation)
    if not rows.any():
        return
    root, label, time = slug(evaluation.label), evaluation.label, columns(evaluation.time[rows])
    skeleton, color = evaluation.skeleton[rows], faded(evaluation.label, keep)
    _send_arm(recording, problem, evaluation, time, evaluation.q[rows], round(SOLID * keep))
    _send_stick(recording, root, color, time, skeleton, (rr.LineStrips3D, rr.Points3D), {})
    if _planar(problem):
        flat, root = _flat(skeleton), f"planar/{root}"
        above = {"draw_order": 30.0 + 20.0 * keep}  # over its ghosts
        _send_stick(recording, root, color, time, flat, (rr.LineStrips2D, rr.Points2D), above)
        chosen = np.unique(np.rint(np.linspace(0, len(flat) - 1, POSES)).astype(int))
        pale = faded(label, 0.3 * keep)
        poses = rr.LineStrips2D(list(flat[chosen]), colors=pale, radii=pixels(0.8), draw_order=10.0)
        recording.log(f"{root}/poses", poses, static=True)
        arm = problem.task.arm
        if arm.base.kind == "floating":
            edges = rr.LineStrips2D.columns(strips=list(_flat(outlines(arm, evaluation.base)[rows])))
            look = {"colors": color, "radii": pixels(1.5), **above}
            recording.log(f"{root}/spacecraft", rr.LineStrips2D.from_fields(**look), static=True)
            recording.send_columns(f"{root}/spacecraft", time, edges)


def _send_stick(
    recording: Any,
    root: str,
    color: tuple[int, ...],
    time: list[Any],
    skeleton: Array,
    kinds: tuple[Any, Any],
    extra: dict[str, Any],
) -> None:
    """The stick figure (K, n + 1, 2 or 3), its joints, the end effector with its trace; `kinds`: lines and points."""
    lines, dots = kinds
    tip, count = skeleton[:, -1], skeleton.shape[1]
    shown = {"colors": color, **extra}
    recording.log(f"{root}/stick", lines.from_fields(radii=pixels(2.0), **shown), static=True)
    recording.send_columns(f"{root}/stick", time, lines.columns(strips=list(skeleton)))
    recording.log(f"{root}/joints", dots.from_fields(radii=pixels(3.5), **shown), static=True)
    joints = dots.columns(positions=skeleton.reshape(-1, skeleton.shape[2])).partition([count] * len(skeleton))
    recording.send_columns(f"{root}/joints", time, joints)
    recording.log(f"{root}/trace", lines([tip], radii=pixels(1.2), **shown), static=True)
    recording.log(f"{root}/end_effector", dots.from_fields(radii=pixels(5.0), **shown), static=True)
    recording.send_columns(f"{root}/end_effector", time, dots.columns(positions=tip))


def _flat(points: Array) -> Array:
    """World points (..., 3) in a 2-D view (..., 2), which has y pointing down."""
    return points[..., :2] * np.array([1.0, -1.0])


def _send_arm(
    recording: Any, problem: Problem, evaluation: Evaluation, time: list[Any], q: Array, opacity: int
) -> None:
    """The user's own picture of the arm in the colour of the method; without one the stick figure must do."""
    moving = evaluation.base.reaction is None
    rows = _finite(evaluation)
    poses = (evaluation.base.position[rows], evaluation.base.rotation[rows]) if moving else None
    arm, root = problem.task.arm, slug(evaluation.label)
    draw_arm(recording, arm, root, rgba(evaluation.label, opacity), time, q, poses)
    send_tool(recording, arm, root, rgba(evaluation.label, opacity), time, tool_poses(arm, evaluation, rows))
    if moving and arm.base.spacecraft.mass > 0:
        _send_spacecraft(recording, arm, root, rgba(evaluation.label, opacity))


def _send_spacecraft(recording: Any, arm: Arm, root: str, color: tuple[int, ...]) -> None:
    """The box that stands for the spacecraft, in the frame of the root link."""
    shape = box(arm)
    solid = rr.Boxes3D(
        sizes=[shape.size],
        centers=[shape.position],
        quaternions=[Rotation.from_rotvec(shape.rotation).as_quat()],
        colors=[color],
        fill_mode="solid",
    )
    recording.log(f"{root}/spacecraft", rr.CoordinateFrame(f"{root}/{arm.description.base}"), static=True)
    recording.log(f"{root}/spacecraft", solid, static=True)
