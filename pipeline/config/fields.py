"""Dataclasses that check themselves: fields with bounds, built from plain mappings, one clear line for a bad key.

@dataclass(frozen=True)
class TimingConfig:
    duration: float = number(10.0, above=0, unit="s")

build(TimingConfig, {"duration": -1}, "timing")   # ConfigError: timing.duration = -1: must be > 0 s
"""

from __future__ import annotations

import dataclasses
import difflib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from pipeline.common.errors import ConfigError
from pipeline.config.renamed import renamed

T = TypeVar("T")


Check = Callable[[Any, str], Any]


def _fail(key: str, value: Any, problem: str) -> ConfigError:
    shown = {None: "null", True: "true", False: "false"}.get(value, value) if isinstance(value, bool | None) else value
    return ConfigError(f"{key} = {value!r}: {problem}" if isinstance(value, str) else f"{key} = {shown}: {problem}")


def _field(default: Any, check: Check) -> Any:
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=lambda: type(default)(default), metadata={"check": check})
    return dataclasses.field(default=default, metadata={"check": check})


def _check_number(whole: bool, low: float | None, high: float | None, above: float | None, unit: str) -> Check:
    bounds = [f"{sign} {bound:g}" for sign, bound in ((">=", low), (">", above), ("<=", high)) if bound is not None]
    kind = "a whole number" if whole else "a number"
    allowed = f"must be {kind}" + (" " + " and ".join(bounds) if bounds else "") + (f" {unit}" if unit else "")

    def check(value: Any, key: str) -> Any:
        ok = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
        if ok and whole:
            ok = float(value).is_integer()
        if (
            not ok
            or (low is not None and value < low)
            or (high is not None and value > high)
            or (above is not None and value <= above)
        ):
            raise _fail(key, value, allowed)
        return int(value) if whole else float(value)

    return check


def number(
    default: float | None,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    unit: str = "",
) -> Any:
    """A real number within bounds; None is allowed where it is the default."""
    return _field(default, _optional(default, _check_number(False, low, high, above, unit)))


def count(default: int | None, *, low: int | None = 1, high: int | None = None) -> Any:
    """A whole number within bounds; None is allowed where it is the default."""
    return _field(default, _optional(default, _check_number(True, low, high, None, "")))


def switch(default: bool) -> Any:
    def check(value: Any, key: str) -> bool:
        if not isinstance(value, bool):
            raise _fail(key, value, "must be true or false")
        return value

    return _field(default, check)


def choice(default: str | None, *allowed: str) -> Any:
    """One of the words in `allowed`."""

    def check(value: Any, key: str) -> str:
        if value not in allowed:
            raise _fail(key, value, f"allowed: {', '.join(allowed)}")
        return str(value)

    return _field(default, check)


def choices(default: Sequence[str], *allowed: str) -> Any:
    """A list of words, each in `allowed`, none twice."""

    def check(value: Any, key: str) -> list[str]:
        if not isinstance(value, list | tuple) or not value:
            raise _fail(key, value, f"must be a list of at least one of: {', '.join(allowed)}")
        for word in value:
            if word not in allowed:
                raise _fail(key, word, f"allowed: {', '.join(allowed)}")
        if len(set(value)) != len(value):
            raise _fail(key, list(value), "a word stands twice")
        return list(value)

    return _field(list(default), check)


def text(default: str | None) -> Any:
    def check(value: Any, key: str) -> str:
        if value is None or isinstance(value, dict | list):
            raise _fail(key, value, "must be text")
        return str(value)

    return _field(default, _optional(default, check))


def texts() -> Any:
    """A list of words."""

    def check(value: Any, key: str) -> list[str]:
        if not isinstance(value, list | tuple) or any(isinstance(word, dict | list | None) for word in value):
            raise _fail(key, value, "must be a list of words")
        return [str(word) for word in value]

    return _field([], check)


def numbers(
    default: Sequence[float] | None,
    *,
    length: int | None = None,
    above: float | None = None,
    unit: str = "",
    optional: bool = False,
) -> Any:
    """A list of finite numbers, each above a bound if one is given; None is allowed where it is the default or `optional`."""

    def check(value: Any, key: str) -> list[float]:
        one = _check_number(False, None, None, above, unit)
        if not isinstance(value, list | tuple) or (length is not None and len(value) != length):
            raise _fail(
                key,
                value,
                f"must be a list of {length or ''} numbers".replace("  ", " ") + (f" {unit}" if unit else ""),
            )
        return [one(entry, f"{key}[{i}]") for i, entry in enumerate(value)]

    made = None if default is None else list(default)
    return _field(made, _optional(None if optional else default, check))


def word_or_vector(default: str, *allowed: str, unit: str = "") -> Any:
    """One of the words in `allowed`, or three numbers."""

    def check(value: Any, key: str) -> str | list[float]:
        if isinstance(value, str) and value in allowed:
            return value
        try:
            return numbers([], length=3, unit=unit).metadata["check"](value, key)
        except ConfigError:
            raise _fail(key, value, f"allowed: {', '.join(allowed)}, or three numbers {unit}") from None

    return _field(default, check)


def per_joint(
    default: float | None = None, *, low: float | None = None, above: float | None = None, unit: str = ""
) -> Any:
    """One number for all joints, or a list with one number per joint; None is allowed where it is the default."""
    one = _check_number(False, low, None, above, unit)

    def check(value: Any, key: str) -> float | list[float]:
        if isinstance(value, list | tuple):
            return [one(entry, f"{key}[{i}]") for i, entry in enumerate(value)]
        return float(one(value, key))

    return _field(default, _optional(default, check))


def intervals() -> Any:
    """A list of [from s, to s, factor]: where a grid is denser, and how many times."""

    def check(value: Any, key: str) -> list[list[float]]:
        rows = numbers([])
        if not isinstance(value, list | tuple):
            raise _fail(key, value, "must be a list of [from s, to s, factor]")
        made = [rows.metadata["check"](row, f"{key}[{i}]") for i, row in enumerate(value)]
        for row in made:
            if len(row) != 3 or not 0 <= row[0] < row[1] or not row[2] > 0:
                raise _fail(key, row, "must be [from s, to s, factor] with 0 <= from < to and factor > 0")
        return made

    return _field([], check)


def angle_or_vector(default: float | None) -> Any:
    """An angle [deg] in the task plane, or a direction vector of 2 or 3 numbers."""

    def check(value: Any, key: str) -> float | list[float]:
        one = _check_number(False, None, None, None, "")
        if isinstance(value, list | tuple):
            return [one(entry, f"{key}[{i}]") for i, entry in enumerate(value)]
        try:
            return float(one(value, key))
        except ConfigError:
            raise _fail(key, value, "must be an angle in degrees or a list of numbers") from None

    return _field(default, check)


def mapping(of: Check | None = None, *, optional: bool = False) -> Any:
    """A free-form table: its keys are data, not options."""

    def check(value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise _fail(key, value, "must be a table of keys and values")
        return {str(name): entry if of is None else of(entry, f"{key}.{name}") for name, entry in value.items()}

    return _field(None, _optional(None, check)) if optional else _field({}, check)


def fixed(word: str) -> Any:
    """What a part chosen by `kind` is called: not to be set, but part of the record."""
    return dataclasses.field(default=word, init=False)


def any_number(value: Any, key: str) -> float:
    return float(_check_number(False, None, None, None, "")(value, key))


def table_of_numbers(value: Any, key: str) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise _fail(key, value, "must be a table of numbers")
    return {str(name): any_number(entry, f"{key}.{name}") for name, entry in value.items()}


def part(kind: type) -> Any:
    """A nested dataclass."""
    return dataclasses.field(default_factory=kind, metadata={"part": kind})


def list_of(kind: type) -> Any:
    """A list of dataclasses."""

    def check(value: Any, key: str) -> list[Any]:
        if not isinstance(value, list | tuple):
            raise _fail(key, value, "must be a list")
        return [build(kind, entry, f"{key}[{i}]") for i, entry in enumerate(value)]

    return _field([], check)


def one_of(kinds: Mapping[str, type], default: str) -> Any:
    """A nested dataclass chosen by the key `kind`."""
    return dataclasses.field(default_factory=kinds[default], metadata={"kinds": kinds})


def table_of(kinds: Mapping[str, type], *, listed: bool = False) -> Any:
    """A free-form table whose entries are dataclasses chosen by their key `kind`; or None, or a list of such under each
    name, if `listed`.
    """

    def check(value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise _fail(key, value, "must be a table of names and shapes")
        made: dict[str, Any] = {}
        for name, entry in value.items():
            if not listed:
                made[str(name)] = _build_kind(kinds, entry, f"{key}.{name}")
                continue
            if not isinstance(entry, list | tuple):
                raise _fail(f"{key}.{name}", entry, "must be a list of shapes")
            made[str(name)] = [_build_kind(kinds, one, f"{key}.{name}[{i}]") for i, one in enumerate(entry)]
        return made

    return _field(None, _optional(None, check)) if listed else _field({}, check)


def _optional(default: Any, check: Check) -> Check:
    if default is not None:
        return check
    return lambda value, key: None if value is None else check(value, key)


def build(cls: type[T], values: Any, where: str = "") -> T:
    """An instance of `cls` from a mapping; raises ConfigError that names the key and what is allowed."""
    if not isinstance(values, Mapping):
        raise _fail(where, values, "must be a table of keys and values")
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    names = {name.rstrip("_"): name for name in fields}
    made: dict[str, Any] = {}
    for key, value in values.items():
        full = f"{where}.{key}" if where else str(key)
        if key not in names:
            raise unknown_key(full, list(names))
        metadata = fields[names[key]].metadata
        if "part" in metadata:
            made[names[key]] = build(metadata["part"], value, full)
        elif "kinds" in metadata:
            made[names[key]] = _build_kind(metadata["kinds"], value, full)
        else:
            made[names[key]] = metadata["check"](value, full)
    return cls(**made)


def _build_kind(kinds: Mapping[str, type], value: Any, where: str) -> Any:
    kind = value.get("kind") if isinstance(value, Mapping) else None
    if not isinstance(kind, str) or kind not in kinds:
        raise _fail(f"{where}.kind", kind, f"allowed: {', '.join(kinds)}")
    return build(kinds[str(kind)], {key: entry for key, entry in value.items() if key != "kind"}, where)


def unknown_key(key: str, allowed: Sequence[str]) -> ConfigError:
    """The error of a key that there is not, with the closest one that there is, or with its new name."""
    now = renamed(key)
    if now is not None:
        return ConfigError(f"{key}: {now}")
    last = key.rsplit(".", 1)[-1]
    close = difflib.get_close_matches(last, allowed, n=1)
    hint = f"; did you mean {close[0]}?" if close else ""
    return ConfigError(
        f"{key}: unknown key{hint} Allowed: {', '.join(sorted(allowed))}".replace("? Allowed", "? allowed").replace(
            "key Allowed", "key; allowed"
        )
    )
