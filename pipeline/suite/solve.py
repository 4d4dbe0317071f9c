"""One problem of a suite: stated, solved, and judged by the evaluation alone."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from hydra import compose, initialize_config_dir

from pipeline.common.files import shipped
from pipeline.config.as_written import keep_as_written
from pipeline.config.compose import checked
from pipeline.config.run import RunConfig
from pipeline.config.unfolding import bound_files
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.problem.solution import Status
from pipeline.run.state import state
from pipeline.suite.read import Case

METHOD = "global"  # where a problem names none


def row(case: Case) -> dict[str, Any]:
    """What is known of it, by column; raises InputError for a problem that cannot be posed."""
    config = _config(case)
    problem = state(config)
    begin, used = time.perf_counter(), time.process_time()
    solutions, certificate = [], float("nan")
    for name in config.methods:
        found = METHODS[name](problem, config.method.of(name), Context(config.seed))
        certificate = float(found[0].statistics.get("gap", certificate)) if name == "lower_bound" else certificate
        solutions += found if name == "segments" else found[:1] if name != "lower_bound" else []
    seconds, processor = time.perf_counter() - begin, time.process_time() - used
    motions = [evaluate(problem, solution) for solution in solutions]
    bad = next((e for e in motions if e.status is not Status.SOLVED), None)
    told = {
        "problem": case.name,
        "robot": config.robot.name,
        "r": problem.task.redundancy,
        "status": "solved" if bad is None else bad.status.word,
        "pieces": len(motions),
    }
    if bad is None:
        told |= _measures(motions)
    clock = {"time_s": seconds, "processor_s": processor}
    return {**told, "certified_gap": certificate, **clock, "message": bad.message if bad else "", "about": case.about}


def _measures(motions: list[Evaluation]) -> dict[str, float]:
    """Sums over the pieces, and the worst of them."""
    return {
        "energy": sum(e.integral("kinetic_energy") for e in motions),
        "velocity_norm": sum(e.integral("velocity_norm") for e in motions),
        "joint_path": float(sum(np.linalg.norm(np.diff(e.q, axis=0), axis=1).sum() for e in motions)),
        "clearance_m": float(min(min(e.clearance.min(), e.clearance_between) for e in motions)),
        "path_error_m": float(max(e.tracking_error_between for e in motions)),
        "orientation_error_rad": float(max(e.orientation_error_between for e in motions)),
    }


def _config(case: Case) -> RunConfig:
    keep_as_written()
    bound_files()
    words = [*case.words]
    if not any(word.startswith("methods=") for word in words):
        words.append(f"methods=[{METHOD}]")
    with initialize_config_dir(str(shipped("conf")), version_base="1.3"):
        return checked(compose("config", overrides=[*words, f"name={case.name}"]))
