"""Whatever is typed, or stands in a file: exit code 0, 1 or 2, one line on stderr that says why, no traceback, nothing
half-written, and little time and memory.

With other examples and more of them: pytest tests/run/test_fuzz.py --hypothesis-profile=many --hypothesis-seed=1
"""

from __future__ import annotations

import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.commands import call
from tests.reports import leave_out_pictures
from tests.support import ROOT

LONGEST, MOST = 10.0, 2 << 30  # [s] of processor time and [bytes] of new memory: of one example

Example = tuple[list[str], str, str]  # the words, and the name and text of the file that they name

QUICK = ("methods=[lsv]", "timing.steps=4", "method.lsv.dt=0.5", "path.length=0.05", "export.method=none")
KEYS = (
    *("seed", "name", "methods", "timing.duration", "timing.steps", "timing.dense", "path.length", "path.direction"),
    *("path.start", "path.turn", "robot.q_init", "robot.task", "robot.locked", "robot.armature", "robot.payload"),
    *("limits.velocity", "limits.lower", "gravity", "obstacles.shapes", "method.lsv.dt", "method.lsv.gain", "boundary"),
    *("method.lsv.singular_value", "parallel.workers", "export.rate", "robot.urdf", "robot", "path", "objective"),
    *("base", "robot.offset_rpy", "robot.orientation", "robot.unlimited", "path.tolerance"),
    *("+robot.x", "~robot.locked", "method.global.nodes", "timing", "limits", "+experiment"),
)
ODD = (
    *("", "null", "nan", "inf", "-1", "0", "1e400", "1e-400", "1e16", "010", "1_0", "1:30", "true", "~", "!!x"),
    *("[]", "{}", "[1,2]", "[nan,0,0]", "{a:1}", "[[1]]", "'", '"a', "${x}", "${oc.env:HOME}", "${name}"),
    *("../x", "a/b", "circle", "free"),
)
VALUES = st.one_of(
    st.sampled_from(ODD),
    st.text(max_size=12),
    st.floats().map(str),
    st.lists(st.floats(allow_nan=False, width=16), max_size=4).map(lambda row: str(row).replace(" ", "")),
)
WORDS = st.lists(st.tuples(st.sampled_from(KEYS), VALUES).map("=".join), min_size=1, max_size=2)

NUMBERS = st.one_of(
    st.floats(-0.3, 0.3).map(str),
    st.sampled_from(["", "nan", "inf", "1_0", "0x1", "\uff11", "1e999", "a", '"', "#", " 0.1 "]),
)
TABLES = st.one_of(
    st.text(max_size=60),
    st.tuples(
        st.lists(st.sampled_from(["x", "y", "z", "time", "yaw", "X", "roll", "qx", ""]), max_size=4),
        st.lists(st.lists(NUMBERS, max_size=4), max_size=5),
    ).map(lambda table: "\n".join(",".join(row) for row in (table[0], *table[1]))),
)

URDF = (ROOT / "robots" / "planar3r.urdf").read_text(encoding="utf-8")
LINK = """<link name="{name}"><pose>{x} 0 0 0 0 0</pose><inertial><pose>0.1 0 0 0 0 0</pose><mass>0.6</mass>
<inertia><ixx>0.001</ixx><iyy>0.002</iyy><izz>0.002</izz></inertia></inertial></link>
"""
JOINT = """<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child><axis><xyz>0 0 1</xyz>
<limit><lower>-2</lower><upper>2</upper><effort>0.4</effort><velocity>3.8</velocity></limit></axis></joint>
"""
LINKS = ("base", "link1", "link2", "tip")
SDF = "".join(
    (
        '<sdf version="1.9"><model name="arm">\n<joint name="f" type="fixed"><parent>world</parent><child>base</child>',
        "</joint>\n",
        *(LINK.format(name=name, x=max(0.0, 0.2 * (i - 1))) for i, name in enumerate(LINKS)),
        *(JOINT.format(name=f"j{i}", parent=LINKS[i], child=LINKS[i + 1]) for i in range(3)),
        "</model></sdf>",
    )
)
SPOILT = st.one_of(
    st.text(max_size=6), st.sampled_from(["nan", "-", "1e400", "1e9", "0", "<", "</link>", '"', "&x;", "<link/>", "\0"])
)


@st.composite
def spoilt(draw: st.DrawFn, text: str) -> str:
    """A description of an arm with a few places spoilt."""
    for _ in range(draw(st.integers(1, 3))):
        at, length = draw(st.integers(0, len(text) - 1)), draw(st.integers(0, 40))
        text = text[:at] + draw(SPOILT) + text[at + length :]
    return text


def of_robot(file: str) -> Callable[[str], Example]:
    return lambda text: ([*QUICK, f"robot.urdf={file}", "robot.end_effector=tip"], file, text)


THROUGH = (*(word for word in QUICK if not word.startswith("path.")), "path=waypoints", "path.file=points.csv")
KINDS: dict[str, st.SearchStrategy[Example]] = {
    "overrides": WORDS.map(lambda words: ([*QUICK, *words], "unused.txt", "")),
    "way-points": TABLES.map(lambda text: ([*THROUGH, "path.relative=true"], "points.csv", text)),
    "URDF": spoilt(URDF).map(of_robot("arm.urdf")),
    "SDF": spoilt(SDF).map(of_robot("arm.sdf")),
}


@contextmanager
def at_most(memory: int) -> Iterator[None]:
    """Within it this process gets no more than so many bytes beyond those that it has."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + memory, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@pytest.fixture
def answers(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[[Example], int]:
    """Call the command line, see that it answers well, and give the exit code."""
    leave_out_pictures(monkeypatch)

    def check(example: Example) -> int:
        words, file, text = example
        folder = Path(tempfile.mkdtemp(dir=tmp_path))
        monkeypatch.chdir(folder)
        (folder / file).write_text(text, encoding="utf-8", errors="replace")
        began = time.process_time()
        with at_most(MOST):
            answer = call(monkeypatch, capfd, *words)
        assert time.process_time() - began < LONGEST, answer
        said = answer.error.splitlines()
        reasons = [line for line in said if not line.startswith("warning: ")]
        assert answer.code in (0, 1, 2), answer
        assert "Traceback" not in answer.error + answer.out
        assert "out of memory" not in answer.error, answer.error
        assert not list(folder.rglob("error.txt")), answer.error
        assert not [item for item in folder.rglob(".*") if item.name != ".hydra"]
        if answer.code == 2:
            assert len(said) == 1, said
            assert said[0].startswith("error: ")
            assert [item.name for item in folder.iterdir()] == [file]
        else:  # the summary says which method failed, and why
            assert not reasons, reasons
            assert len(list(folder.rglob("run.json"))) == 1
        shutil.rmtree(folder)
        return answer.code

    return check


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.02, pytest.param(0.16, marks=pytest.mark.slow)], ids=["few", "many"])
def test_an_answer(kind: str, share: float, answers: Callable[[Example], int]) -> None:
    """`share` of the examples that the profile asks for."""

    @settings(max_examples=int(share * settings().max_examples), suppress_health_check=list(HealthCheck))
    @given(example=KINDS[kind])
    def every(example: Example) -> None:
        answers(example)

    every()


def test_what_is_not_spoilt_runs(answers: Callable[[Example], int]) -> None:
    """So that the descriptions are refused for what is spoilt in them."""
    assert answers(of_robot("arm.sdf")(SDF)) == 0
