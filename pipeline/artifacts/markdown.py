"""summary.md: the summary for people."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd

from pipeline.artifacts.bands import Band, bands, used
from pipeline.artifacts.report import Report
from pipeline.artifacts.table import rows
from pipeline.artifacts.verdict import verdict
from pipeline.common.markdown import markdown_table
from pipeline.config.documents import Printed
from pipeline.evaluation.limits import LIMITS
from pipeline.model.obstacles import Own
from pipeline.problem.integrals import INTEGRALS

UNITS = {
    **{f"{name}_integral": integral.unit for name, integral in INTEGRALS.items()},
    "kinetic_energy_integral_spline": "J s",
    "max_tracking_error": "m",
    "max_tracking_error_between": "m",
    "final_error": "m",
    "max_orientation_error": "rad",
    "max_orientation_error_between": "rad",
    "min_spectral_radius": "kg m²",
    "min_spectral_radius_time": "s",
    "singular_time": "s",
    "min_clearance": "m",
    "min_clearance_between": "m",
    "min_self_clearance": "m",
    "min_self_clearance_time": "s",
    "peak_reaction_force": "N",
    "peak_reaction_torque": "N m",
    "max_base_turn": "rad",
    "final_base_turn": "rad",
    "final_base_shift": "m",
    "max_floating_path_error": "m",
    **dict.fromkeys(("wall_time_s", "update_median_s", "update_95_percent_s", "update_max_s"), "s"),
}


PEAK = re.compile(r"peak_[a-z]+_\d+")
# The groups of rows, by what their columns in summary.csv contain; what is in none stands under the last.
GROUPS = (
    ("Energies", ("integral", "objective", "transversality")),
    ("Tracking", ("error",)),
    ("Limits", ("clearance", "limit")),
    ("Base", ("base", "reaction", "momentum", "floating")),
    ("Solver and all else", ("",)),
)


def markdown(report: Report, table: pd.DataFrame, published: Printed) -> str:
    """The summary for people: the verdict, the motions beside each other, then the details, a row per quantity.

    table: summary.csv, whose published values and differences stand beside.
    """
    motions, config = report.motions, report.motions.config
    reference, arm = motions.problem.reference, motions.problem.task.arm.description
    compared = rows(report)
    lines = [
        f"# {config.name}",
        "",
        f"**{verdict(report)}**",
        "",
        *markdown_table([list(compared[0]), *(list(row.values()) for row in compared)]),
        "",
        f"{arm.name} ({len(arm.actuated)} joints, r = {motions.problem.task.redundancy}), "
        f"path of {reference.geometry.length:.4g} m in {reference.duration:g} s, "
        f"{len(motions.problem.times) - 1} intervals, objective {config.objective.kind}, limits {config.limits.kind}, "
        f"boundary {config.boundary.kind}, base {config.base.kind}, seed {config.seed}.",
        "",
    ]
    for e in motions.evaluations:
        lines.append("; ".join(filter(None, [f"- **{e.label}**: {e.message or e.status.value}", e.solution.evidence])))
    lines += [f"- robot file: {note}" for note in arm.notes]
    lines += own_notes(motions.problem.own)
    lines += [f"- path: {note}" for note in reference.notes]
    for title, group in _details(report, table):
        lines += ["", f"## {title}", "", *markdown_table([["", *(e.label for e in motions.evaluations)], *group])]
    for result in report.results:
        if section := result.section():
            lines += ["", *section]
    if published.document:
        lines += ["", f"Printed values: {published.document}. {published.note}".rstrip()]
    lines += [
        "",
        "Integrals are backward-difference sums on each motion's own grid, as in the documents; *spline* is the "
        "continuous integral of the cubic spline through the knots, free of that quadrature. All values are recomputed "
        "from q(t).",
        "",
    ]
    return "\n".join(lines)


def own_notes(own: Own | None) -> list[str]:
    """What is not known of the arm and itself."""
    if own is None:
        return ["- not checked: self-collision (collision.self=true or false checks it, where the arm has shapes)"]
    if own.unknown:
        return [f"- not checked: self-collision ({own.unknown})"]
    named = ", ".join(" - ".join(pair) for pair in own.always)
    lines = [f"- not checked: {named}, which are as near to each other wherever the arm is"] if named else []
    if own.allowed:
        lines.append(f"- not checked: {own.allowed} pairs of links that the SRDF or collision.allow let touch")
    return lines


def _details(report: Report, table: pd.DataFrame) -> list[tuple[str, list[list[str]]]]:
    """The groups that have rows. Peaks are one row per joint, and limits say how much of them is used, by whom."""
    units = dict(UNITS)
    for result in report.results:
        units |= result.units
    groups: dict[str, list[list[str]]] = {title: [] for title, _ in GROUPS}
    limited = [band for band in bands(report.motions.problem) if band.limited]
    in_words = {f"{band.kind}_limit_excess{suffix}" for band in limited for suffix in ("", "_between")}
    in_words |= {"clearance_limit_excess", "clearance_limit_excess_between"}  # the clearance itself says it
    in_words |= {column for column in table.columns if PEAK.fullmatch(column)}
    for column in table.columns:
        if column in ("method", "optimum", "status", "message", "evidence") or column in in_words:
            continue
        if column.startswith(("published_", "difference_")) or table[column].isin(["", np.nan]).all():
            continue
        title = next(title for title, words in GROUPS if any(word in column for word in words))
        groups[title].append(_row(column, table, units.get(column, "")))
    groups["Limits"] += [_used(report, band) for band in limited]
    peaks = ("Peaks of every joint", _peaks(report, table))
    order = [*((title, groups[title]) for title, _ in GROUPS)]
    return [(title, own) for title, own in [*order[:3], peaks, *order[3:]] if own]


def _row(column: str, table: pd.DataFrame, unit: str) -> list[str]:
    cells = []
    for row in table.to_dict("records"):
        printed = row.get(f"published_{column}", np.nan)
        text = row[column] if isinstance(row[column], str) else "" if pd.isna(row[column]) else f"{row[column]:.4g}"
        if not pd.isna(printed):
            text += f" (printed {printed:.4g}, {100 * row[f'difference_{column}']:+.2g} %)"
        cells.append(text)
    return [column.removesuffix("_s").replace("_", " ") + (f" [{unit}]" if unit else ""), *cells]


def _used(report: Report, band: Band) -> list[str]:
    """How much of the limits of one kind every motion uses at its knots; between them where that is more."""
    cells = []
    for e in report.motions.evaluations:
        found, between = used(report.motions.problem, e, band), e.limit_excess_between.get(band.kind, 0.0)
        more = f", {100 + 100 * between:.4g} % between knots" if between > max(LIMITS, found.share - 1) else ""
        cells.append(
            f"{found.percent} % of {found.bound} ({found.joint}, {found.time:.3g} s){more}" if e.solution.found else ""
        )
    return [f"of the {band.kind}", *cells]


def _peaks(report: Report, table: pd.DataFrame) -> list[list[str]]:
    """A row per joint: what it reaches of each kind that summary.csv has, with units."""
    made = []
    for j, name in enumerate(report.motions.problem.task.arm.description.actuated):
        own = [band for band in bands(report.motions.problem) if f"peak_{band.kind}_{j + 1}" in table]
        cells = []
        for row in table.to_dict("records"):
            values = [(row[f"peak_{band.kind}_{j + 1}"], band.units[j]) for band in own]
            cells.append(", ".join(f"{value:.3g} {unit}" for value, unit in values if not pd.isna(value)))
        made.append([name, *cells])
    return made
