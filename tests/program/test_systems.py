"""The linear systems of Newton's method: banded, tied, indefinite and triangular ones beside dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.problem.problem import Boundary
from pipeline.program.newton import triangular
from pipeline.program.newton.banded import Banded
from pipeline.program.newton.knots import Knots
from tests.support import dense


@pytest.mark.parametrize("cyclic", [False, True])
@pytest.mark.parametrize(("size", "reach"), [(1, 1), (2, 1), (3, 1), (1, 2), (2, 2)])
def test_banded_systems(cyclic: bool, size: int, reach: int, rng: np.random.Generator) -> None:
    count = 7
    diagonal = rng.normal(size=(2, count, size, size))
    diagonal = diagonal + diagonal.swapaxes(-1, -2) + 8 * reach * size * np.eye(size)
    off = [rng.normal(size=(2, count if cyclic else count - j, size, size)) for j in range(1, reach + 1)]
    blocks, right = (diagonal, *off), rng.normal(size=(2, count, size))
    band, knots = Banded(count, size, cyclic, reach), Knots(Boundary.CYCLIC if cyclic else Boundary.FIXED, np.arange(8))
    x, _, changed = band.solve(band.assemble(blocks), np.empty(0), right)
    assert changed == 0
    rows, target = rng.normal(size=(2, 4, count * size)), rng.normal(size=(2, 4))
    tied, nu, _ = band.solve(band.assemble(blocks), np.empty(0), right, rows, target)
    for s in range(2):
        whole = dense(tuple(block[s] for block in blocks), cyclic)
        np.testing.assert_allclose(x[s].ravel(), np.linalg.solve(whole, right[s].ravel()), atol=1e-12)
        np.testing.assert_allclose(knots.product(blocks, right)[s].ravel(), whole @ right[s].ravel(), atol=1e-12)
        both = np.block([[whole, rows[s].T], [rows[s], np.zeros((4, 4))]])
        exact = np.linalg.solve(both, np.concatenate([right[s].ravel(), target[s]]))
        np.testing.assert_allclose(np.concatenate([tied[s].ravel(), nu[s]]), exact, atol=1e-10)


def test_an_indefinite_system_fades_into_a_positive_one(rng: np.random.Generator) -> None:
    band = Banded(5, 1, False)
    bad, good = -np.ones((1, 5, 1, 1)), 2 * np.ones((1, 5, 1, 1))
    off = np.zeros((1, 4, 1, 1))
    right = rng.normal(size=(1, 5, 1))
    x, _, changed = band.solve(band.assemble((bad, off)), band.assemble((good, off)), right)
    assert changed == 1
    np.testing.assert_allclose(x, right / (0.4 * -1 + 0.6 * 2))


def test_null_spaces_and_triangular_systems(rng: np.random.Generator) -> None:
    rows, b = rng.normal(size=(4, 3, 6)), rng.normal(size=(6, 3))  # J' of six knots
    R, Q = triangular.split(rows)
    np.testing.assert_allclose(np.einsum("ijk,ilk->kjl", Q, Q), np.tile(np.eye(4), (6, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(
        np.einsum("ijk,jlk->ilk", Q[:, :3], np.triu(np.ones((3, 3)))[:, :, None] * R), rows, atol=1e-14
    )
    np.testing.assert_allclose(np.einsum("ijk,ik->jk", rows, Q[:, 3]), 0.0, atol=1e-14)
    upper = np.triu(R.transpose(2, 0, 1))
    np.testing.assert_allclose(triangular.backward(upper, b), np.linalg.solve(upper, b[:, :, None])[:, :, 0])
    lower = upper.swapaxes(1, 2)
    np.testing.assert_allclose(triangular.forward(upper, b), np.linalg.solve(lower, b[:, :, None])[:, :, 0])
