"""The certified clearance of a motion against many samples of it, measured by coal."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.collision import make_own
from pipeline.common.arrays import Array
from pipeline.config.robot import CollisionConfig
from pipeline.evaluation import certified
from pipeline.evaluation.clearance import Clearance
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.robot.separation import Solid, distance
from pipeline.robot.shapes import Shape
from tests.support import BALL, composed, robot

BLOCK = Obstacles((replace(BALL, position=(-0.3, 0.45, 0.8)),), 0.02)
KNOTS = np.linspace(0.0, 2.0, 9)


@pytest.fixture(scope="module")
def clearance() -> Clearance:
    arm = robot("panda")
    return Clearance(arm, BLOCK, make_own(CollisionConfig(), arm))


@pytest.fixture(scope="module")
def curve() -> CubicSpline:
    rng, start = np.random.default_rng(3), np.array(composed("robot=panda").robot.q_init)
    return CubicSpline(KNOTS, start + np.vstack([np.zeros(7), np.cumsum(rng.normal(size=(8, 7)) * 0.12, axis=0)]))


@pytest.mark.parametrize("which", ["obstacles", "own"])
def test_never_above_the_truth_and_near_it(which: str, clearance: Clearance, curve: CubicSpline) -> None:
    pairs = getattr(clearance, which)
    found = certified.closest(clearance, pairs, curve, KNOTS)
    assert 0 < found.distance - found.bound <= certified.TOLERANCE
    around = np.clip(found.time + np.linspace(-0.02, 0.02, 15), 0.0, 2.0)
    samples = clearance.smallest(pairs, curve(np.concatenate([np.linspace(0.0, 2.0, 30), around])))
    assert samples.min() >= found.bound
    assert samples.min() <= found.distance + 1e-6
    early = certified.closest(clearance, pairs, curve, KNOTS, 0.0, found.bound / 2)
    assert found.bound / 2 <= early.bound <= found.distance
    margin = found.distance + 1e-3  # that it lacks is told finely: the planner keeps off by no more than it must
    short = certified.closest(clearance, pairs, curve, KNOTS, margin, margin)
    assert short.distance - short.bound <= certified.FINE


def test_no_piece_comes_nearer_than_its_bound(clearance: Clearance, rng: np.random.Generator) -> None:
    """Of motions that turn sharply, where straight on would be too good; on short pieces the plane is the sharper."""
    start, pairs, sharper = np.array(composed("robot=panda").robot.q_init), clearance.own, 0
    bend = CubicSpline(KNOTS, start + 0.8 * rng.normal(size=(9, 7)))
    motion = certified.Motion(clearance, pairs, bend, KNOTS)
    for _ in range(30):
        p, begin, width = int(rng.integers(len(pairs))), float(rng.integers(8)), 0.5 ** int(rng.integers(6))
        piece = certified.Piece(p, begin, begin + width)
        cut = begin + width / 2
        motion.go(cut)
        apart = clearance.apart(pairs[p])
        bound = motion.bound(pairs[p], piece, cut, apart)
        by_way = apart[0] - max(float(motion.reach[p] @ motion.way(*e)) for e in ((begin, cut), (cut, begin + width)))
        sharper += bound > by_way
        true = clearance.smallest([pairs[p]], bend(motion.time(begin) + width * 0.25 * np.linspace(0.0, 1.0, 9)))
        assert bound <= true.min() + 1e-9
    assert sharper > 5


def test_reaches_hold_for_every_configuration(clearance: Clearance, rng: np.random.Generator) -> None:
    """No point of a solid moves by more than rho |dq_j| where one joint turns."""
    pair = max(clearance.own, key=lambda pair: pair.second.joints - pair.first.joints)
    clearance.at(np.zeros(7))
    rho = certified.reaches(clearance, pair, np.zeros(7))
    assert np.all(rho[: pair.first.joints] == 0)
    for joint in range(pair.first.joints, pair.second.joints):
        q = rng.uniform(-2.0, 2.0, 7)
        step = 1e-4 * np.eye(7)[joint]
        moved = np.linalg.norm(_points(clearance, pair, q + step) - _points(clearance, pair, q), axis=1).max()
        assert 0.1 * rho[joint] < moved / 1e-4 <= rho[joint] * (1 + 1e-6)


def _points(clearance: Clearance, pair: certified.Pair, q: Array) -> Array:
    clearance.at(q)
    pose = pair.second.drake.EvalPoseInWorld(clearance._plant_context)
    return pair.second.solid.moved(pose.rotation().matrix(), pose.translation()).points


def test_where_drake_says_too_much_the_bound_does_not(monkeypatch: pytest.MonkeyPatch, clearance: Clearance) -> None:
    """As its hull-hull distance sometimes does, by millimetres."""
    pair = next(pair for pair in clearance.own if pair.first.solid.radius == pair.second.solid.radius == 0)
    clearance.at(np.array(composed("robot=panda").robot.q_init))
    true = clearance.apart(pair)[0]

    wrong = SimpleNamespace(distance=true + 0.01, nhat_BA_W=np.array([0.0, 0.0, 1.0]))
    query = SimpleNamespace(ComputeSignedDistancePairClosestPoints=lambda *_: wrong)
    port = SimpleNamespace(Eval=lambda _: query)
    monkeypatch.setattr(clearance, "_scene", SimpleNamespace(get_query_output_port=lambda: port))
    assert clearance.apart(pair)[:2] == pytest.approx((true, true), abs=1e-6)


def test_capsules_that_overlap_are_told_without_drake() -> None:
    arm = robot("planar4r")
    rods = tuple(replace(shape, kind="capsule") for shape in arm.description.collision)
    arm = Arm(replace(arm.description, collision=rods))
    through = Obstacles((Shape("rod", "capsule", (0.05, 0.4), (0.2, 0.0, 0.0)),), 0.02)
    found = Clearance(arm, through)(np.zeros((1, 4)))[0]
    assert found == pytest.approx(distance(Solid.of(rods[0]), Solid.of(through.shapes[0]))[0])
    assert found < 0
