"""What an arm must keep clear of. Data alone: solver and evaluation measure distances from it each in their own way."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.robot.shapes import Shape


@dataclass(frozen=True)
class Obstacles:
    """Solids in the world, the least distance [m] that moving links must keep from them, and from how much farther on
    [m] they are felt by the solver.
    """

    shapes: tuple[Shape, ...]
    margin: float
    influence: float = 0.05
