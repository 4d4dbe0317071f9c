from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.arrays import Array
from pipeline.methods.pmke.presolve import quasi_newton

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def rosenbrock(x: Array) -> tuple[float, Array]:
    a, b = 1 - x[0], x[1] - x[0] ** 2
    return a * a + 0.5 * b * b, np.array([-2 * a - 2 * x[0] * b, b])


def on_circle(x: Array) -> tuple[Array, Array]:
    return np.array([x @ x - 2.0]), 2 * x[None]


@given(seeds, st.integers(2, 5), st.integers(1, 3))
def test_a_convex_quadratic_with_linear_rows_is_solved(rng: np.random.Generator, k: int, rows: int) -> None:
    rows = min(rows, k - 1)
    root = rng.normal(size=(k, k))
    H, c, A, b = np.eye(k) + 0.1 * root @ root.T, rng.normal(size=k), rng.normal(size=(rows, k)), rng.normal(size=rows)
    answer = np.linalg.solve(np.block([[H, A.T], [A, np.zeros((rows, rows))]]), np.concatenate([-c, b]))[:k]
    start = rng.normal(size=k)
    got = quasi_newton(
        lambda x: (0.5 * x @ H @ x + c @ x, H @ x + c), lambda x: (A @ x - b, A), start, tolerance=1e-10, max_steps=60
    )
    np.testing.assert_allclose(got, answer, atol=1e-7)


def test_rosenbrock_on_a_circle_ends_at_its_minimum() -> None:
    """The unconstrained minimum (1, 1) lies on the circle of radius sqrt(2)."""
    got = quasi_newton(rosenbrock, on_circle, np.array([0.7, 1.3]), tolerance=1e-9, max_steps=40)
    np.testing.assert_allclose(got, [1.0, 1.0], atol=1e-8)


def test_a_point_that_is_good_enough_comes_back_unchanged() -> None:
    start = np.array([1.0, 1.0])
    assert quasi_newton(rosenbrock, on_circle, start, tolerance=1e-9) is start


def test_dependent_rows_leave_the_point_alone() -> None:
    start = np.array([0.3, 0.2])
    twice = np.array([[1.0, 1.0], [1.0, 1.0]])
    got = quasi_newton(rosenbrock, lambda x: (twice @ x - 1, twice), start, tolerance=1e-9)
    np.testing.assert_array_equal(got, start)


def test_the_arguments_are_not_written_to() -> None:
    start = np.array([0.7, 1.3])
    quasi_newton(rosenbrock, on_circle, start, tolerance=1e-9)
    np.testing.assert_array_equal(start, [0.7, 1.3])


def worst_condition(x: Array, multipliers: Array | None = None) -> float:
    """Largest violation of the optimality conditions; without multipliers: those of the identity's Newton step."""
    (_, gradient), (gap, jacobian) = rosenbrock(x), on_circle(x)
    if multipliers is None:
        multipliers = np.linalg.solve(jacobian @ jacobian.T, gap - jacobian @ gradient)
    return max(float(np.abs(gradient + jacobian.T @ multipliers).max()), float(np.abs(gap).max()))


@given(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), st.integers(1, 12))
def test_the_answer_is_never_worse_than_the_start(start: tuple[float, float], steps: int) -> None:
    x = np.array(start)
    if np.linalg.norm(x) < 0.05:
        return
    got = quasi_newton(rosenbrock, on_circle, x, tolerance=1e-12, max_steps=steps)
    (_, gradient), (_, jacobian) = rosenbrock(got), on_circle(got)
    best_multipliers = np.linalg.lstsq(jacobian.T, -gradient, rcond=None)[0]
    # Least squares bounds the sum of squares of two entries, hence the root of two.
    assert worst_condition(got, best_multipliers) <= np.sqrt(2) * worst_condition(x) * (1 + 1e-9)
