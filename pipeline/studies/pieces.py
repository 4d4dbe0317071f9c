"""The pieces into which a path was cut and the transits between them, one after the other as a robot would run them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import pandas as pd

from pipeline.common.markdown import markdown_table
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.solution import Trajectory
from pipeline.studies.study import Motions, Result


@dataclass(frozen=True)
class Pieces(Result):
    """pieces: a row for each piece; program: all knots of pieces and transits in their order, times from 0 on."""

    name: ClassVar[str] = "pieces"
    pieces: pd.DataFrame
    program: pd.DataFrame

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"pieces": self.pieces, "program": self.program}

    def section(self) -> list[str]:
        head = [column.replace("_", " ") for column in self.pieces.columns]
        shown = [["" if value != value else f"{value:.4g}" for value in row] for row in self.pieces.to_numpy()]
        return [
            "## Pieces",
            "",
            *markdown_table([head, *shown]),
            "",
            "program.csv has all of it in order: each piece, and from rest to rest the transit to the next.",
        ]

    def said(self) -> list[str]:
        return [f"Pieces: {len(self.pieces)}, with the transits between them in program.csv."]

    def facts(self) -> Mapping[str, Any]:
        return {"pieces": self.pieces.to_dict("records")}


def study(motions: Motions) -> Pieces | None:
    """Where a method has cut the path."""
    found = [e for e in motions.evaluations if e.solution.stretch is not None and e.solution.found]
    if not found:
        return None
    problem = motions.problem
    clearance = Clearance(problem.task.arm, problem.obstacles, problem.own)
    rows: list[dict[str, Any]] = []
    for e in found:
        assert e.solution.stretch is not None
        approach = e.solution.approach
        rows.append(
            {
                "piece": e.solution.optimum,
                "from_m": e.solution.stretch[0],
                "to_m": e.solution.stretch[1],
                "time_s": float(e.time[-1]),
                "objective": e.objective,
                "transit_s": float("nan") if approach is None else float(approach.time[-1]),
                **{
                    name: float("nan") if approach is None else float(clearance.smallest(pairs, approach.q).min())
                    for name, pairs in (
                        ("transit_clearance_m", clearance.obstacles),
                        ("transit_own_clearance_m", clearance.own),
                    )
                    if pairs
                },
            }
        )
    return Pieces(pd.DataFrame(rows), program(found, problem.task.arm.description.actuated))


def program(found: Sequence[Evaluation], joints: Sequence[str]) -> pd.DataFrame:
    """time [s], which part it is, and every joint [rad or m], of all pieces and transits one after the other."""
    parts: list[pd.DataFrame] = []
    begins = 0.0
    for e in found:
        approach = e.solution.approach
        legs = [(f"piece {e.solution.optimum}", Trajectory(e.time, e.q))]
        if approach is not None:
            legs.insert(0, (f"transit to {e.solution.optimum}", approach))
        for words, leg in legs:
            skipped = 1 if parts else 0  # where it begins the one before has ended
            rows = pd.DataFrame(leg.q[skipped:], columns=list(joints))
            rows.insert(0, "part", words)
            rows.insert(0, "time", begins + leg.time[skipped:])
            parts.append(rows)
            begins += float(leg.time[-1])
    return pd.concat(parts, ignore_index=True)
