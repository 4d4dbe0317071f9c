"""The recording holds what was computed, survives broken input, and opens in the real viewer without complaint."""

from __future__ import annotations

import ctypes.util
import dataclasses
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from pipeline.artifacts.recording import blueprint, recording
from pipeline.artifacts.recording.arm import _rigid
from pipeline.config.methods import GlobalOptions, LsvOptions
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lsv import lsv
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line, direction_vector
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.problem import Problem
from pipeline.robot import urdf
from pipeline.robot.shapes import Shape, capsule
from tests.reports import chunks, component
from tests.support import ROOT
from tests.tasks import HUNG, wait_until

ROBOT = ROOT / "robots" / "planar3r.urdf"
RERUN = shutil.which("rerun", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
QUIET = {**os.environ, "CI": "1"}  # no usage statistics
PROPERTIES = {"seed": 3, "robot": "planar3r", "weights": [0.5, 0.25], "file": ROBOT, "absent": None}
FACTS = {"seed": [3], "robot": ["planar3r"], "weights": [0.5, 0.25], "file": [str(ROBOT)]}
Case = tuple[Problem, list[Evaluation]]


def make_problem(file: Path) -> Problem:
    task = PositionTask(Arm(urdf.read(file, "tip")))
    q_init = np.array([0.0, 0.327, -0.754])
    line = Line(task.value(q_init[None])[0], direction_vector(157.5, 2), 0.4)
    return Problem(task, Reference(line, RaisedCosine(10.0)), q_init, np.linspace(0.0, 10.0, 26))


@pytest.fixture(scope="module")
def case() -> Case:
    """LSV, which meets a singularity, the planner's best and, to have two of one method, that again as its second."""
    problem = make_problem(ROBOT)
    best = global_planner(problem, GlobalOptions(candidates=50, starts=["population", "dynamic_programming"]))[0]
    solutions = [lsv(problem, LsvOptions())[0], best, dataclasses.replace(best, optimum=2)]
    return problem, [evaluate(problem, solution) for solution in solutions]


def write(file: Path, problem: Problem, evaluations: Sequence[Evaluation]) -> None:
    recording.save(file, problem, evaluations, name="line", summary="# A line\n\nthe text", properties=PROPERTIES)


def entities(file: Path) -> set[str]:
    return {chunk.entity_path for chunk in RrdReader(file).stream()}


@pytest.mark.slow
def test_every_series_reads_back(case: Case, tmp_path: Path) -> None:
    problem, evaluations = case
    write(tmp_path / "run.rrd", problem, evaluations)
    assert [e.label for e in evaluations] == ["lsv", "global", "global 2"]
    for evaluation, root in zip(evaluations, ("lsv", "global", "global_2"), strict=True):
        for entity, expected in (
            ("joint_position", evaluation.q),
            ("joint_velocity", evaluation.qd),
            ("joint_torque", evaluation.tau),
            ("kinetic_energy", evaluation.kinetic_energy[:, None]),
            ("energy_integral", evaluation.energy_integral[:, None]),
            ("tracking_error", evaluation.tracking_error[:, None]),
            ("singular_value", evaluation.singular_value[:, None]),
            ("spectral_radius", evaluation.spectral_radius[:, None]),
        ):
            moments, values = recording.read_series(tmp_path / "run.rrd", f"/{root}/{entity}")
            np.testing.assert_allclose(moments, evaluation.time, rtol=0, atol=1e-12)
            np.testing.assert_allclose(values, expected, rtol=0, atol=1e-12)
    with pytest.raises(KeyError, match="no series on /pmke/joint_position"):
        recording.read_series(tmp_path / "run.rrd", "/pmke/joint_position")


@pytest.mark.slow
def test_the_pictures_and_facts_are_there(case: Case, tmp_path: Path) -> None:
    problem, evaluations = case
    file = tmp_path / "run.rrd"
    write(file, problem, evaluations)
    roots = ("lsv", "global", "global_2")
    pictures = ("stick", "joints", "trace", "end_effector")
    expected = {f"/{root}/{part}" for root in roots for part in (*pictures, "tf/joints/joint3", "tf/joints/tip_joint")}
    expected |= {f"/planar/{root}/{part}" for root in roots for part in (*pictures, "poses")}
    expected |= {f"/{root}/planar3r/visual_geometries/link1/visual_1" for root in roots}
    assert expected | {"/reference", "/planar/reference", "/summary"} <= entities(file)
    assert len(component(file, "/planar/lsv/poses", "LineStrips2D:strips")) == recording.POSES
    (facts,) = chunks(file, "/__properties/run")
    stored = {key: value[0] for key, value in facts.to_record_batch().to_pydict().items()}
    assert FACTS.items() <= stored.items()
    assert "absent" not in stored
    (entry,) = RrdReader(file).recordings()
    assert entry.application_id == "selfmotion line"  # a viewer lays all of one application out as the first of them
    assert component(file, "/summary", "TextDocument:text") == ["# A line\n\nthe text"]
    assert component(file, "/__properties", "RecordingInfo:name") == ["line"]


def tetrahedron(file: Path) -> Path:
    """An OBJ file with four corners."""
    corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
    file.write_text(f"{corners}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8")
    return file


def test_obstacles_are_drawn(case: Case, tmp_path: Path) -> None:
    """As solids, and in the view from above as outlines."""
    solids = (
        Shape("ball", "sphere", (0.05,), (0.3, 0.2, 0.1)),
        Shape("box", "box", (0.1, 0.2, 0.3), (0.3, 0.2, 0.1)),
        capsule("rod", np.array([0.1, 0.2, 0.0]), np.array([0.3, 0.2, 0.4]), 0.03),
        Shape("can", "cylinder", (0.05, 0.2), (0.3, 0.2, 0.1)),
        Shape("hull", "mesh", (1.0, 1.0, 1.0), (0.3, 0.2, 0.1), file=str(tetrahedron(tmp_path / "hull.obj"))),
    )
    problem, evaluations = case
    file = tmp_path / "run.rrd"
    write(file, dataclasses.replace(problem, obstacles=Obstacles(solids, 0.02)), evaluations)
    for name in ("ball", "box", "rod", "can", "hull"):
        assert {f"/obstacles/{name}", f"/planar/obstacles/{name}"} <= entities(file)
    (outline,) = component(file, "/planar/obstacles/box", "LineStrips2D:strips")
    assert np.ptp(outline, axis=0) == pytest.approx([0.1, 0.2], abs=1e-6)
    assert np.mean(outline[:-1], axis=0) == pytest.approx([0.3, -0.2], abs=1e-6)


def test_the_drawn_arm_and_the_stick_figure_agree(case: Case, tmp_path: Path) -> None:
    """The joints turn by q, beyond the limits of the URDF too, and the stick figure is the evaluated one."""
    problem, evaluations = case
    file, evaluation = tmp_path / "run.rrd", evaluations[0]
    write(file, problem, evaluations)
    assert np.abs(evaluation.q[:, 2]).max() > 2.1  # the URDF's limit: clamped angles would show
    turned = np.cumsum(evaluation.q, axis=1)
    for joint, before in (("joint2", turned[:, 0]), ("joint3", turned[:, 1])):
        (batch,) = [c.to_record_batch() for c in chunks(file, f"/lsv/tf/joints/{joint}")]
        quaternion = np.array(batch["Transform3D:quaternion"].to_pylist())[:, 0]
        angle = np.unwrap(2 * np.arctan2(quaternion[:, 2], quaternion[:, 3]))
        column = int(joint[-1]) - 1
        np.testing.assert_allclose(np.sin(before + angle), np.sin(turned[:, column]), atol=1e-5)
        np.testing.assert_allclose(np.cos(before + angle), np.cos(turned[:, column]), atol=1e-5)
    stick = np.array([row[0] for c in chunks(file, "/lsv/stick") for row in _rows(c, "LineStrips3D:strips")])
    np.testing.assert_allclose(stick, evaluation.skeleton, atol=1e-6)


def _rows(chunk: object, name: str) -> list[object]:
    batch = chunk.to_record_batch()
    return batch[name].to_pylist() if name in batch.schema.names else []


def test_locked_joints_are_drawn_where_they_are_locked(tmp_path: Path) -> None:
    reduced = urdf.read(ROBOT, "tip", locked={"joint2": 0.5})
    (transform,) = [t for name, t in _rigid(reduced.xml, reduced.joints, "lsv") if name == "joint2"]
    x, y, z, w = transform.quaternion.as_arrow_array().to_pylist()[0]
    assert (x, y) == (0.0, 0.0)
    assert 2 * np.arctan2(z, w) == pytest.approx(0.5, abs=1e-6)


def test_the_file_is_complete(case: Case, tmp_path: Path) -> None:
    assert RERUN is not None
    write(tmp_path / "run.rrd", *case)
    check = [RERUN, "rrd", "verify", str(tmp_path / "run.rrd")]
    result = subprocess.run(check, env=QUIET, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]


def test_a_failed_write_leaves_nothing(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("the disk is full")

    rr.set_strict_mode(False)
    with monkeypatch.context() as patch:
        patch.setattr(recording, "_send_motion", fail)
        with pytest.raises(OSError, match="the disk is full"):
            write(tmp_path / "run.rrd", *case)
    assert list(tmp_path.iterdir()) == []
    assert rr.strict_mode() is False
    write(tmp_path / "run.rrd", *case)
    before = (tmp_path / "run.rrd").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        with pytest.raises(OSError, match="the disk is full"):
            write(tmp_path / "run.rrd", *case)
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    assert (tmp_path / "run.rrd").read_bytes() == before


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.parametrize("missing", [5_000, 100_000])
def test_a_full_disk_is_noticed(case: Case, tmp_path: Path, missing: int) -> None:
    """Rerun itself says nothing when only the last bytes do not fit."""
    resource = pytest.importorskip("resource", reason="needs limits on the size of files")
    write(tmp_path / "whole.rrd", *case)
    limit = (tmp_path / "whole.rrd").stat().st_size - missing
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(RuntimeError):
            write(tmp_path / "run.rrd", *case)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert [file.name for file in tmp_path.iterdir()] == ["whole.rrd"]


@pytest.mark.parametrize("mesh", ["absent.stl", "package://nowhere/absent.stl"])
def test_a_missing_mesh_still_gives_a_recording(case: Case, tmp_path: Path, mesh: str) -> None:
    robot = tmp_path / "robot.urdf"
    robot.write_text(ROBOT.read_text().replace('<box size="0.176 0.024 0.018"/>', f'<mesh filename="{mesh}"/>'))
    write(tmp_path / "run.rrd", make_problem(robot), case[1])
    assert {"/lsv/stick", "/lsv/planar3r/visual_geometries/link3/visual_1"} <= entities(tmp_path / "run.rrd")


def test_an_arm_that_cannot_be_drawn_still_gives_a_recording(
    case: Case, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A robot that Drake reads and Rerun does not."""
    robot = tmp_path / "robot.urdf"
    robot.write_text(ROBOT.read_text().replace('<cylinder radius="0.03" length="0.03"/>', "<cone/>"))
    write(tmp_path / "run.rrd", make_problem(robot), case[1])
    found = entities(tmp_path / "run.rrd")
    assert {"/lsv/stick", "/global_2/joint_position", "/reference"} <= found
    assert not [entity for entity in found if "visual_geometries" in entity]
    assert "stick figures only" in caplog.text


def test_a_motion_that_ends_in_nan_is_drawn_up_to_there(case: Case, tmp_path: Path) -> None:
    problem, (first, *_) = case
    q, skeleton = first.q.copy(), first.skeleton.copy()
    q[700:], skeleton[700:] = np.nan, np.nan
    write(tmp_path / "run.rrd", problem, [dataclasses.replace(first, q=q, skeleton=skeleton)])
    assert sum(len(_rows(c, "Points3D:positions")) for c in chunks(tmp_path / "run.rrd", "/lsv/end_effector")) == 700
    _, values = recording.read_series(tmp_path / "run.rrd", "/lsv/joint_position")
    np.testing.assert_array_equal(values, q)


def _missing_libraries() -> list[str]:
    """Which of the system libraries that a viewer without a screen draws with are not installed."""
    if not sys.platform.startswith("linux"):
        return []
    needed = ("vulkan", "EGL", "xkbcommon-x11", "Xcursor", "Xi", "Xrandr", "X11-xcb")
    missing = [f"lib{name}" for name in needed if ctypes.util.find_library(name) is None]
    drivers = [f for root in ("/usr/share", "/etc") for f in Path(root, "vulkan", "icd.d").glob("*.json")]
    return missing + ["a Vulkan driver"] * (not drivers)


@pytest.fixture
def viewer() -> Iterator[ViewerClient]:
    if missing := _missing_libraries():
        pytest.skip(f"the viewer needs {', '.join(missing)}")
    assert RERUN is not None
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    # Not ViewerClient.spawn: that listens on every interface.
    command = [RERUN, "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    process = subprocess.Popen(
        command, env=QUIET, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:

        def answers() -> bool:
            assert process.poll() is None, f"the viewer ended with {process.returncode}"
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", port)) == 0

        wait_until(answers)
        yield ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
    finally:
        os.killpg(process.pid, signal.SIGTERM)  # the command is a wrapper: the viewer is its child
        process.wait(HUNG)


def in_the_open(*views: Any, active_tab: int | None = None, **named: Any) -> Any:
    """Tabs as a grid, which has none that is shown first."""
    return blueprint.rrb.Grid(*views, **named)


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["as opened", "all views at once"])
def test_the_viewer_shows_everything(
    case: Case, tmp_path: Path, viewer: ViewerClient, monkeypatch: pytest.MonkeyPatch, layout: str
) -> None:
    """No view reports an error. Views in hidden tabs are not drawn, so a second layout has them all in the open."""
    if layout == "all views at once":
        monkeypatch.setattr(blueprint.rrb, "Tabs", in_the_open)
    write(tmp_path / "run.rrd", *case)
    viewer.open(str(tmp_path / "run.rrd"))
    wait_until(lambda: not (state := viewer.get_state()).loading and bool(state.views))
    viewer.set_time("time", duration=5.0, play_state="paused")
    pictures = [b""]

    def settled() -> bool:
        pictures.append(viewer.take_screenshot())
        return pictures[-1] == pictures[-2]

    wait_until(settled, pause=0.5)
    picture = pictures[-1]
    (tmp_path / "screen.png").write_bytes(picture)
    state = viewer.get_state()
    names = [view.name for view in state.views]
    assert {"Arms (plane)", "Arms (3-D)", "Summary", "Kinetic energy T [J]", "Kinetic-energy integral [J s]"} <= {
        *names
    }
    assert names.count("Joint positions [rad]") == 3
    assert {view.name: view.reports for view in state.views if view.reports} == {}
    assert [entry.message for entry in viewer.get_logs() if entry.level == "ERROR"] == []
    assert picture.startswith(b"\x89PNG")
