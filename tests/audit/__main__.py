"""`python -m tests.audit [FOLDER ...]`: shipped experiments, or finished runs, recomputed by pinocchio and coal.

Without folders the experiments below are run in outputs/audit, resumed where that was, and docs/audit.md is written.
Exit code 1 if a number differs by more than 1e-6.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.common.markdown import markdown_table
from pipeline.reproduce.__main__ import sweep
from tests.audit.audit import ALLOWED, KINDS, rows
from tests.audit.library import Run

FILE = Path(__file__).resolve().parents[2] / "docs" / "audit.md"
FOLDER = Path("outputs") / "audit"
EXPERIMENTS = (
    *("traj1", "traj2", "traj3", "traj4", "sim1", "sim2", "sim3", "sim4", "sim5", "case1", "case2", "case3", "case4a"),
    *("sim3_sendable", "sim4_sendable", "traj3_sendable", "planar4r", "floating3r", "panda", "panda_obstacle", "xarm7"),
)


def audit(folders: Sequence[Path]) -> pd.DataFrame:
    """A row per motion of the runs."""
    found = [row for folder in folders for row in rows(Run(folder))]
    return pd.DataFrame(found, columns=["experiment", "motion", *KINDS])


def text(table: pd.DataFrame) -> str:
    """docs/audit.md."""
    shown = [[*row[:2], *("" if np.isnan(value) else f"{value:.1e}" for value in row[2:])] for row in table.to_numpy()]
    worst = table[list(KINDS)].max()
    shown.append(["*largest*", "", *(f"{value:.1e}" for value in worst)])
    return "\n".join(
        [
            "# Recomputed by another library",
            "",
            "Written by `make audit` (`python -m tests.audit`): the motions in `trajectories.parquet` of the shipped "
            "experiments through pinocchio and coal, which share nothing with Drake. By how much the tables differ: "
            "place of the end effector, its largest distance from its path, clearance and pose of a floating base "
            "(from zero momentum) in m and rad, torques and integrals relative.",
            "",
            f"{len(table)} motions of {table['experiment'].nunique()} experiments, made with Drake {version('drake')}, "
            f"recomputed with pinocchio {version('pin')} and coal {version('coal')}; allowed is {ALLOWED:.0e}.",
            "",
            *markdown_table([list(table.columns), *shown]),
            "",
        ]
    )


def main(words: Sequence[str]) -> int:
    """The exit code."""
    folders = [Path(word) for word in words]
    if not folders:
        if sweep(EXPERIMENTS, FOLDER.absolute()) >= 2:
            return 2
        folders = [FOLDER / name for name in EXPERIMENTS]
    table = audit(folders)
    if not words:
        FILE.write_text(text(table), encoding="utf-8")
    print(table.to_string(index=False, float_format="{:.1e}".format, na_rep=""))
    return int(bool((table[list(KINDS)].max() > ALLOWED).any()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
