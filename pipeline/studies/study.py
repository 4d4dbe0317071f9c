"""What a study is: a question that only some runs ask about their motions, and what its answer puts into a run's files.

A study gets the `Motions` of a run and returns a `Result`, or None where the run does not ask. A new one is a file
beside this one and its line in `studies.STUDIES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Motions:
    """The evaluated motions of one run, in the order of its methods and of their optima; and how to compute more."""

    config: RunConfig
    problem: Problem
    evaluations: Sequence[Evaluation]
    workers: Workers = field(default_factory=Workers)

    @property
    def methods(self) -> set[str]:
        """The names of the methods that ran, whatever became of their motions."""
        return {e.method for e in self.evaluations}

    @property
    def solved(self) -> list[Evaluation]:
        """The motions that the evaluation found to be what their methods promise."""
        return [e for e in self.evaluations if e.status is Status.SOLVED]

    def confirmed(self, method: str) -> list[Evaluation]:
        """The confirmed motions of one method; a baseline that met a singularity is one of them."""
        return [e for e in self.evaluations if e.method == method and e.confirmed]

    def best(self, method: str) -> Evaluation | None:
        """The first of one method that is solved: its best, since methods return their optima best first."""
        return next((e for e in self.solved if e.method == method), None)


class Result:
    """What a study found, in the forms in which a run's files take it; all are empty here, and a study has some.

    It draws its own figures and writes nothing: the artifacts know no study, and a study knows no file.
    """

    name: ClassVar[str]  # what run.json calls its facts
    units: ClassVar[Mapping[str, str]] = MappingProxyType({})  # of its columns, for people
    cover: ClassVar[str] = ""  # the one of its figures that opens the recording

    def tables(self) -> Mapping[str, pd.DataFrame]:
        """Tables of its own, each written to `<key>.csv`."""
        return {}

    def section(self) -> list[str]:
        """Its lines of Markdown in summary.md and in the recording."""
        return []

    def said(self) -> list[str]:
        """Its lines on the terminal, at the end of a run."""
        return []

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        """What it adds to the row of `motion` in summary.csv, by column."""
        return {}

    def facts(self) -> Mapping[str, Any]:
        """What it adds to run.json, under its name."""
        return {}

    def figures(self, title: str) -> Mapping[str, Figure]:
        """Its figures, each written to `figures/<key>.png`; `title` is the name of the run."""
        return {}

    def hides(self, motion: Evaluation) -> bool:
        """Whether figures that show motions one by one leave this one out."""
        return False


Study = Callable[[Motions], Result | None]
