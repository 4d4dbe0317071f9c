"""The schema of `conf/reproduction/`: what the documents print, place by place, and where a run's results hold it.

Printed values are text, as printed: their digits say how far they were rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from pipeline.common.errors import ConfigError
from pipeline.common.files import shipped
from pipeline.config.fields import build, choice, count, fixed, list_of, mapping, number, numbers, one_of, text, texts

FOLDER = shipped("conf") / "reproduction"


DOCUMENTS = ("pmke", "global", "pontryagin")


@dataclass(frozen=True)
class Summary:
    """A cell of summary.csv."""

    kind: str = fixed("summary")
    experiment: str = text("")
    method: str = text("")
    optimum: int = count(1)
    column: str = text("")


@dataclass(frozen=True)
class Peak:
    """The largest velocity of one joint of a motion, up to a moment: its size, or the largest positive one."""

    kind: str = fixed("peak")
    experiment: str = text("")
    method: str = text("")
    joint: int = count(1)
    until: float | None = number(None, unit="s")
    side: str = choice("both", "both", "positive")


@dataclass(frozen=True)
class LimitTime:
    """From or until when the planner's first optimum is at a limit [s]; a knot's velocity is that of the interval before."""

    kind: str = fixed("limit_time")
    experiment: str = text("")
    joint: int = count(1)
    limit: str = choice("velocity", "velocity", "torque", "power")
    end: str = choice("from", "from", "until")


@dataclass(frozen=True)
class JointsAtLimit:
    """How many joints of the planner's first optimum are at their velocity limits at the same time, at most."""

    kind: str = fixed("joints_at_limit")
    experiment: str = text("")


@dataclass(frozen=True)
class EndEffector:
    """A coordinate of the end effector at the first or the last knot of the planner's first optimum [m]."""

    kind: str = fixed("end_effector")
    experiment: str = text("")
    axis: str = choice("x", "x", "y", "z")
    end: str = choice("first", "first", "last")


@dataclass(frozen=True)
class Validation:
    """A cell of validation.csv, the planner's optima beside the calculus of variations."""

    kind: str = fixed("validation")
    experiment: str = text("")
    optimum: int = count(1)
    column: str = text("")


@dataclass(frozen=True)
class Minima:
    """The number of the planner's optima that continuous time has too."""

    kind: str = fixed("minima")
    experiment: str = text("")


@dataclass(frozen=True)
class PowerLaw:
    """The fit of the candidate study: log(distance) = intercept + exponent log(candidates)."""

    kind: str = fixed("power_law")
    experiment: str = text("")
    parameter: str = choice("exponent", "exponent", "intercept")


@dataclass(frozen=True)
class PredictionTime:
    """The mean time of PMKE's predictions [s]: of the optimisation, of everything else, or of the whole."""

    kind: str = fixed("prediction_time")
    experiment: str = text("")
    of: str = choice("whole", "whole", "optimisation", "rest")


@dataclass(frozen=True)
class SpectralRatio:
    """The largest ratio over time of the spectral radius of M of one motion to that of another."""

    kind: str = fixed("spectral_ratio")
    experiment: str = text("")
    method: str = text("")
    over: str = text("")


@dataclass(frozen=True)
class RangeShare:
    """How far the joints of a motion are from the middle of their ranges, at most, relative to half of them."""

    kind: str = fixed("range_share")
    experiment: str = text("")
    method: str = text("")


@dataclass(frozen=True)
class Mass:
    """The identified mass of a link [kg]."""

    kind: str = fixed("mass")
    experiment: str = text("")
    link: int = count(1)


SIMPLE = {
    "summary": Summary,
    "peak": Peak,
    "limit_time": LimitTime,
    "joints_at_limit": JointsAtLimit,
    "end_effector": EndEffector,
    "validation": Validation,
    "minima": Minima,
    "power_law": PowerLaw,
    "prediction_time": PredictionTime,
    "spectral_ratio": SpectralRatio,
    "range_share": RangeShare,
    "mass": Mass,
}


@dataclass(frozen=True)
class Ratio:
    """`of` over `to`: the ratio, how much larger in percent, or the size of that."""

    kind: str = fixed("ratio")
    of: Any = one_of(SIMPLE, "summary")
    to: Any = one_of(SIMPLE, "summary")
    unit: str = choice("1", "1", "percent", "percent_of_size")


NUMBERS = {**SIMPLE, "ratio": Ratio}


def experiments(found: Any) -> tuple[str, ...]:
    """The experiments that one number takes, each once."""
    parts = (found.of, found.to) if isinstance(found, Ratio) else (found,)
    return tuple(dict.fromkeys(part.experiment for part in parts))


@dataclass(frozen=True)
class Row:
    """One printed number.

    reading: another way to read it, if it is a misprint. tolerance: in place of the rounding, with its reason in `why`.
    between: what words mean as numbers. better: the side on which a value is better. masses: whether the number serves
    to identify the masses (fit), or is only shown with both (check).
    """

    quantity: str = text("")
    printed: str = text("")
    unit: str = text("")
    found: Any = one_of(NUMBERS, "summary")
    reading: str = text("")
    tolerance: float | None = number(None, above=0)
    why: str = text("")
    between: list[float] | None = numbers(None, length=2)
    better: str = choice("neither", "neither", "lower", "higher")
    masses: str = choice("no", "no", "fit", "check")
    note: str = text("")

    @property
    def value(self) -> float:
        """What the number is read as."""
        return float(self.reading or self.printed)


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn again: `draw` names the function of `artifacts/document_figures.py`; `methods` are those of
    summary.csv, with a number behind from the second optimum on.
    """

    draw: str = text("")
    experiments: list[str] = texts()
    methods: list[str] = texts()


@dataclass(frozen=True)
class Place:
    """A table, figure or section of a document, in its order: what stands there and what is printed.

    inputs: what is given, not computed: shown beside the rows, without a verdict.
    """

    place: str = text("")
    caption: str = text("")
    inputs: dict[str, str] = mapping()
    figures: list[Drawing] = list_of(Drawing)
    rows: list[Row] = list_of(Row)


@dataclass(frozen=True)
class Document:
    """One document."""

    name: str = text("")
    title: str = text("")
    source: str = text("")
    places: list[Place] = list_of(Place)

    @cached_property
    def experiments(self) -> tuple[str, ...]:
        """All experiments that its rows and figures take, in order."""
        names = [name for place in self.places for row in place.rows for name in experiments(row.found)]
        names += [name for place in self.places for figure in place.figures for name in figure.experiments]
        return tuple(dict.fromkeys(names))

    @property
    def rows(self) -> list[tuple[Place, Row]]:
        return [(place, row) for place in self.places for row in place.rows]


def read(name: str, folder: Path = FOLDER) -> Document:
    """The document `name`; raises ConfigError, one line."""
    if name not in DOCUMENTS:
        raise ConfigError(f"document = {name}: no such document; allowed: {', '.join(DOCUMENTS)}")
    file = folder / f"{name}.yaml"
    try:
        document = build(Document, yaml.safe_load(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{file}: {error.strerror}") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{file}: {' '.join(str(error).split())}") from None
    for place, row in document.rows:
        _check(row, f"{name}, {place.place}, {row.quantity}")
    return document


def _check(row: Row, where: str) -> None:
    for key, printed in (("printed", row.printed), ("reading", row.reading)):
        if row.between is not None or (key == "reading" and not printed):
            continue
        try:
            half_width(printed)
        except ValueError as error:
            raise ConfigError(f"{where}: {key}: {error}; words need `between`") from None
    if row.tolerance is not None and not row.why:
        raise ConfigError(f"{where}: a tolerance needs its reason, `why`")


def half_width(printed: str) -> float:
    """Half a unit of the last printed digit: `8.81e-3` -> 5e-6. Raises ValueError if it is no number."""
    try:
        number = Decimal(printed)
    except ArithmeticError:
        raise ValueError(f"{printed!r} is not a number") from None
    exponent = number.as_tuple().exponent
    if not isinstance(exponent, int):
        raise ValueError(f"{printed!r} is not a finite number")
    return float(Decimal((0, (5,), exponent - 1)))
