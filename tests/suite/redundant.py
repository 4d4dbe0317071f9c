"""Eleven problems with two redundant joints or more, or poses in space, with what a brute-force search knows of them:
`redundant.csv`, written by

    python -m tests.suite.redundant [NAME ...]

Four lines of the planar 4R arm and three of the Panda within its joint limits are drawn from fixed seeds; the others
are the experiments of the same names. Each is searched from 600 random motions (`brute.py`).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from tests.suite.brute import optima
from tests.support import composed

FILE = Path(__file__).with_suffix(".csv")
EXPERIMENTS = ("planar4r", "panda", "panda_pose", "xarm7")
COUNTS = {"four": 4, "line": 3}
STARTS = 600
BELOW = 1.5  # times the best: optima up to there are listed
REACH = {"four": 0.95, "line": 0.75}  # [m] from the base
PANDA = ("robot=panda", "boundary.rest=[]", "limits=joint", "timing.duration=4", "timing.steps=100")


def draw(kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """The command line of one random problem: a planar 4R arm's, free or from a given start, or a Panda's."""
    boundary = f"boundary={rng.choice(['fixed', 'free'])}"
    if kind == "four":
        q = ", ".join(f"{angle:.3f}" for angle in rng.uniform(-2.0, 2.0, 4))
        words = [
            "robot=planar4r",
            f"robot.q_init=[{q}]",
            f"timing.duration={rng.choice([1, 2, 4])}",
            "timing.steps=100",
        ]
        line = [f"path.length={rng.uniform(0.2, 0.6):.3f}", f"path.direction={rng.uniform(0, 360):.1f}"]
        return (*words, "path=line", *line, boundary)
    usual = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    q = ", ".join(f"{angle:.3f}" for angle in usual + rng.uniform(-0.5, 0.5, 7))
    direction = rng.normal(size=3)
    x, y, z = direction / np.linalg.norm(direction)
    line = [f"path.length={rng.uniform(0.2, 0.5):.3f}", f"path.direction=[{x:.3f}, {y:.3f}, {z:.3f}]"]
    return (*PANDA, f"robot.q_init=[{q}]", "path=line", *line, boundary)


def problems() -> dict[str, tuple[str, ...]]:
    """Names and command lines; those that the arm cannot reach with ease are drawn again."""
    found: dict[str, tuple[str, ...]] = {name: (f"+experiment={name}",) for name in EXPERIMENTS}
    for number, (kind, count) in enumerate(COUNTS.items()):
        rng = np.random.default_rng(number)
        numbers = iter(range(count))
        left = next(numbers, None)
        while left is not None:
            words = draw(kind, rng)
            try:
                problem = prepare(composed(*words))
            except InputError:
                continue
            path = problem.reference.position(problem.times)
            if np.linalg.norm(path, axis=1).max() < REACH[kind]:
                found[f"{kind}{left}"] = words
                left = next(numbers, None)
    return found


def main(names: list[str]) -> None:
    """Write the file, or only print what is found of the problems named."""
    rows = []
    for number, (name, words) in enumerate(problems().items()):
        if names and name not in names:
            continue
        costs, left_out = optima(prepare(composed(*words)), STARTS, number, BELOW)
        listed = " ".join(f"{cost:.8g}" for cost in costs)
        rows.append({"name": name, "command": " ".join(f"'{word}'" for word in words), "optima": listed})
        print(name, words, listed, f"({left_out} more on these knots alone)" if left_out else "", flush=True)
    if not names:
        pd.DataFrame(rows).to_csv(FILE, index=False)


if __name__ == "__main__":
    main(sys.argv[1:])
