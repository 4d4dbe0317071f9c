"""A part of a curve, or of the orientations along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.path.spline import Sampled


@dataclass(frozen=True)
class Part:
    """What `whole` is from the arc length `start` to `end` [m], by its own arc length from 0 on. Where the whole jumps
    at `end`, the part ends before the jump.
    """

    whole: Sampled
    start: float
    end: float

    @property
    def length(self) -> float:
        return self.end - self.start

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        return self.whole.sample(np.clip(self.start + s, self.start, np.nextafter(self.end, self.start)))
