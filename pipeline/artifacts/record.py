"""run.json: what a run was."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.artifacts.report import Report
from pipeline.artifacts.verdict import first
from pipeline.common.files import write_beside


def write(report: Report, folder: Path) -> None:
    """run.json in `folder`: versions, seed, exit code, statistics of every solve, timings, machine, configuration."""
    motions = report.motions
    best = first(report) if report.motions.solved else None  # to be sent, or else the best
    solved = [
        {
            "method": e.method,
            "optimum": e.solution.optimum,
            "status": e.status.word,
            "statistics": e.solution.statistics,
        }
        for e in motions.evaluations
    ]
    content = {
        **report.facts,
        "exit_code": report.exit_code,
        "chosen": None if best is None else {"method": best.method, "optimum": best.solution.optimum},
        "cpu_count": os.cpu_count(),
        "stages_s": dict(report.stages),
        "methods_s": dict(report.seconds),
        "solutions": solved,
        **{result.name: found for result in report.results if (found := result.facts())},
        "config": asdict(motions.config),
    }
    text = json.dumps(content, indent=1, default=_plain)
    write_beside(folder / "run.json", lambda file: file.write_text(text, encoding="utf-8"))


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)
