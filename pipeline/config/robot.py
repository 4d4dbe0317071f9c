"""Groups `robot`, `base`, `obstacles` and `collision`: the arm, what it stands on, the solids around it, and itself."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.fields import Name, Number, OneOrList, Pose, Switch, Text, Vector, WordOrTable, Words, schema

Position = Annotated[Number, Field(ge=-1e4, le=1e4)]  # [rad or m] of a joint: a sine is exact there
Positions = tuple[Position, ...]
Positive = Annotated[Number, Field(gt=0)]
Edges = Annotated[tuple[Positive, ...], Field(min_length=3, max_length=3)]
Momentum = Annotated[tuple[Annotated[Number, Field(ge=-1e6, le=1e6)], ...], Field(min_length=3, max_length=3)]
Pair = Annotated[tuple[Text, ...], Field(min_length=2, max_length=2)]
ORIGIN = (0.0, 0.0, 0.0)


@schema
class SphereConfig:
    """A sphere."""

    kind: Literal["sphere"] = "sphere"
    center: Annotated[Vector, Field(description="[m] centre")] = ORIGIN
    radius: Annotated[Positive, Field(description="[m] radius")] = 0.1


@schema
class BoxConfig:
    """A box: its edges, and roll, pitch, yaw."""

    kind: Literal["box"] = "box"
    center: Annotated[Vector, Field(description="[m] centre")] = ORIGIN
    size: Annotated[Edges, Field(description="[m] edges")] = (0.1, 0.1, 0.1)
    rpy: Annotated[Vector, Field(description="[rad] roll, pitch, yaw")] = ORIGIN


@schema
class CapsuleConfig:
    """All points within `radius` of the segment from start to end."""

    kind: Literal["capsule"] = "capsule"
    start: Annotated[Vector, Field(description="[m] one end of the segment")] = ORIGIN
    end: Annotated[Vector, Field(description="[m] the other end")] = (0.0, 0.0, 0.1)
    radius: Annotated[Positive, Field(description="[m] distance from the segment")] = 0.1


@schema
class CylinderConfig:
    """A cylinder along its z axis."""

    kind: Literal["cylinder"] = "cylinder"
    center: Annotated[Vector, Field(description="[m] centre")] = ORIGIN
    radius: Annotated[Positive, Field(description="[m] radius")] = 0.1
    length: Annotated[Positive, Field(description="[m] length")] = 0.1
    rpy: Annotated[Vector, Field(description="[rad] roll, pitch, yaw")] = ORIGIN


@schema
class MeshConfig:
    """The convex hull of a mesh file."""

    file: Annotated[Text, Field(description="STL, OBJ, DAE, PLY or GLB: a path, or package://package/file")]
    kind: Literal["mesh"] = "mesh"
    scale: Annotated[Edges, Field(description="of the file's x, y, z; 0.001 each of a file in mm")] = (1.0, 1.0, 1.0)
    center: Annotated[Vector, Field(description="[m] where its origin is")] = ORIGIN
    rpy: Annotated[Vector, Field(description="[rad] roll, pitch, yaw")] = ORIGIN


Shape = Annotated[SphereConfig | BoxConfig | CapsuleConfig | CylinderConfig | MeshConfig, Field(discriminator="kind")]


@schema
class RobotConfig:
    """Group `robot`: the description, the end effector, what of it is prescribed, and where the arm starts."""

    name: Annotated[Name, Field(description="of the robot, in tables and figures")] = "planar3r"
    urdf: Annotated[
        Text, Field(description="URDF, SDF or MJCF file: a path, one of robots/, or package://package/file")
    ] = "robots/planar3r.urdf"
    base: Annotated[Text | None, Field(description="first link of the chain; null: the root link")] = None
    end_effector: Annotated[Text, Field(description="last link of the chain")] = "tip"
    offset: Annotated[Pose, Field(description="[m] end-effector frame in that link")] = ORIGIN
    offset_rpy: Annotated[Pose, Field(description="[rad] its roll, pitch, yaw there")] = ORIGIN
    base_position: Annotated[Pose, Field(description="[m] where the root link stands")] = ORIGIN
    base_rpy: Annotated[Pose, Field(description="[rad] roll, pitch, yaw of the root link")] = ORIGIN
    payload: Annotated[Number, Field(ge=0, le=1e6, description="[kg] point mass at the end effector")] = 0.0
    armature: Annotated[
        OneOrList[Annotated[Number, Field(ge=0, le=1e6)]],
        Field(description="[kg m^2] rotor inertia as the joints feel it, one or one per joint"),
    ] = 0.0
    task: Annotated[
        Words[Literal["x", "y", "z"]], Field(description="prescribed world coordinates of the end effector")
    ] = ("x", "y")
    orientation: Annotated[
        Literal["none", "full", "pointing"],
        Field(description="what of the orientation is prescribed; pointing: the direction of the axis `pointing`"),
    ] = "none"
    pointing: Annotated[Vector, Field(description="axis in the end effector's frame")] = (0.0, 0.0, 1.0)
    collision: Annotated[
        WordOrTable[Literal["file"], dict[str, tuple[Shape, ...]]],
        Field(
            description="file: the shapes of the file, meshes as their hulls; or in their place "
            "{link: [{kind: sphere, box, capsule, cylinder or mesh, ...}, ...]}"
        ),
    ] = "file"
    tool: Annotated[
        tuple[Shape, ...],
        Field(
            description="[{kind: sphere, box, capsule, cylinder or mesh, ...}, ...] fixed to the link end_effector, in "
            "its frame: a tool, or what a gripper holds; nothing but a shape, its mass is payload's"
        ),
    ] = ()
    srdf: Annotated[
        Text | None, Field(description="SRDF that comes with the file: which links may touch; null: none")
    ] = None
    q_init: Annotated[
        Positions | None,
        Field(
            description="[rad] initial configuration, base to tip; null: of a path that says where in the world it is, "
            "the best one, sought in the whole joint space; of others the middle of the joints' ranges"
        ),
    ] = (
        0.0,
        0.327,
        -0.754,
    )
    limits: Annotated[
        Text | None,
        Field(
            description="joint_limits.yaml of ROS 2 with its largest accelerations: they hold where the joints rest at "
            "an end, unless limits.acceleration or limits.file states others"
        ),
    ] = None
    locked: Annotated[
        dict[str, Position] | None, Field(description="{joint: position [rad or m], ...} of joints that are held")
    ] = None
    repair_inertia: Annotated[
        Switch, Field(description="whether inertias that no body can have give way to the nearest possible ones")
    ] = False
    unlimited: Annotated[
        tuple[Literal["velocity", "effort"], ...],
        Field(description="of which limits of zero in the file mean that there is none"),
    ] = ()


@schema
class FixedBaseConfig:
    """`base=fixed`: the root link stands where robot.base_position puts it."""

    kind: Literal["fixed"] = "fixed"


@schema
class FreeBaseConfig:
    """`base=free`: the root link is bolted to a spacecraft that floats; its pose at the start is robot.base_position's.

    mass, inertia and com are those of the spacecraft, beside the root link's own; null: the root link is the base.
    inertia: one moment for all axes, three, or ixx, iyy, izz, ixy, ixz, iyz, about com in the frame of the root link.
    """

    kind: Literal["free"] = "free"
    mass: Annotated[
        Positive | None,
        Field(description="[kg] of the spacecraft, beside the root link's own; null: the root link is the base"),
    ] = None
    inertia: Annotated[
        OneOrList[Number],
        Field(description="[kg m^2] about com in the root link's frame: one, [ixx, iyy, izz], or [..., ixy, ixz, iyz]"),
    ] = 0.0
    com: Annotated[Pose, Field(description="[m] centre of mass of the spacecraft in that frame")] = ORIGIN
    linear_momentum: Annotated[Momentum, Field(description="[N s] of the whole system, in the world")] = ORIGIN
    angular_momentum: Annotated[
        Momentum, Field(description="[N m s] of it, about the place where the root link starts")
    ] = ORIGIN


@schema
class ObstaclesConfig:
    """Group `obstacles`: solids in the world, by name, and the clearance that moving links keep from them."""

    margin: Annotated[Positive, Field(description="[m] least distance of a moving link")] = 0.02
    influence: Annotated[
        Positive, Field(description="[m] beyond the margin, from where on the solver feels an obstacle")
    ] = 0.05
    shapes: Annotated[
        dict[str, Shape],
        Field(description="{name: {kind: sphere, box, capsule, cylinder or mesh, ...}, ...} in the world"),
    ] = field(default_factory=dict)
    file: Annotated[
        Text | None,
        Field(description="SDF (a world too) or URDF of what stands still, in the world; null: none"),
    ] = None
    floor: Annotated[
        Position | None, Field(description="[m] height of a floor: all below it is solid; null: there is none")
    ] = None

    @property
    def any(self) -> bool:
        """Whether there is something to be clear of."""
        return bool(self.shapes) or self.file is not None or self.floor is not None


@schema
class CollisionConfig:
    """Group `collision`: the arm and itself. Pairs of links that are joined to each other may always touch."""

    own: Annotated[
        Switch | None,
        Field(
            alias="self",
            description="whether motions keep the arm clear of itself; null: if it moves in space and has shapes",
        ),
    ] = None
    margin: Annotated[Positive, Field(description="[m] least distance of two links")] = 0.005
    influence: Annotated[
        Positive, Field(description="[m] beyond the margin, from where on the solver feels another link")
    ] = 0.05
    srdf: Annotated[
        Text | None,
        Field(
            description="SRDF whose disable_collisions say which links may touch; null: robot.srdf; none: of no file"
        ),
    ] = None
    allow: Annotated[
        tuple[Pair, ...],
        Field(description="[[link, link or obstacle], ...] that may touch, besides those of the SRDF"),
    ] = ()
