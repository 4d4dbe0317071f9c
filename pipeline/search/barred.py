"""Places of a path at which no configuration keeps the position limits: where r = 1, by all loops of the manifold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.model.kernel.arm import on_kernel
from pipeline.problem.problem import Problem
from pipeline.search.self_motion import manifolds


@dataclass(frozen=True)
class Barred:
    """The worst of them at `time` [s], `place` [m] along the path: of all nodes there, `spacing` [rad] apart, the one
    nearest to the limits is `excess` [rad or m] beyond that of `joint`.
    """

    time: float
    place: float
    excess: float
    joint: str
    spacing: float

    @property
    def sentence(self) -> str:
        return (
            f"at {self.place:.4g} m along the path no configuration keeps the position limits: the nearest is "
            f"{self.excess:.3g} beyond that of {self.joint} (all loops of the self-motion manifold, nodes "
            f"{self.spacing:.2g} rad apart)"
        )


def barred(problem: Problem, times: Array, nodes: int) -> Barred | None:
    """The worst place at the knots `times` (N + 1,); for r = 1. None: there is none, or not all loops could be traced.
    The excess must be more than what lies between two nodes could take away.
    """
    task, reference = on_kernel(problem.task), problem.reference
    x = reference.position(times)
    try:
        loops = manifolds(task, x, np.random.default_rng(0), nodes=nodes, seeds=problem.q_init[None])
    except PathError:
        return None
    worst: Barred | None = None
    for t, here in zip(times, loops, strict=True):
        beyond = _beyond(problem, np.concatenate([loop.q for loop in here]))
        node, spacing = int(beyond.max(axis=1).argmin()), max(loop.length / len(loop.q) for loop in here)
        excess, joint = float(beyond[node].max()), int(beyond[node].argmax())
        # A joint moves by no more than the arc length to the next node, half of it from one of the two.
        if excess > spacing / 2 and (worst is None or excess > worst.excess):
            place = float(reference.timing.sample(np.array([t]), reference.geometry.length)[0][0])
            name = task.arm.description.joints[joint]
            worst = Barred(float(t), place, excess, name, spacing)
    return worst


def _beyond(problem: Problem, q: Array) -> Array:
    """By how much (K, n) each joint is outside its limits, whole turns not counted."""
    bounds, turning = problem.bounds, problem.task.arm.description.revolute
    turns = np.where(turning, 2 * np.pi, 0.0) * np.array([-1.0, 0.0, 1.0])[:, None, None]
    return np.asarray(np.maximum(np.maximum(bounds.lower - q - turns, q + turns - bounds.upper), 0.0).min(axis=0))
