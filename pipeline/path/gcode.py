"""Moves from a file of G-code (ISO 6983, RS-274): G0 to G3 with their feeds. What a file holds is used or refused.

    G0 G1 G2 G3           a rapid, a straight move, an arc or helix clockwise, counter-clockwise; modal, as all of these
    G17 G18 G19           the arcs' plane: xy, zx, yz; I, J, K from the start of the arc to its centre, or R
    G20 G21, G90 G91      inches or mm; places in the file's own frame or from where the tool is
    F                     feed in inches or mm per minute
    G40 G49 G54 G80 G94 G91.1   say what holds here anyway
    M2 M30                the end; M3 M4 M5 M7 M8 M9 and S, of spindle and coolant, move no arm and are named

Rapids before the first other move lead to where the path begins; without any it begins at the file's zero. Comments in
(), after ; and lines of % are skipped, N and O number lines and programs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as File

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.path.curves import Arc, Line

SUFFIXES = (".nc", ".gcode", ".tap")
WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
UNITS = {20: 0.0254, 21: 1e-3}  # [m]
PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}  # first, second and normal axis
GROUPS = ({0, 1, 2, 3}, {17, 18, 19}, {20, 21}, {90, 91})
HELD = {40, 49, 54, 80, 94, 91.1}
ENDS, ASIDE = {2, 30}, {3, 4, 5, 7, 8, 9}
LETTERS = "XYZIJKRFGMSNO"
CENTRES = "IJK"
MOST = 20_000  # moves: each is a piece of the path
ROUNDED = (1e-5, 1e-3)  # [m], and of the radius: by how much the ends of an arc may differ in theirs
SAME = 1e-12  # [m]


@dataclass(frozen=True)
class Move:
    """One straight or round move in x, y, z [m]; feed [m/s], or None where the file has said none so far."""

    piece: Line | Arc
    rapid: bool
    feed: float | None
    line: int


@dataclass
class Reader:
    """What holds at a line of the file. left_out: words that move no arm."""

    file: str
    number: int = 0
    unit: float = 1e-3
    motion: int | None = None
    plane: tuple[int, int, int] = PLANES[17]
    relative: bool = False
    feed: float | None = None
    place: Array = field(default_factory=lambda: np.zeros(3))
    ended: str = ""
    moves: list[Move] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def fail(self, what: str) -> PathError:
        return PathError(f"path.file = {self.file}: line {self.number}: {what}")

    def take(self, text: str) -> None:
        """One line of the file."""
        self.number += 1
        words = self._words(text)
        if not words:
            return
        if self.ended:
            raise self.fail(f"comes after the program's end ({self.ended})")
        own = {letter: value for letter, value in words if letter not in "GM"}
        self._modes([value for letter, value in words if letter == "G"])
        if "F" in own:
            if not own["F"] > 0:
                raise self.fail(f"F{own['F']:g}: a feed is more than zero")
            self.feed = own["F"] * self.unit / 60
        if set(own) & set("XYZIJKR"):
            self._move(own)
        for value in (value for letter, value in words if letter == "M"):
            if value in ENDS:
                self.ended = f"M{value:g}, line {self.number}"
            elif value in ASIDE:
                self.left_out.append(f"M{value:g}")
            else:
                raise self.fail(f"M{value:g} not understood; of M words there may be {_listed('M', ENDS | ASIDE)}")
        self.left_out += [f"S{own['S']:g}"] if "S" in own else []

    def _words(self, text: str) -> list[tuple[str, float]]:
        plain = re.sub(r"\([^()]*\)", "", text).partition(";")[0]
        plain = "".join(plain.split()).upper()
        if plain in ("", "%"):
            return []
        found = WORD.findall(plain)
        if "".join(letter + value for letter, value in found) != plain:
            raise self.fail(f"{text.strip()[:60]!r} not understood: words are a letter and a number")
        words = [(letter, float(value)) for letter, value in found]
        unknown = next((f"{letter}{value:g}" for letter, value in words if letter not in LETTERS), None)
        if unknown:
            raise self.fail(f"{unknown} not understood; words may begin with {', '.join(LETTERS)}")
        letters = [letter for letter, _ in words if letter not in "GM"]
        twice = next((letter for letter in letters if letters.count(letter) > 1), None)
        if twice:
            raise self.fail(f"{twice} stands twice")
        return words

    def _modes(self, codes: Sequence[float]) -> None:
        for code in codes:
            if code not in HELD and not any(code in group for group in GROUPS):
                known = _listed("G", {*HELD, *(one for group in GROUPS for one in group)})
                raise self.fail(f"G{code:g} not understood; of G words there may be {known}")
        for group in GROUPS:
            if sum(code in group for code in codes) > 1:
                raise self.fail(f"{_listed('G', group & set(codes))} contradict each other")
        for code in codes:
            self.motion = int(code) if code in GROUPS[0] else self.motion
            self.plane = PLANES.get(code, self.plane)  # type: ignore[call-overload]
            self.unit = UNITS.get(code, self.unit)  # type: ignore[call-overload]
            self.relative = code == 91 if code in GROUPS[3] else self.relative

    def _move(self, own: dict[str, float]) -> None:
        if self.motion is None:
            raise self.fail("a place, and no G0, G1, G2 or G3 so far")
        start, end = self.place, self.place.copy()
        for axis, letter in enumerate("XYZ"):
            if letter in own:
                end[axis] = own[letter] * self.unit + (start[axis] if self.relative else 0.0)
        round_words = [letter for letter in "IJKR" if letter in own]
        if self.motion < 2 and round_words:
            raise self.fail(f"{round_words[0]} belongs to G2 and G3, and G{self.motion} holds")
        rapid, self.place = self.motion == 0, end
        if rapid and not self.moves:
            return
        if self.motion >= 2:
            piece: Line | Arc = self._arc(start, end, own, round_words)
        elif (length := float(np.linalg.norm(end - start))) > SAME:
            piece = Line(start, (end - start) / length, length)
        else:
            return
        if len(self.moves) >= MOST:
            raise self.fail(f"more than {MOST:,} moves")
        self.moves.append(Move(piece, rapid, self.feed, self.number))

    def _arc(self, start: Array, end: Array, own: dict[str, float], round_words: Sequence[str]) -> Arc:
        first, second, normal = self.plane
        turns = 1.0 if self.motion == 3 else -1.0  # counter-clockwise about the normal, or clockwise
        a, b = start[[first, second]], end[[first, second]]
        across = CENTRES[normal]
        if across in own:
            raise self.fail(f"{across} is across the plane of the arc")
        if not round_words or ("R" in own and len(round_words) > 1):
            raise self.fail("an arc needs R, or the distance to its centre by I, J, K")
        center = self._by_radius(a, b, own["R"] * self.unit, turns) if "R" in own else self._by_center(a, b, own)
        outward = a - center
        radius = float(np.linalg.norm(outward))
        angles = [np.arctan2(*(point - center)[::-1]) for point in (a, b)]
        sweep = float((turns * (angles[1] - angles[0])) % (2 * np.pi))
        if np.linalg.norm(b - a) <= SAME:
            sweep = 2 * np.pi
        to_center, heading, rise = np.zeros((3, 3))
        to_center[[first, second]] = -outward / radius
        heading[[first, second]] = turns * np.array([-outward[1], outward[0]]) / radius
        rise[normal] = end[normal] - start[normal]
        return Arc(start, to_center, heading, radius, sweep, rise)

    def _by_center(self, a: Array, b: Array, own: dict[str, float]) -> Array:
        """Moved so that it is as far from both ends: they are rounded in a file."""
        offset = np.array([own.get(CENTRES[axis], 0.0) * self.unit for axis in self.plane[:2]])
        center, chord = a + offset, b - a
        radii = [float(np.linalg.norm(point - center)) for point in (a, b)]
        if not radii[0] > SAME:
            raise self.fail("the centre of the arc is its start")
        if abs(radii[1] - radii[0]) > ROUNDED[0] + ROUNDED[1] * radii[0]:
            raise self.fail(
                f"the arc begins {radii[0] / self.unit:g} and ends {radii[1] / self.unit:g} from its centre"
            )
        size = float(chord @ chord)
        return center if size <= SAME**2 else center - chord * ((center - (a + b) / 2) @ chord) / size

    def _by_radius(self, a: Array, b: Array, radius: float, turns: float) -> Array:
        """The shorter way round, or the longer one where R is negative."""
        chord = b - a
        half = float(np.linalg.norm(chord)) / 2
        if half <= SAME / 2:
            raise self.fail("R leaves open which circle: the arc ends where it begins; give I, J, K")
        if half > abs(radius) + ROUNDED[0]:
            raise self.fail(f"no arc of radius {abs(radius) / self.unit:g} joins points {2 * half / self.unit:g} apart")
        left = np.array([-chord[1], chord[0]]) / (2 * half)
        height = np.sqrt(max(radius**2 - half**2, 0.0))
        return (a + b) / 2 + left * height * turns * np.copysign(1.0, radius)


def read(file: str | File, axes: Sequence[str]) -> tuple[tuple[Move, ...], tuple[str, ...]]:
    """The moves in the coordinates `axes` [m], and words that move no arm. Raises PathError, one line, with the line of
    the file, for anything else that it holds.
    """
    reader = Reader(str(file))
    try:
        text = File(file).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise PathError(f"path.file = {file}: {getattr(error, 'strerror', None) or 'not UTF-8 text'}") from None
    for line in text.splitlines():
        reader.take(line)
    if not reader.moves:
        raise PathError(f"path.file = {file}: no move by G1, G2 or G3")
    own = ["xyz".index(axis) for axis in axes]
    return tuple(_in_axes(reader, move, own) for move in reader.moves), tuple(dict.fromkeys(reader.left_out))


def _in_axes(reader: Reader, move: Move, own: list[int]) -> Move:
    """The same move in the coordinates of the task; those that it does not prescribe must stand still."""
    x = move.piece.sample(np.linspace(0.0, move.piece.length, 9))[0]
    for axis in set(range(3)) - set(own):
        if np.ptp(x[:, axis]) > SAME:
            reader.number = move.line
            raise reader.fail(f"moves along {'xyz'[axis]}, which robot.task leaves out")
    piece = move.piece
    if isinstance(piece, Line):
        return replace(move, piece=Line(piece.start[own], piece.direction[own], piece.length))
    ways = (piece.to_center[own], piece.heading[own])
    return replace(move, piece=Arc(piece.start[own], *ways, piece.radius, piece.angle, np.asarray(piece.rise)[own]))


def _listed(letter: str, codes: set[float] | set[int]) -> str:
    return " ".join(f"{letter}{code:g}" for code in sorted(codes))
