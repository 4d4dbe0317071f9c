"""A new study is one file and one line of a tuple: the example of docs/extending.md, and where its answer arrives."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts.figures import figures
from pipeline.evaluation.evaluation import Evaluation
from pipeline.run import run
from pipeline.studies.studies import STUDIES
from pipeline.studies.study import Motions, Result
from tests.support import composed

# --- the example: how far the joints of each motion travel ------------------------------------------------------------


@dataclass(frozen=True)
class Travel(Result):
    """travel: by motion, how far its joints turn in all [rad]."""

    name: ClassVar[str] = "travel"
    units: ClassVar[Mapping[str, str]] = {"joint_travel": "rad"}
    travel: Mapping[str, float]

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"travel": pd.DataFrame(self.travel.items(), columns=["motion", "travel"])}

    def section(self) -> list[str]:
        return ["## Travel", "", f"The laziest motion is {min(self.travel, key=self.travel.__getitem__)}."]

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        return {"joint_travel": self.travel[motion.label]}

    def facts(self) -> Mapping[str, Any]:
        return {"least": min(self.travel.values())}

    def figures(self, title: str) -> Mapping[str, Figure]:
        figure = Figure()
        FigureCanvasAgg(figure)
        figure.add_subplot(title=title).bar(list(self.travel), list(self.travel.values()))
        return {"travel": figure}


def study(motions: Motions) -> Travel | None:
    if not motions.solved:
        return None
    return Travel({e.label: float(np.abs(np.diff(e.q, axis=0)).sum()) for e in motions.evaluations})


# --- what a run makes of it -------------------------------------------------------------------------------------------

WORDS = (
    "methods=[lsv,inertia_weighted]",
    "path.length=0.1",
    "timing.duration=1",
    "timing.steps=10",
    "parallel.workers=1",
)


@pytest.mark.slow
def test_a_new_study_arrives_in_every_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "FIGURES", {})  # those of the motions take most of the time
    monkeypatch.setattr(run, "STUDIES", (*STUDIES, study))
    assert run.run(composed(*WORDS), tmp_path) == 0
    motions = pd.read_parquet(tmp_path / "trajectories.parquet").groupby("method", sort=False)
    own = motions[["q_1", "q_2", "q_3"]].apply(lambda q: np.abs(np.diff(q, axis=0)).sum())
    assert 0 < own["lsv"] < own["inertia_weighted"]
    table = pd.read_csv(tmp_path / "travel.csv")
    assert list(table["motion"]) == ["lsv", "inertia_weighted"]
    np.testing.assert_allclose(table["travel"], own, rtol=1e-12)
    np.testing.assert_allclose(pd.read_csv(tmp_path / "summary.csv")["joint_travel"], own, rtol=1e-12)
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "## Travel\n\nThe laziest motion is lsv.\n" in text
    assert f"| joint travel [rad] | {own['lsv']:.4g} | {own['inertia_weighted']:.4g} |" in text
    record = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert record["travel"] == {"least": pytest.approx(own["lsv"])}
    assert [file.name for file in (tmp_path / "figures").iterdir()] == ["travel.png"]
    assert (tmp_path / "figures" / "travel.png").read_bytes().startswith(b"\x89PNG")


def test_without_its_line_there_is_nothing_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "FIGURES", {})
    assert run.run(composed(*WORDS), tmp_path) == 0
    assert not (tmp_path / "travel.csv").exists()
    assert not (tmp_path / "figures").exists()
    assert "joint_travel" not in pd.read_csv(tmp_path / "summary.csv")
    assert "Travel" not in (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "travel" not in json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
