from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from pipeline.methods.pmke.quadratic import Quadratic, minimise


@pytest.mark.parametrize("warm", [False, True])
def test_the_minimum_is_scipys(rng: np.random.Generator, warm: bool) -> None:
    for _ in range(5):
        root, g, C = rng.normal(size=(4, 4)), rng.normal(size=4), rng.normal(size=(9, 4))
        H, c = root @ root.T + 0.1 * np.eye(4), rng.uniform(0.05, 1, 9)  # w = 0 keeps all rows
        start = np.zeros(9)
        if warm:
            start = minimise(Quadratic(H, g * 1.05, C, c), start)[1]  # type: ignore[index]
        found = minimise(Quadratic(H, g, C, c), start)
        right = minimize(
            lambda w, H=H, g=g: 0.5 * w @ H @ w + g @ w,
            np.zeros(4),
            constraints={"type": "ineq", "fun": lambda w, C=C, c=c: c + C @ w},
            options={"ftol": 1e-14},
        )
        assert found is not None
        w, z = found
        np.testing.assert_allclose(w, right.x, atol=1e-5)
        np.testing.assert_allclose(H @ w + g, C.T @ z, atol=1e-7)
        assert (c + C @ w).min() > -1e-9
        assert z.min() >= 0


def test_rows_that_contradict_each_other_have_no_minimum() -> None:
    program = Quadratic(np.eye(2), np.zeros(2), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-1.0, -1.0]))
    assert minimise(program, np.zeros(2)) is None


def test_without_rows_it_is_newtons_step() -> None:
    found = minimise(Quadratic(2 * np.eye(2), np.array([2.0, -4.0]), np.zeros((0, 2)), np.zeros(0)), np.zeros(0))
    assert found is not None
    np.testing.assert_allclose(found[0], [-1.0, 2.0])
