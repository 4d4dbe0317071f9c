"""How far the arm's links are from obstacles and from each other: signed distances from Drake's SceneGraph."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles, Own
from pipeline.model.stack import assemble
from pipeline.robot.shapes import Shape
from pipeline.robot.solids import pose, solid


@dataclass(frozen=True)
class Close:
    """Two solids and their signed distance [m], and the limit that it comes under: `clearance` from obstacles or
    `self_clearance`, and its margin [m].
    """

    kind: str
    margin: float
    distance: float
    first: str
    second: str


@dataclass(frozen=True)
class Kind:
    """Pairs of solids that keep one margin: a context of their own, in which no other pairs are looked at."""

    name: str
    margin: float
    influence: float
    context: Any
    plant_context: Any


class Clearance:
    """The arm's moving links among obstacles, and, where that is kept, among each other."""

    def __init__(self, arm: Arm, obstacles: Obstacles | None, own: Own | None = None) -> None:
        description, solids = arm.description, () if obstacles is None else obstacles.shapes
        pairs = own.pairs if own is not None and own.kept else ()
        named = {link for pair in pairs for link in pair}
        shapes = [shape for shape in description.collision if solids or shape.frame in named]
        builder = DiagramBuilder()
        self.plant, self.scene = AddMultibodyPlantSceneGraph(builder, 0.0)
        model, _ = assemble(self.plant, Parser(self.plant), description, arm.mounting)
        self.names: dict[Any, str] = {}
        self.links: dict[str, list[Any]] = {}
        bodies = [self.plant.GetBodyByName(description.drake_name(str(shape.frame)), model) for shape in shapes]
        for body, shape in zip(bodies, shapes, strict=True):
            self.links.setdefault(str(shape.frame), []).append(self._register(body, shape, str(shape.frame)))
        others = [self._register(self.plant.world_body(), shape, shape.name) for shape in solids]
        self.others = dict(zip(others, solids, strict=True))
        self.plant.Finalize()
        self.diagram = builder.Build()
        every = [geometry for link in self.links.values() for geometry in link]
        self.kinds: list[Kind] = []
        # Drake leaves out pairs that cannot move against each other: the base and the obstacles.
        if obstacles is not None and solids and not all(self.plant.IsAnchored(body) for body in bodies):
            within = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(every))
            for link, own_solids in self.links.items():
                may = [one for one, shape in self.others.items() if not obstacles.keeps(link, shape)]
                within.ExcludeBetween(GeometrySet(own_solids), GeometrySet(may))
            self.kinds.append(self._kind("clearance", obstacles.margin, obstacles.influence, within))
        if own is not None and pairs:
            only = CollisionFilterDeclaration().ExcludeWithin(GeometrySet([*every, *others]))
            for first, second in pairs:
                only.AllowBetween(*(GeometrySet(self.links.get(link, [])) for link in (first, second)))
            self.kinds.append(self._kind("self_clearance", own.margin, own.influence, only))

    def _register(self, body: Any, shape: Shape, name: str) -> Any:
        unique = f"{name}_{len(self.names)}"
        friction = CoulombFriction()
        geometry = self.plant.RegisterCollisionGeometry(body, pose(shape), solid(shape), unique, friction)
        self.names[geometry] = name
        return geometry

    def _kind(self, name: str, margin: float, influence: float, pairs: CollisionFilterDeclaration) -> Kind:
        context = self.diagram.CreateDefaultContext()
        self.scene.collision_filter_manager(self.scene.GetMyMutableContextFromRoot(context)).Apply(pairs)
        return Kind(name, margin, influence, context, self.plant.GetMyMutableContextFromRoot(context))

    def clear(self, q: Array) -> NDArray[np.bool_]:
        """Whether every margin is kept at q (K, n): (K,)."""
        return np.array([not any(True for kind in self.kinds for _ in self._within(kind, one)) for one in q], bool)

    def _within(self, kind: Kind, q: Array, extent: float | None = None) -> Iterator[Any]:
        """Drake's pairs that are nearer than `extent` [m], by default the margin."""
        self.plant.SetPositions(kind.plant_context, q)
        query = self.scene.get_query_output_port().Eval(self.scene.GetMyContextFromRoot(kind.context))
        found = query.ComputeSignedDistancePairwiseClosestPoints(kind.margin if extent is None else extent)
        return (pair for pair in found if extent is not None or pair.distance < kind.margin)

    def _named(self, pair: Any) -> tuple[str, str]:
        """The link first, an obstacle or the later link second."""
        names = self.names[pair.id_A], self.names[pair.id_B]
        order = [*self.links, *self.names.values()]
        return names if order.index(names[0]) <= order.index(names[1]) else names[::-1]

    def closest(self, q: Array) -> list[Close]:
        """Of each kind the closest pair at q (n,)."""
        found = []
        for kind in self.kinds:
            nearest = min(self._within(kind, q, np.inf), key=lambda pair: float(pair.distance))
            found.append(Close(kind.name, kind.margin, float(nearest.distance), *self._named(nearest)))
        return found

    def distances(self, q: Array, extent: float) -> Array:
        """The least signed distance [m] of any kind at q (K, n): (K,); `extent` where nothing is nearer."""
        found = [[float(pair.distance) for kind in self.kinds for pair in self._within(kind, one, extent)] for one in q]
        return np.array([min(some, default=extent) for some in found])

    def rows(self, extra: float = 0.0) -> list[Rows]:
        """Of each kind the constraint that every distance is at least the margin and `extra` [m], one row per knot."""
        return [
            Rows(
                self,
                kind.name,
                MinimumDistanceLowerBoundConstraint(
                    self.plant, kind.margin + extra, kind.plant_context, influence_distance_offset=kind.influence
                ),
            )
            for kind in self.kinds
        ]


class Rows:
    """Drake's smooth penalty of the closest pairs: at most 1 where all keep their distance; its exact derivative."""

    UPPER = 1.0

    def __init__(self, clearance: Clearance, kind: str, constraint: Any) -> None:
        self._keep_alive, self.kind, self._constraint = clearance, kind, constraint

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
