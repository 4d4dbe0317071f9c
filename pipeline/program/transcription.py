"""Problem -> lifted MathematicalProgram, and back to joint positions.

Every quantity that is penalised or limited is an unknown of its own, tied to the others by equality constraints:

    y_i = POSITION_SCALE q_i                                          at all knots,
    w_i = S_i qd_i,     qd_i = (q_i - q_(i-1)) / dt_i                 for every interval (linear),
    u_i = s_i tau_i,    tau_i = M(q_i) qdd_i + n(q_i, qd_i)           of those forces and torques that count,

with backward differences throughout: qdd_i = (qd_i - qd_(i-1)) / dt_i (PMKE paper eq. (4), Global paper eqs (3)-(6));
`scaling.py` chooses S_i and s_i. Each term below adds its unknowns with their start, its rows, bounds and costs, and
returns at once where it does not apply. It comes after the terms whose unknowns it takes by name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from weakref import proxy

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.program.program import Program
from pipeline.program.terms import base, clearance, ends, energy, integrals, limits, torque, tracking

Term = Callable[[Program], None]


TERMS: tuple[Term, ...] = (
    ends.link,
    ends.bound,
    tracking.follow,
    base.close,
    torque.lift,
    base.momentum,
    limits.give_way,
    limits.positions,
    limits.joints,
    base.attitude,
    energy.quadratic,
    energy.secondary,
    clearance.keep,
    integrals.bound,
)


def transcribe(
    problem: Problem, times: Array, guess: Array, *, elastic: Collection[str] = (), keep_off: float = 0.0
) -> Program:
    """The program of `problem` on the knots `times` (N + 1,), scaled for a solve that starts at `guess` (N + 1, n).

    elastic: kinds of limits (position, velocity, torque, power, clearance, attitude) that may all be exceeded by the
    same fraction; that fraction is then what is minimised. keep_off: [m] by how much more than the margin obstacles are
    kept off.
    """
    program = Program(problem, times, guess, elastic=elastic, keep_off=keep_off)
    for term in TERMS:
        term(proxy(program))  # what a term gives to Drake must not keep us alive: Python sees no circle through Drake
    return program
