"""The tables of a run: summary.csv and summary.md, trajectories.parquet, and those that its studies have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.artifacts.markdown import markdown
from pipeline.artifacts.report import Report
from pipeline.common.files import write_beside
from pipeline.config.documents import printed_for
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.task import PositionTask
from pipeline.problem.integrals import INTEGRALS
from pipeline.problem.problem import Problem


def write(report: Report, folder: Path) -> None:
    """All of them into `folder`."""
    motions = report.motions.evaluations
    for result in report.results:
        for name, table in result.tables().items():
            write_beside(folder / f"{name}.csv", partial(table.to_csv, index=False))
    write_beside(folder / "summary.csv", partial(summary(report).to_csv, index=False))
    write_beside(folder / "summary.md", lambda file: file.write_text(text(report), encoding="utf-8"))
    write_beside(folder / "trajectories.parquet", partial(trajectories(motions).to_parquet, index=False))


def text(report: Report) -> str:
    """summary.md: the summary for people."""
    return markdown(report, summary(report), printed_for(report.motions.config.name))


def summary(report: Report) -> pd.DataFrame:
    """One row per motion; `published_*` and `difference_*` (relative) columns where a document prints the number."""
    motions, printed = report.motions, printed_for(report.motions.config.name)
    rows: list[dict[str, Any]] = []
    for e in motions.evaluations:
        row = _row(motions.problem, e)
        for result in report.results:
            row |= result.columns(e)
        row["wall_time_s"] = report.seconds[e.method]
        if e.solution.optimum == 1:
            row |= _differences(row, printed.numbers.get(e.method, {}))
        if printed.note and not rows:
            row["published_note"] = printed.note
        rows.append(row)
    return pd.DataFrame(rows)


def _differences(row: Mapping[str, Any], printed: Mapping[str, float]) -> dict[str, float]:
    beside = {}
    for column, value in printed.items():
        beside[f"published_{column}"] = value
        beside[f"difference_{column}"] = row[column] / value - 1 if column in row else np.nan
    return beside


def trajectories(evaluations: Sequence[Evaluation]) -> pd.DataFrame:
    """The long table: method, optimum, then the columns of `Evaluation.to_frame`."""
    parts = []
    for e in evaluations:
        part = e.to_frame()
        part.insert(0, "method", e.method)
        part.insert(1, "optimum", e.solution.optimum)
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def _first_order(problem: Problem, e: Evaluation) -> dict[str, Any]:
    """What an objective beyond kinetic energy and torque adds: the whole of it, and its parts."""
    objective = problem.objective
    if not objective.weight("velocity_norm") and objective.secondary is None:
        return {}
    return {
        "objective": e.objective,
        "objective_spline": e.objective_spline,
        "velocity_norm_integral": e.velocity_norm_integral[-1],
        "secondary_integral": float(np.trapezoid(e.secondary, e.time)),
        "objective_of_method": e.solution.statistics.get("integral", np.nan),
        "transversality_start": e.solution.statistics.get("transversality_start", np.nan),
        "transversality_end": e.solution.statistics.get("transversality_end", np.nan),
    }


def _orientation(problem: Problem, e: Evaluation) -> dict[str, Any]:
    if isinstance(problem.task, PositionTask):
        return {}
    return {
        "max_orientation_error": e.orientation_error.max(),
        "max_orientation_error_between": e.orientation_error_between,
    }


def _base(problem: Problem, e: Evaluation) -> dict[str, Any]:
    """What a floating base does, or what a base that stands still feels."""
    base = e.base
    if base.reaction is not None:
        peaks = [float(np.linalg.norm(base.reaction[:, part], axis=1).max()) for part in (slice(3), slice(3, 6))]
        row = dict(zip(("peak_reaction_force", "peak_reaction_torque"), peaks, strict=True))
        of_held = [name for name, integral in INTEGRALS.items() if integral.base == "held"]
        names = of_held if problem.task.arm.base.count else []
        return row | {f"{name}_integral": e.integral(name) for name in names}
    # As it is integrated from the joints; a method's own base states drift from that between its steps.
    floating = base.floating
    turn, position = (base.turn, base.position) if floating is None else (floating.turn, floating.position)
    return {
        "max_base_turn": turn.max(),
        "final_base_turn": turn[-1],
        "final_base_shift": float(np.linalg.norm(position[-1] - position[0])),
        "base_rotation_integral": e.integral("base_rotation"),
        "linear_momentum_residual": np.nan if floating is None else floating.linear,
        "angular_momentum_residual": np.nan if floating is None else floating.angular,
        "max_floating_path_error": np.nan if floating is None else floating.path_error,
    }


def _row(problem: Problem, e: Evaluation) -> dict[str, Any]:
    usable = _usable(e)
    radius = int(np.argmin(e.spectral_radius[:usable]))
    row: dict[str, Any] = {
        "method": e.method,
        "optimum": e.solution.optimum,
        "status": e.status.word,
        "message": e.message,
        "evidence": e.solution.evidence,
        "kinetic_energy_integral": e.energy_integral[-1],
        "torque_integral": e.torque_integral[-1],
        "kinetic_energy_integral_spline": e.energy_integral_spline,
        **_first_order(problem, e),
        "max_tracking_error": e.tracking_error.max(),
        "max_tracking_error_between": e.tracking_error_between,
        "final_error": e.tracking_error[-1],
        **_orientation(problem, e),
    }
    peaks = {"velocity": e.qd, "torque": e.tau, "power": e.power}
    if problem.bounds.smooth or any(problem.rest):
        peaks["acceleration"] = e.qdd
    for name, values in peaks.items():
        row |= {f"peak_{name}_{j + 1}": peak for j, peak in enumerate(np.abs(values).max(axis=0))}
    row |= _base(problem, e)
    if problem.obstacles is not None:
        row |= {"min_clearance": e.clearance.min(), "min_clearance_between": e.clearance_between}
    own = e.near.own
    if np.isfinite(own.bound):
        row |= {"min_self_clearance": own.bound, "min_self_clearance_time": own.time}
        row |= {"min_self_clearance_links": f"{own.first} - {own.second}"}
    for suffix, excess in (("", e.limit_excess), ("_between", e.limit_excess_between)):
        row |= {f"{kind}_limit_excess{suffix}": value for kind, value in excess.items()}
    row |= {
        "min_singular_value": e.singular_value[:usable].min(),
        "min_spectral_radius": e.spectral_radius[radius],
        "min_spectral_radius_time": e.time[radius],
        "starts_in_basin": e.solution.statistics.get("starts_in_basin", np.nan),
        "grid_error": e.solution.statistics.get("grid_error", np.nan),
        "kind": e.solution.statistics.get("kind", ""),
        "singular_time": np.nan if e.solution.event_time is None else e.solution.event_time,
    }
    return row if e.solution.found else _without_numbers(row)


def _usable(e: Evaluation) -> int:
    """How many knots lie before the singularity that a motion met, if it met one: behind it its numbers say nothing."""
    event = e.solution.event_time
    return len(e.time) if event is None else max(1, int(np.searchsorted(e.time, event, side="right")))


def _without_numbers(row: dict[str, Any]) -> dict[str, Any]:
    """The row of a method that found no motion: an arm that stands still costs nothing, and that is no result."""
    return {key: np.nan if isinstance(value, float) else value for key, value in row.items()}
