"""What artifacts get of a run: its exit code, the motions that figures show, the results of its studies."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from rerun.chunk import RrdReader

from pipeline.artifacts import record
from pipeline.artifacts.artifacts import ARTIFACTS, name
from pipeline.artifacts.figures import figures
from pipeline.artifacts.recording import recording
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.studies.study import Result
from tests.reports import report_of

Case = tuple[Problem, list[Evaluation]]


@dataclass(frozen=True)
class Picky(Result):
    name: ClassVar[str] = "picky"
    cover: ClassVar[str] = "chosen"
    shown: tuple[int, ...] = (1, 3)

    def hides(self, motion: Evaluation) -> bool:
        return motion.solution.optimum not in self.shown

    def facts(self) -> Mapping[str, object]:
        return {"shown": np.array(self.shown), "most": np.int64(3)}


class Other(Result):
    name = "other"


@pytest.fixture
def case(problem: Callable[[int, int], Problem], guess: Callable[[Problem], Array]) -> Case:
    """Three optima that are one and the same motion."""
    asked = problem(1, 6)
    own = evaluate(asked, Solution("global", Trajectory(asked.times, guess(asked)), Status.SOLVED))
    return asked, [replace(own, solution=replace(own.solution, optimum=optimum)) for optimum in (1, 2, 3)]


@pytest.mark.parametrize(("status", "code"), [(Status.SINGULAR, 0), (Status.UNCONFIRMED, 1), (Status.NOT_CONVERGED, 1)])
def test_the_exit_code_is_that_of_the_worst_motion(case: Case, status: Status, code: int) -> None:
    problem, motions = case
    assert report_of(problem, motions).exit_code == 0
    assert report_of(problem, [*motions, replace(motions[0], status=status)]).exit_code == code


def test_figures_leave_out_what_a_study_hides(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, motions = case
    drawn: list[list[str]] = []
    monkeypatch.setattr(figures, "FIGURES", {"some": lambda problem, own, title: drawn.append([e.label for e in own])})
    for results in ((), (Other(), Picky())):
        figures.write(report_of(problem, motions, *results), tmp_path)
    assert drawn == [["global", "global 2", "global 3"], ["global", "global 3"]]
    assert list(tmp_path.iterdir()) == []  # nothing drawn, nothing written


def test_results_are_found_by_their_kind(case: Case) -> None:
    picky = Picky()
    report = report_of(*case, Other(), picky)
    assert report.find(Picky) is picky
    assert report_of(*case).find(Picky) is None


def test_the_recording_opens_with_the_figure_that_a_study_chose(case: Case, tmp_path: Path) -> None:
    """And is told what the run is, but not the digests of its files."""
    picture = b"\x89PNG\r\n\x1a\n"
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "chosen.png").write_bytes(picture)
    for results, there in (((Other(),), False), ((Other(), Picky()), True)):
        recording.write(report_of(*case, *results), tmp_path)
        chunks = list(RrdReader(tmp_path / "recording.rrd").stream())
        assert ("/picture" in {chunk.entity_path for chunk in chunks}) == there
        (facts,) = (chunk for chunk in chunks if chunk.entity_path == "/__properties/run")
        assert {"experiment", "seed"} <= set(facts.to_record_batch().schema.names)
        assert "inputs" not in facts.to_record_batch().schema.names


def test_the_record_has_the_facts_of_results_under_their_names(case: Case, tmp_path: Path) -> None:
    record.write(report_of(*case, Other(), Picky()), tmp_path)
    read = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert read["picky"] == {"shown": [1, 3], "most": 3}
    assert "other" not in read
    assert (read["exit_code"], read["seed"], read["inputs"]) == (0, 1, {"robot.urdf": "a digest"})
    assert [(solved["method"], solved["optimum"]) for solved in read["solutions"]] == [("global", i) for i in (1, 2, 3)]
    assert read["methods_s"] == {"global": 0.5}


def test_run_json_is_written_last() -> None:
    order = ["summary", "motion_files", "page", "figures", "recording", "animation", "record"]
    assert [name(artifact) for artifact in ARTIFACTS] == order
