"""Null spaces and triangular systems of very many small matrices at once (knots on the last axis)."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array

TINY = 1e-300


def split(matrix: Array) -> tuple[Array, Array]:
    """R (m, m, K) and the orthogonal Q (n, n, K) of matrix (n, m, K) = Q[:, :m] R, by Householder reflections (Golub
    and Van Loan 2013, Section 5.2). The first m columns of Q span the rows' space, the others the null space.
    """
    n, m, count = matrix.shape
    R = matrix.copy()
    reflections = []
    for j in range(m):
        v = R[j:, j].copy()
        norm = np.sqrt((v * v).sum(axis=0))
        alpha = np.where(v[0] > 0, -norm, norm)
        v[0] -= alpha
        beta = 1.0 / np.maximum(-alpha * v[0], TINY)  # 2 / v'v
        R[j, j] = alpha
        if j + 1 < m:
            rest = R[j:, j + 1 :]
            rest -= (beta * v)[:, None] * (v[:, None] * rest).sum(axis=0)
        reflections.append((v, beta))
    Q = np.zeros((n, n, count))
    Q[range(n), range(n)] = 1.0
    for j in range(m - 1, -1, -1):
        v, beta = reflections[j]
        part = Q[j:, j:]
        part -= (beta * v)[:, None] * (v[:, None] * part).sum(axis=0)
    return R[:m], Q


def forward(R: Array, b: Array) -> Array:
    """R^-T b (..., m) for upper triangular R (..., m, m)."""
    out = np.empty_like(b)
    for i in range(b.shape[-1]):
        out[..., i] = (b[..., i] - sum(out[..., j] * R[..., j, i] for j in range(i))) / R[..., i, i]
    return out


def backward(R: Array, b: Array) -> Array:
    """R^-1 b (..., m)."""
    out = np.empty_like(b)
    m = b.shape[-1]
    for i in range(m - 1, -1, -1):
        out[..., i] = (b[..., i] - sum(out[..., j] * R[..., i, j] for j in range(i + 1, m))) / R[..., i, i]
    return out
