"""Problem -> a program whose solution is the exported curve: positions, velocities, accelerations of a C2 cubic spline.

Unknowns, at all knots and each divided by its size:

    q_i, v_i, a_i          of the spline: within an interval of length h the acceleration is linear,
    u_i = s_i tau_i        of those forces that count: tau_i = M(q_i) a_i + n(q_i, v_i),
    w = S qd               at the stations of the energy: midway between the knots (`curve.py` says where else).

Path rows at the knots, squared torques by the trapezoidal rule over them. Limits of acceleration and jerk hold between
the knots too, since the one is linear there and the other constant; those of velocity and position hold for the Bezier
points of each interval, which surround it. Torque, power and clearance hold at the knots: see `tighten.py`.

With `stretch` the motion time is an unknown as well, and what is minimised: the law of the path is kept, and all
that is written here is of the time as the problem has it. Where the law is free, its s_i, sd_i, sdd_i are unknowns
too (`law.py`). A motion stretched by r has velocities v / r, accelerations
a / r^2 and jerks j / r^3.
`stretch` is the r that the guess begins with.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.problem.problem import Problem
from pipeline.program.scaling import Prices
from pipeline.program.spline import energy, law, rows, tool, torque
from pipeline.program.spline.curve import Curve
from pipeline.program.spline.program import Spline, Tightened
from pipeline.program.terms import clearance, ends
from pipeline.program.terms.energy import secondary

Term = Callable[[Spline], None]

COMMON: tuple[Term, ...] = (
    rows.link,
    ends.bound,
    rows.rest,
    rows.enter,
    law.advance,
    law.follow,
    torque.lift,
    rows.limits,
    torque.limits,
    tool.limits,
    clearance.keep,
)

CHEAPEST: tuple[Term, ...] = (*COMMON, energy.velocities, torque.squares, energy.quadratic, secondary)

SHORTEST: tuple[Term, ...] = (rows.shorten, *COMMON)


def transcribe(
    problem: Problem,
    guess: Curve,
    tightened: Tightened | None = None,
    *,
    stretch: float = 0.0,
    prices: Prices | None = None,
) -> Spline:
    """The program of `problem` on the knots of `guess`, scaled for a solve that starts there; stretch: see above.
    prices: of a path that need not be kept exactly.
    """
    tightened = Tightened.none(problem, guess.times) if tightened is None else tightened
    program = Spline(problem, guess, tightened, stretch=stretch or None, prices=prices)
    for term in SHORTEST if stretch else CHEAPEST:
        term(program)
    return program
