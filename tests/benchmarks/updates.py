"""Updates of real runs of PMKE beside CasADi + IPOPT with exact Hessians, which solves the same windows from the same
guesses: roll-out, both guesses and the spline on our side, the two solves alone on the peer's. Interleaved.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.pmke.exact import ExactWindow
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.pmke.predictor import Predictor
from tests.benchmarks import peer
from tests.support import composed

TRAJECTORIES = ("traj1", "traj2", "traj3", "traj4")
REPEATS = 7


def timed(call: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Processor time [ms], and the answer."""
    begin = time.process_time()
    answer = call(*arguments)
    return 1e3 * (time.process_time() - begin), answer


def recorded(call: Callable[[], Any]) -> tuple[list[tuple[Any, ...]], list[tuple[Array, ...]], Any]:
    """What the predictor and its windows were asked while `call` ran, and its answer."""
    updates: list[tuple[Any, ...]] = []
    windows: list[tuple[Array, ...]] = []
    predict, solve = Predictor.__call__, ExactWindow.solve

    def update(self: Predictor, *arguments: Any) -> Any:
        updates.append(tuple(np.copy(argument) for argument in arguments))
        return predict(self, *arguments)

    def window(self: ExactWindow, *arguments: Array) -> Any:
        windows.append(tuple(np.copy(argument) for argument in arguments))
        return solve(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Predictor, "__call__", update)
        patch.setattr(ExactWindow, "solve", window)
        answer = call()
    return updates, windows, answer


def trajectory(name: str, repeats: int = REPEATS, *overrides: str) -> None:
    """One line: medians, their ratio, ours where nothing else runs in between, and how costs and integrals agree."""
    config = composed(f"+experiment={name}", *overrides)
    problem = prepare(config)
    alone, every = (replace(config.method.pmke, confirm=word) for word in ("none", "every"))
    updates, windows, (solution,) = recorded(lambda: pmke(problem, alone))
    arm = peer.PlanarArm.from_urdf(peer.ROBOT)
    program = peer.kinetic_energy_program(arm, alone.horizon, alone.prediction_step, alone.tolerance, expand=True)

    def solved(window: tuple[Array, ...]) -> float:
        return min(peer.solve(program, *window[:2], guess)[1] for guess in window[2])

    ours, theirs, gap = [], [], 0.0
    for _ in range(repeats):
        predictor = Predictor(problem, alone)
        for update, window in zip(updates, windows, strict=True):
            milliseconds, _ = timed(predictor, *update)
            ours.append(milliseconds)
            milliseconds, cost = timed(solved, window)
            theirs.append(milliseconds)
            gap = max(gap, abs(predictor.log[-1]["objective"] / cost - 1))
    alone_ms = []  # one update after another, as in a control loop: the peer leaves nothing of ours in the caches
    for _ in range(repeats):
        predictor = Predictor(problem, alone)
        alone_ms += [timed(predictor, *update)[0] for update in updates]
    integral = float(evaluate(problem, solution).energy_integral[-1])
    confirmed = float(evaluate(problem, pmke(problem, every)[0]).energy_integral[-1])
    ratio = np.median(np.array(ours) / np.array(theirs))
    print(
        f"{name:<8} {np.median(ours):9.3f} {np.median(theirs):9.3f} {ratio:7.2f} {np.median(alone_ms):9.3f}   "
        f"{len(updates)} updates; costs agree to {gap:.0e}, "
        f"integrals to {abs(integral / confirmed - 1):.0e} of {confirmed:.6g} J s"
    )


def main(words: Sequence[str]) -> None:
    """All trajectories, or those named."""
    for word in words:
        if word not in TRAJECTORIES:
            sys.exit(f"{word}: not one of {', '.join(TRAJECTORIES)}")
    print(f"{'update':<8} {'ours [ms]':>9} {'peer [ms]':>9} {'ratio':>7} {'alone':>9}   processor time, medians")
    for word in words or TRAJECTORIES:
        trajectory(word)
