"""A path by length and angle: how far it goes from one moment to the next is measured by scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.path.through import Through, through

RADIAN = 0.2
POINTS = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.101, 0.05, 0], [0.2, 0.05, 0.1]])
TURNS = Rotation.from_rotvec([[0, 0, 0], [0, 0.1, 0], [0, 0.9, 0.3], [0.4, 0.9, 0.3]])
AT = np.array([0, 1, 2, 2, 2, 3])  # stays, and turns on the spot
SPUN = Rotation.concatenate([TURNS[:3], TURNS[2:3], Rotation.from_rotvec([0, 0, 1.1]), Rotation.from_rotvec([0, 0, 2])])


@pytest.fixture(scope="module", params=[True, False], ids=["smooth", "with a turn on the spot"])
def path(request: pytest.FixtureRequest) -> Through:
    return through(POINTS, TURNS, radian=RADIAN) if request.param else through(POINTS[AT], SPUN, radian=RADIAN)


def poses(path: Through, s: Array) -> tuple[Array, Rotation]:
    assert path.orientation is not None
    return path.geometry.sample(s)[0], Rotation.from_rotvec(path.orientation.sample(s)[0])


def test_every_step_counts_its_length_and_its_angle(path: Through) -> None:
    s = np.linspace(0.0, path.geometry.length, 801)
    x, turned = poses(path, s)
    moved = np.linalg.norm(np.diff(x, axis=0), axis=1)
    angle = (turned[:-1].inv() * turned[1:]).magnitude()
    one_way = np.abs((s[1:] + s[:-1])[:, None] / 2 - path.marks).min(axis=1) > np.diff(s)
    np.testing.assert_allclose(np.hypot(moved, RADIAN * angle)[one_way], np.diff(s)[one_way], rtol=1e-3)


def test_it_passes_every_way_point(path: Through) -> None:
    smooth = len(path.marks) == len(POINTS)
    x, turned = poses(path, path.marks)
    np.testing.assert_allclose(x, POINTS if smooth else POINTS[AT], atol=1e-10)
    assert (turned.inv() * (TURNS if smooth else SPUN)).magnitude().max() < 1e-7


def test_its_derivatives_are_those_of_its_values(path: Through) -> None:
    assert path.orientation is not None
    inner = [1, 2] if len(path.marks) == len(POINTS) else [2]
    between = np.linspace(0.0, path.marks[inner[-1]], 40)[1:-1]
    s, h = between[np.abs(between[:, None] - path.marks).min(axis=1) > 1e-3], 1e-5
    for curve in (path.geometry, path.orientation):
        before, here, after = (curve.sample(s + step) for step in (-h, 0.0, h))
        np.testing.assert_allclose(here[2], (after[1] - before[1]) / (2 * h), atol=1e-3 * np.abs(here[2]).max())
    x, ahead = path.geometry.sample(s - h)[0], path.geometry.sample(s + h)[0]
    np.testing.assert_allclose(path.geometry.sample(s)[1], (ahead - x) / (2 * h), atol=1e-6)
    (_, before_turn), (_, after_turn) = poses(path, s - h), poses(path, s + h)
    spin = (after_turn * before_turn.inv()).as_rotvec() / (2 * h)
    np.testing.assert_allclose(path.orientation.sample(s)[1], spin, atol=1e-4)
