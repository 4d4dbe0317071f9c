"""The order of one run: configuration -> problem -> methods -> evaluation -> artifacts."""

from __future__ import annotations

import shutil
import time
from pathlib import Path as File

from pipeline.common.versions import versions
from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.method import Context
from pipeline.run import resume
from pipeline.run.solve import solve, state
from pipeline.studies import studies

UNFINISHED = ".unfinished"  # finished solves of a run that is not finished: what a resumed run starts from


def run_and_write(config: RunConfig, folder: File) -> int:
    """One whole run into `folder`; returns the exit code."""
    from pipeline.artifacts import markdown as pages
    from pipeline.artifacts import motion_files as export
    from pipeline.artifacts import record
    from pipeline.artifacts import summary as tables
    from pipeline.artifacts.figures import base as base_figure
    from pipeline.artifacts.figures import candidates as study_figure
    from pipeline.artifacts.figures import closed_loop as closed_loop_figure
    from pipeline.artifacts.figures import front as front_figure
    from pipeline.artifacts.figures import identification as identification_figure
    from pipeline.artifacts.figures import motions as figures
    from pipeline.artifacts.recording import recording
    from pipeline.run.console import Console

    stages: dict[str, float] = {}
    console = Console()

    def timed(stage: str, begin: float) -> None:
        stages[stage] = round(time.perf_counter() - begin, 4)

    begin = time.perf_counter()
    problem = state(config)
    inputs = resume.inputs(config)
    workers = Workers(config.parallel.workers, folder / UNFINISHED, config.parallel.address)
    workers.check()
    timed("prepare", begin)

    begin = time.perf_counter()
    with console.progress(config.name) as progress:
        solutions, seconds = solve(problem, config, Context(config.seed, workers, progress))
    timed("solve", begin)

    begin = time.perf_counter()
    evaluations = [evaluate(problem, solution) for solution in solutions]
    timed("evaluate", begin)
    begin = time.perf_counter()
    extra = studies.compute(problem, config, evaluations)
    timed("extras", begin)

    begin = time.perf_counter()
    summary = tables.summary(problem, evaluations, seconds, config.published, extra)
    markdown = pages.markdown(config, problem, evaluations, summary, extra)
    tables.write(folder, evaluations, summary, markdown, extra)
    if extra.exported is not None:
        arm = problem.task.arm.description
        export.write(folder, extra.exported, arm.actuated, arm.base)
    timed("tables", begin)
    begin = time.perf_counter()
    figures.write(folder / "figures", problem, extra.shown(evaluations), name=config.name)
    if problem.task.arm.base_coordinates:
        base_figure.write(folder / "figures", problem, extra.shown(evaluations), name=config.name)
    if extra.closed_loop is not None:
        closed_loop_figure.write(folder / "figures", extra.closed_loop, problem, name=config.name)
    if extra.study is not None:
        study_figure.write(folder / "figures", extra.study, name=config.name)
    if extra.identification is not None:
        identification_figure.write(folder / "figures", extra.identification, name=config.name)
    picture = None
    if extra.front is not None:
        picture = front_figure.write(folder / "figures", extra.front, name=config.name)
    timed("figures", begin)
    begin = time.perf_counter()
    facts = {"experiment": config.name, "seed": config.seed, "robot": config.robot.name, **versions()}
    recording.write(
        folder / "recording.rrd",
        problem,
        evaluations,
        name=config.name,
        summary=markdown,
        properties=facts,
        front=picture,
    )
    timed("recording", begin)
    code = 0 if all(evaluation.confirmed for evaluation in evaluations) else 1
    facts |= {"inputs": inputs, "exit_code": code}
    record.write_run(folder, config, facts, seconds, evaluations, stages, extra)
    shutil.rmtree(folder / UNFINISHED, ignore_errors=True)
    console.report(summary, folder)
    return code
