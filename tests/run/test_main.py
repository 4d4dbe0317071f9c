"""The command line: every bad input is one line and code 2 and leaves nothing; help and --cfg answer with 0."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config import run as config
from pipeline.config.compose import checked
from pipeline.problem.objective import Objective
from pipeline.run import main as __main__
from pipeline.run import session
from pipeline.run.main import CONF
from tests.support import ROOT
from tests.tasks import HUNG


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    error: str


Run = Callable[..., Answer]


def call(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str] | None,
    *words: str,
    entry: Callable[[], int] = __main__.main,
) -> Answer:
    """The command line within this process: no imports to wait for. What it prints is lost without `capfd`."""
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # main() sets it; this puts it back
    monkeypatch.setattr(session, "exit_code", 0)
    monkeypatch.setattr(sys, "argv", ["pipeline", *words])
    GlobalHydra.instance().clear()
    if capfd is not None:
        capfd.readouterr()
    try:
        code = entry()
    except SystemExit as leaving:
        code = int(leaving.code or 0)
    finally:
        GlobalHydra.instance().clear()
    return Answer(code, *(capfd.readouterr() if capfd is not None else ("", "")))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Call the command line in an empty folder; results would go to `outputs/` there."""
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd)


def command(*words: str, folder: Path) -> Answer:
    """The command line as a process of its own, started in `folder`."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "pipeline", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=HUNG,
        check=False,
    )
    return Answer(done.returncode, done.stdout, done.stderr)


def assert_refused(answer: Answer, *named: str) -> None:
    lines = answer.error.splitlines()
    assert answer.code == 2, answer
    assert len(lines) == 1, answer.error
    assert lines[0].startswith("error: ")
    assert "Traceback" not in answer.error + answer.out
    assert "Error(" not in lines[0]
    for words in named:
        assert words in lines[0], f"{words!r} is missing in: {lines[0]}"


# What is asked, and what the one line must name.
REFUSED = {
    "group option": (["path=lin"], ["path", "lin", "circle", "line", "waypoints"]),
    "limits option": (["limits=all"], ["limits", "all", "joint", "joint_torque_power", "none"]),
    "robot option": (["robot=unknown"], ["robot", "unknown", "planar3r", "planar3r_printed"]),
    "boundary option": (["boundary=closed"], ["boundary", "closed", "cyclic", "fixed", "free"]),
    "experiment": (["+experiment=traj9"], ["experiment", "traj9", "traj1", "traj4", "sim1"]),
    "hidden option": (["robot=_common"], ["robot = _common", "no such option", "allowed: panda, planar3r"]),
    "hidden experiment": (["-m", "+experiment=sim1,_sim"], ["experiment = _sim", "no such option"]),
    "closest option": (["robot=pandda"], ["robot = pandda", "did you mean panda?"]),
    "plus forgotten": (["experiment=traj3"], ["experiment=traj3", "did you mean +experiment=traj3?"]),
    "group": (["paths=line"], ["paths", "did you mean path"]),
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


# Values are refused alike however they come; these come without the command line, which would take most of the time.
VALUES = {
    "no method": (["methods=[]"], ["methods", "lsv", "pmke", "global"]),
    "method twice": (["methods=[lsv,lsv]"], ["methods", "twice"]),
    "type count": (["timing.steps=10.5"], ["timing.steps", "10.5", "whole number"]),
    "type list": (["robot.q_init=0.3"], ["robot.q_init", "list"]),
    "type table": (["timing=3"], ["timing", "3"]),
    "null": (["timing.duration=null"], ["timing.duration", "> 0"]),
    "infinite": (["timing.duration=inf"], ["timing.duration", "> 0"]),
    "nan": (["path.length=nan"], ["path.length", "> 0"]),
    "negative duration": (["timing.duration=-1"], ["timing.duration", "-1", "> 0", "s"]),
    "zero duration": (["timing.duration=0"], ["timing.duration", "> 0"]),
    "negative steps": (["timing.steps=-5"], ["timing.steps", "-5", ">="]),
    "no steps": (["timing.steps=0"], ["timing.steps", "0", ">="]),
    "dense": (["timing.dense=[[2,1,3]]"], ["timing.dense", "from", "factor"]),
    "negative length": (["path.length=-0.1"], ["path.length", "-0.1", "> 0"]),
    "choice": (["method.lsv.integrator=rk4"], ["method.lsv.integrator", "rk4", "euler", "heun"]),
    "horizon": (["method.pmke.horizon=0"], ["method.pmke.horizon", "0", ">= 1"]),
    "workers": (["parallel.workers=0"], ["parallel.workers", "0", ">= 1"]),
    "start out of reach": (["path.start=[3.0,0.0]"], ["start", "out of reach", "m"]),
    "start length": (["path.start=[0.3,0.1,0.0]"], ["path.start", "2 numbers"]),
    "direction": (["path.direction=[0,0]"], ["path.direction", "2 numbers"]),
    "direction in space": (["path.direction=[0,0,1]"], ["path.direction", "2 numbers"]),
    "no frame": (["robot.end_effector=hand"], ["hand", "tip"]),
    "no base": (["robot.base=floor"], ["floor"]),
    "no redundancy": (["robot.task=[x,y,z]"], ["robot.task", "3 joints", "3 task coordinates"]),
    "task word": (["robot.task=[x,w]"], ["robot.task", "w", "x, y, z"]),
    "q_init short": (["robot.q_init=[0.1,0.2]"], ["robot.q_init", "2", "3", "joint1"]),
    "q_init long": (["robot.q_init=[0.1,0.2,0.3,0.4]"], ["robot.q_init", "4", "3"]),
    "q_init word": (["robot.q_init=[0.1,0.2,up]"], ["robot.q_init[2]", "up", "number"]),
    "locked table": (["robot.locked={elbow: 0.1}"], ["robot.locked", "elbow"]),
    "urdf null": (["robot.urdf=null"], ["robot.urdf", "null"]),
    "limits length": (["limits.velocity=[1.0,2.0]"], ["limits.velocity", "2", "3"]),
    "limits sign": (["limits.velocity=-1"], ["limits.velocity", "-1", "> 0"]),
    "limits contradict": (["limits.lower=1.0", "limits.upper=-1.0"], ["limits.lower", "limits.upper", "joint1"]),
    "far too many steps": (["timing.steps=100000000000"], ["timing.steps"]),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_bad_value_is_one_line(name: str) -> None:
    words, named = VALUES[name]
    line = OmegaConf.create({"path": {"kind": "line"}})
    values: Any = OmegaConf.to_container(OmegaConf.merge(line, OmegaConf.from_dotlist(words)))
    with pytest.raises(InputError) as raised:
        prepare(config.check(values))
    assert_refused(Answer(2, "", f"error: {raised.value}\n"), *named)


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_line_and_leaves_nothing(name: str, run: Run, tmp_path: Path) -> None:
    words, named = REFUSED[name]
    assert_refused(run(*words), *named)
    assert list(tmp_path.iterdir()) == []


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


URDF = """<robot name="bad">
  <link name="base"/>
  {links}
</robot>"""
JOINT = """<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><origin xyz="0.2 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="3" effort="1"/></joint>"""


def robot(joints: int, inertia: str) -> str:
    parents = ["base", *[f"l{i}" for i in range(joints)]]
    links = [f'<link name="l{i}">{inertia}</link>' + JOINT.format(i=i, parent=parents[i]) for i in range(joints)]
    return URDF.format(links="\n  ".join(links))


SOLID = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROBOTS = {
    "no inertia": (robot(3, ""), 3, ["inertia"]),
    "unphysical inertia": (robot(3, SOLID.replace('izz="0.1"', 'izz="0.5"')), 3, ["l0", "inertia that no body has"]),
    "a floating joint": (robot(3, SOLID).replace("revolute", "floating", 1), 3, ["j0", "floating", "revolute"]),
    "a mimicking joint": (
        robot(3, SOLID).replace("</joint>", '<mimic joint="j1"/></joint>', 1),
        3,
        ["j0", "mimics", "robot.locked.j0"],
    ),
    "two joints for two coordinates": (robot(2, SOLID), 2, ["robot.task", "2 joints", "redundancy"]),
    "not xml": ("<robot", 3, ["arm.urdf"]),
    "another document": ("<sdf/>", 3, ["arm.urdf"]),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_bad_robots(name: str, run: Run, tmp_path: Path) -> None:
    text, joints, named = ROBOTS[name]
    file = tmp_path / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    q_init = ",".join(["0.3"] * joints)
    answer = run(
        f"robot.urdf={file}", f"robot.end_effector=l{joints - 1}", f"robot.q_init=[{q_init}]", "path.length=0.05"
    )
    assert_refused(answer, *named)
    assert [file.name for file in tmp_path.iterdir()] == ["arm.urdf"]


def test_a_robot_without_any_fault_is_taken(run: Run, tmp_path: Path) -> None:
    """So that the test above fails for the reason it names."""
    file = tmp_path / "arm.urdf"
    file.write_text(robot(3, SOLID), encoding="utf-8")
    words = [f"robot.urdf={file}", "robot.end_effector=l2", "robot.q_init=[0.3,0.4,0.3]", "path.length=0.05"]
    assert_refused(run(*words, "boundary=cyclic"), "boundary")  # got as far as the last check


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
def test_a_bad_robot_as_a_process(tmp_path: Path) -> None:
    """Neither Drake nor Hydra adds a line of its own."""
    file = tmp_path / "arm.sdf"
    links = [f'<link name="l{i}"><pose>0.{2 * i} 0 0 0 0 0</pose>{{}}</link>' for i in range(4)]
    bad = "<inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.5</izz></inertia></inertial>"
    joint = '<joint name="j{0}" type="revolute"><parent>l{0}</parent><child>l{1}</child><axis><xyz>0 0 1</xyz></axis></joint>'
    joints = [joint.format(i, i + 1) for i in range(3)]
    model = "".join([*(link.format(bad) for link in links), *joints])
    file.write_text(f'<sdf version="1.9"><model name="arm">{model}</model></sdf>', encoding="utf-8")
    answer = command(f"robot.urdf={file}", "robot.end_effector=l3", "robot.q_init=[0.1,0.2,0.3]", folder=tmp_path)
    assert_refused(answer, "robot.urdf", "link 'l1'", "inertia that no body has")
    assert answer.out == ""
    assert [file.name for file in tmp_path.iterdir()] == ["arm.sdf"]
