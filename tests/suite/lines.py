"""Random lines of the Panda, each planned with the arm kept off itself and without: `python -m tests.suite.lines`.

Whether a motion touches the arm is for coal to say (`self_collision.py`), at SAMPLES moments of the exported curve.
"""

from __future__ import annotations

import sys
import time
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd

from pipeline.build.problem import prepare
from pipeline.common.errors import PathError
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from tests.suite.self_collision import least, lines
from tests.support import composed

SAMPLES = 1000


@dataclass(frozen=True)
class Row:
    """One line: energies [J s], what the motions keep from the arm itself [m], by our certificate and by coal, and
    the planner's processor time [s]; of the motion without self-collision too.
    """

    name: str
    status: str
    energy: float = np.nan
    energy_without: float = np.nan
    certified: float = np.nan
    certified_without: float = np.nan
    coal: float = np.nan
    seconds: float = np.nan
    seconds_without: float = np.nan

    @property
    def was_clear(self) -> bool:
        """Whether the best motion keeps the margin without being asked to."""
        return self.certified_without >= 0.005


def planned(problem: Problem, words: tuple[str, ...]) -> tuple[Evaluation, float]:
    """The planner's best motion and its processor time [s]."""
    config, begin = composed(*words), time.process_time()
    found = global_planner(problem, config.method.global_, Context(config.seed))[0]
    took = time.process_time() - begin
    return evaluate(problem, found), took


def compared(name: str, words: tuple[str, ...]) -> Row:
    """One line with and without."""
    try:
        problem = prepare(composed(*words))
    except PathError as error:
        return Row(name, str(error))
    assert problem.own is not None
    without, seconds_without = planned(replace(problem, own=replace(problem.own, kept=False)), words)
    best, seconds = planned(problem, words)
    if best.status is not Status.SOLVED:
        return Row(name, best.message)
    curve, motion = whole(problem, best.solution.trajectory), best.solution.trajectory
    return Row(
        name,
        best.status.name,
        float(best.energy_integral[-1]),
        float(without.energy_integral[-1]),
        best.near.own.bound,
        without.near.own.bound,
        least(curve(np.linspace(motion.time[0], motion.time[-1], SAMPLES))),
        seconds,
        seconds_without,
    )


def main() -> int:
    """The table, on standard output; 1 if any motion touches the arm."""
    only, rows = set(sys.argv[1:]), []
    for name, words in lines():
        if not only or name in only:
            rows.append(compared(name, words))
            print(pd.DataFrame([asdict(rows[-1])]).to_csv(index=False, header=len(rows) == 1), end="", flush=True)
    found = [row for row in rows if np.isfinite(row.energy)]
    clear = [row for row in found if row.was_clear]
    ratio = np.median([row.seconds / row.seconds_without for row in found])
    apart = max((abs(row.energy / row.energy_without - 1) for row in clear), default=0.0)
    touching = [row.name for row in found if row.coal <= 0]
    print(f"{len(found)} of {len(rows)} solved; by coal {len(touching)} touch the arm: {' '.join(touching) or 'none'}")
    print(f"{len(clear)} were clear without: energies apart by at most {apart:.1e}; median processor time {ratio:.2f}")
    return int(bool(touching))


if __name__ == "__main__":
    sys.exit(main())
