"""The runs of a reproduction: every verdict and number is recomputed from them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.config import documents
from pipeline.config.found import Summary
from pipeline.reproduce import __main__ as reproduce
from pipeline.reproduce.pages import index
from pipeline.reproduce.recompute import recompute
from pipeline.reproduce.results import ResultError
from pipeline.reproduce.table import COLUMNS, command, compare, counts, judge
from tests.reproduce import errata
from tests.reproduce.printed import asked, expected, runs_in


@pytest.mark.slow
def test_every_verdict_is_recomputed(reproduced: Path) -> None:
    """From runs made here, with fewer starts than `make reproduce` takes."""
    table = compare(asked(), runs_in(reproduced))
    assert list(table.columns) == list(COLUMNS)
    found = list(table[["document", "place", "printed", "verdict"]].itertuples(index=False, name=None))
    differing = [(one, other[3]) for one, other in zip(expected(), found, strict=True) if one != other]
    assert differing == []
    assert np.isfinite(table["recomputed"]).all()
    assert counts(table) == {"reproduced": 37, "better": 4, "misprint": 5, "differs": 33}
    assert counts(table, derived=True) == {"reproduced": 5, "better": 0, "misprint": 0, "differs": 9}


@pytest.mark.slow
def test_nedungadis_motions_from_the_planners_configurations(reproduced: Path) -> None:
    """Mean joint differences beside an audit's in another code, which gives so many digits."""
    table = runs_in(reproduced)["sim1_validation"].table("validation").set_index("planner_optimum")
    found = table.loc[[1, 2, 4], "difference_from_planner_start"]
    np.testing.assert_allclose(found, [0.0068, 0.0234, 0.0126], atol=6e-5)


@pytest.mark.slow
def test_numbers_of_the_errata_are_those_of_its_commands(reproduced: Path) -> None:
    """A sample, of runs made here; `make reproduce` runs every command (`errata.py`)."""
    assert errata.wrong(errata.QUICK, runs_in(reproduced)) == []
    assert errata.wrong([(errata.QUICK[0][0], "LSV peak of joint 1 is 0.177")], runs_in(reproduced)) != []
    assert errata.wrong([(errata.QUICK[1][0], "LSV peak of joint 1 is 0.176")], runs_in(reproduced)) != []


def test_a_command_of_the_errata_is_run_or_has_been(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    called: list[list[str]] = []
    monkeypatch.setattr(
        errata.subprocess, "run", lambda words, **_: called.append(words[2:]) or SimpleNamespace(returncode=3)
    )
    made = tmp_path / "runs" / "traj1"
    made.mkdir(parents=True)
    (made / "run.json").touch()
    beside = tmp_path / "errata" / "01"
    for asked_for in ("pipeline +experiment=traj1", "pipeline.reproduce pmke"):
        assert errata.run(asked_for, tmp_path, beside) == 0
    assert not called
    for asked_for in ("pipeline -m +experiment=traj1,traj2", "pipeline +experiment=traj1 seed=2", "pytest tests/path"):
        assert errata.run(asked_for, tmp_path, beside) == 3
    assert called == [
        ["pipeline", "-m", "+experiment=traj1,traj2", f"hydra.sweep.dir={beside}"],
        ["pipeline", "-m", "+experiment=traj1", "seed=2", f"hydra.sweep.dir={beside}"],
        ["pytest", "tests/path"],
    ]
    assert len(errata.commands()) > 15
    assert all(word in " ".join(errata.commands()) for word, _, _ in errata.BESIDE)


@pytest.mark.slow
def test_the_printed_masses_give_no_printed_energy(reproduced: Path) -> None:
    table = compare(asked(), runs_in(reproduced))
    energies = table[
        table["with_printed_masses"].notna() & (table["unit"] == "J s") & (table["verdict"] == "reproduced")
    ]
    assert len(energies) >= 5
    share = energies["with_printed_masses"] / energies["printed"].astype(float)
    assert share.between(0.5, 0.8).all()


def test_a_finished_reproduction_says_what_its_runs_say() -> None:
    """Whatever lies in outputs/reproduction, if anything does."""
    file = reproduce.FOLDER / "reproduction.csv"
    if not file.is_file():
        pytest.skip("no outputs/reproduction: `make reproduce` makes it")
    table = pd.read_csv(file, dtype={"printed": str, "unit": str})
    again = compare([documents.read(name) for name in table["document"].unique()], runs_in(reproduce.FOLDER))
    assert list(table["verdict"]) == list(again["verdict"])
    np.testing.assert_allclose(table["recomputed"], again["recomputed"], rtol=1e-9)


@pytest.mark.slow
def test_a_number_that_is_not_run_or_not_there_says_so(reproduced: Path) -> None:
    (document,) = (d for d in asked() if d.name == "pontryagin")
    runs = runs_in(reproduced)
    del runs["case1"]
    table = compare([document], runs)
    lost = table[table["recomputed"].isna()]
    assert list(lost["place"]) == ["Figure 3", "Figure 4"]
    assert set(lost["verdict"]) == {"not run"}
    assert counts(table) == {"reproduced": 4, "better": 0, "misprint": 0, "differs": 0, "not run": 2}
    assert "<td>2</td>" in index([document], table)
    assert set(lost["note"]) == {"no run of experiment case1"}
    row = replace(document.rows[0][1], found=Summary("case4a", "pontryagin_as_printed", 7, "final_error"))
    with pytest.raises(ResultError, match="case4a: no pontryagin_as_printed 7"):
        recompute(row.found, runs)
    place = replace(document.places[0], rows=(row,))
    assert list(compare([replace(document, places=(place,))], runs)["verdict"]) == ["differs"]
    assert judge(row, 0.00261) == "reproduced"
    assert command(row) == "python -m pipeline +experiment=case4a"


@pytest.mark.slow
def test_a_motion_read_back_is_evaluated_to_the_same_numbers(reproduced: Path) -> None:
    run = runs_in(reproduced)["traj3"]
    for method in ("lsv", "pmke", "global"):
        e = run.evaluation(method)
        assert e.energy_integral[-1] == pytest.approx(run.cell(method, 1, "kinetic_energy_integral"), rel=1e-12)
    assert run.evaluation("lsv").solution.event_time == pytest.approx(6.48)
