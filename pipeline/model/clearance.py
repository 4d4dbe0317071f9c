"""How far the arm's links are from obstacles: signed distances and their derivatives, from Drake's SceneGraph."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.geometry import Box, Capsule, CollisionFilterDeclaration, GeometrySet, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.model.stack import assemble
from pipeline.robot.shapes import Shape

FAR = 1e3  # [m] what a clearance is where there is nothing to be clear of


class Clearance:
    """The arm's moving links among obstacles. Distances between the links themselves do not count."""

    def __init__(self, arm: Arm, obstacles: Obstacles) -> None:
        self.arm, self.obstacles = arm, obstacles
        description = arm.description
        builder = DiagramBuilder()
        self.plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
        model, _ = assemble(self.plant, Parser(self.plant), description, arm.mounting)
        self.names: dict[Any, str] = {}
        bodies = [
            self.plant.GetBodyByName(description.drake_name(str(shape.frame)), model) for shape in description.collision
        ]
        links = [
            self._register(body, shape, str(shape.frame))
            for body, shape in zip(bodies, description.collision, strict=True)
        ]
        for shape in obstacles.shapes:
            self._register(self.plant.world_body(), shape, shape.name)
        self.plant.Finalize()
        self.link_ids = set(links)
        scene.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(links)))
        self.scene, self.diagram = scene, builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        # Drake leaves out pairs that cannot move against each other: the base and the obstacles.
        self.any = bool(obstacles.shapes) and not all(self.plant.IsAnchored(body) for body in bodies)

    def _register(self, body: Any, shape: Shape, name: str) -> Any:
        pose = RigidTransform(RotationMatrix(Rotation.from_rotvec(shape.rotation).as_matrix()), shape.position)
        solid = {"sphere": Sphere, "box": Box, "capsule": Capsule}[shape.kind](*shape.size)
        unique = f"{name}_{len(self.names)}"
        geometry = self.plant.RegisterCollisionGeometry(body, pose, solid, unique, CoulombFriction())
        self.names[geometry] = name
        return geometry

    def smallest(self, q: Array) -> Array:
        """The smallest signed distance (K,) [m] between a link and an obstacle at q (K, n)."""
        return np.array([self.closest(one)[0] for one in q])

    def closest(self, q: Array) -> tuple[float, str, str]:
        """That distance at q (n,), and the names of the link and of the obstacle."""
        if not self.any:
            return FAR, "", ""
        self.plant.SetPositions(self.plant_context, q)
        query = self.scene.get_query_output_port().Eval(self.scene.GetMyContextFromRoot(self.context))
        nearest = min(query.ComputeSignedDistancePairwiseClosestPoints(), key=lambda pair: pair.distance)
        first, second = nearest.id_A, nearest.id_B
        if first not in self.link_ids:
            first, second = second, first
        return float(nearest.distance), self.names[first], self.names[second]

    def rows(self, extra: float = 0.0) -> Rows:
        """The constraint that every distance is at least the margin and `extra` [m], one row per knot."""
        bound = self.obstacles.margin + extra
        constraint = MinimumDistanceLowerBoundConstraint(
            self.plant, bound, self.plant_context, influence_distance_offset=self.obstacles.influence
        )
        return Rows(self, constraint)


class Rows:
    """Drake's smooth penalty of the closest pairs: at most 1 where all keep their distance; its exact derivative."""

    UPPER = 1.0

    def __init__(self, clearance: Clearance, constraint: Any) -> None:
        self._keep_alive, self._constraint = clearance, constraint

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Values (K,) and their derivatives (K, n) at q (K, n)."""
        values, gradients = np.empty(len(q)), np.zeros_like(q)
        for i, one in enumerate(q):
            y = self._constraint.Eval(InitializeAutoDiff(one).ravel())
            values[i] = ExtractValue(y)[0, 0]
            gradient = ExtractGradient(y)
            if gradient.size:  # far from everything it is empty
                gradients[i] = gradient[0]
        return values, gradients
