"""How far the moving links of an arm are from obstacles and from each other, from a diagram of the evaluation's own.

Distances are those of Drake's SceneGraph, one pair of solids after the other. It is not relied upon alone: every
distance has a lower bound that never lies above the truth (`robot/separation.py`), by the normal that Drake gives or,
where the two do not meet, by Wolfe's algorithm. The solver's penalty comes from another diagram, with other calls
(`pipeline.model.clearance`); a test holds the two against each other and against another library.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder

from pipeline.common.arrays import Array
from pipeline.evaluation.plant import add_arm, weld
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles, Own
from pipeline.robot import solids
from pipeline.robot.separation import Solid, along, nearest
from pipeline.robot.shapes import Shape
from pipeline.robot.touching import groups

AGREES = 1e-6  # [m] between Drake's distance and its lower bound


@dataclass(frozen=True)
class Body:
    """One solid: its name (that of its link), how many joints carry it (0: none), Drake's body and geometry of it,
    what it is in the frame of that body, and the ball (center (3,), radius [m]) around it there.
    """

    name: str
    joints: int
    drake: Any
    geometry: Any
    solid: Solid
    center: Array
    radius: float


@dataclass(frozen=True)
class Pair:
    """Two solids of which the second is carried by more joints: those from `first.joints` on move it."""

    first: Body
    second: Body


class Clearance:
    """The pairs of solids of an arm among obstacles, and their distances: `obstacles` and `own` are lists of pairs."""

    def __init__(self, arm: Arm, obstacles: Obstacles | None, own: Own | None = None) -> None:
        builder = DiagramBuilder()
        self._plant, self._scene = AddMultibodyPlantSceneGraph(builder, 0.0)
        parts = add_arm(self._plant, arm.description, arm.mounting)
        weld(self._plant, parts.root, arm.mounting)
        around = () if obstacles is None else obstacles.shapes
        pairs = () if own is None else own.pairs
        named = {link for pair in pairs for link in pair}
        carried = groups(arm.description)
        links: dict[str, list[Body]] = {}
        for shape in arm.description.collision:
            if around or shape.frame in named:
                link = str(shape.frame)
                body = self._plant.GetBodyByName(arm.description.drake_name(link), parts.model)
                links.setdefault(link, []).append(self._add(body, shape, link, carried[link]))
        world = self._plant.world_body()
        others = [(self._add(world, shape, shape.name, 0), shape) for shape in around]
        self._plant.Finalize()
        moving = [body for link in links.values() for body in link if body.joints]
        self.obstacles = [
            Pair(other, body)
            for body in moving
            for other, shape in others
            if obstacles is not None and obstacles.keeps(body.name, shape)
        ]
        self.own = [Pair(a, b) for one, two in pairs for a in links.get(one, []) for b in links.get(two, [])]
        self.joints = parts.joints
        self._order = [joint.position_start() for joint in parts.joints]  # those of velocities too: one each
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        self._scene_context = self._scene.GetMyContextFromRoot(self._context)

    def _add(self, body: Any, shape: Shape, name: str, joints: int) -> Body:
        unique = f"{shape.name} {self._scene.model_inspector().num_geometries()}"
        geometry = self._plant.RegisterCollisionGeometry(
            body, solids.pose(shape), solids.solid(shape), unique, CoulombFriction()
        )
        solid = Solid.of(shape)
        return Body(name, joints, body, geometry, solid, solid.center, solid.reach(solid.center))

    def at(self, q: Array) -> None:
        """Put the arm at q (n,)."""
        positions = np.zeros(len(q))
        positions[self._order] = q
        self._plant.SetPositions(self._plant_context, positions)

    def slides(self, joint: int) -> bool:
        """Whether a joint slides."""
        return bool(self.joints[joint].type_name() == "prismatic")

    def axis(self, joint: int) -> Array:
        """The unit vector (3,) in the world that a joint turns about."""
        frame = self.joints[joint].frame_on_parent()
        turn = frame.CalcPoseInWorld(self._plant_context).rotation().matrix()
        return np.asarray(turn @ self.joints[joint].revolute_axis())

    def origins(self) -> Array:
        """Where each joint is (n, 3) [m] in the world."""
        frames = (joint.frame_on_parent() for joint in self.joints)
        return np.array([frame.CalcPoseInWorld(self._plant_context).translation() for frame in frames])

    def balls(self, bodies: list[Body]) -> Array:
        """The centres (B, 3) [m] of the balls around solids."""
        return np.array([body.drake.EvalPoseInWorld(self._plant_context) @ body.center for body in bodies])

    def apart(self, pair: Pair) -> tuple[float, float, Array]:
        """A lower and an upper bound [m] on the signed distance of a pair where the arm is now, and the unit vector
        (3,) from the first to the second that shows the lower one. They agree to a micrometre; where the solids
        overlap, both are Drake's.
        """
        first, second = self._placed(pair)
        if first.face is not None:
            low = along(first, second, first.face)
            return low, low, first.face
        if first.radius and second.radius:  # Drake may never come back from capsules whose ends meet
            return nearest(first, second)
        try:
            query = self._scene.get_query_output_port().Eval(self._scene_context)
            found = query.ComputeSignedDistancePairClosestPoints(pair.first.geometry, pair.second.geometry)
        except RuntimeError:  # what Drake's FCL cannot decide (Drake's issues 21673 and 21234)
            return nearest(first, second)
        normal = -np.asarray(found.nhat_BA_W)
        size = float(np.linalg.norm(normal))
        if not size > 0.5:
            return nearest(first, second)
        normal = normal / size
        low = along(first, second, normal)
        if found.distance < 0 and low < 0:
            return float(found.distance), float(found.distance), normal
        if found.distance - low <= AGREES:
            return min(low, found.distance), float(found.distance), normal
        return nearest(first, second)

    def _placed(self, pair: Pair) -> list[Solid]:
        poses = [body.drake.EvalPoseInWorld(self._plant_context) for body in (pair.first, pair.second)]
        solids = pair.first.solid, pair.second.solid
        return [s.moved(at.rotation().matrix(), at.translation()) for s, at in zip(solids, poses, strict=True)]

    def going(self, pair: Pair, n: Array, qd: Array, spans: tuple[float, ...]) -> float:
        """The least distance [m] that the unit vector n (3,), from the first to the second, shows at any of the `spans`
        [s] from now, if the points of the second went on as fast against the first as they go at the speeds qd (n,).
        """
        speeds = np.zeros(len(qd))
        speeds[self._order] = np.where(np.arange(len(qd)) < pair.first.joints, 0.0, qd)
        self._plant.SetVelocities(self._plant_context, speeds)
        first, second = self._placed(pair)
        origin = pair.second.drake.EvalPoseInWorld(self._plant_context).translation()
        speed = pair.second.drake.EvalSpatialVelocityInWorld(self._plant_context)
        shown = n @ (origin - first.support(n)) - first.radius
        turning, moving = np.cross(n, speed.rotational()), float(n @ speed.translational())
        found = np.inf
        for span in spans:
            # n (x + s (v + w x r)) with r = x - origin is n origin + s n v + r (n + s n x w)
            turned = n + span * turning
            size = float(np.sqrt(turned @ turned))
            reached = turned @ (second.support(-turned / size) - origin) - second.radius * size
            found = min(found, float(shown + span * moving + reached))
        return found

    def __call__(self, q: Array) -> Array:
        """The smallest distances (K,) [m] from obstacles at q (K, n): infinite without obstacles, nan where q is not
        finite.
        """
        return self.smallest(self.obstacles, q)

    def smallest(self, pairs: list[Pair], q: Array) -> Array:
        """The same (K,) [m] of some pairs."""
        if not pairs:
            return np.where(np.isfinite(q).all(axis=1), np.inf, np.nan)
        return np.array([self._smallest(pairs, one) if np.all(np.isfinite(one)) else np.nan for one in q])

    def _smallest(self, pairs: list[Pair], q: Array) -> float:
        """By the balls, pairs that are farther than one that has been looked at need not be."""
        self.at(q)
        bounds = self.bounds(pairs)
        least = np.inf
        for k in np.argsort(bounds):
            if bounds[k] >= least:
                break
            least = min(least, self.apart(pairs[k])[0])
        return float(least)

    def bounds(self, pairs: list[Pair]) -> Array:
        """Lower bounds (P,) [m] on the distances of pairs where the arm is now, by the balls around them."""
        bodies = list({id(body): body for pair in pairs for body in (pair.first, pair.second)}.values())
        place = dict(zip(map(id, bodies), self.balls(bodies), strict=True))
        gap = np.array([place[id(pair.first)] - place[id(pair.second)] for pair in pairs])
        radii = np.array([pair.first.radius + pair.second.radius for pair in pairs])
        return np.asarray(np.sqrt((gap * gap).sum(axis=1)) - radii)
