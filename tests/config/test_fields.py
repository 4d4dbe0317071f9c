from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.errors import ConfigError
from pipeline.config.fields import (
    angle_or_vector,
    any_number,
    build,
    choice,
    choices,
    count,
    mapping,
    number,
    numbers,
    one_of,
    part,
    switch,
    text,
)


@dataclass(frozen=True)
class Line:
    length: float = number(0.4, above=0, unit="m")


@dataclass(frozen=True)
class Circle:
    radius: float = number(0.1, above=0, high=1, unit="m")


@dataclass(frozen=True)
class Inner:
    gain: float = number(0.0, low=0)
    steps: int = count(10, low=2, high=20)


@dataclass(frozen=True)
class Outer:
    free: float | None = number(None)
    law: str = choice("quintic", "quintic", "linear")
    axes: list[str] = choices(["x"], "x", "y")  # noqa: RUF009
    on: bool = switch(True)
    label: str = text("a")
    point: list[float] = numbers([0.0, 0.0], length=2, unit="m")  # noqa: RUF009
    direction: float | list[float] = angle_or_vector(0.0)  # noqa: RUF009
    table: dict[str, float] = mapping(any_number)  # noqa: RUF009
    inner: Inner = part(Inner)  # noqa: RUF009
    global_: Inner = part(Inner)  # noqa: RUF009
    path: Line | Circle = one_of({"line": Line, "circle": Circle}, "line")  # noqa: RUF009


NAN = float("nan")
FAULTS: list[tuple[dict[str, Any], list[str]]] = [
    ({"free": NAN}, ["free = nan", "must be a number"]),
    ({"free": float("inf")}, ["free = inf"]),
    ({"free": True}, ["free = true", "must be a number"]),
    ({"free": "1"}, ["free = '1'"]),
    ({"inner": {"gain": -1}}, ["inner.gain = -1", ">= 0"]),
    ({"inner": {"gain": None}}, ["inner.gain = null"]),
    ({"inner": {"steps": 1}}, ["inner.steps = 1", "whole number", ">= 2", "<= 20"]),
    ({"inner": {"steps": 21}}, ["inner.steps = 21", "<= 20"]),
    ({"inner": {"steps": 2.5}}, ["inner.steps = 2.5", "whole number"]),
    ({"inner": {"steps": False}}, ["inner.steps = false"]),
    ({"inner": 3}, ["inner = 3", "table"]),
    ({"law": "quintik"}, ["law = 'quintik'", "quintic, linear"]),
    ({"axes": []}, ["axes", "at least one of: x, y"]),
    ({"axes": ["x", "w"]}, ["axes = 'w'", "x, y"]),
    ({"axes": ["x", "x"]}, ["axes", "twice"]),
    ({"axes": "xy"}, ["axes = 'xy'"]),
    ({"on": 1}, ["on = 1", "true or false"]),
    ({"label": ["a"]}, ["label", "text"]),
    ({"point": [0.0]}, ["point", "2 numbers m"]),
    ({"point": [0.0, NAN]}, ["point[1] = nan"]),
    ({"point": 0.0}, ["point = 0.0"]),
    ({"direction": True}, ["direction = true", "angle"]),
    ({"direction": [0.0, "x"]}, ["direction[1] = 'x'"]),
    ({"table": {"j1": NAN}}, ["table.j1 = nan"]),
    ({"table": [1]}, ["table = [1]"]),
    ({"path": {"kind": "circel"}}, ["path.kind = 'circel'", "line, circle"]),
    ({"path": {"radius": 0.1}}, ["path.kind = null", "line, circle"]),
    ({"path": {"kind": ["line"]}}, ["path.kind = ['line']", "line, circle"]),
    ({"path": "line"}, ["path"]),
    ({"path": {"kind": "circle", "radius": 0}}, ["path.radius = 0", "> 0", "<= 1 m"]),
    ({"path": {"kind": "circle", "length": 0.1}}, ["path.length: unknown key", "allowed: radius"]),
    ({"inner": {"gian": 1}}, ["inner.gian: unknown key; did you mean gain?", "allowed: gain, steps"]),
    ({"zzz": 1}, ["zzz: unknown key; allowed: axes, direction, free, global, inner"]),
    ({"free": 10**400}, ["free"]),
]


@pytest.mark.parametrize(("values", "named"), FAULTS, ids=[str(values)[:40] for values, _ in FAULTS])
def test_a_fault_is_one_line_that_names_the_key_and_what_is_allowed(values: dict[str, Any], named: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        build(Outer, values)
    assert "\n" not in str(caught.value)
    for word in named:
        assert word in str(caught.value)


def test_good_values_are_converted_and_the_rest_are_defaults() -> None:
    made = build(
        Outer,
        {
            "free": 2,
            "axes": ("y", "x"),
            "point": (1, 2),
            "direction": [1, 0, 0],
            "table": {"j1": 1},
            "inner": {"steps": 4.0},
            "global": {"gain": 3},
            "path": {"kind": "circle", "radius": 0.5},
        },
    )
    assert made == Outer(
        free=2.0,
        axes=["y", "x"],
        point=[1.0, 2.0],
        direction=[1.0, 0.0, 0.0],
        table={"j1": 1.0},
        inner=Inner(steps=4),
        global_=Inner(gain=3.0),
        path=Circle(0.5),
    )
    assert isinstance(made.free, float)
    assert isinstance(made.inner.steps, int)
    assert build(Outer, {}) == Outer()
    assert build(Outer, {"free": None}).free is None


def test_defaults_are_not_shared() -> None:
    assert Outer().point is not Outer().point
    assert Outer().table is not Outer().table


@given(st.floats(allow_nan=False), st.floats(-5, 5), st.floats(-5, 5))
def test_bounds_are_kept_exactly(value: float, low: float, high: float) -> None:
    made = dataclasses.make_dataclass("Made", [("v", float, number(0.0, low=low, high=high))], frozen=True)
    if low <= value <= high:
        assert build(made, {"v": value}).v == value  # type: ignore[attr-defined]
    else:
        with pytest.raises(ConfigError, match=r"^group\.v = "):
            build(made, {"v": value}, "group")
