"""Colours and names that every picture of a run shares: one colour per method, one per joint, readable on white."""

from __future__ import annotations

import colorsys
from typing import TYPE_CHECKING

from pipeline.methods.registry import METHODS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Joints 1, 2, 3 are blue, red and yellow in the papers; the others keep apart from them and from one another.
JOINT_COLORS = ("#1F5FBF", "#C62828", "#D9A400", "#2E8B57", "#7B3FA0", "#00838F", "#8D5524", "#D81B7A", "#5A6472")


UNKNOWN = "#44403C"


# In the order of the registry, so that LSV, PMKE and the planner, which often coincide, differ.
DASHES: tuple[str | tuple[int, tuple[float, ...]], ...] = (
    "-",
    (0, (1, 1.2)),
    (0, (6, 2)),
    (0, (3, 1.5)),
    (0, (4, 2.5)),
)


FRONT = 19  # points after the first over which a front's hues run from blue to red


def _split(label: str) -> tuple[str, int]:
    """`global 2` -> `global`, 2; a label without a number is the first optimum of its method."""
    method, _, number = label.rpartition(" ")
    return (method, int(number)) if method and number.isdigit() else (label, 1)


def color(label: str) -> str:
    """The colour `#RRGGBB` of a motion: its method's, lighter for every further optimum; a front runs through hues."""
    method, optimum = _split(label)
    if method == "pareto":
        hue = 0.62 - 0.62 * min(1.0, (optimum - 1) / FRONT)
        return "#" + "".join(f"{round(255 * channel):02X}" for channel in colorsys.hsv_to_rgb(hue, 0.75, 0.75))
    base = METHODS[method].color if method in METHODS else UNKNOWN
    keep = max(0.75 ** (optimum - 1), 0.35)
    channels = (int(base[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 - keep * (255 - channel)):02X}" for channel in channels)


def dashes(label: str) -> str | tuple[int, tuple[float, ...]]:
    """The line style of a motion, by its method: baselines whole, everything else broken in its own way."""
    method, _ = _split(label)
    number = list(METHODS).index(method) if method in METHODS else 0
    return DASHES[number % len(DASHES)]


def name(label: str) -> str:
    """The name of a motion for legends and titles: `Planner's optimum 2`."""
    method, optimum = _split(label)
    numbered = optimum > 1 or method in ("pareto", "segments")
    title = METHODS[method].title if method in METHODS else method
    return title + (f" {optimum}" if numbered else "")


def joint_color(joint: int) -> str:
    """The colour `#RRGGBB` of joint 0, 1, ...: the table is run through again after its end."""
    return JOINT_COLORS[joint % len(JOINT_COLORS)]


def sheet(width: float, height: float) -> Figure:
    """An empty figure of this size [inch]. Whoever draws nothing does not wait for matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
