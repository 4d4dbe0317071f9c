"""What a run says first: the verdict, the table of motions, and how much of which limit each of them uses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artifacts.bands import bands, closest
from pipeline.artifacts.markdown import PEAK, markdown
from pipeline.artifacts.report import Report
from pipeline.artifacts.summary import summary
from pipeline.artifacts.table import rows
from pipeline.artifacts.verdict import first, percent, status, verdict
from pipeline.config.documents import Printed
from pipeline.path.timing import ConstantSpeed
from pipeline.problem.solution import Status
from pipeline.studies import export
from pipeline.studies.estimate import Comparison, Estimate
from tests.reports import report_of, three_motions


@pytest.fixture
def report() -> Report:
    return three_motions()


def within(report: Report) -> Report:
    """The same where joint1 may be as fast as it is, twice; and LSV has no singularity but twice the energy."""
    problem = replace(report.motions.problem, limits=replace(report.motions.problem.bounds, velocity=np.full(3, 0.7)))
    lsv, good, _ = report.motions.evaluations
    dear = {name: 2 * running for name, running in lsv.integrals.items()}
    lsv = replace(lsv, status=Status.SOLVED, solution=replace(lsv.solution, event_time=None), integrals=dear)
    good = replace(good, limit_excess={"velocity": -0.5}, limit_excess_between={"velocity": -0.5})
    resampled = export.Resampled("global", 1, good.time, good.q, good.qd, good.qdd, 1e-9, 0.0, {"velocity": -0.5}, {})
    return report_of(problem, [lsv, good], resampled)


def test_the_limit_that_is_used_most(report: Report) -> None:
    """joint1 turns by 0.4 (1 - 0.75^2) in the last half second."""
    e = report.motions.evaluations[1]
    near = closest(report.motions.problem, e)
    assert near is not None
    assert near.share == pytest.approx(0.4 * (1 - 0.75**2) / 0.5 / 0.1)
    assert (near.kind, near.joint, near.time, near.bound) == ("velocity", "joint1", 2.0, "0.1 rad/s")
    assert near.said == "joint1, 350 % of its velocity (0.1 rad/s) at 2 s"
    assert near.brief == "joint1 velocity 350 % of 0.1 rad/s at 2 s"
    assert replace(near, share=0.83).percent == "83"
    assert replace(near, share=0.9996).percent == "99.96"  # not 100 before it is


def test_shares_of_a_range_count_from_its_middle(report: Report) -> None:
    problem = report.motions.problem
    problem = replace(
        problem, limits=replace(problem.bounds, lower=np.full(3, -1.0), upper=np.array([3.0, np.inf, 1.0]))
    )
    used = bands(problem)[0].used(report.motions.evaluations[1])
    np.testing.assert_allclose(used[0], [1.0 / 2, 0.0, 0.7])  # from 1 by half of 4; without an end; from 0


def test_solved_is_not_said_of_what_no_robot_could_do(report: Report) -> None:
    lsv, good, _ = report.motions.evaluations
    assert status(lsv) == "singular"
    assert status(good) == "solved, exceeds velocity"
    assert (
        status(replace(good, limit_excess={}, limit_excess_between={"clearance": 0.1})) == "solved, exceeds clearance"
    )
    assert status(within(report).motions.evaluations[1]) == "solved"


def test_what_to_send_and_why(report: Report) -> None:
    good = within(report)
    said = verdict(good)
    assert said.startswith("Send global 1: 50 % less energy than LSV")
    assert "keeps every limit (closest: joint1, 50 % of its velocity (0.7 rad/s) at 2 s)" in said
    clear = 1000 * good.motions.evaluations[1].clearance_between
    assert f"clearance {clear:.3g} mm, peak acceleration " in said
    assert said.endswith("; confirmed by IPOPT; not checked: self-collision.")


def test_a_path_that_is_entered_at_speed_says_so(report: Report) -> None:
    good = within(report)
    assert "begins at speed" not in verdict(good)
    reference = good.motions.problem.reference
    flying = replace(
        good.motions.problem, reference=replace(reference, timing=ConstantSpeed(reference.timing.duration))
    )
    evaluations = [replace(e, qd=np.full_like(e.qd, [0.1, -0.3, 0.2])) for e in good.motions.evaluations]
    said = verdict(report_of(flying, evaluations, good.find(export.Resampled)))
    assert f", begins at speed ({flying.task.arm.description.actuated[1]} at 0.3 rad/s)" in said


def test_why_the_best_is_not_what_is_sent(report: Report) -> None:
    good = within(report)
    sent, (lsv, best) = good.find(export.Resampled), good.motions.evaluations
    assert sent is not None
    cheap = replace(lsv, integrals={name: running / 2 for name, running in best.integrals.items()})
    passed = replace(sent, method="lsv", faults=("starts with a jump",))
    given = replace(sent, before=(passed,), instead="Do this. ")
    said = verdict(report_of(good.motions.problem, [cheap, best], given))
    assert said.startswith("Send global 1: ")
    assert said.endswith(". lsv 1 would take 50 % less energy, but starts with a jump. Do this.")


def test_who_else_leads_to_a_motion(report: Report) -> None:
    """No search from which the planner has its motion speaks for it, and none that led to another."""
    good = within(report)
    motions, resampled = good.motions.evaluations, good.find(export.Resampled)
    here = Comparison("dynamic_programming", 25, 1.0, 1.0, 1, gone_on=False)
    others = (replace(here, method="lower_bound", same_as=2), replace(here, method="lower_bound", gone_on=True))
    for other in others:
        known = report_of(good.motions.problem, motions, resampled, Estimate((here, other)))
        assert "; confirmed by IPOPT, dynamic programming leads there too; not checked" in verdict(known)


def test_why_nothing_is_sent(report: Report) -> None:
    problem, (lsv, good, other) = report.motions.problem, report.motions.evaluations
    refused = export.Resampled("global", 1, *[good.time] * 4, 1e-9, 0.0, {}, {}, ("starts with a jump",))
    said = verdict(report_of(problem, [lsv, good], export.Nothing((refused,), "Do this. ")))
    assert said.startswith(
        "Nothing to send: global 1, the best found, starts with a jump. Do this. global 1: exceeds velocity (closest: "
    )
    assert said.endswith("; LSV is singular at 1.50 s; not checked: self-collision.")
    bad = replace(other, status=Status.INFEASIBLE)
    assert verdict(report_of(problem, [bad])) == "Nothing to send: global 2 is none found."


def test_a_motion_within_its_limits_comes_before_a_cheaper_one(report: Report) -> None:
    problem, (_, good, other) = report.motions.problem, report.motions.evaluations
    dear = replace(other, objective=9.0, limit_excess={}, limit_excess_between={})
    assert good.objective < 9
    assert first(report_of(problem, [good, dear])) is dear


def test_shares_are_no_powers_of_ten() -> None:
    assert [percent(share) for share in (0.316, -0.0123, 0.994, 1.13, -0.9999)] == ["32", "-1.2", "99", "113", "-100"]


def test_the_table_of_motions(report: Report) -> None:
    lsv, best = rows(within(report))
    assert (lsv["vs LSV"], best["vs LSV"]) == ("", "-50 %")
    assert (lsv["exported"], best["exported"]) == ("", "yes")
    assert best["closest limit"] == "joint1 velocity 50 % of 0.7 rad/s at 2 s"
    good = report.motions.evaluations[1]
    assert best["clearance [mm]"] == f"{1000 * min(good.clearance.min(), good.clearance_between):.3g}"
    assert all("[" in title for title in ("energy [J s]", "path error [m]", "time [s]") if best[title])


def test_seven_joints_need_no_more_than_forty_rows(report: Report) -> None:
    """A row per joint: three joints and seven differ by four."""
    table = summary(report)
    text = markdown(report, table, Printed({}))
    details = text[text.index("## Energies") :]
    count = sum(line.startswith("| ") and not line.startswith("|  |") for line in details.splitlines())
    assert count + 4 <= 40
    peaks = [column for column in table.columns if PEAK.fullmatch(column)]
    assert len(peaks) == 9
    assert "| joint1 | " in details
    assert "350 % of 0.1 rad/s (joint1, 2 s)" in details
