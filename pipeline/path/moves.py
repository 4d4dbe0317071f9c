"""A path of straight and round pieces, exact, with corners that are rounded or stopped at.

A corner is rounded as a polygon's (`blend.py`), by a quintic that leaves one piece and meets the next with their own
tangents and curvatures; so is a change of curvature where the direction goes on, which no joint could follow at speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BPoly
from scipy.optimize import brentq

from pipeline.common.arrays import Array
from pipeline.path.blend import STRAIGHT, G
from pipeline.path.curves import Arc, Geometry, Line
from pipeline.path.spline import ByLength, Chain
from pipeline.path.through import BACK, Through

BENT = 1e-9  # [1/m]: curvatures that differ by less are the same
TURNS = 0.5  # [rad] of an arc that a rounded corner may take
FINE = 65  # samples of a rounded corner


@dataclass(frozen=True)
class Part:
    """Of a curve what lies between two of its arc lengths [m]."""

    whole: Geometry
    first: float
    last: float

    @property
    def length(self) -> float:
        return self.last - self.first

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        return self.whole.sample(s + self.first)


def joined(pieces: Sequence[Line | Arc], blend: float | None) -> Through:
    """The path along pieces each of which begins where the one before ends; blend [m]: at most how far it leaves a
    corner, None: it stops at each. It also stops where it turns back. Marks are the ends of the pieces.
    """
    rounds = [None if blend is None else _round(before, after, blend) for before, after in pairwise(pieces)]
    stops, parts, ends, marks = list[int](), list[Geometry](), [0.0], [0.0]
    left, farthest, closer = 0.0, (0.0, 0), list[int]()
    for i, piece in enumerate(pieces):
        corner = rounds[i] if i < len(rounds) else None
        cut = corner.cut if corner else 0.0
        part = Part(piece, left, piece.length - cut)
        if part.length > 0:
            parts.append(part)
            ends.append(ends[-1] + part.length)
        left = cut
        if i == len(pieces) - 1:
            marks.append(ends[-1])
        elif corner is None or corner.curve is None:
            marks.append(ends[-1])
            if corner is None:
                stops.append(i + 1)
        else:
            marks.append(ends[-1] + float(corner.curve.marks[0]))
            parts.append(corner.curve)
            ends.append(ends[-1] + corner.curve.length)
            farthest = max(farthest, (_off(corner.curve, pieces[i], pieces[i + 1], cut), i + 1))
            closer += [i + 1] if corner.closer else []
    geometry: Geometry = Chain(parts, np.array(ends)) if len(parts) > 1 else parts[0]
    return Through(geometry, None, np.array(marks), tuple(stops), farthest, tuple(closer))


@dataclass(frozen=True)
class Corner:
    """How two pieces are joined: cut [m] off either, and the curve between; None: they go on by themselves."""

    cut: float = 0.0
    curve: ByLength | None = None
    closer: bool = False


def _round(before: Line | Arc, after: Line | Arc, blend: float) -> Corner | None:
    """None: the path turns back, and stops."""
    (corner,), (way,), (bend,) = before.sample(np.array([before.length]))
    _, (onward,), (further,) = after.sample(np.zeros(1))
    if way @ onward < np.cos(BACK):
        return None
    turn = float(np.arctan2(np.linalg.norm(onward - way), np.linalg.norm(onward + way))) * 2
    if turn < STRAIGHT and np.linalg.norm(further - bend) < BENT:
        return Corner()
    room = min(_room(before, bend), _room(after, further))

    def beyond(cut: float) -> float:
        curve, width = _between(before, after, cut, turn)
        return float(np.linalg.norm(curve(width / 2) - corner)) - blend

    short = beyond(room) <= 0
    cut = room if short else float(brentq(beyond, 1e-6 * room, room, xtol=1e-12))
    curve, width = _between(before, after, cut, turn)
    made = ByLength(curve, np.array([width / 2]), np.array([0.0, width]))
    return Corner(cut, made, short and turn >= STRAIGHT)


def _room(piece: Line | Arc, bend: Array) -> float:
    """How much of a piece a corner may take: half, and of a round one no more than it can follow."""
    return min(piece.length / 2, TURNS / max(float(np.linalg.norm(bend)), 1e-300))


def _between(before: Line | Arc, after: Line | Arc, cut: float, turn: float) -> tuple[BPoly, float]:
    """The quintic over so much of the parameter, whose speed is one at both ends."""
    first = [values[0] for values in before.sample(np.array([before.length - cut]))]
    last = [values[0] for values in after.sample(np.array([cut]))]
    width = (5 * G if turn >= STRAIGHT else 2.0) * cut
    return BPoly.from_derivatives([0.0, width], [first, last]), width


def _off(curve: ByLength, before: Line | Arc, after: Line | Arc, cut: float) -> float:
    """How far [m] a rounded corner is from the pieces that it cuts, at most."""
    share = np.linspace(0.0, 1.0, 4 * FINE)
    old = np.vstack([before.sample(before.length - cut * (1 - share))[0], after.sample(cut * share)[0]])
    points = curve.sample(np.linspace(0.0, curve.length, FINE))[0]
    start, chord = old[:-1], np.diff(old, axis=0)
    along = np.einsum("pkm,km->pk", points[:, None] - start, chord) / np.maximum((chord**2).sum(axis=1), 1e-300)
    nearest = start + np.clip(along, 0.0, 1.0)[:, :, None] * chord
    return float(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max())
