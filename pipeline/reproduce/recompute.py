"""What the runs give for a printed number: one function per kind of number in `config/found.py`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import singledispatch
from typing import Any

import numpy as np

from pipeline.config import found as kinds
from pipeline.reproduce.results import NotRunError, ResultError, Results

AT_LIMIT = 1e-5  # relative: a value this near to its limit is at it


Runs = Mapping[str, Results]


def recompute(found: Any, runs: Runs) -> float:
    """The number that `found` describes; raises NotRunError without its run, ResultError if it is not in it."""
    for name in found.experiments:
        if name not in runs:
            raise NotRunError(f"no run of experiment {name}")
    return float(_value(found, runs))


@singledispatch
def _value(found: Any, runs: Runs) -> float:
    raise TypeError(found)


@_value.register
def _(found: kinds.Summary, runs: Runs) -> float:
    return runs[found.experiment].cell(found.method, found.optimum, found.column)


@_value.register
def _(found: kinds.Peak, runs: Runs) -> float:
    motion = runs[found.experiment].motion(found.method)
    speed = motion[f"qd_{found.joint}"][motion["time"] <= (np.inf if found.until is None else found.until)]
    return float((speed if found.side == "positive" else speed.abs()).max())


@_value.register
def _(found: kinds.Ratio, runs: Runs) -> float:
    ratio = _value(found.of, runs) / _value(found.to, runs)
    percent = 100 * (ratio - 1)
    return {"1": ratio, "percent": percent, "percent_of_size": abs(percent)}[found.unit]


@_value.register
def _(found: kinds.LimitTime, runs: Runs) -> float:
    run = runs[found.experiment]
    motion, j, bounds = run.motion("global"), found.joint, run.problem.bounds
    values = {
        "velocity": motion[f"qd_{j}"],
        "torque": motion[f"tau_{j}"],
        "power": motion[f"qd_{j}"] * motion[f"tau_{j}"],
    }
    at = np.flatnonzero(values[found.limit].abs() >= getattr(bounds, found.limit)[j - 1] * (1 - AT_LIMIT))
    if not at.size:
        return float("nan")
    time = motion["time"].to_numpy()
    return float(time[max(at[0] - 1, 0)] if found.end == "from" else time[at[-1]])


@_value.register
def _(found: kinds.JointsAtLimit, runs: Runs) -> float:
    run = runs[found.experiment]
    n = run.problem.task.arm.n
    speed = run.motion("global")[[f"qd_{j + 1}" for j in range(n)]].abs().to_numpy()
    return float((speed >= run.problem.bounds.velocity * (1 - AT_LIMIT)).sum(axis=1).max())


@_value.register
def _(found: kinds.EndEffector, runs: Runs) -> float:
    return float(runs[found.experiment].motion("global")[found.axis].iloc[0 if found.end == "first" else -1])


@_value.register
def _(found: kinds.Validation, runs: Runs) -> float:
    table = runs[found.experiment].table("validation")
    rows = table[table["planner_optimum"] == found.optimum]
    if rows.empty or found.column not in table:
        raise ResultError(f"{found.experiment}: no {found.column} of optimum {found.optimum} in validation.csv")
    return float(rows[found.column].iloc[0])


@_value.register
def _(found: kinds.Minima, runs: Runs) -> float:
    table = runs[found.experiment].table("validation")
    return float((table["planner_optimum"].notna() & (table["kind"] == "minimum")).sum())


@_value.register
def _(found: kinds.PowerLaw, runs: Runs) -> float:
    run = runs[found.experiment]
    curve = run.table("candidate_study")
    tail = curve[curve["candidates"] >= len(run.problem.times) * run.problem.task.arm.n]
    exponent, intercept = np.polyfit(np.log(tail["candidates"]), np.log(tail["distance"]), 1)
    return float(exponent if found.parameter == "exponent" else intercept)


@_value.register
def _(found: kinds.PredictionTime, runs: Runs) -> float:
    solutions = runs[found.experiment].record["solutions"]
    log = next((s["statistics"]["predictions"] for s in solutions if s["method"] == "pmke"), None)
    if not log:
        raise ResultError(f"{found.experiment}: no predictions of pmke in run.json")
    whole, solver = (float(np.mean([entry[key] for entry in log])) for key in ("wall_time_s", "solver_time_s"))
    return {"whole": whole, "optimisation": solver, "rest": whole - solver}[found.of]


@_value.register
def _(found: kinds.SpectralRatio, runs: Runs) -> float:
    run = runs[found.experiment]
    own, other = run.evaluation(found.method), run.evaluation(found.over)
    return float((np.interp(other.time, own.time, own.spectral_radius) / other.spectral_radius)[1:].max())


@_value.register
def _(found: kinds.RangeShare, runs: Runs) -> float:
    run = runs[found.experiment]
    criteria = run.problem.objective.secondary
    if criteria is None:
        raise ResultError(f"{found.experiment}: its objective knows no joint ranges")
    q = run.motion(found.method)[[f"q_{j + 1}" for j in range(run.problem.task.arm.n)]].to_numpy()
    middle, half = (criteria.upper + criteria.lower) / 2, (criteria.upper - criteria.lower) / 2
    return float((np.abs(q - middle) / half).max())


@_value.register
def _(found: kinds.Mass, runs: Runs) -> float:
    table = runs[found.experiment].table("masses")
    return float(table.loc[table["link"] == found.link, "identified"].iloc[0])
