"""A spline program in the making: its unknowns with their starts and sizes (`transcription.py` says what they mean)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.path.timing import Found
from pipeline.problem.lagrangian import trapezoid_weights
from pipeline.problem.problem import Boundary, Problem
from pipeline.program import ipopt
from pipeline.program.program import Lifted
from pipeline.program.scaling import POSITION_SCALE, Prices, Sums, scale
from pipeline.program.spline.curve import Curve, integrals, stations

SMALL = 3e-4  # of velocities and accelerations among the unknowns, relative to the guess's, with the kinetic energy


SMALL_WITH_TORQUE = 3e-3


# Of IPOPT where w is there and no torque: nearly all rows are short and linear, so that small pivots fill in least, and
# the Hessian is nearly the identity, so that a short memory, of which every solve pays twice the length, does as well.
EASY = {"spral_nemin": 1, "limited_memory_max_history": 4}


# Of IPOPT where the shortest motion was lost: a barrier that may rise lets the time run off to many times itself.
STEADY = {"mu_strategy": "monotone", "mu_init": 1e-4}


# Of IPOPT in a tube: most knots touch its wall. A barrier that only falls does not send them to and fro, and one that
# falls to 1e-11 leaves rounding errors of 1e-6 in the optimality for hundreds of iterations.
TUBE = {**STEADY, "mu_min": 1e-9, "acceptable_iter": 5}


@dataclass(frozen=True)
class Tightened:
    """What of the limits holds at the knots so that they hold between them: factors of torque, power (N + 1, n), of the
    tolerances of the path and the pace of the tool (N + 1, 1); keep_off [m] is by how much more than the margin
    obstacles are kept off.
    """

    torque: Array
    power: Array
    tolerance: Array
    orientation_tolerance: Array
    tool_speed: Array
    tool_acceleration: Array
    keep_off: float = 0.0

    @classmethod
    def none(cls, problem: Problem, times: Array) -> Tightened:
        whole, one = np.ones((len(times), problem.task.arm.n)), np.ones((len(times), 1))
        return cls(whole, whole, one, one, one, one)


@dataclass(frozen=True)
class Law:
    """The law of the path as unknowns at the knots: s, sd, sdd (N + 1, 1); what a meter (per second ...) is there."""

    s: NDArray[Any]
    sd: NDArray[Any]
    sdd: NDArray[Any]
    units: tuple[float, ...]

    @property
    def s_unit(self) -> float:
        return self.units[0]


@dataclass(frozen=True)
class Solved:
    """A spline as IPOPT leaves it; iterations; program: the solved one; stretch: what its times are to be multiplied
    with; law: that of the path, where it was free.
    """

    curve: Curve
    outcome: ipopt.Outcome
    iterations: int
    program: Spline
    stretch: float = 1.0
    law: Found | None = None

    def timed(self, problem: Problem) -> Problem:
        """The problem with the law that was found, if it was free."""
        if self.law is None:
            return problem
        return replace(problem, reference=replace(problem.reference, timing=self.law))

    def residuals(self) -> tuple[float, float]:
        """Violation and optimality that IPOPT has left, see `residuals.py`."""
        return self.program.residuals(self.outcome)


class Spline(Lifted):
    """The unknowns, scaled for a solve that starts at `guess`."""

    def __init__(
        self,
        problem: Problem,
        guess: Curve,
        tightened: Tightened,
        *,
        stretch: float | None = None,
        prices: Prices | None = None,
    ) -> None:
        super().__init__(problem, guess.times, guess.q, keep_off=tightened.keep_off)
        self.guess, self.tightened, self.prices = guess, tightened, prices
        self.tube = np.hstack([tightened.tolerance, tightened.orientation_tolerance])
        place, velocity, self.weights = stations(problem, guess)
        costs = integrals(problem, guess if stretch is None else guess.stretched(stretch))
        sums = Sums(place, self.weights, costs.tau, trapezoid_weights(guess.times))
        self.scaling = scale(problem, sums, costs, self.forces)
        small = SMALL_WITH_TORQUE if self.forces else SMALL
        self.v_unit, self.a_unit = small / _size(guess.v), small / _size(guess.a)
        self.v, self.a = self.new("v", self.v_unit * guess.v), self.new("a", self.a_unit * guess.a)
        self.counts = self.lagrangian.is_quadratic and stretch is None
        if self.counts:
            self.w = self.new("w", self.scaling.to_w(velocity))
        if self.forces:
            self.new("forces", self.scaling.force * costs.tau[:, self.forces.rows])
        self.law = self._law(small) if problem.free_law else None
        # r, r^2, r^3
        self.stretch = None if stretch is None else self.new("stretch", stretch ** np.array([1.0, 2.0, 3.0]))
        if problem.zero_acceleration and problem.reference.exact:
            # Ends at rest without acceleration give the path's rows there all that they can be given.
            self.left_out = tuple(
                knot for knot, rests in zip((1, self.intervals - 1), problem.rest, strict=True) if rests
            )

    def _law(self, small: float) -> Law:
        reference = self.problem.reference
        values = [
            value[:, None] for value in reference.timing.sample(self.times - self.times[0], reference.geometry.length)
        ]
        units = [POSITION_SCALE / reference.geometry.length, *(small / _size(value) for value in values[1:])]
        made = [
            self.new(name, unit * value) for name, unit, value in zip(("s", "sd", "sdd"), units, values, strict=True)
        ]
        return Law(made[0], made[1], made[2], tuple(units))

    def unit(self, own: NDArray[Any]) -> float:
        """What one radian or meter (per second ...) is among these unknowns."""
        units = {id(self.v): self.v_unit, id(self.a): self.a_unit}
        if self.law is not None:
            units |= dict(zip(map(id, (self.law.s, self.law.sd, self.law.sdd)), self.law.units, strict=True))
        return units.get(id(own), POSITION_SCALE)

    def _solver(self) -> dict[str, Any]:
        if not self.problem.reference.exact:
            return TUBE
        return EASY if self.counts and not self.forces else {}

    def solve(self, **options: Any) -> Solved:
        """Solve from the guess."""
        outcome, iterations = self.run(extra=self._solver(), **options)
        if self.stretch is not None and not outcome.converged:
            outcome, iterations = self.run(extra=STEADY, **options)
        q, v, a = (self.read(outcome, unknowns) for unknowns in (self.y, self.v, self.a))
        curve = Curve(self.times, q / POSITION_SCALE, v / self.v_unit, a / self.a_unit)
        stretch = 1.0 if self.stretch is None else float(self.read(outcome, self.stretch)[0])
        law = None
        if self.law is not None:
            s = self.read(outcome, self.law.s)[:, 0] / self.law.s_unit
            law = Found(tuple((self.times - self.times[0]).tolist()), tuple((s / s[-1]).tolist()))
        return Solved(curve, outcome, iterations, self, stretch, law)


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) or 1.0


def why_not(problem: Problem) -> str | None:
    """What a spline program does not serve, for a message; None: it serves the problem whole."""
    arm = problem.task.arm
    if arm.base.count:
        return f"the base is {arm.base.kind}"
    if problem.bounds_of_integrals:
        return "integrals are bounded"
    if problem.qd_init is not None and problem.boundary is Boundary.FIXED:
        return "the first velocity is given"
    return None
