"""The order of one run: configuration -> problem -> motions -> studies -> artifacts."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

from pipeline.artifacts.artifacts import ARTIFACTS, name, write
from pipeline.artifacts.report import Report
from pipeline.common.versions import versions
from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.method import Context
from pipeline.run import resume
from pipeline.run.console import Console
from pipeline.run.hints import hints
from pipeline.run.solve import solve
from pipeline.run.stages import Stages
from pipeline.run.state import state
from pipeline.studies.studies import STUDIES
from pipeline.studies.study import Motions

UNFINISHED = ".unfinished"  # finished solves of a run that is not finished: what a resumed run starts from


def run(config: RunConfig, folder: Path) -> int:
    """One whole run into `folder`; returns the exit code. Raises InputError before anything is written."""
    stages, console = Stages(), Console()
    with stages("prepare"):
        problem, made = state(config), facts(config)
        workers = Workers(config.parallel.workers, folder / UNFINISHED, config.parallel.address, config.parallel.wait)
        workers.check()
    for line in hints(config, problem):
        print(f"hint: {line}", file=sys.stderr)
    with stages("solve"), console.progress(config.name) as (progress, phase):
        solutions, seconds = solve(problem, config, Context(config.seed, workers, progress, phase))
    console.phase(config.name, "evaluating")
    with stages("evaluate"):
        if solutions[0].stretch is None:  # where its timing was to be found, with that of the best
            problem = solutions[0].posed(problem)
        motions = Motions(config, problem, [evaluate(problem, solution) for solution in solutions], workers)
    with stages("studies"):
        results = tuple(result for study in STUDIES if (result := study(motions)) is not None)
    report = Report(motions, results, seconds, stages.seconds, made)
    console.report(report)
    console.phase(config.name, "writing and drawing")
    for artifact in ARTIFACTS:
        with stages(name(artifact)):
            write(artifact, report, folder)
    shutil.rmtree(folder / UNFINISHED, ignore_errors=True)
    console.where(folder)
    return report.exit_code


def facts(config: RunConfig) -> dict[str, Any]:
    """What a run is and what it is made with; the digests of its files are those at its beginning."""
    own = {"experiment": config.name, "seed": config.seed, "robot": config.robot.name}
    return {**own, **versions(), "inputs": resume.inputs(config)}
