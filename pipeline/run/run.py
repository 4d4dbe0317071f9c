"""The order of one run: configuration -> problem -> methods -> evaluation -> artifacts."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path as File

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.common.versions import versions
from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods import calculus_of_variations, dynamic_programming, global_planner, lsv, pareto
from pipeline.methods.pmke import predictive
from pipeline.methods.pontryagin import boundary_value
from pipeline.methods.pontryagin.as_printed import as_printed
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Progress, Solution
from pipeline.run import resume
from pipeline.studies import studies

UNFINISHED = ".unfinished"  # finished solves of a run that is not finished: what a resumed run starts from


def state(config: RunConfig) -> Problem:
    """The problem of a configuration, refused before anything is solved if a method asked for does not serve it."""
    problem = prepare(config)
    if problem.task.arm.base.count:
        _require_fixed_base(config)
    if "dynamic_programming" in config.methods or (
        "global" in config.methods and config.method.global_.starts != "population"
    ):
        dynamic_programming.check(problem)
    if "calculus_of_variations" in config.methods:
        calculus_of_variations.check(problem)
    if "pontryagin" in config.methods:
        boundary_value.check(problem)
    return problem


def _require_fixed_base(config: RunConfig) -> None:
    """Refuse what a base that moves, or that is held for its reaction, is not served by: the attitude is a state."""
    refused = {"dynamic_programming", "calculus_of_variations", "pontryagin"} & set(config.methods)
    if refused:
        raise ConfigError(
            f"methods: {', '.join(sorted(refused))} serve arms on a fixed base; of a floating or held base serve lsv, "
            "inertia_weighted, pmke, global and pareto"
        )
    if config.method.global_.starts != "population":
        raise ConfigError(f"method.global.starts = {config.method.global_.starts}: allowed on such a base: population")
    if config.closed_loop.run:
        raise ConfigError("closed_loop.run: the controller is one for arms on a fixed base")


def solve(
    problem: Problem, config: RunConfig, workers: Workers, progress: Progress
) -> list[tuple[list[Solution], float]]:
    """The solutions of each method asked for, in order, with the method's wall time [s]."""
    options = config.method
    own = options.pontryagin
    methods: dict[str, Callable[[], list[Solution]]] = {
        "lsv": lambda: [lsv.solve(problem, options.lsv)],
        "inertia_weighted": lambda: [lsv.solve(problem, options.inertia_weighted, "inertia_weighted")],
        "pmke": lambda: [predictive.solve(problem, options.pmke)],
        "global": lambda: global_planner.solve(problem, options.global_, config.seed, workers, progress),
        "pareto": lambda: pareto.solve(problem, config.pareto, options.global_, config.seed, workers, progress),
        "dynamic_programming": lambda: dynamic_programming.solve(problem, options.dynamic_programming),
        "calculus_of_variations": lambda: calculus_of_variations.solve(problem, options.calculus_of_variations),
        "pontryagin": lambda: boundary_value.boundary_value(problem, own, config.seed, workers, progress),
        "pontryagin_as_printed": lambda: as_printed(problem, own),
    }
    asked = list(config.methods)
    if "pontryagin" in asked and own.formulation != "boundary_value":
        at = asked.index("pontryagin")
        asked[at : at + 1] = ["pontryagin_as_printed", "pontryagin"][: 1 if own.formulation == "as_printed" else 2]
    results = []
    for method in asked:
        begin = time.perf_counter()
        solutions = methods[method]()
        results.append((solutions, time.perf_counter() - begin))
    return results


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
        results = solve(problem, config, workers, progress)
    timed("solve", begin)

    begin = time.perf_counter()
    evaluations = [evaluate(problem, solution) for solutions, _ in results for solution in solutions]
    wall_times = {solutions[0].method: seconds for solutions, seconds in results}
    timed("evaluate", begin)
    begin = time.perf_counter()
    extra = studies.compute(problem, config, evaluations)
    timed("extras", begin)

    begin = time.perf_counter()
    summary = tables.summary(problem, evaluations, wall_times, config.published, extra)
    markdown = pages.markdown(config, problem, evaluations, summary, extra)
    tables.write(folder, evaluations, summary, markdown, extra)
    if extra.exported is not None:
        arm = problem.task.arm.description
        export.write(folder, extra.exported, arm.actuated, arm.base)
    timed("tables", begin)
    begin = time.perf_counter()
    figures.write(folder / "figures", problem, extra.shown(evaluations), name=config.name)
    if problem.task.arm.base.count:
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
    record.write_run(folder, config, facts, results, evaluations, stages, extra)
    shutil.rmtree(folder / UNFINISHED, ignore_errors=True)
    console.report(summary, folder)
    return code
