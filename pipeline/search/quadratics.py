"""Quadratics on the unit interval and the unit square, many at once: fits and least values.

On the square a quadratic is k0 + k1 s + k2 t + k3 s^2 + k4 s t + k5 t^2, its coefficients stacked (6, P).
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array

AT = np.linspace(0, 1, 5)  # where a cell is looked at, in both directions
S, T = (place.ravel() for place in np.meshgrid(AT, AT, indexing="ij"))
SQUARE = np.stack([np.ones_like(S), S, T, S * S, S * T, T * T])
FIT_SQUARE = np.linalg.pinv(SQUARE)
ENDS = np.array([0.0, 0.5, 1.0])
FIT_NINE = np.linalg.pinv(SQUARE[:, np.isin(S, ENDS) & np.isin(T, ENDS)])  # of values (P, 9) there
THROUGH = np.linalg.inv(np.vander(ENDS, increasing=True)).T  # values at ENDS @ THROUGH: coefficients


def fitted(values: Array) -> tuple[Array, Array]:
    """The quadratics (6, P) nearest to values (P, 25) at (S, T), and how far they miss any of these (P,)."""
    coefficients = values @ FIT_SQUARE
    return coefficients.T, np.abs(coefficients @ SQUARE - values).max(axis=1)


def lowest(a: Array, b: Array, c: Array) -> Array:
    """The least value of a + b t + c t^2 (P,) for t in [0, 1]."""
    with np.errstate(all="ignore"):
        bottom = np.clip(-b / (2 * c), 0, 1)
    t = np.where(c > 0, bottom, np.where(b + c < 0, 1.0, 0.0))
    return np.asarray(a + t * (b + c * t))


def lowest_on_square(k: Array) -> Array:
    """The least value (P,) of quadratics (6, P) on the unit square: on an edge, or where the gradient vanishes."""
    edges = (
        lowest(k[0], k[2], k[5]),
        lowest(k[0] + k[1] + k[3], k[2] + k[4], k[5]),
        lowest(k[0], k[1], k[3]),
        lowest(k[0] + k[2] + k[5], k[1] + k[4], k[3]),
    )
    on_edge = np.minimum.reduce(edges)
    with np.errstate(all="ignore"):
        determinant = 4 * k[3] * k[5] - k[4] ** 2
        s = (k[4] * k[2] - 2 * k[5] * k[1]) / determinant
        t = (k[4] * k[1] - 2 * k[3] * k[2]) / determinant
        bowl = (determinant > 0) & (k[3] > 0) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
        bottom = k[0] + 0.5 * (k[1] * s + k[2] * t)
    return np.where(bowl, np.minimum(on_edge, bottom), on_edge)
