"""report.html: one file that shows a run, or several, in any browser and without a network."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from functools import cache, partial
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader

from pipeline.artifacts.page import content
from pipeline.artifacts.report import Report
from pipeline.common.errors import OutputError
from pipeline.common.files import write_beside

PAGE = "report.html"
HERE = Path(__file__).parent
# uPlot, 44 kB: a package that ships it is installed with this one; nothing of it is imported, the file is read.
SHIPS_UPLOT, UPLOT = "metaflow-card-uplot", "metaflow_extensions/card_uplot/plugins/cards/uplot/uplot"
DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)


def write(report: Report, folder: Path) -> None:
    """report.html in `folder`."""
    own = content.run(report)
    save(folder / PAGE, own["name"], [own], made=_made(report.facts))


def save(
    file: Path,
    title: str,
    runs: Sequence[Mapping[str, Any]],
    *,
    plane: Mapping[str, Any] | None = None,
    notes: Sequence[str] = (),
    made: str = "",
) -> None:
    """The page of `runs` (`content.run`). plane: in which their motions, counted through, are chosen; None: its own."""
    text = html(title, runs, plane, notes, made)
    write_beside(file, partial(Path.write_text, data=text, encoding="utf-8"))


def html(
    title: str, runs: Sequence[Mapping[str, Any]], plane: Mapping[str, Any] | None, notes: Sequence[str], made: str
) -> str:
    titles, table = _table(runs)
    data = json.dumps({"runs": runs, "plane": plane}, allow_nan=False).replace("</", "<\\/")
    environment = Environment(loader=FileSystemLoader(HERE), autoescape=True, trim_blocks=True)
    return environment.get_template("page.html.j2").render(
        title=title,
        runs=runs,
        notes=notes,
        titles=titles,
        table=table,
        moving=any(run["motions"] for run in runs),
        data=data,
        library=library("uPlot.iife.min.js"),
        library_style=library("uPlot.min.css"),
        style=(HERE / "style.css").read_text(encoding="utf-8"),
        script="\n".join((HERE / f"{name}.js").read_text(encoding="utf-8") for name in ("scene", "plots", "page")),
        made=made,
    )


def read(folder: Path) -> list[dict[str, Any]]:
    """The runs on the page of `folder`; raises OutputError where there is none."""
    file = folder / PAGE
    if not file.is_file():
        raise OutputError(f"{folder}: no {PAGE} there; run it again with this version")
    found = DATA.search(file.read_text(encoding="utf-8"))
    if found is None:
        return []
    runs: list[dict[str, Any]] = json.loads(found[1])["runs"]
    return runs


@cache
def library(name: str) -> str:
    """A file of uPlot, from the installed package."""
    return Path(str(distribution(SHIPS_UPLOT).locate_file(f"{UPLOT}/{name}"))).read_text(encoding="utf-8")


def _table(runs: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[dict[str, Any]]]:
    """The rows of all runs under the titles of all of them; `motion` counts those that move."""
    several = len(runs) > 1
    titles = list(dict.fromkeys(title for run in runs for row in run["table"] for title in row))
    rows, count = [], 0
    for run in runs:
        moving = {motion["label"] for motion in run["motions"]}
        for row in run["table"]:
            moves = row["motion"] in moving
            cells = [*([run["name"]] if several else []), *(row.get(title, "") for title in titles)]
            rows.append({"motion": count if moves else None, "cells": cells})
            count += moves
    return [*(["run"] if several else []), *titles], rows


def _made(facts: Mapping[str, Any]) -> str:
    known = (f"{key} {facts[key]}" for key in ("selfmotion", "drake", "seed") if key in facts)
    return ", ".join(known)
