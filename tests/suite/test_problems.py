"""Suites of problems as data: ours can all be posed, CppFlow's files are read, and a run leaves its table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.common.errors import ConfigError
from pipeline.suite.__main__ import main
from pipeline.suite.read import cases

PROBLEMS = Path(__file__).parent / "problems"
WORDS = "path.length=0.1, timing.steps=12, method.global.optimised=2, method.global.nodes=40"
QUICK = f"about: a short line\nwords: [{WORDS}]\n"


def test_every_problem_says_what_it_is_and_names_paths_that_are_there(tmp_path: Path) -> None:
    found = cases(PROBLEMS, tmp_path)
    assert len(found) >= 12
    assert all(case.about for case in found)
    files = [Path(word.partition("=")[2]) for case in found for word in case.words if word.startswith("path.file=")]
    assert files
    assert all(file.is_file() for file in files)


def test_a_problem_of_cppflow_is_moved_turned_and_surrounded_as_it_says(tmp_path: Path) -> None:
    problems, paths = tmp_path / "problems", tmp_path / "paths"
    problems.mkdir()
    paths.mkdir()
    half = np.sqrt(0.5)
    rows = [f"0,0.1,0,0,1,0,0,0\n1,0.2,0,0,{half},0,0,{half}"]
    (paths / "two.csv").write_text(",0,1,2,3,4,5,6\n" + "\n".join(rows) + "\n")
    (problems / "panda__two.yaml").write_text(
        "robot: panda\npath_name: two\npath_offset_frame: world\npath_xyz_offset: [0, 0.5, 0.75]\n"
        "path_R_offset: [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]\nobstacle_xyz_offset: [0, 0, 0.1]\nobstacles:\n"
        "  - [x: 0.2, y: 0.3, z: 0.4, roll: 0.0, pitch: 0.0, yaw: 0.0, size_x: 0.1, size_y: 0.2, size_z: 0.3]\n"
    )
    (case,) = cases(problems, tmp_path / "made")
    assert "robot.end_effector=panda_hand" in case.words
    assert any("center: [0.2, 0.3, 0.5], size: [0.1, 0.2, 0.3]" in word for word in case.words)
    table = pd.read_csv(tmp_path / "made" / "panda__two.csv")
    np.testing.assert_allclose(table[["x", "y", "z"]], [[0.1, 0.5, 0.75], [0.2, 0.5, 0.75]])
    # A quarter turn about y; the second one after a quarter turn about z.
    np.testing.assert_allclose(table[["qx", "qy", "qz", "qw"]], [[0, half, 0, half], [-0.5, 0.5, 0.5, 0.5]], atol=1e-12)
    (problems / "fetch__two.yaml").write_text("robot: fetch\npath_name: two\n")
    with pytest.raises(ConfigError, match="robot fetch is not known here; known are panda"):
        cases(problems, tmp_path / "made")


@pytest.mark.slow
def test_a_suite_leaves_a_row_for_each_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problems = tmp_path / "problems"
    problems.mkdir()
    (problems / "short.yaml").write_text(QUICK)
    assert main([str(problems), "--folder", str(tmp_path / "out")]) == 0
    row = pd.read_csv(tmp_path / "out" / "suite.csv").iloc[0]
    assert (row["problem"], row["status"], row["pieces"]) == ("short", "solved", 1)
    assert row["energy"] > 0
    assert row["path_error_m"] < 1e-4
    assert "| short" in (tmp_path / "out" / "suite.md").read_text()
    assert main([str(problems), "--only", "long"]) == 2
    assert main([str(tmp_path / "nothing")]) == 2
    assert "has no problem long" in capsys.readouterr().err
