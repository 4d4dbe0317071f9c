"""What a method is: a name, the problems that it serves, and a function from a problem to its solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.common.errors import InputError
from pipeline.common.workers import Workers
from pipeline.problem.integrals import INTEGRALS
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Progress, Solution, no_phase, no_progress

ALL_BOUNDARIES = frozenset(Boundary)


@dataclass(frozen=True)
class Serves:
    """The problems that a method serves; by default all.

    redundancy: the only degree r served; None: any. order: the highest derivative in the objective, 1 for one of
    positions and velocities, 2 for one of accelerations too (torques, reactions). constraints: whether there may be
    limits or obstacles. orientation: whether the task may prescribe one. moving_base: whether the arm may stand on a
    base that floats, or that is held so that what it feels can count. rest: whether the joints may be
    told to rest at an end, or their accelerations and jerks be limited. timing: whether the timing may be left to it.
    tube: whether the path may be one that need not be kept exactly. breaks: whether it may be several tool paths.
    """

    redundancy: int | None = None
    order: Literal[1, 2] = 2
    boundaries: frozenset[Boundary] = ALL_BOUNDARIES
    constraints: bool = True
    orientation: bool = True
    moving_base: bool = True
    rest: bool = True
    timing: bool = False
    tube: bool = False
    breaks: bool = False

    def why_not(self, problem: Problem) -> str | None:
        """The first condition that `problem` does not meet and what is supported, without full stop; None if served."""
        why = self._unmet(problem)
        if why is None and not self.timing and problem.free_timing:
            return "timing.law = optimal and timing.duration = shortest are found by the method global alone"
        if why is None and not self.tube and not problem.reference.exact:
            return "path.exact = false is used by the method global, and by the front of path_tolerance, alone"
        if why is None and not self.breaks and problem.reference.breaks:
            return "the path is several tool paths (column segment of path.file), which the method segments connects"
        return _contradiction(problem) if why is None else f"{why}; supported {self}"

    def _unmet(self, problem: Problem) -> str | None:
        task, boundary = problem.task, problem.boundary
        if not self.moving_base and task.arm.base.count:
            return f"the base is {task.arm.base.kind}"
        if self.redundancy not in (None, task.redundancy):
            return f"the redundancy degree is {task.redundancy}"
        if self.order == 1 and problem.objective.second_order:
            return "the objective holds a torque or reaction integral, which is of second order"
        if self.order == 1 and not Lagrangian(task, problem.objective).is_quadratic:
            return "no velocity counts in the objective"
        if boundary not in self.boundaries:
            return f"the boundary is {boundary.value}"
        if not self.constraints and problem.constrained:
            return "the problem has limits or obstacles"
        if not self.rest and (any(problem.rest) or problem.bounds.smooth):
            return "the joints are to rest at an end, or their accelerations are limited"
        if not self.orientation and task.m > len(task.axes):
            return "the task prescribes orientations"
        return None

    def __str__(self) -> str:
        """What is supported, as `are ...`."""
        parts = []
        if self.redundancy is not None:
            parts.append(f"r = {self.redundancy}")
        if self.order == 1:
            parts.append("objectives of first order, such as the kinetic energy")
        if self.boundaries != ALL_BOUNDARIES:
            parts.append("boundary " + " or ".join(sorted(boundary.value for boundary in self.boundaries)))
        if not self.orientation:
            parts.append("positions only")
        if not self.constraints:
            parts.append("no limits or obstacles")
        if not self.moving_base:
            parts.append("arms on a fixed base")
        if not self.rest:
            parts.append("motions without rest at an end (boundary.rest=[]) and limits of acceleration or jerk")
        return "are " + "; ".join(parts) if parts else "is every problem"


def _contradiction(problem: Problem) -> str | None:
    """What no method can serve, because the problem's own parts do not go together."""
    kind = problem.task.arm.base.kind
    for name in problem.objective.weights:
        if INTEGRALS[name].base not in ("any", kind):
            return f"the objective holds {name}, which needs a {INTEGRALS[name].base} base; this one is {kind}"
    if problem.boundary is Boundary.CYCLIC and not problem.closed_path:
        return "the boundary is cyclic, but the path does not end where it starts"
    return None


ANY = Serves()
WITH_TIMING = Serves(timing=True, tube=True)
ON_KNOTS = Serves(rest=False)  # by differences, which know no rest
ALONG_LOOPS = Serves(redundancy=1, order=1, moving_base=False, rest=False)  # of the self-motion of an arm that stands


@dataclass(frozen=True)
class Context:
    """What a run shares with its methods: the seed of every random draw, the workers, and whom progress is told.

    phase: told in a few words what begins.
    """

    seed: int = 1
    workers: Workers = field(default_factory=Workers)
    progress: Progress = no_progress
    phase: Callable[[str], None] = no_phase


@dataclass(frozen=True)
class NoOptions:
    """Of a method that has none."""


Solve = Callable[[Problem, Any, Context], list[Solution]]


def _nothing_more(problem: Problem, options: Any) -> str | None:
    return None


@dataclass(frozen=True)
class Method:
    """One word of the key `methods`: called with a problem it refuses what it does not serve, then solves.

    name: the word, and that of its motions. title: in legends. color: #RRGGBB. options: their class, whose own defaults
    hold where a caller gives none. solve(problem, options, context) returns at least one Solution, best first; where
    there is no motion, one that says why. refuses(problem, options) names what more than `serves` stands against it.
    """

    name: str
    title: str
    color: str
    options: type
    serves: Serves
    solve: Solve
    refuses: Callable[[Problem, Any], str | None] = _nothing_more

    def why_not(self, problem: Problem, options: Any = None) -> str | None:
        """Why this method refuses `problem`, in one line with its name and what is supported; None: it does not."""
        why = self.serves.why_not(problem)
        if why is None:
            why = self.refuses(problem, self.options() if options is None else options)
        return why and f"{self.name}: {why}"

    def __call__(self, problem: Problem, options: Any = None, context: Context = Context()) -> list[Solution]:
        """The solutions, best first; raises InputError, one line, for a problem that this method does not serve."""
        options = self.options() if options is None else options
        why = self.why_not(problem, options)
        if why:
            raise InputError(why)
        return self.solve(problem, options, context)
