"""How near the best of so many random candidates comes to the optimum (Global paper Section 3.1.2, Fig. 1, eq. (16))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.config.studies import CandidateStudyConfig
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.search.configurations import starting_points
from pipeline.search.population import population


@dataclass(frozen=True)
class Study:
    """count (P,): candidates; distance (P,): mean distance of the best of them from the optimum; fit: distance =
    exp(intercept) count^exponent over counts from the number of parameters on.
    """

    count: Array
    distance: Array
    parameters: int
    intercept: float
    exponent: float


def study(problem: Problem, optimum: float, options: GlobalOptions, config: CandidateStudyConfig, seed: int) -> Study:
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
    return Study(count, np.exp(mean), parameters, float(intercept), float(exponent))
