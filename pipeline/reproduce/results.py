"""The results of a finished run, read back from its folder; what is not in its files is evaluated again from q(t)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import DictConfig, OmegaConf

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.compose import checked
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory


class ResultError(InputError):
    """A run does not hold what is looked for in it."""


class NotRunError(ResultError):
    """There is no such run."""


@dataclass(frozen=True)
class Results:
    """One run's folder; each file is read when it is first needed."""

    folder: Path

    @property
    def name(self) -> str:
        return self.folder.name

    def table(self, name: str) -> pd.DataFrame:
        """`name`.csv; raises ResultError if the run has left none."""
        file = self.folder / f"{name}.csv"
        if not file.is_file():
            raise ResultError(f"{self.name}: the run left no {file.name}")
        return pd.read_csv(file)

    @cached_property
    def summary(self) -> pd.DataFrame:
        return self.table("summary")

    @cached_property
    def motions(self) -> pd.DataFrame:
        """All motions, the long table: method, optimum, time, q_1.., qd_1.., qdd_1.., tau_1.., x, y, z."""
        file = self.folder / "trajectories.parquet"
        if not file.is_file():
            raise ResultError(f"{self.name}: the run left no {file.name}")
        return pd.read_parquet(file)

    @cached_property
    def record(self) -> dict[str, Any]:
        """run.json."""
        file = self.folder / "run.json"
        if not file.is_file():
            raise ResultError(f"{self.name}: the run is not finished")
        return dict(json.loads(file.read_text(encoding="utf-8")))

    @cached_property
    def config(self) -> RunConfig:
        values = OmegaConf.load(self.folder / ".hydra" / "config.yaml")
        assert isinstance(values, DictConfig)
        return checked(values)

    @cached_property
    def problem(self) -> Problem:
        return prepare(self.config)

    def motion(self, method: str, optimum: int = 1) -> pd.DataFrame:
        """One motion of the long table; raises ResultError."""
        rows = self.motions[(self.motions["method"] == method) & (self.motions["optimum"] == optimum)]
        if rows.empty:
            raise ResultError(f"{self.name}: no motion of {method} {optimum}")
        return rows

    def evaluation(self, method: str, optimum: int = 1) -> Evaluation:
        """One motion, evaluated again."""
        if (method, optimum) not in self._evaluations:
            motion = self.motion(method, optimum)
            row = self._row(method, optimum)
            q = motion[[f"q_{j + 1}" for j in range(self.problem.task.arm.n)]].to_numpy()
            event = row["singular_time"]
            solution = Solution(
                method,
                Trajectory(motion["time"].to_numpy(), q),
                next(status for status in Status if status.word == row["status"]),
                optimum=optimum,
                event_time=None if pd.isna(event) else float(event),
            )
            self._evaluations[method, optimum] = evaluate(self.problem, solution)
        return self._evaluations[method, optimum]

    @cached_property
    def _evaluations(self) -> dict[tuple[str, int], Evaluation]:
        return {}

    def _row(self, method: str, optimum: int) -> pd.Series:
        rows = self.summary[(self.summary["method"] == method) & (self.summary["optimum"] == optimum)]
        if rows.empty:
            raise ResultError(f"{self.name}: no {method} {optimum} in summary.csv")
        return rows.iloc[0]

    def cell(self, method: str, optimum: int, column: str) -> float:
        """A number of summary.csv; raises ResultError."""
        row = self._row(method, optimum)
        if column not in row:
            raise ResultError(f"{self.name}: no column {column} in summary.csv")
        return float(row[column])
