"""The catalogue of the integrals that a motion is judged by: each can be minimised, bounded and traded for another.

Whoever computes one, weighs one or prints one finds its name, unit and kind here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from pipeline.common.errors import InputError

Order = Literal[1, 2]


@dataclass(frozen=True)
class Integral:
    """The integral of a rate over a motion; `label` with `unit` [] names an axis.

    order: 1 if positions and velocities give the rate (`lagrangian.py`), 2 if it is a sum of squared generalized forces
    (`costs.py`). base: what the arm must stand on for it not to vanish.
    """

    name: str
    unit: str
    label: str
    order: Order
    base: Literal["any", "floating", "held"] = "any"


INTEGRALS = {
    integral.name: integral
    for integral in (
        Integral("kinetic_energy", "J s", "Kinetic-energy integral", 1),
        Integral("torque", "N² m² s", "Squared-torque integral", 2),
        Integral("velocity_norm", "rad²/s", "Integral of the squared joint velocities", 1),
        Integral("base_rotation", "rad²/s", "Integral of the base's squared angular velocity", 1, "floating"),
        Integral("reaction_force", "N² s", "Integral of the squared force on the base", 2, "held"),
        Integral("reaction_torque", "N² m² s", "Integral of the squared torque on the base", 2, "held"),
    )
}


class ByIntegral(Mapping[str, float]):
    """Numbers by the names of integrals, in the catalogue's order; cannot be changed, can be hashed and pickled."""

    def __init__(self, values: Mapping[str, float]) -> None:
        for name in values:
            if name not in INTEGRALS:
                raise InputError(f"integral {name!r}: must be one of {', '.join(INTEGRALS)}")
        self._values = {name: float(values[name]) for name in INTEGRALS if name in values}

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(tuple(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


def of_order(values: Mapping[str, float], order: Order) -> dict[str, float]:
    """Those of `values` (by the names of integrals) whose integrals are of this order."""
    return {name: value for name, value in values.items() if INTEGRALS[name].order == order}
