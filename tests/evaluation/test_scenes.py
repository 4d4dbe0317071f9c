"""Every kind of solid around an arm that carries a tool: the certified clearance against many samples in coal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.collision import make_own
from pipeline.build.robot import load
from pipeline.config.robot import BoxConfig, CollisionConfig, CylinderConfig
from pipeline.evaluation import certified
from pipeline.evaluation.clearance import Clearance
from pipeline.model import clearance as solver
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.model.places import Places
from pipeline.robot.shapes import SLAB, Shape
from pipeline.robot.touching import groups
from tests.coal_solids import least
from tests.support import BALL, BOX, ROD, composed

SOLIDS = (
    replace(BALL, position=(0.3, 0.6, 0.6)),
    BOX,
    ROD,
    Shape("drum", "cylinder", (0.1, 0.3), (0.5, 0.3, 0.2), (0.4, 0.2, 0.0)),
    Shape("part", "mesh", (3.0, 3.0, 3.0), (0.7, 0.1, 0.1), (0.5, 0.0, 0.3)),  # the hand, enlarged
    Shape("floor", "half_space", SLAB, (0.0, 0.0, 0.02)),
    Shape("slope", "half_space", SLAB, (0.0, 0.9, 0.0), (0.9, 0.0, 0.0)),
)
KNOTS = np.linspace(0.0, 1.0, 5)


@pytest.fixture(scope="module")
def arm() -> Arm:
    """The Panda with a bar across a rod in its hand."""
    tool = (CylinderConfig(center=(0.0, 0.0, 0.12), radius=0.015, length=0.1), BoxConfig(size=(0.3, 0.03, 0.03)))
    return load(replace(composed("robot=panda").robot, tool=tool))


@pytest.fixture(scope="module")
def curve() -> CubicSpline:
    start = np.array(composed("robot=panda").robot.q_init)
    steps = np.random.default_rng(5).normal(size=(4, 7)) * 0.15
    return CubicSpline(KNOTS, start + np.vstack([np.zeros(7), np.cumsum(steps, axis=0)]))


@pytest.mark.slow
@pytest.mark.parametrize("shape", SOLIDS, ids=lambda shape: shape.name)
def test_the_bound_holds_for_every_kind(shape: Shape, arm: Arm, curve: CubicSpline) -> None:
    """Never above what coal finds, and hardly below; the solver measures the same."""
    hand = next(own for own in arm.description.collision if own.frame == "panda_hand")
    shape = replace(shape, file=hand.file) if shape.kind == "mesh" else shape
    among = Obstacles((shape,), 0.02)
    clearance, places, carried = Clearance(arm, among), Places(arm), groups(arm.description)
    found = certified.closest(clearance, clearance.obstacles, curve, KNOTS)
    moving = [own for own in arm.description.collision if carried[str(own.frame)]]
    times = np.append(np.linspace(0.0, 1.0, 5), found.time)
    true = [least(moving, places(q), (shape,)) for q in curve(times)]
    assert found.bound <= min(true) + 1e-6
    assert min(true) == pytest.approx(found.bound, abs=certified.TOLERANCE + 1e-5)
    (close,) = solver.Clearance(arm, among).closest(curve(found.time))
    assert close.distance == pytest.approx(true[-1], abs=2e-5)


def test_the_tool_is_kept_off_the_arm(arm: Arm, curve: CubicSpline) -> None:
    """Of the link before the last joint too, which the bar can meet; it counts as coal says."""
    own = make_own(CollisionConfig(), arm)
    assert own is not None
    assert ("panda_link6", "tool") in (*own.pairs, *own.always)
    assert ("panda_link5", "tool") in own.pairs
    assert not {("panda_link7", "tool"), ("panda_hand", "tool")} & {*own.pairs, *own.always}
    pair = replace(own, pairs=(("panda_link5", "tool"),))
    clearance, places = Clearance(arm, None, pair), Places(arm)
    found = certified.closest(clearance, clearance.own, curve, KNOTS)
    at = places(curve(found.time))
    rotation, position = at["panda_link5"]
    others = [s.moved(rotation, position) for s in arm.description.collision if s.frame == "panda_link5"]
    assert found.distance == pytest.approx(least(arm.description.attached, at, others), abs=1e-6)
