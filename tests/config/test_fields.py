from __future__ import annotations

import dataclasses
import pickle
from dataclasses import field
from typing import Annotated, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from pipeline.common.errors import ConfigError
from pipeline.config.fields import (
    Number,
    Numbers,
    OneOrList,
    Switch,
    Text,
    Vector,
    Whole,
    WordOrVector,
    Words,
    build,
    schema,
)
from pipeline.config.messages import unknown_key


@schema
class Line:
    length: Annotated[Number, Field(gt=0, description="[m] length")] = 0.4
    kind: Literal["line"] = "line"


@schema
class Circle:
    radius: Annotated[Number, Field(gt=0, le=1, description="[m] radius")] = 0.1
    kind: Literal["circle"] = "circle"


@schema
class Inner:
    gain: Annotated[Number, Field(ge=0)] = 0.0
    steps: Annotated[Whole, Field(ge=2, le=20)] = 10


@schema
class Outer:
    free: Number | None = None
    law: Annotated[Literal["quintic", "linear"], Field(description="of motion")] = "quintic"
    axes: Words[Literal["x", "y"]] = ("x",)
    on: Switch = True
    marks: tuple[Literal["p", "q"], ...] = ()
    label: Text = "a"
    point: Annotated[Numbers, Field(min_length=2, max_length=2, description="[m] a place")] = (0.0, 0.0)
    direction: Annotated[OneOrList[Number], Field(description="[deg] angle, or a vector")] = 0.0
    weight: Annotated[WordOrVector[Literal["none", "earth"]], Field(description="[m/s^2] acceleration")] = "none"
    normal: Vector = (0.0, 0.0, 1.0)
    table: dict[str, Number] = field(default_factory=dict)
    inner: Inner = Inner()
    global_: Annotated[Inner, Field(alias="global")] = Inner()
    path: Annotated[Line | Circle, Field(discriminator="kind")] = Line()
    paths: dict[str, tuple[Annotated[Line | Circle, Field(discriminator="kind")], ...]] | None = None


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
    ({"weight": "moon"}, ["weight = 'moon'", "none, earth or a list of 3 numbers m/s^2", "acceleration"]),
    ({"weight": [0.0, 1.0]}, ["weight = [0.0, 1.0]", "none, earth or a list of 3 numbers m/s^2"]),
    ({"normal": [0.0, 1.0]}, ["normal", "a list of 3 numbers"]),
    ({"direction": "north"}, ["direction = 'north'", "a number deg or a list of numbers deg"]),
    ({"law": "quintik"}, ["did you mean quintic?"]),
    ({"path": {"kind": "circel"}}, ["did you mean circle?"]),
    ({"global": {"gain": -1}}, ["global.gain = -1"]),
    ({"global_": {"gain": 1}}, ["global_: unknown key; did you mean global?"]),
    ({"paths": {"a": [{"kind": "line"}, {"kind": "line", "length": 0}]}}, ["paths.a[1].length = 0", "> 0 m (length)"]),
    ({"paths": {"a": {"kind": "line"}}}, ["paths.a = ", "a list of tables"]),
    ({"marks": "p"}, ["marks = 'p'", "a list of any of: p, q"]),
    ({"free": []}, ["must be a number or null"]),
    ({"on": None}, ["on = null", "must be true or false"]),
    ({1: 2}, ["1: unknown key"]),
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
        axes=("y", "x"),
        point=(1.0, 2.0),
        direction=(1.0, 0.0, 0.0),
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
    assert Outer().table is not Outer().table


def test_a_value_stays_what_it_is() -> None:
    """Nobody changes the configuration of a run: neither its fields nor what stands in them."""
    made = Outer()
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.free = 1.0  # type: ignore[misc]
    assert isinstance(build(Outer, {"point": [1, 2]}).point, tuple)


def test_python_is_as_strict_as_a_file() -> None:
    """One line that names the class and the key, also where a copy is changed."""
    for make in (lambda: Inner(gain=-1), lambda: dataclasses.replace(Inner(), gain=-1)):
        with pytest.raises(ConfigError, match=r"^Inner\.gain = -1: must be a number >= 0$"):
            make()
    assert unknown_key("innr.gain", ["inner", "other"]).startswith("innr.gain: unknown key; did you mean inner?")
    with pytest.raises(ConfigError, match=r"^Inner\.gian: unknown key; did you mean gain\?"):
        Inner(gian=1)  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match=r"^Inner: 2 values at most, in the order gain, steps"):
        Inner(1.0, 2, 3)  # type: ignore[call-arg]


def test_a_copy_of_another_process_is_the_same() -> None:
    made = Outer(inner=Inner(3.0), path=Circle(0.5))
    assert pickle.loads(pickle.dumps(made)) == made
    assert dataclasses.asdict(made)["path"] == {"kind": "circle", "radius": 0.5}


@given(st.floats(allow_nan=False), st.floats(-5, 5), st.floats(-5, 5))
def test_bounds_are_kept_exactly(value: float, low: float, high: float) -> None:
    bounded = Annotated[Number, Field(ge=low, le=high)]
    Made = schema(type("Made", (), {"__annotations__": {"v": bounded}, "v": low}))
    if low <= value <= high and (value == 0 or abs(value) >= 1e-30):
        assert build(Made, {"v": value}).v == value
    else:
        with pytest.raises(ConfigError, match=r"^group\.v = "):
            build(Made, {"v": value}, "group")
