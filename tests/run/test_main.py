"""The command line: every bad input is one line and code 2 and leaves nothing; help and --cfg answer with 0."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from pipeline.build.problem import prepare
from pipeline.config import run as config
from pipeline.config.compose import checked
from pipeline.problem.objective import Objective
from pipeline.run.main import CONF
from tests.commands import Run, assert_refused, call, command

# What is asked, and what the one line must name.
REFUSED = {
    "group option": (["path=lin"], ["path", "lin", "circle", "line", "waypoints"]),
    "limits option": (["limits=all"], ["limits", "all", "joint", "joint_torque_power", "none"]),
    "robot option": (["robot=unknown"], ["robot", "unknown", "planar3r", "planar3r_printed"]),
    "boundary option": (["boundary=closed"], ["boundary", "closed", "cyclic", "fixed", "free"]),
    "experiment": (["+experiment=traj9"], ["experiment", "traj9", "traj1", "traj4", "sim1"]),
    "hidden option": (["robot=_common"], ["robot = _common", "no such option", "allowed: kinova, panda, planar3r"]),
    "hidden experiment": (["-m", "+experiment=sim1,_sim"], ["experiment = _sim", "no such option"]),
    "closest option": (["robot=pandda"], ["robot = pandda", "did you mean panda?"]),
    "sweeper": (["-m", "hydra/sweeper=bayes"], ["hydra/sweeper = bayes", "allowed: basic", "pip install '.[optuna]'"]),
    "plus forgotten": (["experiment=traj3"], ["experiment=traj3", "did you mean +experiment=traj3?"]),
    "group": (["paths=line"], ["paths", "did you mean path"]),
    "numbers for an option": (["boundary=[1,2]"], ["boundary=[1,2]: "]),
    "key": (["sed=2"], ["sed", "did you mean seed", "methods"]),
    "appended key": (["+sed=2"], ["sed", "did you mean seed", "methods"]),
    "nested key": (["path.lenght=0.2"], ["path.lenght", "did you mean length", "direction", "start"]),
    "appended nested key": (["+path.lenght=0.2"], ["path.lenght", "did you mean length", "direction", "start"]),
    "key of the option": (["path=circle", "path.length=0.2"], ["path.length", "radius", "center_direction"]),
    "deep key": (["method.pmke.horizn=2"], ["method.pmke.horizn", "did you mean horizon", "update_interval"]),
    "method": (["methods=[lsv,gobal]"], ["methods", "gobal", "pmke", "global", "dynamic_programming"]),
    "one method's group": (["method=global"], ["method = global", "methods=[global]"]),
    "some methods' groups": (["method=[lsv,pmke]"], ["method = lsv, pmke", "methods=[lsv, pmke]"]),
    "deleted key": (["~methods"], ["~methods", "deleted"]),
    "deleted group": (["~robot"], ["~robot", "deleted"]),
    "deleted option": (["~robot=planar3r"], ["~robot=planar3r", "deleted"]),
    "deleted methods": (["~method"], ["~method", "deleted"]),
    "deleted value": (["~method.pmke.horizon"], ["~method.pmke.horizon", "deleted"]),
    "deleted key of an option": (["path=circle", "~path.radius"], ["~path.radius", "deleted"]),
    "old front": (["pareto.steps=3"], ["pareto.steps", "method.pareto.steps"]),
    "old front, appended": (["+pareto.steps=3"], ["pareto", "method.pareto"]),
    "old limits": (["method.pmke.limits=true"], ["method.pmke.limits", "methods=[receding]", "method.receding"]),
    "old tail": (["method.pmke.tail=3"], ["method.pmke.tail", "method.receding.tail"]),
    "old formulation": (["method.pontryagin.formulation=both"], ["formulation", "methods=[pontryagin_as_printed]"]),
    "old step": (["+method.pontryagin.dt=0.1"], ["method.pontryagin.dt", "method.pontryagin_as_printed.dt"]),
    "planner of the front": (["method.pareto.planner.optimised=4"], ["planner.optimised", "method.global.optimised"]),
    "three in a front": (
        ["methods=[pareto]", "method.pareto.objectives=[kinetic_energy]"],
        ["method.pareto.objectives = [kinetic_energy]", "two integrals"],
    ),
    "methods no list": (["methods=lsv"], ["methods", "list", "pmke"]),
    "type number": (["path.length=long"], ["path.length", "long", "number"]),
    "type switch": (["path=circle", "path.clockwise=perhaps"], ["path.clockwise", "perhaps", "true or false"]),
    "seed": (["seed=-1"], ["seed", "-1", ">= 0"]),
    "out of reach": (["path.length=2.0", "path.direction=0"], ["path", "out of reach from", "m along", "misses it by"]),
    "no urdf": (["robot.urdf=nowhere.urdf"], ["nowhere.urdf"]),
    "locked joint": (["+robot.locked.elbow=0.1"], ["robot.locked", "elbow", "joint1"]),
    "weights": (
        ["objective=weighted", "objective.torque=0.7"],
        ["objective.kinetic_energy", "objective.torque", "1.2"],
    ),
    "cyclic on open path": (["boundary=cyclic"], ["boundary", "cyclic", "0.4 m", "closed"]),
    "start outside limits": (["limits=joint", "robot.q_init=[2.5,0.327,-0.754]"], ["robot.q_init", "joint1", "limits"]),
    "no file given": (["path=waypoints"], ["path.file", "CSV"]),
    "no file": (["path=waypoints", "path.file=nowhere.csv"], ["path.file", "nowhere.csv", "no such file"]),
    "no equals sign": (["path.length"], ["path.length"]),
    "open bracket": (["methods=[lsv"], ["methods=[lsv"]),
    "dangling": (["+experiment="], ["experiment"]),
    "no key": (["=3"], ["=3"]),
    "group null": (["path=null"], ["path"]),
    "group empty": (["path="], ["path", "line"]),
    "interpolation": (["path.length=${nothing}"], ["path.length", "nothing"]),
    "mandatory missing": (["name=???"], ["name"]),
    "two experiments without -m": (["+experiment=traj1,traj2"], ["experiment", "multirun"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_line_and_leaves_nothing(name: str, run: Run, tmp_path: Path) -> None:
    words, named = REFUSED[name]
    assert_refused(run(*words), *named)
    assert list(tmp_path.iterdir()) == []


def test_entries_of_a_table_are_deleted(run: Run) -> None:
    """Of two obstacles that cannot be one stays, and that one is named."""
    added = [f"+obstacles.shapes.{name}={{kind: ball, size: [{size}]}}" for name, size in (("near", -1), ("far", -2))]
    assert_refused(run(*added, "~obstacles.shapes.near"), "obstacles.shapes.far", "kind", "ball")
    assert_refused(run(*added, "~obstacles.shapes.far"), "obstacles.shapes.near", "kind", "ball")


TABLES = {
    "a value that is not a number": ("x,y\n0.4,0.0\nnan,0.1\n", ["row 2", "finite"]),
    "a word": ("x,y\n0.4,0.0\n0.3,here\n", ["row 2", "finite"]),
    "a missing column": ("x,z\n0.4,0.0\n0.3,0.1\n", ["no column y", "x, z"]),
    "one way-point": ("x,y\n0.4,0.0\n", ["1 way-point,", "at least 2"]),
    "no way-point": ("x,y\n", ["0 way-points", "at least 2"]),
    "nothing": ("", ["CSV"]),
    "a repeated point": ("x,y\n0.4,0.0\n0.4,0.0\n0.3,0.1\n", ["1 and 2", "same point"]),
    "points out of reach": ("x,y\n0.46,0.0\n0.9,0.0\n1.5,0.0\n", ["out of reach from", "misses it by"]),
}


@pytest.mark.parametrize("name", TABLES)
def test_bad_way_points(name: str, run: Run, tmp_path: Path) -> None:
    text, named = TABLES[name]
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    assert_refused(run("path=waypoints", "path.file=points.csv"), "path", *named)
    assert [file.name for file in tmp_path.iterdir()] == ["points.csv"]


@pytest.mark.slow
def test_a_path_that_leaves_the_reach_says_where_and_by_how_much(run: Run) -> None:
    """The numbers of the message are those of the arm's length."""
    task = prepare(config.RunConfig()).task
    reach = float(np.linalg.norm(task.value(np.zeros((1, 3)))))
    start = task.value(np.array([[0.0, 0.327, -0.754]]))[0]
    answer = run("path.length=0.5", "path.direction=0.0")
    words = answer.error.split()
    leaves = float(words[words.index("from") + 1])
    missed = float(words[words.index("to") + 1])
    assert start[0] + leaves == pytest.approx(reach, abs=0.006)  # looked at every 5 mm
    assert missed == pytest.approx(np.hypot(start[0] + 0.5, start[1]) - reach, rel=5e-3)


@pytest.mark.parametrize("kind", ["kinetic_energy", "torque"])
def test_an_objective_is_what_it_is_called(kind: str) -> None:
    """`kind` is printed in the tables: it must not name what is not minimised."""
    with initialize_config_dir(CONF, version_base="1.3"):
        config = checked(compose("config", overrides=[f"objective.kind={kind}"]))
    assert config.objective.kind == kind
    assert prepare(config).objective == Objective({kind: 1.0})


@pytest.mark.parametrize(
    ("methods", "more"),
    [
        ("dynamic_programming", ["objective=torque"]),
        ("calculus_of_variations", ["objective=torque"]),
        ("calculus_of_variations", ["limits=joint"]),
        ("calculus_of_variations", ["path=circle", "boundary=cyclic"]),
    ],
)
def test_a_method_that_cannot_take_the_problem(methods: str, more: list[str], run: Run, tmp_path: Path) -> None:
    assert_refused(run(f"methods=[lsv,{methods}]", *more), methods)
    assert list(tmp_path.iterdir()) == []


def test_an_output_folder_below_a_file(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here", encoding="utf-8")
    assert_refused(run("methods=[lsv]", f"hydra.run.dir={tmp_path}/file/results"), str(tmp_path / "file"))
    assert (tmp_path / "file").read_text(encoding="utf-8") == "here"
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_an_output_folder_that_is_a_file(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here", encoding="utf-8")
    assert_refused(run("methods=[lsv]", f"hydra.run.dir={tmp_path}/file"), str(tmp_path / "file"))
    assert (tmp_path / "file").read_text(encoding="utf-8") == "here"


@pytest.mark.parametrize("words", [["--help"], ["--cfg", "job"], ["--cfg", "job", "+experiment=traj3"], ["--version"]])
def test_questions_are_answered(words: list[str], run: Run, tmp_path: Path) -> None:
    answer = run(*words)
    assert answer.code == 0
    assert answer.error == ""
    assert answer.out.strip()
    assert list(tmp_path.iterdir()) == []


def test_help_names_the_groups_and_cfg_the_values(run: Run) -> None:
    answer = run("--help")
    for group in ("robot", "path", "timing", "objective", "limits", "boundary", "method", "experiment"):
        assert group in answer.out
    assert "planar3r_printed" in answer.out
    answer = run("--cfg", "job", "+experiment=traj4", "timing.steps=42")
    assert "length: 0.7" in answer.out
    assert "steps: 42" in answer.out


def test_an_unknown_flag(run: Run, tmp_path: Path) -> None:
    answer = run("--nonsense")
    assert answer.code == 2
    assert "Traceback" not in answer.error
    assert "--nonsense" in answer.error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_bad_input_as_a_process(tmp_path: Path) -> None:
    """What the user sees: stderr holds the one line, without a warning of an import before it."""
    answer = command("+experiment=traj3", "path.lenght=0.2", folder=tmp_path)
    assert_refused(answer, "path.lenght", "did you mean length")
    assert answer.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_table_that_is_given_whole_names_the_entry_that_is_not_known(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    answer = call(monkeypatch, capfd, "timing={durations:1}")
    assert answer.error.startswith("error: timing.durations: unknown key; did you mean duration?")
    answer = call(monkeypatch, capfd, "obstacles.shapes={ball:{kind:sphere}}")
    assert "obstacles.shapes.ball: entries are added with a plus, as +obstacles.shapes.ball=..." in answer.error


def test_mp4_needs_ffmpeg(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    answer = run("methods=[lsv]", "timing.steps=4", "artifacts.animation=mp4")
    assert_refused(answer, "artifacts.animation = mp4: needs ffmpeg: pip install '.[film]'; gif needs none")


def test_a_key_of_an_option_that_is_not_picked_names_that_one(run: Run) -> None:
    said = "error: base.mass: the option picked in base has no keys; base=free has this one"
    assert run("base.kind=free", "base.mass=20").error.startswith(said)


def test_files_of_ones_own_are_picked_as_the_projects(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "mine" / "experiment"
    folder.mkdir(parents=True)
    (folder / "own.yaml").write_text("# @package _global_\nname: own\nseed: 5\n")
    answer = run("--config-dir", "mine", "+experiment=own", "--cfg", "job")
    assert answer.code == 0
    assert {"name: own", "seed: 5"} <= {*answer.out.splitlines()}
    assert_refused(run("--config-dir", "mine", "+experiment=onw"), "did you mean own?")
    assert_refused(run("--config-dir", "nowhere", "+experiment=own"), "nowhere' not found")
