"""A lifted program in the making: knots, scaling, unknowns with their starts, and what terms add to them.

It knows none of its terms (`terms/`); `transcription.py` puts them together and says what the unknowns mean.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from pydrake.solvers import LinearConstraint, MathematicalProgram

from pipeline.common.arrays import Array
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.program import ipopt
from pipeline.program.differentiable import DifferentiableConstraint, DifferentiableCost
from pipeline.program.residuals import Conditions
from pipeline.program.scaling import POSITION_SCALE, Guess, Prices, Scaling, Sums, lifted, scale

KNOTS_PER_BINDING = 10  # a Python binding pays for its size squared: more, smaller bindings are cheaper up to a point
POSITIONS_PER_BINDING = 25  # of knots whose positions alone it takes


Block = NDArray[np.int_]


Rate = Callable[[Array, Array], tuple[Array, Array, Array]]  # of an integral, with its derivatives by q and qd


class Positions(Protocol):
    """A motion of which nothing but its positions is asked."""

    @property
    def q(self) -> Array:
        """(N + 1, n) [rad]."""


class Lifted:
    """The unknowns of a motion on the knots `times`, of them y (N + 1, n), its positions, and room for what terms add.

    A term takes the unknowns of another by name: `forces` (N, forces), `entry` (1, n), `excess` (1,). `drake` is the
    MathematicalProgram; every unknown's start is its initial guess.
    """

    scaling: Scaling
    guess: Positions
    w: NDArray[Any]  # (S, n) the velocities at the stations where the energy is summed up, scaled
    weights: Array  # (S,) [s] of that sum
    left_out: tuple[int, ...] = ()  # knots at which the path is not asked for
    tube: Array  # (N + 1, 2) the shares of the path's tolerances by which it may be left at the knots, if it may
    prices: Prices | None = None  # of the path, where they are known

    def __init__(
        self, problem: Problem, times: Array, guess: Array, *, elastic: Collection[str] = (), keep_off: float = 0.0
    ) -> None:
        self.problem, self.times, self.elastic, self.keep_off = problem, times, elastic, keep_off
        self.task, self.arm, self.limits = problem.task, problem.task.arm, problem.bounds
        self.n, self.nb, self.intervals = self.arm.n, self.arm.base.count, len(times) - 1
        self.first_free = 1 if problem.boundary is Boundary.FIXED else 0
        self.closed = problem.boundary is Boundary.CYCLIC
        self.dt = np.diff(times)
        self.x_ref = problem.reference.position(times)
        self.tube = np.ones((len(times), 2))
        self.lagrangian = Lagrangian(problem.task, problem.objective)
        self.forces = lifted(problem)
        self.drake = MathematicalProgram()
        self._unknowns: dict[str, NDArray[Any]] = {}
        self._rows: list[DifferentiableConstraint] = []
        self.followed: list[tuple[Block, Any]] = []  # knots, and the binding that keeps them on their path
        self.functions: dict[Any, DifferentiableCost | DifferentiableConstraint] = {}  # by evaluator
        self.y = self.new("y", POSITION_SCALE * guess)

    def new(self, name: str, start: Array) -> NDArray[Any]:
        """Unknowns of the shape of their `start`, for all terms to find by `name`."""
        made = self.drake.NewContinuousVariables(start.size, name)
        self.drake.SetInitialGuess(made, start.ravel())
        self._unknowns[name] = made.reshape(start.shape)
        return self._unknowns[name]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._unknowns[name]

    def add_rows(self, function: Any, target: Array, unknowns: Any, pattern: list[tuple[int, int]]) -> Any:
        """function(x) -> (values, Jacobian) equals `target`; pattern: the Jacobian's entries that can differ from 0.
        Returns the binding.
        """
        rows = DifferentiableConstraint(function)
        binding = self.drake.AddConstraint(rows, lb=target, ub=target, vars=unknowns)
        binding.evaluator().SetGradientSparsityPattern(pattern)
        self.functions[binding.evaluator()] = rows
        self._rows.append(rows)
        return binding

    def add_cost(self, function: Callable[[Array], tuple[float, Array]], unknowns: Any) -> None:
        """function(x) -> (value, gradient) is part of the objective."""
        cost = DifferentiableCost(function)
        self.functions[self.drake.AddCost(cost, vars=unknowns).evaluator()] = cost

    def keep_within(self, kind: str, low: Array, high: Array, unknowns: Any, slack: Array, rows: Any = None) -> None:
        """low <= rows @ unknowns <= high; as bounds where it can be, and softened by excess * slack if elastic."""
        if kind not in self.elastic:
            if rows is None:
                self.drake.AddBoundingBoxConstraint(low, high, unknowns)
            else:
                self.drake.AddConstraint(LinearConstraint(sp.csc_matrix(rows), low, high), unknowns)
            return
        rows = sp.eye_array(len(unknowns)) if rows is None else rows
        # A joint with a limit on one side only gives way by a radian per unit of excess.
        give = sp.csc_matrix(np.where(np.isfinite(slack), slack, POSITION_SCALE)[:, None])
        both = sp.csc_matrix(sp.vstack([sp.hstack([rows, -give]), sp.hstack([-sp.csc_matrix(rows), -give])]))
        above = np.concatenate([high, -low])
        used = np.flatnonzero(np.isfinite(above))
        free = np.full(len(used), -np.inf)
        everything = np.concatenate([unknowns, self["excess"]])
        self.drake.AddConstraint(LinearConstraint(both[used], free, above[used]), everything)

    def run(self, *, guess: Array | None = None, **options: Any) -> tuple[ipopt.Outcome, int]:
        """Solve from the unknowns' starts, or from `guess`: IPOPT's outcome and its iterations."""
        for function in self.functions.values():
            function.forget()
        outcome = ipopt.solve(self.drake, self.drake.initial_guess() if guess is None else guess, **options)
        # IPOPT linearises every row once per iteration: any of them can tell how many there were.
        return outcome, self._rows[0].iterations

    def residuals(self, outcome: ipopt.Outcome) -> tuple[float, float]:
        """Violation and optimality that IPOPT has left (`residuals.py`)."""
        return self._conditions.residuals(outcome.result)

    @cached_property
    def _conditions(self) -> Conditions:
        return Conditions(self.drake, self.functions)

    def read(self, outcome: ipopt.Outcome, unknowns: NDArray[Any]) -> Array:
        """The values of unknowns in an outcome, in their shape."""
        found: Array = outcome.x[self.drake.FindDecisionVariableIndices(unknowns.ravel())]
        return found.reshape(unknowns.shape)


class Program(Lifted):
    """The same by backward differences: one velocity w (N, n) for each interval, at the end of which energy counts."""

    guess: Guess

    def __init__(
        self, problem: Problem, times: Array, guess: Array, *, elastic: Collection[str] = (), keep_off: float = 0.0
    ) -> None:
        super().__init__(problem, times, guess, elastic=elastic, keep_off=keep_off)
        self.guess = Guess.of(problem, times, guess)
        sums = Sums(guess[1:], self.dt, self.guess.costs.tau[1:], self.dt)
        self.scaling = scale(problem, sums, self.guess.costs, self.forces)
        self.w = self.new("w", self.scaling.to_w(self.guess.qd[1:]))
        self.weights = self.dt

    def solve(self, **options: Any) -> tuple[Array, ipopt.Outcome, int]:
        """Solve from the guess: positions (N + 1, n) [rad], IPOPT's outcome, its iterations."""
        outcome, iterations = self.run(**options)
        return self.read(outcome, self.y) / POSITION_SCALE, outcome, iterations


def blocks(first: int, end: int, knots: int = KNOTS_PER_BINDING) -> list[Block]:
    """The numbers from `first` to before `end`, as many at a time as one binding serves."""
    return [np.arange(start, min(start + knots, end)) for start in range(first, end, knots)]
