"""The schema of `conf/reproduction/`: what the documents print, place by place, and where a run's results hold it.

Printed values are text, as printed: their digits say how far they were rounded. A number that is a cell of summary.csv
stands beside ours in the tables of every run of its experiment (`printed_for`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import Field

from pipeline.common.errors import ConfigError
from pipeline.common.files import shipped
from pipeline.config.fields import Number, Text, build, schema
from pipeline.config.found import Cell, Ratio, Simple, Summary

FOLDER = shipped("conf") / "reproduction"


DOCUMENTS = ("pmke", "global", "pontryagin")

Names = tuple[Text, ...]
Pair = Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)]


@schema
class Row:
    """One printed number."""

    quantity: Annotated[Text, Field(description="what it is")] = ""
    printed: Annotated[Text, Field(description="as printed")] = ""
    unit: Annotated[Text, Field(description="of the number")] = ""
    found: Annotated[Simple | Ratio, Field(discriminator="kind")] = Summary()
    reading: Annotated[Text, Field(description="another way to read it, if it is a misprint")] = ""
    between: Annotated[Pair | None, Field(description="what words mean as numbers")] = None
    better: Annotated[
        Literal["neither", "lower", "higher"],
        Field(description="the side on which a value is better, of what the document minimises or maximises"),
    ] = "neither"
    masses: Annotated[
        Literal["no", "fit", "check"],
        Field(description="whether it serves to identify the masses (fit), or is only shown with both (check)"),
    ] = "no"
    note: Annotated[Text, Field(description="what else there is to say")] = ""

    @property
    def value(self) -> float:
        """What the number is read as."""
        return float(self.reading or self.printed)


@schema
class Drawing:
    """A figure that is drawn again."""

    draw: Annotated[Text, Field(description="the function of `reproduce/drawings.py`")] = ""
    experiments: Annotated[Names, Field(description="whose runs it shows")] = ()
    methods: Annotated[
        Names, Field(description="those of summary.csv, with a number behind from the second optimum on")
    ] = ()


@schema
class Place:
    """A table, figure or section of a document, in its order: what stands there and what is printed."""

    place: Annotated[Text, Field(description="its name in the document")] = ""
    caption: Annotated[Text, Field(description="what it shows")] = ""
    inputs: Annotated[
        dict[str, Text], Field(description="what is given, not computed: shown beside the rows, without a verdict")
    ] = field(default_factory=dict)
    figures: Annotated[tuple[Drawing, ...], Field(description="what is drawn there")] = ()
    rows: Annotated[tuple[Row, ...], Field(description="what is printed there")] = ()


@schema
class Mention:
    """What the tables of an experiment's run say of the document."""

    places: Annotated[Text, Field(description="where it prints the experiment's numbers")] = ""
    note: Annotated[Text, Field(description="what there is to say of them")] = ""
    same_as: Annotated[Text, Field(description="the experiment whose numbers are this one's too")] = ""


@schema
class Document:
    """One document."""

    name: Annotated[Text, Field(description="of the file")] = ""
    title: Annotated[Text, Field(description="of the document")] = ""
    source: Annotated[Text, Field(description="who wrote it, and where it stands")] = ""
    cited: Annotated[Text, Field(description="how the tables of a run name it")] = ""
    runs: Annotated[dict[str, Mention], Field(description="what the tables of each experiment's run say of it")] = (
        field(default_factory=dict)
    )
    places: Annotated[tuple[Place, ...], Field(description="its tables, figures and sections")] = ()

    @cached_property
    def experiments(self) -> tuple[str, ...]:
        """All experiments that its rows and figures take, in order."""
        names = [name for _, row in self.rows for name in row.found.experiments]
        names += [name for place in self.places for figure in place.figures for name in figure.experiments]
        return tuple(dict.fromkeys(names))

    @property
    def rows(self) -> list[tuple[Place, Row]]:
        return [(place, row) for place in self.places for row in place.rows]

    def derived(self, row: Row) -> bool:
        """Whether a row is a ratio of two numbers that have rows of their own: it is not counted again."""
        return bool(row.found.parts) and self._cells.issuperset((p.experiment, p.cell) for p in row.found.parts)

    @cached_property
    def _cells(self) -> frozenset[tuple[str, Cell | None]]:
        """What summary.csv holds of the printed numbers, by experiment."""
        found = (row.found for _, row in self.rows)
        return frozenset((one.experiments[0], one.cell) for one in found if one.cell)


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


@dataclass(frozen=True)
class Printed:
    """What a document prints of an experiment: {method: {column of summary.csv: number}}, its name and a note."""

    numbers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    document: str = ""
    note: str = ""


def printed_for(experiment: str, folder: Path = FOLDER) -> Printed:
    """What stands in conf/reproduction/ of the first optima of an experiment; nothing if no document has it."""
    for name in DOCUMENTS:
        document = _once(name, folder)
        if experiment in document.runs:
            mention = document.runs[experiment]
            values = _cells(document, mention.same_as or experiment)
            return Printed(values, ", ".join(filter(None, (document.cited, mention.places))), mention.note)
    return Printed()


_once = cache(read)  # the documents do not change while a process runs


def _cells(document: Document, experiment: str) -> dict[str, dict[str, float]]:
    """The numbers that are cells of summary.csv, of first optima; the first row of those that print the same cell.

    Computing times stay out: another machine's are nothing to compare a run with.
    """
    values: dict[str, dict[str, float]] = {}
    for _, row in document.rows:
        cell = row.found.cell
        if not cell or cell.optimum != 1 or row.found.timing:
            continue
        if row.between is None and row.found.experiments == (experiment,):
            values.setdefault(cell.method, {}).setdefault(cell.column, row.value)
    return values
