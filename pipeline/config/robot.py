"""Groups `robot`, `base` and `obstacles`: the arm, what it stands on, and the solids around it."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.config.fields import (
    any_number,
    choice,
    choices,
    fixed,
    mapping,
    number,
    numbers,
    per_joint,
    switch,
    table_of,
    text,
    texts,
)


@dataclass(frozen=True)
class SphereConfig:
    """A sphere."""

    kind: str = fixed("sphere")
    center: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    radius: float = number(0.1, above=0, unit="m")


@dataclass(frozen=True)
class BoxConfig:
    """A box: its edges, and roll, pitch, yaw."""

    kind: str = fixed("box")
    center: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    size: list[float] = numbers([0.1, 0.1, 0.1], length=3, above=0, unit="m")
    rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")


@dataclass(frozen=True)
class CapsuleConfig:
    """All points within `radius` of the segment from start to end."""

    kind: str = fixed("capsule")
    start: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    end: list[float] = numbers([0.0, 0.0, 0.1], length=3, unit="m")
    radius: float = number(0.1, above=0, unit="m")


SHAPES = {"sphere": SphereConfig, "box": BoxConfig, "capsule": CapsuleConfig}


@dataclass(frozen=True)
class RobotConfig:
    """Group `robot`: the description, the end effector, what of it is prescribed, and where the arm starts."""

    name: str = text("planar3r")
    urdf: str = text("robots/planar3r.urdf")
    base: str | None = text(None)
    end_effector: str = text("tip")
    offset: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    offset_rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")
    base_position: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    base_rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")
    payload: float = number(0.0, low=0, unit="kg")
    armature: float | list[float] = per_joint(0.0, low=0, unit="kg m^2")
    task: list[str] = choices(["x", "y"], "x", "y", "z")
    orientation: str = choice("none", "none", "full", "pointing")
    pointing: list[float] = numbers([0.0, 0.0, 1.0], length=3)
    collision: dict[str, list[SphereConfig | BoxConfig | CapsuleConfig]] | None = table_of(SHAPES, listed=True)
    q_init: list[float] | None = numbers([0.0, 0.327, -0.754], unit="rad", optional=True)
    locked: dict[str, float] | None = mapping(any_number, optional=True)
    repair_inertia: bool = switch(False)
    unlimited: list[str] = texts()


@dataclass(frozen=True)
class FixedBaseConfig:
    """`base=fixed`: the root link stands where robot.base_position puts it."""

    kind: str = fixed("fixed")


@dataclass(frozen=True)
class FreeBaseConfig:
    """`base=free`: the root link is bolted to a spacecraft that floats; its pose at the start is robot.base_position's.

    mass, inertia and com are those of the spacecraft, beside the root link's own; null: the root link is the base.
    inertia: one moment for all axes, three, or ixx, iyy, izz, ixy, ixz, iyz, about com in the frame of the root link.
    """

    kind: str = fixed("free")
    mass: float | None = number(None, above=0, unit="kg")
    inertia: float | list[float] = per_joint(0.0, unit="kg m^2")
    com: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    linear_momentum: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="N s")
    angular_momentum: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="N m s")


@dataclass(frozen=True)
class ObstaclesConfig:
    """Group `obstacles`: solids in the world, by name, and the clearance that moving links keep from them."""

    margin: float = number(0.02, above=0, unit="m")
    influence: float = number(0.05, above=0, unit="m")
    shapes: dict[str, SphereConfig | BoxConfig | CapsuleConfig] = table_of(SHAPES)
