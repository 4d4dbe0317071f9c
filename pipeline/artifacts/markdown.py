"""summary.md: the summary for people."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.config.documents import Printed
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.studies import certificate, export
from pipeline.studies.front import hypervolume
from pipeline.studies.studies import Extras

UNITS = {
    "kinetic_energy_integral": "J s",
    "kinetic_energy_integral_spline": "J s",
    "torque_integral": "N² m² s",
    "max_tracking_error": "m",
    "max_tracking_error_between": "m",
    "final_error": "m",
    "max_orientation_error": "rad",
    "max_orientation_error_between": "rad",
    "velocity_norm_integral": "rad²/s",
    "peak_velocity": "rad/s",
    "peak_torque": "N m",
    "peak_power": "W",
    "min_spectral_radius": "kg m²",
    "min_spectral_radius_time": "s",
    "singular_time": "s",
    "min_clearance": "m",
    "export_tracking_error": "m",
    "closed_loop_joint_error": "rad",
    "closed_loop_tracking_error": "m",
    "min_clearance_between": "m",
    "peak_reaction_force": "N",
    "peak_reaction_torque": "N m",
    "reaction_force_integral": "N² s",
    "reaction_torque_integral": "N² m² s",
    "max_base_turn": "rad",
    "final_base_turn": "rad",
    "final_base_shift": "m",
    "base_rotation_integral": "rad²/s",
    "max_floating_path_error": "m",
    "wall_time_s": "s",
}


def markdown(
    config: RunConfig,
    problem: Problem,
    evaluations: Sequence[Evaluation],
    table: pd.DataFrame,
    extras: Extras,
    published: Printed,
) -> str:
    """The summary for people: a row per quantity and a column per motion, published values and differences beside."""
    reference = problem.reference
    arm = problem.task.arm.description
    lines = [
        f"# {config.name}",
        "",
        f"{arm.name} ({len(arm.actuated)} joints, r = {problem.task.redundancy}), path of {reference.geometry.length:.4g} m "
        f"in {reference.duration:g} s, {len(problem.times) - 1} intervals, objective {config.objective.kind}, "
        f"limits {config.limits.kind}, boundary {config.boundary.kind}, base {config.base.kind}, seed {config.seed}.",
        "",
        *markdown_table(_by_quantity(evaluations, table)),
        "",
    ]
    lines += [f"- **{e.label}**: {e.message or e.status.value}" for e in evaluations]
    if extras.certificate is not None:
        grid = next(e for e in evaluations if e.method == "dynamic_programming")
        lines += ["", f"Certificate: {certificate.sentence(extras.certificate, len(grid.time) - 1)}."]
    if extras.validation is not None:
        lines += ["", "## Planner and calculus of variations", "", *markdown_table(_cells(extras.validation))]
    if extras.front is not None:
        good = extras.front[extras.front["status"] == "optimal"]
        share = hypervolume(good[extras.front.columns[2:4]].to_numpy())
        lines += ["", "## Pareto front", "", f"Hypervolume {share:.4f} of the rectangle between the extremes.", ""]
        lines += markdown_table(_cells(extras.front.drop(columns=["solver_status"])))
    if extras.convergence is not None:
        lines += ["", "## Planner on finer grids, against the extremal of the maximum principle", ""]
        lines += markdown_table(_cells(extras.convergence))
    if extras.identification is not None:
        found = extras.identification
        lines += ["", f"## Masses [kg], with intervals of {found.confidence:.0%} confidence", ""]
        lines += markdown_table(_cells(found.masses))
        lines += ["", "## What the printed and the identified masses give (residuals in units of the rounding)", ""]
        lines += markdown_table(_cells(found.numbers))
    if extras.exported is not None:
        lines += ["", f"Exported: {export.sentence(extras.exported)}."]
    elif config.export.method == "best":
        lines += [
            "",
            "Exported: nothing, since no confirmed motion keeps every limit (export.method names one anyway).",
        ]
    if extras.closed_loop is not None:
        lines += ["", f"Closed loop: {extras.closed_loop.sentence}."]
    if extras.study is not None:
        study = extras.study
        lines += [
            "",
            f"Candidates: distance = exp({study.intercept:.4f}) N^{study.exponent:.4f} from N = {study.parameters} on; the paper prints exp(-4.0733) N^-0.2030.",
        ]
    if published.document:
        lines += ["", f"Printed values: {published.document}. {published.note}".rstrip()]
    lines += [
        "",
        "Integrals are backward-difference sums on each motion's own grid, as in the documents; *spline* is the continuous "
        "integral of the cubic spline through the knots, free of that quadrature. All values are recomputed from q(t).",
        "",
    ]
    return "\n".join(lines)


def _by_quantity(evaluations: Sequence[Evaluation], table: pd.DataFrame) -> list[list[str]]:
    rows = [["", *(e.label for e in evaluations)]]
    skipped = ("method", "optimum", "message")
    for column in table.columns:
        if (
            column in skipped
            or column.startswith(("published_", "difference_"))
            or table[column].isin(["", np.nan]).all()
        ):
            continue
        unit = UNITS.get(column, UNITS.get(re.sub(r"_\d+$", "", column), ""))
        cells = []
        for row in table.to_dict("records"):
            printed = row.get(f"published_{column}", np.nan)
            text = row[column] if isinstance(row[column], str) else "" if pd.isna(row[column]) else f"{row[column]:.4g}"
            if not pd.isna(printed):
                text += f" (printed {printed:.4g}, {100 * row[f'difference_{column}']:+.2g} %)"
            cells.append(text)
        rows.append([column.removesuffix("_s").replace("_", " ") + (f" [{unit}]" if unit else ""), *cells])
    return rows


def markdown_table(rows: list[list[str]]) -> list[str]:
    head, *body = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return [head, "|---|" + "---:|" * (len(rows[0]) - 1), *body]


def _cells(table: pd.DataFrame) -> list[list[str]]:
    rows = [[column.replace("_", " ") for column in table.columns]]
    for record in table.to_numpy():
        rows.append([_cell(value) for value in record])
    return rows


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else ""
    if isinstance(value, str):
        return value
    return "" if pd.isna(value) or np.isinf(value) else f"{value:.5g}"
