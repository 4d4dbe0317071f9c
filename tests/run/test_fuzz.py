"""Whatever is typed, or stands in a file: exit code 0, 1 or 2, at most one line on stderr, no traceback, nothing
half-written.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.commands import call
from tests.reports import leave_out_pictures
from tests.support import ROOT

pytestmark = pytest.mark.slow

QUICK = ("methods=[lsv]", "timing.steps=4", "method.lsv.dt=0.5", "path.length=0.05", "export.method=none")
URDF = (ROOT / "robots" / "planar3r.urdf").read_text(encoding="utf-8")
KEYS = (
    *("seed", "name", "methods", "timing.duration", "timing.steps", "timing.dense", "path.length", "path.direction"),
    *("path.start", "path.turn", "robot.q_init", "robot.task", "robot.locked", "robot.armature", "robot.payload"),
    *("limits.velocity", "limits.lower", "gravity", "obstacles.shapes", "method.lsv.dt", "method.lsv.gain", "boundary"),
    *(
        "method.lsv.singular_value",
        "parallel.workers",
        "export.rate",
        "robot.urdf",
        "robot",
        "path",
        "objective",
        "base",
    ),
)
VALUES = st.one_of(
    st.sampled_from(
        [
            "",
            "null",
            "nan",
            "inf",
            "-1",
            "0",
            "1e400",
            "1e-400",
            "1e16",
            "[]",
            "{}",
            "[1,2]",
            "[nan,0,0]",
            "'",
            '"a',
            "${x}",
            "${oc.env:HOME}",
            "${name}",
            "{a:1}",
            "[[1]]",
            "1:30",
            "010",
            "1_0",
            "true",
            "~",
            "../x",
            "a/b",
            "circle",
            "free",
            "!!x",
        ]
    ),
    st.text(max_size=12),
    st.floats().map(str),
    st.lists(st.floats(allow_nan=False, width=16), max_size=4).map(lambda row: str(row).replace(" ", "")),
)
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


@st.composite
def descriptions(draw: st.DrawFn) -> str:
    """The arm's own file with a few places spoilt."""
    text = URDF
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text) - 1))
        length = draw(st.integers(0, 40))
        new = draw(
            st.one_of(
                st.text(max_size=6), st.sampled_from(["nan", "-", "1e400", "<", "</link>", '"', "&x;", "<link/>", "\0"])
            )
        )
        text = text[:at] + new + text[at + length :]
    return text


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> object:
    leave_out_pictures(monkeypatch)

    def check(*words: str, file: tuple[str, str] | None = None) -> None:
        folder = Path(tempfile.mkdtemp(dir=tmp_path))
        monkeypatch.chdir(folder)
        if file is not None:
            (folder / file[0]).write_text(file[1], encoding="utf-8", errors="replace")
        answer = call(monkeypatch, capfd, *words)
        assert answer.code in (0, 1, 2), answer
        assert len(answer.error.splitlines()) <= 1, answer.error
        assert "Traceback" not in answer.error + answer.out
        made = {item.name for item in folder.iterdir()} - {file[0] if file else ""}
        if answer.code == 2:
            assert answer.error.startswith("error: ")
            assert not made, made
        assert not list(folder.rglob("error.txt")), answer.error
        assert not [item for item in folder.rglob(".*") if item.name != ".hydra"]
        shutil.rmtree(folder)

    return check


@settings(max_examples=24, suppress_health_check=list(HealthCheck))
@given(words=st.lists(st.tuples(st.sampled_from(KEYS), VALUES).map("=".join), min_size=1, max_size=2))
def test_overrides(answers, words: list[str]) -> None:  # type: ignore[no-untyped-def]
    answers(*QUICK, *words)


@settings(max_examples=12, suppress_health_check=list(HealthCheck))
@given(table=TABLES)
def test_way_points(answers, table: str) -> None:  # type: ignore[no-untyped-def]
    words = [word for word in QUICK if not word.startswith("path.")]
    answers(*words, "path=waypoints", "path.file=w.csv", "path.relative=true", file=("w.csv", table))


@settings(max_examples=12, suppress_health_check=list(HealthCheck))
@given(text=descriptions())
def test_robot_descriptions(answers, text: str) -> None:  # type: ignore[no-untyped-def]
    answers(*QUICK, "robot.urdf=arm.urdf", "robot.end_effector=tip", file=("arm.urdf", text))
