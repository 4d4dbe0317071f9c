"""The self-motion manifold: closed on its point, even, every component found, for planar and spatial arms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.common.errors import InputError, PathError
from pipeline.model.arm import Arm
from pipeline.model.kinematics import wrap
from pipeline.model.task import PositionTask
from pipeline.robot import urdf
from pipeline.search import self_motion
from pipeline.search.configurations import KINDS, random_configurations
from pipeline.search.self_motion import manifold, manifolds, on_manifold, tangent
from tests.support import ROOT

ROBOT = ROOT / "robots" / "planar3r.urdf"
Q_INIT = np.array([0.0, 0.327, -0.754])
LINKS = (0.176, 0.176, 0.1375)

LINK = """<link name="l{i}"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><origin xyz="{x} 0 0"/>
<axis xyz="{axis}"/><limit lower="-3" upper="3" effort="10" velocity="3"/></joint>"""


@pytest.fixture(scope="module")
def planar() -> PositionTask:
    return PositionTask(Arm(urdf.read(ROBOT, "tip")))


@pytest.fixture(scope="module")
def spatial(tmp_path_factory: pytest.TempPathFactory) -> PositionTask:
    """A 4R arm in space: one waist, a tilted shoulder and two elbows; m = 3, r = 1."""
    axes = ("0 0 1", "0 1 0", "0 0.6 0.8", "0 1 0")
    links = ["base", "l1", "l2", "l3"]
    parts = ['<robot name="r"><link name="base"/>']
    for i, axis in enumerate(axes, start=1):
        parts += [LINK.format(i=i), JOINT.format(i=i, parent=links[i - 1], x=0.0 if i == 1 else 0.3, axis=axis)]
    parts.append('<link name="tip"/><joint name="t" type="fixed"><parent link="l4"/><child link="tip"/>')
    parts.append('<origin xyz="0.3 0 0"/></joint></robot>')
    file = tmp_path_factory.mktemp("arm") / "spatial4r.urdf"
    file.write_text("\n".join(parts))
    return PositionTask(Arm(urdf.read(file, "tip")), ("x", "y", "z"))


def components(distance: float) -> int:
    """Closed form for the planar 3R: the distal link's angle sweeps the circle where the first two links reach.

    The loop closes through both elbow signs wherever they reach only part of it; they part where they reach all of it.
    """
    angle = np.linspace(0, 2 * np.pi, 20001)
    wrist = np.hypot(distance - LINKS[2] * np.cos(angle), LINKS[2] * np.sin(angle))
    inside = wrist < LINKS[0] + LINKS[1]
    if inside.all():
        return 2
    return int((np.diff(np.append(inside, inside[0]).astype(int)) == 1).sum())


@pytest.mark.slow
@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.floats(0.02, 0.48), st.floats(-np.pi, np.pi))
def test_every_component_is_found_and_closed(planar: PositionTask, distance: float, angle: float) -> None:
    x = distance * np.array([np.cos(angle), np.sin(angle)])
    loops = manifold(planar, x, np.random.default_rng(1), spacing=0.05)
    assert len(loops) == components(distance)
    for loop in loops:
        assert np.abs(planar.value(loop.q) - x).max() < 1e-10
        step = np.linalg.norm(wrap(np.roll(loop.q, -1, axis=0) - loop.q, loop.revolute), axis=1)
        assert step.max() < 1.02 * loop.length / len(loop.q)
        assert step.min() > 0.9 * loop.length / len(loop.q)
        assert len(loop.q) % 2 == 0


@pytest.mark.parametrize("excess", [1e-3, 1e-5, 1e-7])
def test_close_to_the_change_of_topology(planar: PositionTask, excess: float) -> None:
    critical = LINKS[0] + LINKS[1] - LINKS[2]
    for distance, count in ((critical + excess, 1), (critical - excess, 2)):
        assert len(manifold(planar, np.array([distance, 0.0]), np.random.default_rng(0))) == count


@pytest.mark.parametrize("distance", [LINKS[0] + LINKS[1] - LINKS[2], LINKS[2], sum(LINKS)])
def test_at_a_critical_point(planar: PositionTask, distance: float) -> None:
    loops = manifold(planar, np.array([distance, 0.0]), np.random.default_rng(0))
    assert loops
    assert max(np.abs(planar.value(loop.q) - [distance, 0.0]).max() for loop in loops) < 1e-10


def test_a_path_is_traced_as_its_points_are(planar: PositionTask) -> None:
    start = planar.value(Q_INIT[None])[0]
    x = start + np.linspace(0, 0.4, 13)[:, None] * np.array([np.cos(np.deg2rad(157.5)), np.sin(np.deg2rad(157.5))])
    along = manifolds(planar, x, np.random.default_rng(0), nodes=180)
    counts = [len(loops) for loops in along]
    assert counts == [components(float(np.linalg.norm(point))) for point in x]
    assert set(counts) == {1, 2}
    for point, loops in zip(x, along, strict=True):
        alone = manifold(planar, point, np.random.default_rng(3))
        np.testing.assert_allclose(
            sorted(loop.length for loop in loops), sorted(loop.length for loop in alone), rtol=1e-3
        )


def test_space_arm(spatial: PositionTask) -> None:
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2, 2, size=(4, 4)):
        x = spatial.value(q[None])[0]
        loops = manifold(spatial, x, rng)
        assert max(np.abs(spatial.value(loop.q) - x).max() for loop in loops) < 1e-10
        assert min(np.linalg.norm(wrap(loop.q - q, loop.revolute), axis=1).min() for loop in loops) < 0.03
        # No random configuration on the point may lie off the loops.
        others = random_configurations(spatial, q, 40, rng, "uniform")
        for other in others:
            nearest = min(np.linalg.norm(wrap(loop.q - other, loop.revolute), axis=1).min() for loop in loops)
            assert nearest < 0.03


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.floats(-50, 50))
def test_interpolation_by_arc_length(planar: PositionTask, s: float) -> None:
    x = planar.value(Q_INIT[None])[0]
    (loop,) = manifold(planar, x, np.random.default_rng(0))
    q = on_manifold(planar, loop, np.array([s, s + 1e-3, s + loop.length]), x)
    assert np.abs(planar.value(q) - x).max() < 1e-12
    np.testing.assert_allclose(wrap(q[2] - q[0], loop.revolute), 0, atol=1e-9)
    assert np.linalg.norm(wrap(q[1] - q[0], loop.revolute)) == pytest.approx(1e-3, rel=0.02)


def test_tangent_is_the_null_vector(spatial: PositionTask) -> None:
    jacobian = spatial.jacobian(np.random.default_rng(0).uniform(-2, 2, size=(20, 4)))
    t = tangent(jacobian)
    np.testing.assert_allclose(np.einsum("kmn,kn->km", jacobian, t), 0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(t, axis=1), 1)
    assert (np.linalg.det(np.concatenate([jacobian, t[:, None]], axis=1)) > 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_random_configurations(planar: PositionTask, kind: str) -> None:
    q = random_configurations(planar, Q_INIT, 66, np.random.default_rng(0), kind)
    assert len(q) == 66
    assert np.abs(planar.value(q) - planar.value(Q_INIT[None])).max() < 1e-10
    assert (np.abs(q) <= np.pi).all()
    gaps = np.abs(wrap(q[:, None] - q, np.ones(3, dtype=bool))).max(axis=2)
    assert gaps[~np.eye(66, dtype=bool)].min() > 1e-3
    again = random_configurations(planar, Q_INIT, 66, np.random.default_rng(0), kind)
    np.testing.assert_array_equal(q, again)


def test_random_configurations_with_more_redundancy(spatial: PositionTask) -> None:
    task = PositionTask(spatial.arm, ("x", "y"))
    q0 = np.array([0.3, -0.4, 0.5, 0.6])
    q = random_configurations(task, q0, 20, np.random.default_rng(0))
    assert len(q) == 20
    assert np.abs(task.value(q) - task.value(q0[None])).max() < 1e-10


def test_errors(planar: PositionTask, spatial: PositionTask) -> None:
    with pytest.raises(PathError, match="out of the arm's reach: none of 100 attempts"):
        manifold(planar, np.array([0.6, 0.0]), np.random.default_rng(0))
    with pytest.raises(InputError, match="r = 2"):
        manifold(PositionTask(spatial.arm, ("x", "y")), np.zeros(2), np.random.default_rng(0))
    with pytest.raises(InputError, match="allowed are normal"):
        random_configurations(planar, Q_INIT, 3, np.random.default_rng(0), "sobol")


def test_a_point_without_a_closed_self_motion_is_not_called_out_of_reach(
    planar: PositionTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(self_motion, "_all_loops", lambda task, x, seeds: [[] for _ in x])
    with pytest.raises(PathError, match=r"no self-motion that closes was found there, although \d+ of 100 attempts"):
        manifold(planar, np.array([0.3, 0.1]), np.random.default_rng(0))
