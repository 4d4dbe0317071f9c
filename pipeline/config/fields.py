"""Types of values, and the dataclass that checks itself: every field has its bounds, unit and one-line meaning.

@schema
class TimingConfig:
    duration: Annotated[Number, Field(gt=0, description="[s] motion time")] = 10.0

build(TimingConfig, {"duration": -1}, "timing")  # ConfigError: timing.duration = -1: must be a number > 0 s (...)

A description begins with the unit in brackets, if there is one: messages, `--help` and conf/schema.json read it there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from functools import wraps
from math import isfinite
from typing import Annotated, Any, TypeVar, cast, dataclass_transform

from pydantic import (
    AfterValidator,
    AllowInfNan,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    TypeAdapter,
    ValidationError,
)
from pydantic.dataclasses import dataclass

from pipeline.common.errors import ConfigError
from pipeline.config.json_schema import json_schema
from pipeline.config.messages import in_one_line

T = TypeVar("T")

SMALLEST, LARGEST = 1e-30, 1e20  # of any number: squares of others, or of their inverses, leave what a computer counts
CHECKED = ConfigDict(extra="forbid", validate_by_name=True)


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _text(value: Any) -> Any:
    return value if isinstance(value, dict | list | tuple | None) else str(value)


def as_name(text: str) -> str:
    """A name that can be a folder's, and that stands in Markdown and HTML as it is; raises ValueError."""
    if not re.fullmatch(r"\w([\w .,+()@=-]{0,98}[\w)])?", text):
        raise ValueError("must be a name of at most 100 letters, digits and blanks or . , + - = @ ( ) _ within")
    return text


def once(words: tuple[T, ...]) -> tuple[T, ...]:
    """Words of which each stands once; raises ValueError."""
    if len(set(words)) != len(words):
        raise ValueError("a word stands twice")
    return words


def _kind(value: Any) -> str:
    """The type of a value as JSON calls it."""
    if isinstance(value, list | tuple):
        return "array"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "number"
    return "string" if isinstance(value, str) else "other"


Number = Annotated[float, Strict(), AllowInfNan(False)]  # finite; neither true nor "1" is one
Whole = Annotated[int, Strict(), BeforeValidator(_whole)]  # 4.0 is one
Switch = Annotated[bool, Strict()]
Name = Annotated[str, BeforeValidator(_text), AfterValidator(as_name)]
Text = Annotated[str, BeforeValidator(_text)]
Numbers = tuple[Number, ...]
Vector = Annotated[Numbers, Field(min_length=3, max_length=3)]
Coordinate = Annotated[Number, Field(ge=-1e6, le=1e6)]  # [m or rad]: beyond, doubles no longer tell 1e-10 of it apart
Coordinates = tuple[Coordinate, ...]
Pose = Annotated[Coordinates, Field(min_length=3, max_length=3)]  # its position or its roll, pitch, yaw
Words = Annotated[tuple[T, ...], Field(min_length=1), AfterValidator(once)]
# One for all (joints, axes), or a list.
OneOrList = Annotated[Annotated[T, Tag("number")] | Annotated[tuple[T, ...], Tag("array")], Discriminator(_kind)]
WordOrWords = Annotated[Annotated[T, Tag("string")] | Annotated[Words[T], Tag("array")], Discriminator(_kind)]
W = TypeVar("W")
WordOrTable = Annotated[Annotated[W, Tag("string")] | Annotated[T, Tag("other")], Discriminator(_kind)]
WordOrPositive = Annotated[
    Annotated[T, Tag("string")] | Annotated[Annotated[Number, Field(gt=0)], Tag("number")], Discriminator(_kind)
]
WordOrVector = Annotated[Annotated[T, Tag("string")] | Annotated[Vector, Tag("array")], Discriminator(_kind)]


def _refuse_uncountable(value: Any, where: str) -> None:
    """Raise ConfigError for the first number in `value`, tables and lists, that nobody can count with."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            _refuse_uncountable(inner, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            _refuse_uncountable(inner, f"{where}[{index}]")
    elif isinstance(value, float) and value and isfinite(value) and not SMALLEST <= abs(value) <= LARGEST:
        raise ConfigError(f"{where} = {value:g}: must be 0 or of a size from {SMALLEST:g} to {LARGEST:g}")


@dataclass_transform(frozen_default=True, field_specifiers=(Field, field))
def schema(cls: type[T]) -> type[T]:
    """A frozen dataclass of pydantic; a bad argument is a ConfigError of one line, from Python as from a command."""
    made = dataclass(frozen=True, config=CHECKED)(cls)
    plain = made.__init__

    @wraps(plain)
    def init(self: Any, *values: Any, **named: Any) -> None:
        _refuse_uncountable(named, made.__name__)
        try:
            plain(self, *values, **named)
        except ValidationError as error:
            raise ConfigError(in_one_line(error, json_schema(made), made.__name__)) from None

    made.__init__ = init  # type: ignore[method-assign]
    return cast(type[T], made)


def build(cls: type[T], values: Any, where: str = "") -> T:
    """An instance of `cls` from a mapping; raises ConfigError that names the key and what is allowed."""
    _refuse_uncountable(values, where)
    try:
        return TypeAdapter(cls).validate_python(values, by_alias=True, by_name=False)
    except ValidationError as error:
        raise ConfigError(in_one_line(error, json_schema(cls), where)) from None
