"""Groups `path` and `timing`: the curve, the orientation along it, and s(t)."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.config.fields import angle_or_vector, choice, count, fixed, intervals, number, numbers, switch, text


@dataclass(frozen=True)
class PathConfig:
    """What every path has for tasks with an orientation: the one it starts with, and how far it turns to its end."""

    orientation: list[float] | None = numbers(None, length=3, unit="rad")
    turn: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")


@dataclass(frozen=True)
class LineConfig(PathConfig):
    """`path=line`: straight, `length` m along `direction`."""

    kind: str = fixed("line")
    length: float = number(0.4, above=0, unit="m")
    direction: float | list[float] = angle_or_vector(157.5)
    start: list[float] | None = numbers(None, unit="m")


@dataclass(frozen=True)
class CircleConfig(PathConfig):
    """`path=circle`: through the start, centre `radius` m away along `center_direction`; `angle` deg of it."""

    kind: str = fixed("circle")
    radius: float = number(0.05, above=0, unit="m")
    center_direction: float | list[float] = angle_or_vector(180.0)
    clockwise: bool = switch(False)
    angle: float = number(360.0, above=0, unit="deg")
    normal: list[float] = numbers([0.0, 0.0, 1.0], length=3)
    start: list[float] | None = numbers(None, unit="m")


@dataclass(frozen=True)
class WaypointsConfig(PathConfig):
    """`path=waypoints`: a smooth curve through the rows of a CSV file."""

    kind: str = fixed("waypoints")
    file: str = text("")
    relative: bool = switch(False)


@dataclass(frozen=True)
class TimingConfig:
    """Group `timing`: the law s(t), the motion time and the number of intervals of the global grid."""

    law: str = choice("raised_cosine", "raised_cosine", "constant_speed", "quintic")
    duration: float = number(10.0, above=0, unit="s")
    steps: int = count(100, low=2, high=100_000)
    dense: list[list[float]] = intervals()
