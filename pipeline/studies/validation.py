"""The planner's optima beside the stationary motions of the calculus of variations (Global paper Section 4.1, Table 4).

Two motions are the same optimum where their joint paths are; a motion without a partner says why.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.common.markdown import cells, markdown_table
from pipeline.evaluation.evaluation import Evaluation
from pipeline.methods.calculus_of_variations.extremals import initial_state, integrate
from pipeline.model.kinematics import weighted_pseudoinverse, wrap
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.selection import path_distance
from pipeline.studies.study import Motions, Result

TOLERANCE = 1e-8  # of the extremals' integration
SAME = 0.3  # [rad] largest joint difference at which a discrete and a continuous motion are the same optimum


@dataclass(frozen=True)
class Validation(Result):
    """table: see `table`."""

    name: ClassVar[str] = "validation"
    table: pd.DataFrame

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"validation": self.table}

    def section(self) -> list[str]:
        return ["## Planner and calculus of variations", "", *markdown_table(cells(self.table))]


def study(motions: Motions) -> Validation | None:
    """Where both methods were asked for."""
    return Validation(table(motions)) if motions.methods >= {"global", "calculus_of_variations"} else None


def table(motions: Motions) -> pd.DataFrame:
    """One row per confirmed motion of either method, paired by joint path."""
    revolute = motions.problem.task.arm.description.revolute
    planner, stationary = motions.confirmed("global"), motions.confirmed("calculus_of_variations")
    intervals = len(motions.problem.times) - 1
    pairs = _pairs([_at_knots(e, intervals) for e in planner], [_at_knots(e, intervals) for e in stationary], revolute)
    followed = _followed(motions.problem, [_at_knots(e, intervals) for e in planner])
    rows: list[dict[str, Any]] = []
    for index, e in enumerate(planner):
        row: dict[str, Any] = {"planner_optimum": e.solution.optimum, "planner_objective": e.objective}
        row |= followed[index] if followed else {}
        if index in pairs:
            other = stationary[pairs[index]]
            row |= {
                "stationary_motion": other.solution.optimum,
                "stationary_objective": other.solution.statistics["integral"],
                "mean_absolute_difference": _mean_difference(e, other, intervals, revolute),
                "kind": other.solution.statistics["kind"],
            }
        else:
            row["remark"] = (
                "no stationary motion near it: an optimum of the finite-difference sum on these knots that continuous "
                "time does not have; it moves or disappears on finer grids (timing.steps)"
            )
        rows.append(row)
    for index, other in enumerate(stationary):
        if index not in pairs.values():
            kind = other.solution.statistics["kind"]
            remark = (
                "the planner did not find it"
                if kind == "minimum"
                else "not a minimum: the planner does not look for it"
            )
            rows.append(
                {
                    "stationary_motion": other.solution.optimum,
                    "stationary_objective": other.solution.statistics["integral"],
                    "kind": kind,
                    "remark": remark,
                }
            )
    columns = [
        "planner_optimum",
        "planner_objective",
        "stationary_motion",
        "stationary_objective",
        "mean_absolute_difference",
        "objective_from_planner_start",
        "difference_from_planner_start",
    ]
    return pd.DataFrame(rows, columns=[*columns, "kind", "remark"])


def _at_knots(motion: Evaluation, intervals: int) -> Array:
    """A motion (N + 1, n) at the knots of the problem, where its own are parts of their intervals."""
    return motion.q[:: (len(motion.time) - 1) // intervals]


def _followed(problem: Problem, planner: list[Array]) -> list[dict[str, float]]:
    """What the extremals that begin as the planner's motions (N + 1, n) do come to, their objective and mean joint
    difference: the Global paper's comparison (Table 4). Where the start is free it is at rest but for the path.
    """
    if problem.boundary is not Boundary.FREE or not planner:
        return []
    first = np.array([q[0] for q in planner])
    xd = problem.reference.sample(np.zeros(len(first)))[1]
    metric = Lagrangian(problem.task, problem.objective).metric(first)
    inverse = weighted_pseudoinverse(problem.task.jacobian(first), np.linalg.inv(metric))
    state = initial_state(first, (inverse @ problem.task.velocity(first, xd)[:, :, None])[:, :, 0])
    path = [first]
    for begin, end in pairwise(problem.times):
        state = integrate(problem, state, begin, end, TOLERANCE)
        path.append(state[:, : first.shape[1]])
    apart = np.abs(np.array(path).swapaxes(0, 1) - np.array(planner)).mean(axis=(1, 2))
    return [
        {"objective_from_planner_start": float(value), "difference_from_planner_start": float(mean)}
        for value, mean in zip(state[:, -1], apart, strict=True)
    ]


def _mean_difference(one: Evaluation, other: Evaluation, intervals: int, revolute: NDArray[np.bool_]) -> float:
    """[rad] of the joints at the knots of the problem."""
    return float(np.abs(wrap(_at_knots(one, intervals) - _at_knots(other, intervals), revolute)).mean())


def _pairs(planner: list[Array], stationary: list[Array], revolute: NDArray[np.bool_]) -> dict[int, int]:
    """Which stationary motion belongs to which optimum: one to one, nearest first."""
    distances = sorted(
        (path_distance(q, other, revolute), i, j) for i, q in enumerate(planner) for j, other in enumerate(stationary)
    )
    pairs: dict[int, int] = {}
    for distance, i, j in distances:
        if distance < SAME and i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs
