"""summary.md: the summary for people."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.artifacts.report import Report
from pipeline.common.markdown import markdown_table
from pipeline.config.documents import Printed
from pipeline.evaluation.evaluation import Evaluation
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
    "peak_velocity": "rad/s",
    "peak_acceleration": "rad/s²",
    "peak_torque": "N m",
    "peak_power": "W",
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
    "wall_time_s": "s",
}


def markdown(report: Report, table: pd.DataFrame, published: Printed) -> str:
    """The summary for people: a row per quantity and a column per motion, published values and differences beside.

    table: summary.csv.
    """
    motions, config = report.motions, report.motions.config
    reference, arm = motions.problem.reference, motions.problem.task.arm.description
    units = dict(UNITS)
    for result in report.results:
        units |= result.units
    lines = [
        f"# {config.name}",
        "",
        f"{arm.name} ({len(arm.actuated)} joints, r = {motions.problem.task.redundancy}), "
        f"path of {reference.geometry.length:.4g} m in {reference.duration:g} s, "
        f"{len(motions.problem.times) - 1} intervals, objective {config.objective.kind}, limits {config.limits.kind}, "
        f"boundary {config.boundary.kind}, base {config.base.kind}, seed {config.seed}.",
        "",
        *markdown_table(_by_quantity(motions.evaluations, table, units)),
        "",
    ]
    for e in motions.evaluations:
        lines.append("; ".join(filter(None, [f"- **{e.label}**: {e.message or e.status.value}", e.solution.evidence])))
    lines += [f"- robot file: {note}" for note in arm.notes]
    lines += own_notes(motions.problem.own)
    lines += [f"- path: {note}" for note in reference.notes]
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
    lines = [f"- not checked: {named}, which touch wherever the arm is"] if named else []
    if own.allowed:
        lines.append(f"- not checked: {own.allowed} pairs of links that the SRDF or collision.allow let touch")
    return lines


def _by_quantity(evaluations: Sequence[Evaluation], table: pd.DataFrame, units: Mapping[str, str]) -> list[list[str]]:
    rows = [["", *(e.label for e in evaluations)]]
    skipped, records = ("method", "optimum", "message", "evidence"), table.to_dict("records")
    for column in table.columns:
        if (
            column in skipped
            or column.startswith(("published_", "difference_"))
            or table[column].isin(["", np.nan]).all()
        ):
            continue
        unit = units.get(column, units.get(re.sub(r"_\d+$", "", column), ""))
        cells = []
        for row in records:
            printed = row.get(f"published_{column}", np.nan)
            text = row[column] if isinstance(row[column], str) else "" if pd.isna(row[column]) else f"{row[column]:.4g}"
            if not pd.isna(printed):
                text += f" (printed {printed:.4g}, {100 * row[f'difference_{column}']:+.2g} %)"
            cells.append(text)
        rows.append([column.removesuffix("_s").replace("_", " ") + (f" [{unit}]" if unit else ""), *cells])
    return rows
