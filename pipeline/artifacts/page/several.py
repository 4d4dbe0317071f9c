"""One page over several runs: that of a sweep, or of runs that are compared."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.artifacts.page.page import PAGE, read, save
from pipeline.artifacts.sweep import swept_by

MOST = 24  # runs whose motions the page holds; of more it says so


def write(folder: Path, title: str, runs: Sequence[Path], names: Sequence[str]) -> None:
    """report.html in `folder` of the runs in these folders, called `names`, if any of them has left a page."""
    words = swept_by(runs)
    there = [number for number, run in enumerate(runs) if (run / PAGE).is_file()]
    shown, content = there[:MOST], []
    for number in shown:
        own = read(runs[number])
        content += [{**run, "name": names[number]} for run in own]
    if not content:
        return
    together = [motion for run in content for motion in run["motions"]]
    for number, motion in enumerate(together):
        motion["color"] = _shade(number / max(1, len(together)))
    notes = [f"{names[number]} has left no page." for number in range(len(runs)) if number not in there]
    if len(there) > len(shown):
        notes.append(
            f"The first {len(shown)} of {len(there)} runs are shown; each has a page of its own in its folder."
        )
    save(folder / PAGE, title, content, plane=_plane(content, [words[number] for number in shown]), notes=notes)


def _plane(runs: Sequence[Mapping[str, Any]], words: Sequence[Mapping[str, str]]) -> dict[str, Any] | None:
    """The first cost of every motion over what was swept, where that is one number, else over the runs' order."""
    keys = list(words[0]) if words else []
    swept = [_number(own[keys[0]]) for own in words] if len(keys) == 1 else [None]
    numbers = [value for value in swept if value is not None]
    ordered = len(numbers) != len(runs)
    costs = {cost for run in runs for motion in run["motions"] for cost in motion["costs"]}
    shared = [cost for cost in costs if all(cost in motion["costs"] for run in runs for motion in run["motions"])]
    if not shared:
        return None
    first = next(cost for cost in next(run for run in runs if run["motions"])["motions"][0]["costs"] if cost in shared)
    points, count = [], 0
    for number, run in enumerate(runs):
        for motion in run["motions"]:
            if motion["until"] is None:
                x = number + 1 if ordered else numbers[number]
                points.append({"motion": count, "x": x, "y": motion["costs"][first], "mark": "", "good": True})
            count += 1
    if not points:
        return None
    across = "run, in the order of the table" if ordered else keys[0]
    return {"title": "Costs of all runs", "x": across, "y": first, "step": False, "points": points}


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _shade(share: float) -> str:
    """A hue of its own, darker or lighter by turns: methods' colours repeat from run to run."""
    red, green, blue = colorsys.hls_to_rgb(share, 0.36 + 0.14 * (round(1000 * share) % 2), 0.75)
    return f"#{round(255 * red):02X}{round(255 * green):02X}{round(255 * blue):02X}"
