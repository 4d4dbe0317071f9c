"""Every method on every kind of problem: motions, or a refusal of one line, alike from Python and a command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.config.run import RunConfig
from pipeline.methods.method import ANY, Context, Serves
from pipeline.methods.registry import METHODS
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary
from pipeline.problem.solution import Status
from pipeline.run.solve import solve
from pipeline.run.state import state
from tests.support import composed

FEW = (
    *("configurations=4", "candidates=30", "optimised=1", "same_path=0.5", "refine_to=null"),
    *("nodes=40", "layers=3"),
)
SMALL = (
    *(f"method.global.{word}" for word in FEW),
    *(
        "timing.steps=8",
        "path.length=0.15",
        "timing.duration=4",
        "method.lsv.dt=0.1",
        "method.inertia_weighted.dt=0.1",
    ),
    *(
        "method.pmke.dt=0.02",
        "method.pareto.steps=2",
        "method.pareto.rounds=0",
        "method.pareto.max_iterations=60",
        "method.receding.update_interval=2",
    ),
    *("method.dynamic_programming.nodes=60", "method.dynamic_programming.intervals=6"),
    *("method.segments.intervals=20", "method.segments.nodes=60"),
    *("method.lower_bound.intervals=6", "method.lower_bound.cells=30"),
    *("method.calculus_of_variations.spacing=0.3", "method.calculus_of_variations.refinements=1"),
    *(
        "method.calculus_of_variations.max_speed=0.5",
        "method.calculus_of_variations.scan_tolerance=1e-4",
        "method.calculus_of_variations.tolerance=1e-7",
        "method.pontryagin.guesses=2",
        "method.pontryagin.intervals=10",
        "method.pontryagin.tolerance=1e-7",
    ),
)
CIRCLE = tuple(word for word in SMALL if not word.startswith("path."))
PROBLEMS = {
    "fixed": SMALL,
    "free": (*SMALL, "boundary=free"),
    "cyclic": (*CIRCLE, "path=circle", "path.radius=0.03", "boundary=cyclic", "timing.steps=12"),
    "limits": (*SMALL, "limits=joint"),
    "torque": (*SMALL, "objective=torque"),
    "floating": (*SMALL, "base=free", "base.mass=20", "base.inertia=1"),
    "held": (
        *SMALL,
        "objective=reaction",
        "method.pmke.objective=kinetic_energy",
        "method.receding.objective=kinetic_energy",
        "method.pareto.objectives=[reaction_force,torque]",
    ),
    "r = 2": (*SMALL, "robot=planar4r", "timing.steps=12"),
}
BASELINES = {"lsv", "inertia_weighted", "pmke", "receding", "global", "pareto"}
SERVED = {
    "fixed": set(METHODS),
    "free": set(METHODS),
    "cyclic": BASELINES | {"dynamic_programming", "lower_bound"},
    "limits": BASELINES | {"dynamic_programming", "lower_bound", "segments"},
    "torque": BASELINES | {"segments"},
    "floating": BASELINES,
    "held": BASELINES,
    "r = 2": BASELINES | {"pontryagin", "pontryagin_as_printed", "segments"},
}
WHY = {  # a word of the refusal, where the problem's name is none
    "floating": "the base is floating",
    "held": "the base is held",
    "r = 2": "the redundancy degree is 2",
}


def asked(problem: str, method: str) -> RunConfig:
    return replace(composed(*PROBLEMS[problem]), methods=(method,))  # composed once for all methods


@pytest.mark.parametrize(("name", "problem"), [(m, p) for p in PROBLEMS for m in METHODS if m not in SERVED[p]])
def test_a_refusal_is_one_line_and_the_same_from_python_and_from_the_command_line(name: str, problem: str) -> None:
    config = asked(problem, name)
    with pytest.raises(InputError, match=rf"^{name}: .*{WHY.get(problem, problem)}.*; supported are ") as refused:
        METHODS[name](prepare(config), config.method.of(name))
    with pytest.raises(InputError) as by_command:
        state(config)
    line, others = str(by_command.value).split("; methods that serve this problem: ")
    assert line == str(refused.value)
    assert "\n" not in line
    assert set(others.split(", ")) == SERVED[problem]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "problem"), [(m, p) for p in PROBLEMS for m in METHODS if m in SERVED[p]])
def test_what_is_not_refused_is_solved(name: str, problem: str) -> None:
    config = asked(problem, name)
    stated = state(config)
    solutions = METHODS[name](stated, config.method.of(name))
    assert [solution.method for solution in solutions] == [name] * len(solutions)
    assert [solution.optimum for solution in solutions] == list(range(1, len(solutions) + 1))
    for solution in solutions:
        time, q = solution.trajectory.time, solution.trajectory.q
        assert solution.found
        assert solution.status is Status.SOLVED, solution.message
        assert q.shape == (len(time), stated.task.arm.n)
        gap = stated.task.error(q, stated.reference.position(time))
        assert np.abs(gap).max() <= max(1e-6, min(solution.tracking_tolerance, 0.1))


def test_the_names_are_the_keys_and_titles_and_colours_are_their_own() -> None:
    assert all(name == method.name for name, method in METHODS.items())
    assert len({method.title for method in METHODS.values()}) == len(METHODS)
    assert all(len(method.color) == 7 and int(method.color[1:], 16) >= 0 for method in METHODS.values())


def test_defaults_are_those_of_the_options_and_the_context() -> None:
    problem = prepare(asked("fixed", "lsv"))
    own, given = (
        METHODS["lsv"](problem)[0],
        METHODS["lsv"](problem, METHODS["lsv"].options(), Context())[0],
    )
    np.testing.assert_array_equal(own.trajectory.q, given.trajectory.q)


def test_a_run_calls_its_methods_in_order_with_their_own_options() -> None:
    config = composed(*SMALL, "methods=[inertia_weighted,lsv]", "method.lsv.dt=0.2")
    solutions, seconds = solve(prepare(config), config, Context())
    assert [solution.method for solution in solutions] == list(seconds) == ["inertia_weighted", "lsv"]
    assert [len(solution.trajectory.time) for solution in solutions] == [41, 21]
    assert all(second > 0 for second in seconds.values())


@pytest.mark.parametrize("starts", ["dynamic_programming", ["population", "dynamic_programming"]])
def test_starts_by_dynamic_programming_serve_what_it_serves(starts: str | list[str]) -> None:
    options = GlobalOptions(starts=starts)
    assert METHODS["global"].why_not(prepare(asked("limits", "global")), options) is None
    for problem in ("torque", "floating", "r = 2"):
        line = METHODS["global"].why_not(prepare(asked(problem, "global")), options)
        assert line is not None
        assert line.startswith(f"global: method.global.starts = {', '.join(options.generators)}: dynamic_programming: ")
        assert line.endswith("; starts = roadmap serves every problem")


def test_a_front_is_refused_where_the_planner_is_or_two_integrals_are_not_given() -> None:
    pareto, problem = METHODS["pareto"], prepare(asked("fixed", "pareto"))
    by_grid = ParetoOptions(planner=GlobalOptions(starts=["population", "dynamic_programming"]))
    line = pareto.why_not(problem, by_grid)
    assert line is not None
    assert "the objective holds a torque or reaction integral" in line
    for wrong in (["torque"], ["torque", "kinetic_energy", "base_rotation"]):
        with pytest.raises(InputError, match="a front is one of two integrals"):
            pareto(problem, ParetoOptions(objectives=wrong))


def test_a_cycle_needs_a_closed_path() -> None:
    open_path = replace(prepare(asked("fixed", "lsv")), boundary=Boundary.CYCLIC)
    for name in SERVED["cyclic"]:
        with pytest.raises(InputError, match="the path does not end where it starts"):
            METHODS[name](open_path)


@pytest.mark.parametrize(("integral", "base"), [("base_rotation", "floating"), ("reaction_torque", "held")])
def test_an_integral_of_the_base_needs_that_base(integral: str, base: str) -> None:
    problem = replace(prepare(asked("fixed", "lsv")), objective=Objective({integral: 1.0}))
    line = f"the objective holds {integral}, which needs a {base} base; this one is fixed"
    assert METHODS["global"].why_not(problem) == f"global: {line}"
    front = ParetoOptions(objectives=("kinetic_energy", integral))
    assert METHODS["pareto"].why_not(prepare(asked("fixed", "pareto")), front) == f"pareto: global: {line}"


def test_what_serves_everything_says_so() -> None:
    assert str(ANY) == "is every problem"
    assert str(Serves(redundancy=1, boundaries=frozenset((Boundary.FREE, Boundary.FIXED)), constraints=False)) == (
        "are r = 1; boundary fixed or free; no limits or obstacles"
    )
