"""The page of a run: what it holds, and how it behaves in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.artifacts import sweep
from pipeline.artifacts.page import content, page, several
from pipeline.artifacts.report import Report
from pipeline.common.errors import OutputError
from pipeline.evaluation.evaluation import evaluate
from pipeline.problem.solution import Solution, Status, Trajectory
from tests.reports import MOVES as Q
from tests.reports import TIMES, report_of, three_motions
from tests.tasks import HUNG

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
TRIAL = Path(__file__).with_name("trial.js")  # what is tried in the page, and before it what watches for errors


@pytest.fixture(scope="module")
def report() -> Report:
    return three_motions()


@pytest.fixture(scope="module")
def folder(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("page") / "0_first"
    made.mkdir()
    page.write(report, made)
    return made


def test_the_page_holds_what_was_evaluated(report: Report, folder: Path) -> None:
    (run,) = page.read(folder)
    problem, motions = report.motions.problem, report.motions.evaluations
    assert [motion["label"] for motion in run["motions"]] == ["lsv", "global", "global 2"]
    for motion, e in zip(run["motions"], motions, strict=True):
        for values, there in (
            (motion["joints"]["torque"], e.tau),
            (motion["lines"]["kinetic-energy integral"], e.energy_integral),
            (motion["lines"]["clearance"], e.clearance),
            (motion["points"], e.skeleton),
        ):
            np.testing.assert_allclose(content.unpacked(values).reshape(there.shape), there, rtol=1e-6, atol=1e-7)
        assert motion["costs"]["Squared-torque integral [N² m² s]"] == e.torque_integral[-1]
    assert [motion["until"] for motion in run["motions"]] == [1.5, None, None]
    ball, wall = run["obstacles"]
    assert (ball["ends"], ball["radius"]) == ([[0.2, 0.5, 0.0]] * 2, 0.05)
    assert np.ptp(wall["corners"], axis=0).tolist() == pytest.approx([0.1, 0.2, 0.3])
    velocity = next(band for band in run["bands"] if band["kind"] == "velocity")
    assert (velocity["lower"], velocity["upper"], velocity["unit"]) == ([-0.1, -9.0, None], [0.1, 9.0, None], "rad/s")
    assert run["flat"] == 2
    ends = content.unpacked(run["path"]).reshape(-1, 3)[[0, -1]]
    np.testing.assert_allclose(
        ends, problem.task.in_world(problem.reference.position(TIMES[[0, -1]]), ends[0]), atol=1e-6
    )
    assert [point["motion"] for point in run["plane"]["points"]] == [1, 2]  # none of a motion that breaks off


def test_knots_are_thinned_and_both_ends_kept(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content, "KNOTS", 3)
    motion = content.run(report)["motions"][1]
    assert content.unpacked(motion["time"]).tolist() == [0.0, 1.0, 2.0]
    np.testing.assert_allclose(content.unpacked(motion["joints"]["position"]).reshape(3, 3), Q[[0, 2, 4]], rtol=1e-6)


def test_a_file_on_its_own(folder: Path) -> None:
    """Neither a file beside it nor a network, and small."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"<(?:script|img|link|iframe)[^>]+(?:src|href)=|@import|url\(|fetch\(|XMLHttpRequest", text)
    assert len(page.library("uPlot.iife.min.js")) < 50_000
    assert len(text) < 120_000
    assert "uPlot" in text


def test_a_motion_that_nobody_found_is_a_row_without_a_picture(report: Report, tmp_path: Path) -> None:
    problem = report.motions.problem
    nothing = evaluate(problem, Solution("global", Trajectory(TIMES, Q), Status.INFEASIBLE, "no way", found=False))
    page.write(report_of(problem, [nothing]), tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "none found" in text
    assert "<canvas" not in text
    assert page.read(tmp_path) == []


def test_no_page_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"no report\.html there; run it again"):
        page.read(tmp_path)


def test_a_sweep_has_a_page_over_its_runs(report: Report, folder: Path) -> None:
    """One of the runs has left none."""
    for number, name in ((0, "0_first"), (1, "1_second"), (2, "2_bad")):
        own = folder.with_name(name)
        (own / ".hydra").mkdir(parents=True, exist_ok=True)
        (own / ".hydra" / "overrides.yaml").write_text(f"- path.length=0.{number + 1}\n", encoding="utf-8")
        if number < 2:
            (own / "report.html").write_bytes((folder / "report.html").read_bytes())
        sweep.write_failure(own, "made for a test")
    several.write(
        folder.parent, "Sweep", [folder.with_name(name) for name in ("0_first", "1_second", "2_bad")], list("abc")
    )
    text = (folder.parent / "report.html").read_text(encoding="utf-8")
    runs = page.read(folder.parent)
    assert [run["name"] for run in runs] == ["a", "b"]
    assert "c has left no page." in text
    plane = json.loads(page.DATA.search(text)[1])["plane"]  # type: ignore[index]
    assert (plane["x"], [point["x"] for point in plane["points"]]) == ("path.length", [0.1, 0.1, 0.2, 0.2])
    assert [point["motion"] for point in plane["points"]] == [1, 2, 4, 5]
    shades = [motion["color"] for run in runs for motion in run["motions"]]
    assert len(set(shades)) == 6


@pytest.fixture(scope="module")
def tried(folder: Path) -> dict[str, Any]:
    """What a browser finds when it opens the page and uses it, all in one go."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    copy = folder / "tried.html"
    watch, trial = (
        f"<script>{TRIAL.with_name(name).read_text(encoding='utf-8')}</script>" for name in ("watch.js", "trial.js")
    )
    copy.write_text(text.replace("<head>", f"<head>{watch}").replace("</body>", f"{trial}</body>"), encoding="utf-8")
    quiet = ("no-first-run", "disable-background-networking", "disable-component-update", "disable-sync")
    words = ["headless", "no-sandbox", "disable-gpu", *quiet, f"user-data-dir={folder / 'profile'}", "dump-dom"]
    done = subprocess.run(
        [str(CHROMIUM), *(f"--{word}" for word in words), copy.as_uri()],
        check=True,
        timeout=HUNG,
        capture_output=True,
        text=True,
    )
    told = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told is not None, done.stdout[-2000:]
    found: dict[str, Any] = json.loads(unescape(told[1]))
    return found


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium to open the page")
def test_in_a_browser(tried: dict[str, Any], report: Report) -> None:
    assert (tried["ready"], tried["errors"]) == ("yes", [])
    best = report.motions.evaluations[1]
    first, middle = (np.array(tip.split(), dtype=float) for tip in tried["tip"])
    np.testing.assert_allclose(first, best.position[0], atol=2e-5)
    np.testing.assert_allclose(middle, best.position[2], atol=2e-5)  # knots 0 and 2 are at 0 and 1 s
    assert tried["moved"]
    assert tried["marker"]
    assert all(tried["marker"])
    assert tried["ink"]
    heads = " ".join(tried["plots"])
    for words in (
        "velocity of all joints, global [rad/s]",
        "clearance [m]",
        "kinetic energy [J]",
        "torque of all joints",
    ):
        assert words in heads
    assert tried["chosen"] == [2, "position of all joints, global 2 [rad] "]
    assert tried["hidden"]
    assert tried["one"].startswith("position of joint2 [rad]")
    assert tried["byPoint"].count(True) == 1  # a click on a point shows its motion alone
