"""Printed numbers stand once, and the tables of a run find them by its experiment."""

from __future__ import annotations

import pytest

from pipeline.config.documents import DOCUMENTS, Printed, printed_for, read
from tests.support import ROOT, composed

EXPERIMENTS = sorted(file.stem for file in (ROOT / "conf" / "experiment").glob("[!_]*.yaml"))


def test_numbers_as_the_documents_print_them() -> None:
    """Read off the PMKE paper's Table 5 and Section 3.2, and the Global paper's Tables 4 to 6."""
    third = printed_for("traj3")
    assert third.document == "PMKE paper (Appl. Sci. 2021, 11, 2346), Table 5 and Section 3.2"
    assert third.note.startswith("The LSV energy")
    assert third.numbers["lsv"] == {"kinetic_energy_integral": 2.17e-2, "singular_time": 6.5}
    assert third.numbers["pmke"]["peak_velocity_1"] == 0.25
    assert third.numbers["global"] == {"kinetic_energy_integral": 6.09e-3}
    assert printed_for("sim5").numbers["global"]["peak_power_1"] == 5.814
    assert printed_for("case1").numbers == {"pontryagin_as_printed": {"final_error": 0.0026}}


def test_a_misprint_is_read_as_what_was_meant() -> None:
    assert printed_for("traj1").numbers["lsv"]["kinetic_energy_integral"] == 8.81e-4


def test_what_is_no_cell_of_the_table_is_left_out() -> None:
    """A peak up to a moment, a largest positive velocity, words, and what belongs to a later optimum."""
    assert "peak_velocity_1" not in printed_for("traj3").numbers["lsv"]
    assert "wall_time_s" not in printed_for("sim1_validation").numbers["global"]  # of another machine
    assert "wall_time_s" not in printed_for("traj1").numbers["pmke"]
    assert "peak_velocity_3" not in printed_for("traj2").numbers["lsv"]
    assert printed_for("case2").numbers == {}
    assert printed_for("sim1_validation").numbers["global"]["kinetic_energy_integral"] == 0.0528


def test_the_calculus_of_variations_beside_the_planner() -> None:
    printed = printed_for("sim1_validation").numbers
    assert printed["calculus_of_variations"] == {"kinetic_energy_integral": 0.0532}
    assert printed_for("sim1").numbers == printed


def test_nothing_is_printed_of_an_experiment_of_ours() -> None:
    assert printed_for("panda") == Printed()
    assert printed_for("no such experiment") == Printed()


@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_a_document_says_of_runs_is_of_experiments_that_exist(name: str) -> None:
    document = read(name)
    assert set(document.runs) <= set(EXPERIMENTS)
    assert set(document.experiments) <= set(EXPERIMENTS)
    assert all(mention.same_as in ("", *EXPERIMENTS) for mention in document.runs.values())


@pytest.mark.slow
@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_a_printed_number_has_a_method_to_compare_it_with(experiment: str) -> None:
    printed = set(printed_for(experiment).numbers)
    own = set(composed(f"+experiment={experiment}").methods)
    assert printed <= own | {"calculus_of_variations"}
