"""`python -m pipeline.suite FOLDER [--only NAME] [--folder DIR]`: solve the problems of a folder and judge the motions.

FOLDER holds problems as YAML files, ours or CppFlow's. Into DIR (outputs/suite) come suite.csv and suite.md, a row per
problem: what was found, recomputed from its motion. Exit code 0: all are solved; 1: one is not; 2: bad input.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.common.errors import ConfigError, InputError

FOLDER = Path("outputs") / "suite"


def main(words: Sequence[str]) -> int:
    """Run a suite; returns the exit code."""
    if {"--help", "-h"} & {*words} or not words:
        print(__doc__)
        return 0 if words else 2
    try:
        problems, folder, only = parse(words)
        return run(problems, folder, only)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def parse(words: Sequence[str]) -> tuple[Path, Path, str]:
    """The folder of problems, the one to write into, and the name of the only one that is asked for, or nothing."""
    given: dict[str, str] = {}
    plain, rest = [], iter(words)
    for word in rest:
        if word in ("--folder", "--only"):
            value = next(rest, None)
            if value is None:
                raise ConfigError(f"{word}: needs a value")
            given[word] = value
        else:
            plain.append(word)
    if len(plain) != 1:
        raise ConfigError(f"one folder of problems is needed, {len(plain)} are given")
    return Path(plain[0]), Path(given.get("--folder", FOLDER)), given.get("--only", "")


def run(problems: Path, folder: Path, only: str = "") -> int:
    """Solve them one after the other, writing the table after each."""
    from pipeline.suite.read import cases
    from pipeline.suite.solve import row
    from pipeline.suite.table import save

    found = [case for case in cases(problems, folder / "paths") if only in ("", case.name)]
    if not found:
        raise ConfigError(f"--only: {problems} has no problem {only}")
    rows = []
    for case in found:
        rows.append(row(case))
        print(f"{case.name}: {rows[-1]['status']}, {rows[-1]['time_s']:.3g} s", flush=True)
        save(folder, rows)
    print(f"table in {folder}")
    return 0 if all(one["status"] == "solved" for one in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
