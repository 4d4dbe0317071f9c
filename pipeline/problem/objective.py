"""What is minimised: a weighted sum of integrals, less what a secondary criterion gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.common.errors import InputError
from pipeline.problem.integrals import ByIntegral, of_order
from pipeline.problem.secondary import Secondary


@dataclass(frozen=True)
class Objective:
    """A sum of integrals by their names in the catalogue (`integrals.py`), `weights` in 1 over their units, as in
    Objective({"kinetic_energy": 0.3, "torque": 0.7}).

    What `secondary` gains is taken off (Pontryagin report eq. (13) with the sign that maximises it). Weights of zero
    are dropped. Raises InputError for an unknown name or a weight that is negative or not finite.
    """

    weights: Mapping[str, float] = field(default_factory=lambda: {"kinetic_energy": 1.0})
    secondary: Secondary | None = None

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not (weight >= 0 and np.isfinite(weight)):
                raise InputError(f"objective: the weight of {name} is {weight:g}; it must be finite and not negative")
        counted = ByIntegral({name: weight for name, weight in self.weights.items() if weight})
        object.__setattr__(self, "weights", counted)

    def weight(self, name: str) -> float:
        """Zero for integrals that do not count."""
        return self.weights.get(name, 0.0)

    @property
    def second_order(self) -> bool:
        """Whether accelerations count."""
        return bool(of_order(self.weights, 2))
