"""Groups `path` and `timing`: the curve, the orientation along it, and s(t)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from pipeline.config.fields import (
    Coordinates,
    Number,
    Numbers,
    OneOrList,
    Switch,
    Text,
    Vector,
    Whole,
    WordOrPositive,
    schema,
)

Direction = OneOrList[Number]
START = "[m] task coordinates of the start; null: the end effector at robot.q_init"


Turn = Annotated[Number, Field(ge=-1000, le=1000)]  # [rad]: a hundred and fifty times round
Turns = Annotated[tuple[Turn, ...], Field(min_length=3, max_length=3)]


def _finer(row: tuple[float, ...]) -> tuple[float, ...]:
    if len(row) != 3 or not 0 <= row[0] < row[1] or not row[2] > 0:
        raise ValueError("must be [from s, to s, factor] with 0 <= from < to and factor > 0")
    return row


@schema
class PathConfig:
    """What every path has for tasks with an orientation: the one it starts with, and how far it turns to its end."""

    orientation: Annotated[
        Vector | None, Field(description="[rad] roll, pitch, yaw at the start, for such tasks; null: at robot.q_init")
    ] = None
    turn: Annotated[
        Annotated[tuple[Turn, ...], Field(min_length=3, max_length=3)],
        Field(description="[rad] rotation vector by which it turns to the end, in the world"),
    ] = (
        0.0,
        0.0,
        0.0,
    )
    meters_per_radian: Annotated[
        Number | None,
        Field(
            gt=0,
            description="[m/rad] what turning counts of the path's length, by which the law runs through it; null: "
            "nothing, but 0.1 on the spot",
        ),
    ] = None
    exact: Annotated[
        Switch,
        Field(description="whether every knot is on the path; false: a motion may use all of the tolerances, anywhere"),
    ] = True
    tolerance: Annotated[Number, Field(gt=0, description="[m] how far from it a motion may be between its knots")] = (
        1e-4
    )
    orientation_tolerance: Annotated[
        Number, Field(gt=0, description="[rad] the same of the orientation, where one is prescribed")
    ] = 1e-3


@schema
class LineConfig(PathConfig):
    """`path=line`: straight, `length` m along `direction`."""

    kind: Literal["line"] = "line"
    length: Annotated[Number, Field(ge=0, description="[m] length of the line; 0: it turns on the spot")] = 0.4
    direction: Annotated[Direction, Field(description="[deg] angle in the task plane, or a vector")] = 157.5
    start: Annotated[Coordinates | None, Field(description=START)] = None


@schema
class CircleConfig(PathConfig):
    """`path=circle`: through the start, centre `radius` m away along `center_direction`; `angle` deg of it."""

    kind: Literal["circle"] = "circle"
    radius: Annotated[Number, Field(gt=0, description="[m] radius of the circle")] = 0.05
    center_direction: Annotated[
        Direction, Field(description="[deg] angle from the start to the centre in the task plane, or a vector")
    ] = 180.0
    clockwise: Annotated[Switch, Field(description="which way round, seen against `normal`")] = False
    angle: Annotated[Number, Field(gt=0, le=360_000, description="[deg] how much of the circle")] = 360.0
    normal: Annotated[Vector, Field(description="of the circle's plane, for tasks in space")] = (0.0, 0.0, 1.0)
    start: Annotated[Coordinates | None, Field(description=START)] = None


@schema
class WaypointsConfig(PathConfig):
    """`path=waypoints`: a smooth curve through the rows of a CSV file."""

    kind: Literal["waypoints"] = "waypoints"
    file: Annotated[
        Text,
        Field(
            description="CSV file with header x,y or x,y,z, in m, orientations and times beside; or G-code (.nc, "
            ".gcode, .tap)"
        ),
    ] = ""
    relative: Annotated[Switch, Field(description="shift the curve so that it starts at the end effector")] = False
    units: Annotated[Literal["m", "mm"], Field(description="of the points in the file")] = "m"
    corners: Annotated[
        Literal["spline", "blend", "stop"],
        Field(
            description="spline: a smooth curve through all way-points; blend: straight with rounded corners; stop: "
            "straight, with a stop at each way-point"
        ),
    ] = "spline"
    blend: Annotated[Number, Field(gt=0, description="[m] how far corners that blend may be left, at most")] = 0.005
    rapid: Annotated[
        Number, Field(gt=0, description="[m/s] of the moves G0 of a file of G-code, with timing.law from_file")
    ] = 0.1


@schema
class TimingConfig:
    """Group `timing`: the law s(t), the motion time and the number of intervals of the global grid."""

    law: Annotated[
        Literal["raised_cosine", "constant_speed", "quintic", "cruise", "optimal", "from_file"],
        Field(
            description="how the path is run through in time; optimal: as costs least, found with the motion; "
            "from_file: by the column time of path.file, or the feeds of G-code"
        ),
    ] = "raised_cosine"
    duration: Annotated[
        WordOrPositive[Literal["shortest"]],
        Field(description="[s] motion time, unless it is from_file; shortest: as short as the limits allow"),
    ] = 10.0
    ramp: Annotated[
        Number,
        Field(
            ge=1e-3,
            le=0.5,
            description="of law cruise, and of the feeds of G-code: the share of the time for each of its ends",
        ),
    ] = 0.4
    steps: Annotated[Whole, Field(ge=2, le=100_000, description="intervals of the grid of the planner's optima")] = 100
    dense: Annotated[
        tuple[Annotated[Numbers, AfterValidator(_finer)], ...],
        Field(description="rows [from s, to s, factor]: where that grid is finer than elsewhere"),
    ] = ()

    @property
    def seconds(self) -> float:
        """The motion time [s], or one to begin with where the shortest is to be found."""
        return 1.0 if isinstance(self.duration, str) else self.duration
