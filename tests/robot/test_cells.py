"""Arms as they stand in cells: hung from a ceiling, on rails and carts, beside another arm, with open grippers; each
against pinocchio and coal, which read the same file on their own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from pipeline.artifacts import scene
from pipeline.artifacts.recording.picture import picture
from pipeline.build.collision import make_own
from pipeline.build.problem import prepare
from pipeline.build.robot import load
from pipeline.common.errors import ConfigError
from pipeline.config.robot import CollisionConfig
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.plant import SinglePlant
from pipeline.model.arm import Arm
from pipeline.problem.problem import Problem
from pipeline.robot import urdf
from pipeline.robot.packages import find
from tests.support import composed

MOBILE = "robots/mobile4r.urdf"
CART = (f"robot.urdf={MOBILE}", "robot.end_effector=grasp", "robot.task=[x,y,z]", "timing.steps=8")
STANDS = ("robot.q_init=[0,0,0,0,0.6,1.2,0.6]", "path.direction=[0,1,0]", "path.length=0.1")
BAXTER = "package://example-robot-data/robots/baxter_description/urdf/baxter.urdf"
DOWN = {"right_s0": 0.4, "right_s1": -0.3, "right_e1": 0.8, "right_w1": 0.5}
RAIL = """<robot name="ur5_on_a_rail"><link name="ground"/><joint name="rail" type="prismatic"><parent link="ground"/>
<child link="{root}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1.5" velocity="0.5" effort="900"/></joint>"""


def configurations(arm: Arm, count: int, rng: np.random.Generator) -> Any:
    low, high = np.maximum(arm.description.lower, -1.5), np.minimum(arm.description.upper, 1.5)
    return rng.uniform(low, high, size=(count, arm.n))


def torques(model: Any, q: Any, v: Any, a: Any) -> Any:
    data = model.createData()
    return np.array([pin.rnea(model, data, *one) for one in zip(q, v, a, strict=True)])


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_from_a_ceiling_gravity_pulls_the_other_way(name: str, rng: np.random.Generator) -> None:
    rpy = "robot.base_rpy=[3.141592653589793,0.2,0.4]"
    robot = composed(f"robot={name}", rpy, "robot.base_position=[0.3,0,2.2]").robot
    arm = load(robot, "earth")
    model = pin.buildModelFromUrdf(str(find(robot.urdf)))
    beside = [i for i in range(1, model.njoints) if model.names[i] not in arm.description.joints]
    model = pin.buildReducedModel(model, beside, pin.neutral(model))
    up = Rotation.from_euler("xyz", robot.base_rpy).as_matrix().T
    model.gravity.linear = up @ np.array([0.0, 0.0, -9.80665])
    q, (v, a) = configurations(arm, 4, rng), rng.normal(size=(2, 4, arm.n))
    wanted = torques(model, q, v, a)
    np.testing.assert_allclose(arm.inverse_dynamics(q, v, a), wanted, atol=1e-9)
    plant = SinglePlant(arm)
    plant.at(q[0], v[0])
    np.testing.assert_allclose(plant.torque(a[0]), wanted[0], atol=1e-9)
    assert np.abs(wanted - torques_upright(model, q, v, a)).max() > 10.0


def torques_upright(model: Any, q: Any, v: Any, a: Any) -> Any:
    other = model.copy()
    other.gravity.linear = np.array([0.0, 0.0, -9.80665])
    return torques(other, q, v, a)


def test_an_arm_on_a_rail_has_metres_and_newtons(tmp_path: Path, rng: np.random.Generator) -> None:
    """A UR5 whose base slides: forces and places are pinocchio's."""
    text = find("package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf").read_text(encoding="utf-8")
    inner = text[text.index("<link") :]
    file = tmp_path / "rail.urdf"
    file.write_text(RAIL.format(root="world") + inner, encoding="utf-8")
    words = (f"robot.urdf={file}", "robot.end_effector=tool0", "robot.task=[x,y,z]", "robot.q_init=null")
    arm = load(composed(*words).robot)
    assert (arm.description.joints[0], arm.description.unit(0), arm.description.unit(1)) == ("rail", "m", "rad")
    assert (arm.description.lower[0], arm.description.upper[0], arm.description.velocity[0]) == (-1.0, 1.5, 0.5)
    model = pin.buildModelFromUrdf(str(file))
    model.gravity.setZero()
    q, (v, a) = configurations(arm, 4, rng), rng.normal(size=(2, 4, 7))
    np.testing.assert_allclose(arm.inverse_dynamics(q, v, a), torques(model, q, v, a), atol=1e-9)


def test_a_cart_drives_within_its_limits(rng: np.random.Generator) -> None:
    """The planar joint's x, y and yaw have the limits of limits.file; places and forces are pinocchio's."""
    problem = prepare(composed(*CART, *STANDS, "limits=joint", "limits.file=robots/mobile4r_limits.yaml"))
    arm, limits = problem.task.arm, problem.bounds
    assert arm.description.joints[:3] == ("drive_x", "drive_y", "drive_yaw")
    assert limits.lower[:3].tolist() == [-1.0, -0.5, -np.inf]
    assert limits.velocity[:4].tolist() == [0.8, 0.8, 1.0, 2.0]
    model = pin.buildModelFromUrdf(str(find(MOBILE)))
    model.gravity.setZero()
    data, q = model.createData(), rng.normal(size=(3, 7))
    v, a = rng.normal(size=(2, 3, 7))
    for k in range(3):
        turned = np.array([np.cos(q[k, 2]), np.sin(q[k, 2])])
        whole = np.array([*q[k, :2], *turned, *q[k, 3:]])
        pin.framesForwardKinematics(model, data, whole)
        tip = data.oMf[model.getFrameId("grasp")].translation
        np.testing.assert_allclose(arm.position(q[k : k + 1])[0], tip, atol=1e-12)
        # pinocchio's planar velocities are in the cart's own frame
        turn = np.array([[turned[0], -turned[1]], [turned[1], turned[0]]])
        rate = np.array([[0.0, 1.0], [-1.0, 0.0]]) * v[k, 2]
        own, speed = np.array(v[k]), turn.T @ v[k, :2]
        own[:2] = speed
        change = np.array(a[k])
        change[:2] = turn.T @ a[k, :2] + rate @ speed
        forces = np.array(pin.rnea(model, data, whole, own, change))
        forces[:2] = turn @ forces[:2]
        np.testing.assert_allclose(arm.inverse_dynamics(*(x[k : k + 1] for x in (q, v, a)))[0], forces, atol=1e-9)


def test_a_cart_is_drawn_and_can_be_a_rail() -> None:
    held = {"drive_y": 0.1, "drive_yaw": 0.0}
    description = urdf.read(find(MOBILE), "grasp", locked=held)
    assert description.joints == ("drive_x", "turret", "shoulder", "elbow", "wrist")
    xml, _ = picture(description)
    assert all(f'name="drive_{axis}"' in xml for axis in ("x", "y", "yaw"))
    assert "planar" not in xml


@pytest.mark.slow
def test_a_cart_may_touch_its_floor() -> None:
    """Where collision.allow says so, an obstacle's name in it; another name is refused."""
    words = (*CART, *STANDS)
    with pytest.raises(ConfigError, match=r"cart is 0\.01 m from obstacle floor.*collision\.allow=\[\[cart,floor\]\]"):
        prepare(composed(*words, "obstacles.floor=0.04"))
    for pair in ("[cart,floor]", "[floor,cart]"):
        problem = prepare(composed(*words, "obstacles.floor=0.04", f"collision.allow=[{pair}]"))
        near = Clearance(problem.task.arm, problem.obstacles)(problem.q_init[None])[0]
        assert near > 0.2  # of the column, which stands on the cart
    with pytest.raises(ConfigError, match=r"collision\.allow: no link is called flor; did you mean floor"):
        prepare(composed(*words, "obstacles.floor=0.04", "collision.allow=[[cart,flor]]"))


@cache
def in_coal(file: str, moving: tuple[str, ...], held: tuple[tuple[str, float], ...]) -> tuple[Any, Any]:
    """The file's arm and its collision shapes, meshes as hulls, other joints held; what mimics one is held as it."""
    path = find(file)
    model = pin.buildModelFromUrdf(str(path))
    solids = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[*map(str, path.parents)])
    q = pin.neutral(model)
    for name, value in held:
        q[model.joints[model.getJointId(name)].idx_q] = value
    beside = [i for i in range(1, model.njoints) if model.names[i] not in moving]
    model, solids = pin.buildReducedModel(model, solids, beside, q)
    for one in solids.geometryObjects:
        if isinstance(one.geometry, coal.BVHModelBase):
            one.geometry.buildConvexHull(True, "Qt")
            one.geometry = one.geometry.convex
    return model, solids


def least(model: Any, solids: Any, q: Any, pairs: Any) -> float:
    """The least distance [m] of the links of `pairs`, by the names of their links."""
    data, at = model.createData(), solids.createData()
    pin.updateGeometryPlacements(model, data, solids, at, q)
    of_link: dict[str, list[int]] = {}
    for i, one in enumerate(solids.geometryObjects):
        of_link.setdefault(model.frames[one.parentFrame].name, []).append(i)
    found = np.inf
    for first, second in pairs:
        for i in of_link[first]:
            for j in of_link[second]:
                poses = [coal.Transform3s(at.oMg[k].rotation, at.oMg[k].translation) for k in (i, j)]
                shapes = [solids.geometryObjects[k].geometry for k in (i, j)]
                request, answer = coal.DistanceRequest(True, True), coal.DistanceResult()
                found = min(found, coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, answer))
    return float(found)


@pytest.mark.slow
def test_the_other_arm_is_seen(rng: np.random.Generator) -> None:
    """Baxter's left arm moves, its right one is held and stands in the way: as coal sees it, held otherwise too."""
    for held in (DOWN, {"right_s0": -0.6}):
        description = urdf.read(find(BAXTER), "left_gripper", locked=held)
        arm = Arm(description)
        own = make_own(CollisionConfig(), arm)
        assert own is not None
        pairs = tuple(pair for pair in own.pairs if "right" in pair[0] + pair[1])
        assert {("right_lower_forearm", "left_lower_forearm"), ("right_wrist", "left_upper_shoulder")} <= set(pairs)
        clearance = Clearance(arm, None, replace(own, pairs=pairs))
        model, solids = in_coal(BAXTER, description.joints, tuple(held.items()))
        for q in configurations(arm, 1, rng):
            ours = clearance.smallest(clearance.own, q[None])[0]
            true = least(model, solids, q, pairs)
            assert ours == pytest.approx(true, abs=1e-5) or max(ours, true) < 0


@pytest.mark.parametrize("width", [0.0, 0.04])
def test_a_gripper_stands_at_its_width(width: float) -> None:
    """Both fingers, of which one mimics the other."""
    robot = composed("robot=panda", f"robot.locked={{panda_finger_joint1: {width}}}").robot
    arm, q = load(robot), np.array(robot.q_init)
    own = make_own(CollisionConfig(), arm)
    assert own is not None
    pairs = (("panda_link5", "panda_leftfinger"), ("panda_link5", "panda_rightfinger"))
    held = (("panda_finger_joint1", width), ("panda_finger_joint2", width))
    model, solids = in_coal(robot.urdf, arm.description.joints, held)
    for pair in pairs:
        clearance = Clearance(arm, None, replace(own, pairs=(pair,)))
        ours = clearance.smallest(clearance.own, q[None])[0]
        assert ours == pytest.approx(least(model, solids, q, [pair]), abs=1e-6)


@pytest.mark.slow
def test_other_limbs_are_drawn_where_they_are_held() -> None:
    """And the arm itself is not, nor fingers, nor what nobody could read."""
    arm = Arm(urdf.read(find(BAXTER), "left_gripper", locked=DOWN))
    own = make_own(CollisionConfig(), arm)
    assert own is not None
    drawn = scene.limbs(cast(Problem, SimpleNamespace(task=SimpleNamespace(arm=arm), own=own)))
    model, solids = in_coal(BAXTER, arm.description.joints, tuple(DOWN.items()))
    data, at = model.createData(), solids.createData()
    pin.updateGeometryPlacements(model, data, solids, at, np.zeros(7))
    there = {one.name: at.oMg[i].translation for i, one in enumerate(solids.geometryObjects)}
    assert any("right_wrist" in shape.name for shape in drawn)
    assert not any(shape.name.startswith("left") for shape in drawn)
    for shape in drawn:
        np.testing.assert_allclose(shape.position, there[shape.name], atol=1e-9)
    panda = load(composed("robot=panda").robot)
    assert panda.description.aside
    assert scene.limbs(cast(Problem, SimpleNamespace(task=SimpleNamespace(arm=panda), own=own))) == ()
    unknown = replace(own, unknown="a mesh is missing")
    assert scene.limbs(cast(Problem, SimpleNamespace(task=SimpleNamespace(arm=arm), own=unknown))) == ()
