"""The tables of a run: summary.csv, summary.md, trajectories.parquet, run.json."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from pipeline import certificate, resample
from pipeline.config import PublishedConfig, RunConfig
from pipeline.evaluation import Evaluation
from pipeline.extras import NOTHING, Extras
from pipeline.files import write_beside
from pipeline.front import hypervolume
from pipeline.problem import Problem, Solution
from pipeline.task import PositionTask

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
        names = ("reaction_force", "reaction_torque") if problem.task.arm.base_coordinates else ()
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


def trajectories(evaluations: Sequence[Evaluation]) -> pd.DataFrame:
    """The long table: method, optimum, time, q_1..n, qd_1..n, qdd_1..n, tau_1..n, x, y, z; of a floating base its position
    base_x, .. and rotation vector base_rx, .. in the world.
    """
    parts = []
    for e in evaluations:
        columns: dict[str, Any] = {"method": e.method, "optimum": e.solution.optimum, "time": e.time}
        for name, values in (("q", e.q), ("qd", e.qd), ("qdd", e.qdd), ("tau", e.tau)):
            columns |= {f"{name}_{j + 1}": values[:, j] for j in range(values.shape[1])}
        columns |= dict(zip("xyz", e.position.T, strict=True))
        if e.base.reaction is None:
            turned = Rotation.from_matrix(e.base.rotation).as_rotvec()
            columns |= {f"base_{axis}": column for axis, column in zip("xyz", e.base.position.T, strict=True)}
            columns |= {f"base_r{axis}": column for axis, column in zip("xyz", turned.T, strict=True)}
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def markdown(
    config: RunConfig, problem: Problem, evaluations: Sequence[Evaluation], table: pd.DataFrame, extras: Extras
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
        lines += ["", f"Exported: {resample.sentence(extras.exported)}."]
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
    if config.published.document:
        lines += ["", f"Printed values: {config.published.document}. {config.published.note}".rstrip()]
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


def write_run(
    folder: Path,
    config: RunConfig,
    facts: Mapping[str, Any],
    results: Sequence[tuple[list[Solution], float]],
    evaluations: Sequence[Evaluation],
    stages: Mapping[str, float],
    extras: Extras = NOTHING,
) -> None:
    """run.json: versions, seed, statistics of every solve, timings per stage, machine, the configuration."""
    solved = [
        {"method": s.method, "optimum": s.optimum, "status": e.status.word, "statistics": s.statistics}
        for s, e in zip([s for solutions, _ in results for s in solutions], evaluations, strict=True)
    ]
    content = {
        **facts,
        "cpu_count": os.cpu_count(),
        "stages_s": dict(stages),
        "methods_s": {solutions[0].method: seconds for solutions, seconds in results},
        "solutions": solved,
        **_sent_facts(extras),
        "config": asdict(config),
    }
    write_beside(
        folder / "run.json",
        lambda file: file.write_text(json.dumps(content, indent=1, default=_plain), encoding="utf-8"),
    )


def _sent_facts(extras: Extras) -> dict[str, Any]:
    facts: dict[str, Any] = {}
    if (motion := extras.exported) is not None:
        facts["export"] = {
            "method": motion.method,
            "optimum": motion.optimum,
            "samples": len(motion.time),
            "tracking_error": motion.tracking_error,
            "limit_excess": motion.limit_excess,
            "keeps_limits": motion.keeps_limits,
        }
    if (loop := extras.closed_loop) is not None:
        facts["closed_loop"] = {
            "method": loop.method,
            "optimum": loop.optimum,
            "joint_error": float(np.abs(loop.joint_error).max()),
            "tracking_error": float(loop.end_effector_error.max()),
            "saturation": loop.saturation,
            "peak_torque_over_limit": np.abs(loop.tau).max(axis=0) / loop.effort,
            "diverged": loop.diverged,
        }
    return facts


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)
