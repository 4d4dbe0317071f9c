"""Where must a path be cut? The fewest pieces that one motion each can follow, each with its optimum, and the transits.

A path of several tool paths is connected in their order, and each of them is cut where it must be. What one motion can
follow is found by `search/continuity.py`; the piece's optimum is the planner's, from any of the configurations where it
begins; between two pieces the arm rests and goes through joint space (`transit.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import interp1d

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import SegmentsOptions
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.planner import solve as plan
from pipeline.methods.global_planner.reasons import no_place
from pipeline.methods.method import Context, Method, Serves
from pipeline.methods.segments.transit import Transits
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.continuity import Components, components, fewest, motions, places_of
from pipeline.search.manifold import Manifold
from pipeline.search.widest import widest

WAYS = 16  # of a piece, from which its optimum is sought
MOST_TIMES = 4  # so many times the nodes that are asked for, where fewer leave cuts
STEADY = 1  # doublings after one another that leave no fewer cuts
LOOKED = 50  # intervals of a tool path on which it is seen how far beyond the joints' limits it leads
FEWEST = 20  # intervals of a piece, and of a tool path on which it is cut


@dataclass(frozen=True)
class Piece:
    """Along the path at places (P,) [m] the ways (K, P, n) that continuous motions can go, none where they have to move
    while the tool stands; q (n,): from where it can begin; between: [m] where the cut before it may be, None: another
    tool path begins there, or the motion.
    """

    places: Array
    ways: Array
    q: Array
    between: tuple[float, float] | None = None

    @property
    def start(self) -> float:
        return float(self.places[0])

    @property
    def end(self) -> float:
        return float(self.places[-1])


@dataclass(frozen=True)
class _Known:
    """The ways of a piece as motions on any knots, those that follow the path there."""

    part: Problem
    piece: Piece

    def __call__(self, knots: Array) -> Array:
        reference, manifold = self.part.reference, Manifold(self.part)
        s = self.piece.start + reference.timing.sample(knots, reference.geometry.length)[0]
        found, arrived = manifold.along(
            knots, interp1d(self.piece.places, self.piece.ways, axis=1)(np.clip(s, *self.piece.places[[0, -1]]))
        )
        return np.asarray(found[arrived])


def solve(problem: Problem, options: SegmentsOptions, context: Context) -> list[Solution]:
    """The pieces in their order, each with its optimum and the transit to it."""
    rng, length = np.random.default_rng(context.seed), problem.reference.geometry.length
    pieces: list[Piece] = []
    widths: list[float | None] = []
    for first, last in pairwise((0.0, *problem.reference.breaks, length)):
        context.phase("seeking where the path must be cut")
        tool_path = _part(problem, first, last, len(pieces) == 0, problem.q_init)
        count = max(FEWEST, round(options.intervals * (last - first) / length))
        found, cuts = _cut(tool_path, count, options, rng)
        if cuts != [] and problem.obstacles is not None and np.isfinite(found.spacing):
            context.phase("seeking with how much clearance it could be followed")
            widths.append(widest(tool_path, count, options.nodes, rng))
        if cuts is None:
            return [_nothing(tool_path, found, first, _width(widths[-1:]))]
        pieces += _pieces(found, cuts, first, Manifold(tool_path))
    words = _words(problem, pieces, found, widths)
    solutions: list[Solution] = []
    transits = Transits(problem, rng)
    for number, piece in enumerate(pieces):
        context.phase(f"piece {number + 1} of {len(pieces)}")
        part = _part(problem, piece.start, piece.end, number == 0, piece.q)
        known = _Known(part, piece) if len(piece.ways) else None
        best = plan(part, replace(options.planner, coarse_steps=len(piece.places) - 1), context, known)[0]
        best = replace(best, method="segments", optimum=number + 1, reference=part.reference)
        best = replace(best, stretch=(piece.start, piece.end), evidence=words * (number == 0) + best.evidence)
        solutions.append(_after(solutions, best, transits) if solutions else best)
    return solutions


def refuses(problem: Problem, options: SegmentsOptions) -> str | None:
    """The law must be one that a part of the path can be run through under; and what the planner refuses."""
    if problem.task.redundancy < 1:
        return f"the redundancy degree is {problem.task.redundancy}; it needs one of at least 1"
    try:
        problem.reference.part(0.0, problem.reference.geometry.length)
    except InputError as error:
        return str(error)
    return global_planner.refuses(problem, options.planner)


segments = Method(
    "segments",
    "Pieces",
    "#97266D",
    SegmentsOptions,
    Serves(boundaries=frozenset({Boundary.FIXED, Boundary.FREE}), moving_base=False, breaks=True),
    solve,
    refuses,
)


def _cut(
    problem: Problem, count: int, options: SegmentsOptions, rng: np.random.Generator
) -> tuple[Components, list[tuple[int, int]] | None]:
    """The cuts of one tool path, at twice as many places with twice as many nodes and again while that leaves fewer."""
    found = components(problem, count, options.nodes, rng)
    cuts = fewest(found)
    nodes, kept = options.nodes, 0
    while cuts != [] and nodes < MOST_TIMES * options.nodes and kept < STEADY:
        nodes, count = 2 * nodes, 2 * count
        finer = components(problem, count, nodes, rng)
        again = fewest(finer)
        fewer = again is not None and (cuts is None or len(again) < len(cuts))
        kept = 0 if fewer else kept + 1
        if fewer:
            found, cuts = finer, again
    return found, cuts


def _part(problem: Problem, start: float, end: float, first: bool, q: Array) -> Problem:
    """The problem of one part of the path; only the first may begin at a given configuration."""
    reference = problem.reference.part(start, end)
    count = max(FEWEST, round((len(problem.times) - 1) * (end - start) / problem.reference.geometry.length))
    boundary = problem.boundary if first else Boundary.FREE
    times = np.linspace(0.0, reference.duration, count + 1)
    return replace(problem, reference=reference, times=times, boundary=boundary, q_init=q)


def _pieces(found: Components, cuts: list[tuple[int, int]], offset: float, manifold: Manifold) -> list[Piece]:
    ends = [0, *places_of(found, cuts), len(found.places) - 1]
    places, ranges = found.places + offset, [None, *((found.places[a], found.places[b]) for a, b in cuts)]
    pieces = []
    for (a, b), between in zip(pairwise(ends), ranges, strict=True):
        ways = motions(found, a, b, manifold, WAYS)
        begin = ways[0, 0] if len(ways) else found.nodes[a][0]
        cut = None if between is None else (float(between[0] + offset), float(between[1] + offset))
        pieces.append(Piece(places[a : b + 1], ways, np.asarray(begin), cut))
    return pieces


def _after(before: list[Solution], own: Solution, transits: Transits) -> Solution:
    """A piece with the transit to it from the one before, in whose turn its joints are."""
    last = before[-1]
    if not (last.found and own.found):
        return own
    end, q = last.trajectory.q[-1], own.trajectory.q
    q = q + (transits.manifold.wrap(q[0] - end) - (q[0] - end))
    own = replace(own, trajectory=replace(own.trajectory, q=q))
    approach = transits(end, q[0])
    if approach is None:
        said = f"no transit to it from piece {own.optimum - 1} was found"
        return replace(own, status=Status.NOT_CONVERGED, message="; ".join(filter(None, [said, own.message])))
    return replace(own, approach=approach)


def _words(problem: Problem, pieces: list[Piece], found: Components, widths: list[float | None]) -> str:
    """Into how many pieces, where, how well that is known, and what clearance would leave it whole."""
    proven = np.isfinite(found.spacing)
    known = (
        f"by all loops of the self-motion manifold at {len(found.places)} places, nodes {found.spacing:.2g} rad apart"
        if proven
        else "as far as samples show"
    )
    where = [f"{a:.4g} to {b:.4g} m" for a, b in (piece.between for piece in pieces if piece.between)]
    tool_paths = len(problem.reference.breaks) + 1
    if not where:
        each = "each tool path" if tool_paths > 1 else "the whole path"
        return f"a continuous motion can follow {each}; "
    return (
        f"no continuous motion follows the path: {len(pieces)} pieces at least, cut between {', '.join(where)} along "
        f"it ({known}); {_width(widths)}"
    )


def _width(widths: list[float | None]) -> str:
    """What clearance would leave every tool path whole."""
    if not widths:
        return ""
    if (least := min((-np.inf if width is None else width) for width in widths)) == -np.inf:
        return "nor does one without the obstacles; "
    if least < 0:
        return f"all ways that lead on go {-least:.3g} m or more into the obstacles; "
    return f"by that grid one would at obstacles.margin = {least:.4g} m; "


def _nothing(problem: Problem, found: Components, offset: float, width: str) -> Solution:
    empty = [place for place, q in zip(found.places, found.nodes, strict=True) if not len(q)]
    message = (
        f"at {offset + empty[0]:.4g} m along the path no configuration found is within the limits and clear"
        if empty
        else "from some place of the path no configuration found leads on"
    )
    barred = no_place(problem, np.linspace(0.0, problem.reference.duration, LOOKED + 1)) if empty else ""
    message = "; ".join(filter(None, [message, barred, width.removesuffix("; ")]))
    standing = Trajectory(problem.times, np.tile(problem.q_init, (len(problem.times), 1)))
    return Solution("segments", standing, Status.INFEASIBLE, message, found=False)
