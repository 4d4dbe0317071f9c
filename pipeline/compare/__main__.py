"""`python -m pipeline.compare RUN RUN ... [--folder DIR]`: runs that exist, beside each other.

RUN is the folder of a run. Into DIR (outputs/comparison) come comparison.csv and comparison.md, a row per run and
motion; comparison.png, their energies and torques; and report.html, the page over all of them. Nothing is solved again.
Exit code 0, or 2 for bad input.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.common.errors import ConfigError, InputError, OutputError

FOLDER = Path("outputs") / "comparison"


def main(words: Sequence[str]) -> int:
    """Compare the runs that are named; returns the exit code."""
    if {"--help", "-h"} & {*words} or not words:
        print(__doc__)
        return 0 if words else 2
    try:
        runs, folder = parse(words)
        compare(runs, folder)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"comparison in {folder}")
    return 0


def parse(words: Sequence[str]) -> tuple[list[Path], Path]:
    """The folders of runs, and the one to write into; raises ConfigError for what is none."""
    runs, folder, rest = [], FOLDER, iter(words)
    for word in rest:
        if word == "--folder":
            given = next(rest, None)
            if given is None:
                raise ConfigError("--folder: needs a folder")
            folder = Path(given)
        elif not (Path(word) / "summary.csv").is_file():
            raise ConfigError(f"{word}: not the folder of a run, it has no summary.csv")
        else:
            runs.append(Path(word).absolute())
    if len({*runs}) < len(runs):
        raise ConfigError("a run is named twice")
    if not runs:
        raise ConfigError("no run is named")
    if any(folder.absolute() == run for run in runs):
        raise OutputError(f"{folder}: is the folder of a run, which keeps its own report.html")
    return runs, folder


def compare(runs: Sequence[Path], folder: Path) -> None:
    """Write tables, figure and page of `runs` into `folder`."""
    from pipeline.artifacts import sweep
    from pipeline.artifacts.page import several
    from pipeline.compare.figure import draw

    called = names(runs)
    sweep.save(folder, "comparison", "Comparison", runs, called)
    several.write(folder, "Comparison", runs, called)
    draw(folder / "comparison.png", folder / "comparison.csv")


def names(runs: Sequence[Path]) -> list[str]:
    """What tells the runs apart: their folders' names, with those of the folders above where they are the same."""
    shared = Path(os.path.commonpath([run.parent for run in runs]))
    short = [run.name for run in runs]
    return short if len({*short}) == len(runs) else [str(run.relative_to(shared)) for run in runs]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
