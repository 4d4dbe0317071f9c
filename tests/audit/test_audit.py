"""`make audit` on two runs, and that it sees what is wrong in them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest

from tests.audit.__main__ import audit, main
from tests.audit.audit import ALLOWED, KINDS


@pytest.mark.slow
def test_another_library_gives_the_same_tables(reproduced: Path) -> None:
    table = audit([reproduced / "runs" / "traj1", reproduced / "runs" / "sim5"])
    assert {*table["motion"]} >= {"lsv 1", "pmke 1", "global 1", "global 2"}
    kinds = [kind for kind in KINDS if kind not in ("clearance", "base")]
    assert table[kinds].notna().all(axis=None)
    assert (table[kinds].max() < ALLOWED).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("column", "seen"), [("tau_2", "torques"), ("x", "place"), ("q_1", "energy"), ("qd_3", "torques")]
)
def test_it_sees_a_wrong_table(reproduced: Path, tmp_path: Path, column: str, seen: str) -> None:
    run = tmp_path / "case1"
    shutil.copytree(reproduced / "runs" / "case1", run)
    motions = pd.read_parquet(run / "trajectories.parquet")
    motions[column] *= 1 + 1e-4
    motions.to_parquet(run / "trajectories.parquet", index=False)
    assert audit([run])[seen].max() > ALLOWED
    assert main([str(run)]) == 1
