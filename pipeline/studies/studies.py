"""What only some runs have beside their motions: certificate, validation and convergence tables, studies, masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.config.studies import ExportConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.evaluation.limits import LIMITS
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.studies import (
    candidates,
    certificate,
    closed_loop,
    convergence,
    export,
    front,
    identification,
    validation,
)

FEW = 4  # motions between the extremes of a front that the figures show


@dataclass(frozen=True)
class Extras:
    """Each is None where the run does not ask for it."""

    certificate: dict[str, float] | None = None
    validation: pd.DataFrame | None = None
    study: candidates.Study | None = None
    front: pd.DataFrame | None = None
    convergence: pd.DataFrame | None = None
    exported: export.Resampled | None = None
    closed_loop: closed_loop.ClosedLoop | None = None
    identification: identification.Identification | None = None

    def shown(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """The motions that figures show one by one: all of them, but of a front its extremes, its knee and a few between."""
        if self.front is None:
            return list(evaluations)
        good = self.front[self.front["status"] == "optimal"]
        chosen = set(good[good["extreme"] | good["knee"]]["point"])
        chosen |= set(good["point"].iloc[:: max(1, len(good) // FEW)])
        return [e for e in evaluations if e.method != "pareto" or e.solution.optimum in chosen]


NOTHING = Extras()


def compute(problem: Problem, config: RunConfig, evaluations: Sequence[Evaluation]) -> Extras:
    """The extras that the methods of this run make possible."""
    pair = certificate.comparable([evaluation.solution for evaluation in evaluations])
    methods = {evaluation.method for evaluation in evaluations}
    chosen = _chosen(config.export, evaluations)
    return Extras(
        certificate=None if pair is None else certificate.certify(problem, *pair),
        validation=validation.table(problem, evaluations) if methods >= {"global", "calculus_of_variations"} else None,
        front=front.table(evaluations),
        convergence=convergence.table(problem, [evaluation.solution for evaluation in evaluations]),
        study=_study(problem, config, evaluations) if config.candidate_study.run else None,
        exported=None if chosen is None else export.resample(problem, chosen, config.export.rate),
        closed_loop=(
            closed_loop.simulate(problem, chosen, config.closed_loop)
            if chosen is not None and config.closed_loop.run
            else None
        ),
        identification=_identified(problem, config) if config.identification.run else None,
    )


def _identified(problem: Problem, config: RunConfig) -> identification.Identification:
    workers = Workers(config.parallel.workers, address=config.parallel.address)
    return identification.identify(problem.task.arm, config.identification, config.seed, workers)


def _chosen(export: ExportConfig, evaluations: Sequence[Evaluation]) -> Evaluation | None:
    """The motion to export; None if there is no confirmed one, or none is asked for.

    The best one keeps every limit and every clearance at its knots: a method that knows none may go cheaply through a wall.
    """
    good = [e for e in evaluations if e.status is Status.SOLVED and export.method in ("best", e.method)]
    if export.method == "best":
        good = [e for e in good if max(e.limit_excess.values(), default=0.0) <= LIMITS]
    # Of a method with several optima, and of all methods, the cheapest by the problem's own objective.
    return min(good, key=lambda e: e.objective, default=None) if export.method != "none" else None


def _study(problem: Problem, config: RunConfig, evaluations: Sequence[Evaluation]) -> candidates.Study | None:
    found = [e for e in evaluations if e.method == "global" and e.confirmed]
    if not found:
        return None
    optimum = float(objective_values(problem, problem.times, found[0].solution.trajectory.q[None])[0])
    return candidates.study(problem, optimum, config.method.global_, config.candidate_study, config.seed)
