"""What Drake made of the frames of a file: its bodies and joints as the links and joints of a `Tree`.

Every joint keeps its name, and every link its own frame: where that is not the joint's frame, a massless link between
them carries the difference.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PlanarJoint, PrismaticJoint, RevoluteJoint, WeldJoint

from pipeline.robot.numbers import Vector
from pipeline.robot.tree import Joint, Link, Tree

KINDS = {RevoluteJoint: "revolute", PrismaticJoint: "prismatic", WeldJoint: "fixed", PlanarJoint: "planar"}


def made(tree: Tree, xml: str, kind: str, packages: Mapping[str, str]) -> tuple[Any, list[Any]]:
    """The plant of a file's text, and its models; raises RobotError with Drake's reason."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    known: PackageMap = parser.package_map()
    for name, folder in packages.items():
        if not known.Contains(name):
            known.Add(name, folder)
    try:
        with _quiet():
            models = parser.AddModelsFromString(xml, kind)
    except RuntimeError as error:
        raise tree.fail(" ".join(str(error).split())) from None
    plant.Finalize()
    return plant, models


@contextmanager
def _quiet() -> Iterator[None]:
    """What Drake warns of is either refused here, in one line, or does not matter."""
    log = logging.getLogger("drake")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


def fill(tree: Tree, plant: Any, models: list[Any], name: Callable[[Any], str], links: Mapping[str, Link]) -> None:
    """Put the bodies and joints of some models into `tree`. name: what a body or joint is called there; links: what
    the file says of a link.
    """
    bodies = [plant.get_body(index) for model in models for index in plant.GetBodyIndices(model)]
    for body in bodies:
        tree.add_link(links.get(name(body), Link(name(body))))
    for joint in (plant.get_joint(index) for model in models for index in plant.GetJointIndices(model)):
        if joint.parent_body().index() == plant.world_body().index():
            if isinstance(joint, WeldJoint):
                continue  # the root's place is ours to give (robot.base_position)
            if joint.name() == joint.child_body().name() or joint.type_name() == "quaternion_floating":
                continue  # the free joint of a model that stands nowhere
            if "world" not in tree.links:
                tree.links = {"world": Link("world"), **tree.links}
        _add(tree, joint, name)


def _add(tree: Tree, joint: Any, name: Callable[[Any], str]) -> None:
    kind = next((word for cls, word in KINDS.items() if isinstance(joint, cls)), joint.type_name())
    called, child = name(joint), name(joint.child_body())
    before = joint.frame_on_parent().GetFixedPoseInBodyFrame()
    after = joint.frame_on_child().GetFixedPoseInBodyFrame().inverse()
    between = child
    if kind == "fixed":
        before = before @ joint.X_FM() @ after
    elif not after.IsNearlyIdentity(1e-12):
        between = f"{child} (frame of {called})"
    axis: Vector = (0.0, 0.0, 1.0)
    limit: dict[str, str] = {}
    if kind in ("revolute", "prismatic"):
        axis = tuple((joint.revolute_axis() if kind == "revolute" else joint.translation_axis()).tolist())
        limit = {"lower": repr(float(joint.position_lower_limits()[0]))}
        limit["upper"] = repr(float(joint.position_upper_limits()[0]))
    tree.add_joint(Joint(called, kind, name(joint.parent_body()), between, *pose(before), axis, limit))
    if between != child:
        tree.add_link(Link(between))
        tree.add_joint(Joint(f"{called}__frame", "fixed", between, child, *pose(after)))


def pose(transform: RigidTransform) -> tuple[Vector, Vector]:
    """xyz [m] and rpy [rad] of a transform."""
    return tuple(transform.translation().tolist()), tuple(RollPitchYaw(transform.rotation()).vector().tolist())
