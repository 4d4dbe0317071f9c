"""What a run asks about its motions beside solving: export, closed loop, candidate study, identification."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.config.fields import choice, choices, count, mapping, number, switch, table_of_numbers, text
from pipeline.config.methods import METHODS


@dataclass(frozen=True)
class CandidateStudyConfig:
    """The Global paper's Fig. 1: how near the best of so many candidates comes to the optimum."""

    run: bool = switch(False)
    most: int = count(10000, low=100)
    repeats: int = count(5)


@dataclass(frozen=True)
class ExportConfig:
    """The motion that is written for a controller: `best`, the cheapest confirmed one, `none`, or that of one method."""

    method: str = choice("best", "best", "none", *METHODS)
    rate: float = number(100.0, above=0, high=10_000, unit="Hz")


@dataclass(frozen=True)
class IdentificationConfig:
    """The masses of the links from the numbers that documents print (see experiment identify_masses)."""

    run: bool = switch(False)
    documents: list[str] = choices(["pmke", "global"], "pmke", "global")
    confidence: float = number(0.95, above=0, high=0.999)


@dataclass(frozen=True)
class ClosedLoopConfig:
    """Drake's Simulator follows the exported motion with a torque-limited inverse-dynamics controller."""

    run: bool = switch(False)
    bandwidth: float = number(20.0, above=0, unit="rad/s")
    damping: float = number(1.0, above=0)
    sampling: float = number(1000.0, above=0, high=100_000, unit="Hz")
    mass_error: float = number(0.0, above=-1)
    initial_error: float = number(0.0, unit="rad")


@dataclass(frozen=True)
class PublishedConfig:
    """Printed numbers that a run is compared against: data for the tables, never used in solving."""

    document: str = text("")
    note: str = text("")
    values: dict[str, dict[str, float]] = mapping(table_of_numbers)
