"""What an arm must keep clear of. Data alone: solver and evaluation measure distances from it each in their own way."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.robot.shapes import Shape


@dataclass(frozen=True)
class Obstacles:
    """Solids in the world, the least distance [m] that moving links must keep from them, and from how much farther on
    [m] they are felt by the solver. allowed: links and solids by name that may touch.
    """

    shapes: tuple[Shape, ...]
    margin: float
    influence: float = 0.05
    allowed: frozenset[tuple[str, str]] = frozenset()

    def keeps(self, link: str, shape: Shape) -> bool:
        """Whether a link has to be clear of a solid."""
        return (link, shape.name) not in self.allowed


@dataclass(frozen=True)
class Own:
    """Pairs of the arm's links that may not touch, the least distance [m] between them, from how much farther on [m]
    they are felt by the solver, and whether motions have to keep it: if not, it is reported all the same.

    always: pairs that were left out since no motion parts them or brings them nearer; allowed: how many were since they
    may touch.
    unknown: why nothing is known of any pair.
    """

    pairs: tuple[tuple[str, str], ...]
    margin: float
    influence: float = 0.05
    kept: bool = True
    always: tuple[tuple[str, str], ...] = ()
    allowed: int = 0
    unknown: str = ""
