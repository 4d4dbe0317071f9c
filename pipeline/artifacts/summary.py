"""The tables of a run: summary.csv, summary.md, trajectories.parquet, run.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.artifacts.record import trajectories
from pipeline.common.files import write_beside
from pipeline.config.studies import PublishedConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.task import PositionTask
from pipeline.problem.problem import Problem
from pipeline.studies.studies import NOTHING, Extras


def summary(
    problem: Problem,
    evaluations: Sequence[Evaluation],
    wall_times: Mapping[str, float],
    published: PublishedConfig,
    extras: Extras = NOTHING,
) -> pd.DataFrame:
    """One row per motion; `published_*` and `difference_*` (relative) columns where a document prints the number."""
    rows = []
    for evaluation in evaluations:
        row = _row(problem, evaluation) | _sent(evaluation, extras)
        row["wall_time_s"] = wall_times[evaluation.method]
        if evaluation.solution.optimum == 1:
            for column, printed in published.values.get(evaluation.method, {}).items():
                row[f"published_{column}"] = printed
                row[f"difference_{column}"] = row[column] / printed - 1 if column in row else np.nan
            if evaluation is evaluations[0] and published.note:
                row["published_note"] = published.note
        rows.append(row)
    return pd.DataFrame(rows)


def _first_order(problem: Problem, e: Evaluation) -> dict[str, Any]:
    """What an objective beyond kinetic energy and torque adds: the whole of it, and its parts."""
    weights = problem.objective
    if not weights.velocity_norm and weights.secondary is None:
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


def _sent(e: Evaluation, extras: Extras) -> dict[str, Any]:
    """What became of the motion that is exported and simulated; others have none of these columns' values."""
    row: dict[str, Any] = {}
    motion, loop = extras.exported, extras.closed_loop
    if motion is not None and (motion.method, motion.optimum) == (e.method, e.solution.optimum):
        row["export_tracking_error"] = motion.tracking_error
        row |= {f"export_{kind}_limit_excess": excess for kind, excess in motion.limit_excess.items()}
    if loop is not None and (loop.method, loop.optimum) == (e.method, e.solution.optimum):
        row |= {
            "closed_loop_joint_error": np.abs(loop.joint_error).max(),
            "closed_loop_tracking_error": loop.end_effector_error.max(),
            "closed_loop_saturation": loop.saturation,
        }
    return row


def _updates(e: Evaluation) -> dict[str, Any]:
    """How long the updates of a predictive method took, and the share that took longer than its update interval."""
    log = e.solution.statistics.get("predictions")
    if not log:
        return {}
    took = np.array([entry["wall_time_s"] for entry in log])
    deadline = e.solution.statistics["update_interval"]
    return {
        "updates": len(took),
        "update_median_s": float(np.median(took)),
        "update_95_percent_s": float(np.percentile(took, 95)),
        "update_max_s": float(took.max()),
        "late_updates": float((took > deadline).mean()),
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
        names = ("reaction_force", "reaction_torque") if problem.task.arm.base.count else ()
        return row | {f"{name}_integral": e.integral(name) for name in names}
    floating = base.floating
    return {
        "max_base_turn": base.turn.max(),
        "final_base_turn": base.turn[-1],
        "final_base_shift": float(np.linalg.norm(base.position[-1] - base.position[0])),
        "base_rotation_integral": e.integral("base_rotation"),
        "linear_momentum_residual": np.nan if floating is None else floating.linear,
        "angular_momentum_residual": np.nan if floating is None else floating.angular,
        "max_floating_path_error": np.nan if floating is None else floating.path_error,
    }


def _row(problem: Problem, e: Evaluation) -> dict[str, Any]:
    radius = int(np.argmin(e.spectral_radius))
    row: dict[str, Any] = {
        "method": e.method,
        "optimum": e.solution.optimum,
        "status": e.status.word,
        "message": e.message,
        "kinetic_energy_integral": e.energy_integral[-1],
        "torque_integral": e.torque_integral[-1],
        "kinetic_energy_integral_spline": e.energy_integral_spline,
        **_first_order(problem, e),
        "max_tracking_error": e.tracking_error.max(),
        "max_tracking_error_between": e.tracking_error_between,
        "final_error": e.tracking_error[-1],
        **_orientation(problem, e),
    }
    for name, values in (("velocity", e.qd), ("torque", e.tau), ("power", e.power)):
        row |= {f"peak_{name}_{j + 1}": peak for j, peak in enumerate(np.abs(values).max(axis=0))}
    row |= _base(problem, e)
    if problem.obstacles is not None:
        row |= {"min_clearance": e.clearance.min(), "min_clearance_between": e.clearance_between}
    for suffix, excess in (("", e.limit_excess), ("_between", e.limit_excess_between)):
        row |= {f"{kind}_limit_excess{suffix}": value for kind, value in excess.items()}
    row |= {
        "min_singular_value": e.singular_value.min(),
        "min_spectral_radius": e.spectral_radius[radius],
        "min_spectral_radius_time": e.time[radius],
        **_updates(e),
        "starts_in_basin": e.solution.statistics.get("starts_in_basin", np.nan),
        "grid_error": e.solution.statistics.get("grid_error", np.nan),
        "kind": e.solution.statistics.get("kind", ""),
        "singular_time": np.nan if e.solution.event_time is None else e.solution.event_time,
    }
    return row if e.solution.found else _without_numbers(row)


def _without_numbers(row: dict[str, Any]) -> dict[str, Any]:
    """The row of a method that found no motion: an arm that stands still costs nothing, and that is no result."""
    return {key: np.nan if isinstance(value, float) else value for key, value in row.items()}


def write(folder: Path, evaluations: Sequence[Evaluation], table: pd.DataFrame, text: str, extras: Extras) -> None:
    """summary.csv, summary.md, trajectories.parquet, and the tables of what only some runs have."""
    if extras.validation is not None:
        validation = extras.validation
        write_beside(folder / "validation.csv", lambda file: validation.to_csv(file, index=False))
    if extras.convergence is not None:
        convergence = extras.convergence
        write_beside(folder / "convergence.csv", lambda file: convergence.to_csv(file, index=False))
    if extras.front is not None:
        front = extras.front
        write_beside(folder / "front.csv", lambda file: front.to_csv(file, index=False))
    if extras.study is not None:
        curve = pd.DataFrame({"candidates": extras.study.count, "distance": extras.study.distance})
        write_beside(folder / "candidate_study.csv", lambda file: curve.to_csv(file, index=False))
    if extras.identification is not None:
        found = extras.identification
        write_beside(folder / "masses.csv", lambda file: found.masses.to_csv(file, index=False))
        write_beside(folder / "identification.csv", lambda file: found.numbers.to_csv(file, index=False))
    write_beside(folder / "summary.csv", lambda file: table.to_csv(file, index=False))
    write_beside(folder / "summary.md", lambda file: file.write_text(text, encoding="utf-8"))
    write_beside(folder / "trajectories.parquet", lambda file: trajectories(evaluations).to_parquet(file, index=False))
