"""How a recording opens: arms and summary on the left, energies of all motions in the middle, joints on the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pipeline.common.arrays import Array
from pipeline.studies import style

BACKGROUND = (255, 255, 255)  # the colours of style.py are made for white


GRID = (120, 120, 120, 60)


MANY = 8  # motions that can be told apart in one view


ENERGIES = {
    "energy_integral": "Kinetic-energy integral [J s]",
    "kinetic_energy": "Kinetic energy T [J]",
}


CHECKS = {
    "tracking_error": "Tracking error [m]",
    "singular_value": "Smallest singular value",
    "spectral_radius": "Spectral radius of M",
}


FLOATING = {"base_turn": "Turn of the base [rad]"}  # first of the checks where the base floats
AMONG = {"clearance": "Clearance [m]"}  # and where there are obstacles


def slug(label: str) -> str:
    """The entity of a motion, one path element: `global 2` -> `global_2`."""
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in label)


def build(
    labels: Sequence[str],
    points: Array,
    revolute: Sequence[bool],
    planar: bool,
    ranges: Mapping[str, tuple[float, float]],
    picture: str = "",
    floats: bool = False,
    among: bool = False,
    first: str = "",
    outside: Mapping[str, str] | None = None,
) -> rrb.Blueprint:
    """The layout for the motions `labels`; the cameras take in `points` (P, 3) [m], all of the scene.

    revolute: (n,) which joints turn; it decides on the units in the titles.
    ranges: the lowest and highest value to show of an entity such as `kinetic_energy`; others show all there is.
    among: whether there are obstacles. first: the label of the motion whose joints are shown first.
    outside: what a plot's title says of limits that it does not draw, by entity.
    picture: the title of one that is shown in the first tab, if any. With more than MANY motions the first, the last
    and `first` are shown, and the panel on the left is open, where the eye beside each motion shows or hides it.
    """
    hidden = [label for label in labels[1:-1] if label != first] if len(labels) > MANY else []
    arms = _space(labels, points, planar, hidden)
    if planar:
        arms = rrb.Tabs(_plane(labels, points, hidden), arms, name="Arms")
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    if picture:
        summary = rrb.Tabs(rrb.Spatial2DView(origin="/picture", name=picture), summary)
    compared = {
        entity: _compare(labels, entity, title, ranges.get(entity))
        for entity, title in (ENERGIES | CHECKS | FLOATING | AMONG).items()
    }
    checked = (FLOATING if floats else {}) | (AMONG if among else {}) | CHECKS
    checks = rrb.Tabs(*[compared[entity] for entity in checked], name="Checks")
    opens = labels.index(first) if first in labels else 0
    joints = rrb.Tabs(*[_joints(label, revolute, outside or {}) for label in labels], active_tab=opens, name="Joints")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(arms, summary, row_shares=[5, 3]),
            rrb.Vertical(*[compared[entity] for entity in ENERGIES], checks, row_shares=[1, 1, 1]),
            joints,
            column_shares=[5, 4, 4],
        ),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="paused", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="expanded" if hidden else "hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _hide(hidden: Sequence[str], prefix: str = "") -> dict[str, Any]:
    return {f"{prefix}/{slug(label)}": rrb.EntityBehavior(visible=False) for label in hidden}


def _space(labels: Sequence[str], points: Array, planar: bool, hidden: Sequence[str]) -> Any:
    """A 3-D view of everything; a planar arm is seen from steeply above, others from the side."""
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    size = max(float(np.linalg.norm(points - center, axis=1).max()), 1e-6)
    direction = np.array([0.15, -0.75, 1.0] if planar else [1.0, -1.2, 0.7])
    eye = center + 2.4 * size * direction / np.linalg.norm(direction)  # a sphere of `size` fills the field of view
    return rrb.Spatial3DView(
        origin="/",
        contents=["/reference", "/obstacles/**", *(f"/{slug(label)}/**" for label in labels)],
        name="Arms (3-D)",
        overrides=_hide(hidden),
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=10.0 ** np.floor(np.log10(size)) / 2, color=GRID),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=center, eye_up=(0.0, 0.0, 1.0)),
    )


def _plane(labels: Sequence[str], points: Array, hidden: Sequence[str]) -> Any:
    """The view from above. Rerun's 2-D views have y pointing down, so everything in `/planar` is logged with -y."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    margin = 0.08 * max(float((high - low).max()), 1e-6)
    return rrb.Spatial2DView(
        origin="/planar",
        contents=["/planar/reference", "/planar/obstacles/**", *(f"/planar/{slug(label)}/**" for label in labels)],
        name="Arms (plane)",
        overrides=_hide(hidden, "/planar"),
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=(low[0] - margin, high[0] + margin), y_range=(-high[1] - margin, -low[1] + margin)
        ),
    )


def _compare(labels: Sequence[str], entity: str, title: str, shown: tuple[float, float] | None) -> Any:
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"/limits/{entity}", *(f"/{slug(label)}/{entity}" for label in labels)],
        name=title,
        axis_y=None if shown is None else rrb.ScalarAxis(range=shown),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )


def _joints(label: str, revolute: Sequence[bool], outside: Mapping[str, str]) -> Any:
    """Positions, velocities and torques of one motion below one another, with their limits."""
    turn, slide = any(revolute), not all(revolute)
    units = {
        "joint_position": ("Joint positions", "rad", "m"),
        "joint_velocity": ("Joint velocities", "rad/s", "m/s"),
        "joint_torque": ("Joint torques", "N m", "N"),
    }
    views = [
        rrb.TimeSeriesView(
            origin="/",
            contents=[f"/{slug(label)}/{entity}", f"/limits/{entity}"],
            name=f"{title} [{', '.join([unit_turn] * turn + [unit_slide] * slide)}]"
            + (f", {outside[entity]}" if entity in outside else ""),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        )
        for entity, (title, unit_turn, unit_slide) in units.items()
    ]
    return rrb.Vertical(*views, name=style.name(label))


def rgba(label: str, alpha: int = 255) -> tuple[int, int, int, int]:
    """The colour of a motion as Rerun takes it."""
    red, green, blue = (int(style.color(label)[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue, alpha


def faded(label: str, keep: float) -> tuple[int, int, int]:
    """The colour of a motion mixed with the background: lines know no transparency."""
    red, green, blue = (
        round(keep * channel + (1 - keep) * white) for channel, white in zip(rgba(label)[:3], BACKGROUND, strict=True)
    )
    return red, green, blue


def pixels(size: float) -> Any:
    """A radius in points of the screen, so that lines are as thick for an arm of any size."""
    return rr.Radius.ui_points(size)
