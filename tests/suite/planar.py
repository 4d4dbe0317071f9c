"""Thirty random problems of the planar arm with what a brute-force search knows of them: `planar.csv`, written by

    python -m tests.suite.planar

which draws the problems from fixed seeds and searches each from 600 random motions (`brute.py`).

Seventeen more motions, optima on 100 intervals, leave their path between the knots by more than path.tolerance and are
not listed: on 200, 400 and 800 intervals fifteen of them cost ever more, 1.4 to 7 times as much, as jumps do, or are
lost; on 1600 the other two, both of free7, fall into optima that are listed. One more, of cyclic4, winds, and
does not last either (`brute.py`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from tests.suite.brute import optima
from tests.support import composed

FILE = Path(__file__).with_suffix(".csv")
KINDS = ("fixed", "free", "cyclic", "long")
COUNTS = {"fixed": 10, "free": 10, "cyclic": 5, "long": 5}
STARTS = 600
BELOW = 3.0  # times the best: optima up to there are listed


def draw(kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """The command line of one random problem."""
    q = ", ".join(f"{angle:.3f}" for angle in rng.uniform(-2.5, 2.5, 3))
    words = ["robot=planar3r", f"robot.q_init=[{q}]", f"timing.duration={rng.choice([1, 2, 4])}", "timing.steps=100"]
    if kind == "cyclic":
        return (*words, "boundary=cyclic", "path=circle", f"path.radius={rng.uniform(0.03, 0.12):.3f}")
    length = rng.uniform(0.6, 0.85) if kind == "long" else rng.uniform(0.1, 0.6)
    words += ["path=line", f"path.length={length:.3f}", f"path.direction={rng.uniform(0, 360):.1f}"]
    return (*words, f"boundary={'fixed' if kind == 'fixed' else 'free'}")


def problems() -> dict[str, tuple[str, ...]]:
    """Names and command lines; those that the arm cannot reach are drawn again."""
    found: dict[str, tuple[str, ...]] = {}
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng(number)
        while sum(name.startswith(kind) for name in found) < COUNTS[kind]:
            words = draw(kind, rng)
            try:
                problem = prepare(composed(*words))
            except InputError:
                continue
            reach = 0.985 * 0.4895  # of the arm's three links
            if np.linalg.norm(problem.reference.position(problem.times), axis=1).max() < reach:
                found[f"{kind}{sum(name.startswith(kind) for name in found)}"] = words
    return found


def main() -> None:
    """Write the file."""
    rows = []
    for name, words in problems().items():
        costs, left_out = optima(prepare(composed(*words)), STARTS, len(rows), BELOW)
        listed = " ".join(f"{cost:.8g}" for cost in costs)
        rows.append({"name": name, "command": " ".join(f"'{word}'" for word in words), "optima": listed})
        print(name, listed, f"({left_out} more on these knots alone)" if left_out else "", flush=True)
    pd.DataFrame(rows).to_csv(FILE, index=False)


if __name__ == "__main__":
    main()
