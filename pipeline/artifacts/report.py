"""All that a run has found out, as every artifact gets it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pipeline.evaluation.evaluation import Evaluation
from pipeline.studies.study import Motions, Result

Kind = TypeVar("Kind", bound=Result)


@dataclass(frozen=True)
class Report:
    """seconds: wall time of each method [s]. stages: of each stage of the run so far [s]. facts: of the run, such as
    its seed and the versions of what it was made with; `inputs` among them: the digests of the files that it read.
    """

    motions: Motions
    results: tuple[Result, ...]
    seconds: Mapping[str, float]
    stages: Mapping[str, float]
    facts: Mapping[str, Any]

    @property
    def exit_code(self) -> int:
        """0 if every method's motion is confirmed, else 1."""
        return 0 if all(e.confirmed for e in self.motions.evaluations) else 1

    @property
    def shown(self) -> list[Evaluation]:
        """The motions that figures show one by one: all that no study hides."""
        return [e for e in self.motions.evaluations if not any(result.hides(e) for result in self.results)]

    def find(self, kind: type[Kind]) -> Kind | None:
        """The result of one study, or None where the run has none."""
        return next((result for result in self.results if isinstance(result, kind)), None)
