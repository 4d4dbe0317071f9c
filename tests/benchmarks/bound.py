"""The bound from below on the suite's problems of redundancy degree 1: how near it comes to the best motion, how fast.

All at 12 intervals, simulation 1 and trajectory 4 of the papers at 50 and 100 too. Timed is processor time: the
search for the motion, the tracing of the loops, the rounds of cells, and the finish on the problem's own knots.
"""

from __future__ import annotations

import sys
import time

import pandas as pd

from pipeline.build.problem import prepare
from pipeline.config.methods import LowerBoundOptions
from pipeline.methods.lower_bound import lower_bound, percent
from tests.suite.planar import FILE
from tests.support import composed

COARSE, FINER = 12, (50, 100)
EXPERIMENTS = ("sim1", "sim2", "sim5", "traj1", "traj2", "traj3", "traj4")
FINE = ("sim1", "traj4")
HEAD = f"{'bound from below':<14} {'intervals':>9} {'best':>12} {'gap':>9} {'time [s]':>9} {'rounds':>6} {'links':>8}"


def problems() -> dict[str, tuple[str, ...]]:
    """Names and command lines."""
    known = pd.read_csv(FILE, quotechar='"').set_index("name")["command"]
    suite = {str(name): tuple(word.strip("'") for word in line.split("' '")) for name, line in known.items()}
    return {**{name: (f"+experiment={name}",) for name in EXPERIMENTS}, **suite}


def row(name: str, words: tuple[str, ...], intervals: int) -> float:
    """Print one line; the relative gap."""
    problem = prepare(composed(*words))
    begin = time.process_time()
    (solution,) = lower_bound(problem, LowerBoundOptions(intervals=intervals))
    seconds, found = time.process_time() - begin, solution.statistics
    sizes = [entry["links"] for entry in found["rounds"]]
    note = "" if found["cost"] == found["cost_from_roadmap"] else f"   roadmap {found['cost_from_roadmap']:.6g}"
    print(
        f"{name:<14} {intervals:9d} {found['cost']:12.6g} {percent(found['gap']):>9} {seconds:9.2f} {len(sizes):6d} "
        f"{max(sizes):8d}{note}",
        flush=True,
    )
    return float(found["gap"])


def main(names: list[str]) -> None:
    """All problems, or those named; a name may ask for other intervals, as in sim1:100."""
    known = problems()
    unknown = {word.partition(":")[0] for word in names} - set(known)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not one of {', '.join(known)}")
    asked = [(name, COARSE) for name in known] + [(name, size) for name in FINE for size in FINER]
    if names:
        parts = [(name, size or COARSE) for name, _, size in (word.partition(":") for word in names)]
        asked = [(name, int(size)) for name, size in parts]
    print(HEAD)
    for name, intervals in asked:
        row(name, known[name], intervals)
