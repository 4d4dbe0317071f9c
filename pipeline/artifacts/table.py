"""The motions of a run beside each other, as people compare them: a row of words per motion, for every artifact."""

from __future__ import annotations

import numpy as np

from pipeline.artifacts.bands import closest
from pipeline.artifacts.report import Report
from pipeline.artifacts.verdict import baseline, percent, saving, sent, status, weighs
from pipeline.methods.registry import METHODS
from pipeline.studies.front import Front, cost, unit

SHORT = {"kinetic_energy": "energy", "torque": "torque²", "velocity_norm": "velocity²"}  # for the heads of columns


def rows(report: Report) -> list[dict[str, str]]:
    """By title. A column in which no motion has anything to say is left out; every unit stands in its title."""
    problem, against, chosen = report.motions.problem, baseline(report), sent(report)
    main = weighs(problem)
    front = report.find(Front)
    names = list(dict.fromkeys([main, *(front.objectives if front is not None else ()), "kinetic_energy", "torque"]))
    table = []
    for e in report.motions.evaluations:
        row = {"motion": e.label, "status": status(e)}
        found = e.solution.found
        for name in names:
            title = f"{SHORT.get(name, name.replace('_', ' '))} [{unit(name)}]"
            row[title] = f"{cost(e, name):.4g}" if found else ""
        if against is not None:
            known = found and e.solution.event_time is None and e is not against
            saved = saving(problem, e, against) if known else 0.0
            more = f"{'+' if saved <= 0 else ''}{percent(-saved)} %"
            row[f"vs {METHODS[against.method].title}"] = more if known else ""
        near = closest(problem, e) if found and e.solution.event_time is None else None
        row["closest limit"] = "" if near is None else near.brief
        clear = min(e.clearance.min(), e.clearance_between)
        row["clearance [mm]"] = f"{1000 * clear:.3g}" if problem.obstacles is not None and np.isfinite(clear) else ""
        row["path error [m]"] = f"{e.tracking_error.max():.1e}" if found else ""
        row["exported"] = "yes" if e is chosen else ""
        row["time [s]"] = f"{report.seconds[e.method]:.2f}"
        table.append(row)
    said = [title for title in table[0] if any(row[title] for row in table)]
    return [{title: row[title] for title in said} for row in table]
