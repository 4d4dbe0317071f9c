"""How long the updates of predictive methods took, and how many were late: quantiles, a histogram, the machine's load.

An update is late if it took longer than the interval between updates. Wall time depends on what else the machine does,
processor time hardly: where the two are far apart, the machine was busy.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.studies import style
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES = {"median": 50.0, "95_percent": 95.0, "99_percent": 99.0, "max": 100.0}
BINS = 40
PER_PANEL = 2.6  # [in]


@dataclass(frozen=True)
class Times:
    """Wall and processor time (K,) [s] of the updates of one motion, and their deadline [s]."""

    wall: Array
    processor: Array
    deadline: float

    def columns(self) -> dict[str, float]:
        """Quantiles [s], and the shares that took longer than the deadline."""
        row: dict[str, float] = {"updates": len(self.wall)}
        for name, took in (("update", self.wall), ("update_processor", self.processor)):
            row |= {f"{name}_{word}_s": float(np.percentile(took, share)) for word, share in QUANTILES.items()}
        row["late_updates"] = float((self.wall > self.deadline).mean())
        row["late_updates_processor"] = float((self.processor > self.deadline).mean())
        return row

    @property
    def sentence(self) -> str:
        """For people."""
        row = self.columns()
        parts = []
        for name, what in (("update_processor", "processor time"), ("update", "wall time")):
            median, most, nearly, longest = (1e3 * row[f"{name}_{word}_s"] for word in QUANTILES)
            parts.append(
                f"{median:.3g} ms of {what} in the median, {most:.3g} ms at 95 %, {nearly:.3g} ms at 99 %, "
                f"{longest:.3g} ms at most"
            )
        return (
            f"{len(self.wall)} updates took {'; '.join(parts)}; {100 * row['late_updates']:.3g} % were later than "
            f"{1e3 * self.deadline:.4g} ms, by processor time {100 * row['late_updates_processor']:.3g} %"
        )


def load() -> str:
    """How busy the machine is: processes that want to run, in the mean of the last minute, and its processors."""
    return f"{os.getloadavg()[0]:.1f} processes on {os.cpu_count()} processors"


def histogram(axes: Axes, times: Times, color: str) -> None:
    """Both kinds of time on a logarithmic axis in ms, with the deadline."""
    both = 1e3 * np.concatenate([times.wall, times.processor])
    edges = np.geomspace(0.9 * max(both.min(), 1e-3), 1.1 * both.max(), BINS)
    for took, label, filled in ((times.processor, "processor time", True), (times.wall, "wall time", False)):
        axes.hist(
            1e3 * took,
            edges.tolist(),
            label=f"{label}: median {1e3 * np.median(took):.3g} ms, 99 % {1e3 * np.percentile(took, 99):.3g} ms",
            histtype="stepfilled" if filled else "step",
            color=color if filled else "#1A202C",
            alpha=0.6 if filled else 1.0,
            linewidth=1.3,
        )
    axes.axvline(
        1e3 * times.deadline, color="#C53030", linestyle=(0, (4, 3)), label=f"deadline {1e3 * times.deadline:.4g} ms"
    )
    axes.set_xscale("log")
    axes.locator_params(axis="y", integer=True)
    axes.set_ylabel("Updates")
    axes.grid(color="#E2E8F0", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    axes.margins(y=0.45)


@dataclass(frozen=True)
class Deadlines(Result):
    """By the label of each motion: its times, and how many of its windows IPOPT confirmed and how far it moved them."""

    name: ClassVar[str] = "updates"
    units: ClassVar[Mapping[str, str]] = {
        **{f"{kind}_{word}_s": "s" for kind in ("update", "update_processor") for word in QUANTILES},
        "apart_from_ipopt": "rad",
    }
    times: Mapping[str, Times]
    confirmed: Mapping[str, tuple[int, float]]
    load: str

    def section(self) -> list[str]:
        lines = []
        for label, times in self.times.items():
            count, apart = self.confirmed[label]
            moved = f", which moved no joint by more than {apart:.1e} rad" if count else ""
            sure = f"{count} of them were confirmed by IPOPT{moved}"
            lines.append(f"Updates of {label}: {times.sentence}; {sure}. The machine: {self.load}.")
        return lines

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        if motion.label not in self.times:
            return {}
        count, apart = self.confirmed[motion.label]
        return {**self.times[motion.label].columns(), "confirmed_updates": count, "apart_from_ipopt": apart}

    def facts(self) -> Mapping[str, Any]:
        return {"machine": self.load, **{label: times.columns() for label, times in self.times.items()}}

    def figures(self, title: str) -> Mapping[str, Figure]:
        figure = style.sheet(8.0, 0.9 + PER_PANEL * len(self.times))
        panels = figure.subplots(len(self.times), 1, squeeze=False)[:, 0]
        for axes, (label, times) in zip(panels, self.times.items(), strict=True):
            histogram(axes, times, style.color(label))
            axes.set_title(style.name(label), fontsize=10, loc="left")
        panels[-1].set_xlabel(f"Time of an update [ms]; the machine: {self.load}")
        figure.suptitle(f"{title}: how long updates took", fontweight="bold")
        return {"updates": figure}


def study(motions: Motions) -> Deadlines | None:
    """Where a method predicts."""
    times, confirmed = {}, {}
    for e in motions.evaluations:
        log = e.solution.statistics.get("predictions")
        if log:
            wall, processor = (np.array([entry[key] for entry in log]) for key in ("wall_time_s", "processor_time_s"))
            times[e.label] = Times(wall, processor, float(e.solution.statistics["update_interval"]))
            apart = [entry["apart_from_ipopt"] for entry in log if entry["apart_from_ipopt"] is not None]
            confirmed[e.label] = len(apart), max(apart, default=np.nan)
    return Deadlines(times, confirmed, load()) if times else None
