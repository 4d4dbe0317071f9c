"""How far the moving links of an arm are from obstacles: what the evaluation says of it, from a diagram of its own.

It asks Drake's SceneGraph for one pair of solids after the other. The solver's penalty comes from another diagram, with
other calls (`pipeline.model.clearance`); a test holds the two against each other and against distances of segments.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from pydrake.geometry import Box, Capsule, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.evaluation.plant import add_arm, weld
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.robot.shapes import Shape


class Clearance:
    """The smallest signed distance [m] between a moving link and an obstacle; between links themselves none counts."""

    def __init__(self, arm: Arm, obstacles: Obstacles | None) -> None:
        builder = DiagramBuilder()
        self._plant, self._scene = AddMultibodyPlantSceneGraph(builder, 0.0)
        parts = add_arm(self._plant, arm.description, arm.mounting)
        weld(self._plant, parts.root, arm.mounting)
        solids = () if obstacles is None else obstacles.shapes
        shapes = arm.description.collision if solids else ()
        bodies = [
            self._plant.GetBodyByName(arm.description.drake_name(str(shape.frame)), parts.model) for shape in shapes
        ]
        links = [
            self._add(body, shape, f"link {i}") for i, (body, shape) in enumerate(zip(bodies, shapes, strict=True))
        ]
        others = [self._add(self._plant.world_body(), shape, f"obstacle {i}") for i, shape in enumerate(solids)]
        self._plant.Finalize()
        moving = [link for link, body in zip(links, bodies, strict=True) if not self._plant.IsAnchored(body)]
        self._pairs = list(product(moving, others))
        self._order = [joint.position_start() for joint in parts.joints]
        diagram = builder.Build()
        self._diagram, self._context = diagram, diagram.CreateDefaultContext()
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        self._scene_context = self._scene.GetMyContextFromRoot(self._context)

    def _add(self, body: Any, shape: Shape, name: str) -> Any:
        pose = RigidTransform(RotationMatrix(Rotation.from_rotvec(shape.rotation).as_matrix()), shape.position)
        kind: Any = {"sphere": Sphere, "box": Box, "capsule": Capsule}[shape.kind]
        return self._plant.RegisterCollisionGeometry(body, pose, kind(*shape.size), name, CoulombFriction())

    def __call__(self, q: Array) -> Array:
        """The distances (K,) at q (K, n): infinite if there is nothing to keep clear of, nan where q is not finite."""
        if not self._pairs:
            return np.where(np.isfinite(q).all(axis=1), np.inf, np.nan)
        return np.array([self._smallest(one) if np.all(np.isfinite(one)) else np.nan for one in q])

    def _smallest(self, q: Array) -> float:
        positions = np.zeros(len(q))
        positions[self._order] = q
        self._plant.SetPositions(self._plant_context, positions)
        query = self._scene.get_query_output_port().Eval(self._scene_context)
        distances = (query.ComputeSignedDistancePairClosestPoints(*pair).distance for pair in self._pairs)
        return float(min(distances, default=np.inf))
