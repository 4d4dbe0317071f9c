"""run.json and trajectories.parquet: what a run was, and its motions."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from pipeline.common.files import write_beside
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.studies.studies import NOTHING, Extras


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


def write_run(
    folder: Path,
    config: RunConfig,
    facts: Mapping[str, Any],
    seconds: Mapping[str, float],
    evaluations: Sequence[Evaluation],
    stages: Mapping[str, float],
    extras: Extras = NOTHING,
) -> None:
    """run.json: versions, seed, statistics of every solve, timings per stage, machine, the configuration."""
    solved = [
        {"method": e.method, "optimum": s.optimum, "status": e.status.word, "statistics": s.statistics}
        for e in evaluations
        for s in (e.solution,)
    ]
    content = {
        **facts,
        "cpu_count": os.cpu_count(),
        "stages_s": dict(stages),
        "methods_s": dict(seconds),
        "solutions": solved,
        **sent_facts(extras),
        "config": asdict(config),
    }
    write_beside(
        folder / "run.json",
        lambda file: file.write_text(json.dumps(content, indent=1, default=_plain), encoding="utf-8"),
    )


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)


def sent_facts(extras: Extras) -> dict[str, Any]:
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
