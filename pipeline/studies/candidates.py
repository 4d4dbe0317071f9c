"""How near the best of so many random candidates comes to the optimum (Global paper Section 3.1.2, Fig. 1, eq. 16)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pandas as pd

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.config.studies import CandidateStudyConfig
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.search.configurations import starting_points
from pipeline.search.population import population
from pipeline.studies import style
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRINTED = (-4.0733, -0.2030)  # eq. (16): logarithm of the factor, exponent


@dataclass(frozen=True)
class Candidates(Result):
    """count (P,): candidates; distance (P,): mean distance of the best of them from the optimum; fit: distance =
    exp(intercept) count^exponent over counts from the number of parameters on.
    """

    name: ClassVar[str] = "candidate_study"
    count: Array
    distance: Array
    parameters: int
    intercept: float
    exponent: float

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"candidate_study": pd.DataFrame({"candidates": self.count, "distance": self.distance})}

    def section(self) -> list[str]:
        return [
            f"Candidates: distance = exp({self.intercept:.4f}) N^{self.exponent:.4f} from N = {self.parameters} on; "
            f"the paper prints exp({PRINTED[0]:.4f}) N^{PRINTED[1]:.4f}."
        ]

    def figures(self, title: str) -> Mapping[str, Figure]:
        return {"candidate_study": draw(self, title)}


def study(motions: Motions) -> Candidates | None:
    """Where it is asked for, and the planner found the optimum to measure from."""
    config, problem, found = motions.config, motions.problem, motions.confirmed("global")
    if not config.candidate_study.run or not found:
        return None
    trajectory = found[0].solution.trajectory
    problem = replace(problem, times=trajectory.time)
    optimum = float(objective_values(problem, problem.times, trajectory.q[None])[0])
    return measure(problem, optimum, config.method.global_, config.candidate_study, config.seed)


def measure(
    problem: Problem, optimum: float, options: GlobalOptions, config: CandidateStudyConfig, seed: int
) -> Candidates:
    """Draw `repeats` populations of `most` candidates, shuffle each, and average the running minimum's distance."""
    rng = np.random.default_rng(seed)
    count = np.unique(np.round(np.geomspace(1, config.most, 60)).astype(int))
    curves = []
    for _ in range(config.repeats):
        starts = starting_points(problem, options.configurations, rng, options.draw)
        motions = population(problem, problem.times, starts, config.most, rng)
        costs = rng.permutation(objective_values(problem, problem.times, motions))
        running = np.minimum.accumulate(costs)
        curves.append(np.log(np.maximum(running[np.minimum(count, len(running)) - 1] - optimum, 1e-12)))
    mean = np.mean(curves, axis=0)
    parameters = len(problem.times) * problem.task.arm.n
    tail = count >= parameters
    enough = tail.sum() >= 3
    exponent, intercept = np.polyfit(np.log(count[tail]), mean[tail], 1) if enough else (np.nan, np.nan)
    return Candidates(count, np.exp(mean), parameters, float(intercept), float(exponent))


def draw(study: Candidates, title: str) -> Figure:
    """The mean curve, its fitted power law and the printed one, on logarithmic axes (Fig. 1)."""
    figure = style.sheet(7.0, 4.6)
    axes = figure.add_subplot()
    axes.loglog(study.count, study.distance, ".-", color=style.color("global"), label="mean over populations")
    tail = study.count[study.count >= study.parameters].astype(float)
    for (intercept, exponent), label, line in (
        ((study.intercept, study.exponent), "fit", "k-"),
        (PRINTED, "printed, eq. (16)", "k:"),
    ):
        law = np.exp(intercept) * tail**exponent
        axes.loglog(tail, law, line, label=f"{label}: $e^{{{intercept:.3f}}} N^{{{exponent:.3f}}}$")
    axes.axvline(study.parameters, color="0.7", linewidth=1.0)
    axes.annotate(f" {study.parameters} parameters", (study.parameters, study.distance.min()), color="0.4")
    axes.set(xlabel="Number of candidates $N$", ylabel="Best candidate above the optimum [J s]", title=title)
    axes.grid(True, which="both", color="0.93")
    axes.legend()
    return figure
