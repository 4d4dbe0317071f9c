"""Hand a value and its analytic gradient to Drake's solvers, which ask for both through AutoDiffXd arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff

from pipeline.common.arrays import Array


class DifferentiableCost:
    """A Drake cost from value_and_gradient(x) -> (float, (len(x),)).

    Drake's IPOPT interface seeds every binding with the identity, so the gradient by x is the gradient by the seeds.
    """

    def __init__(self, value_and_gradient: Callable[[Array], tuple[float, Array]]) -> None:
        self.value_and_gradient = value_and_gradient

    def __call__(self, x: NDArray[Any]) -> Any:
        if x.dtype != object:
            return self.value_and_gradient(x)[0]
        value, gradient = self.value_and_gradient(ExtractValue(x).ravel())
        return AutoDiffXd(value, gradient)


class DifferentiableConstraint:
    """A Drake constraint from value_and_jacobian(x) -> ((rows,), (rows, len(x))); the last point is remembered.

    IPOPT asks for the value and then for the Jacobian at the same point.
    """

    def __init__(self, value_and_jacobian: Callable[[Array], tuple[Array, Array]]) -> None:
        self.value_and_jacobian = value_and_jacobian
        self.linearisations = 0
        self._x: Array | None = None
        self._last: tuple[Array, Array] | None = None

    def __call__(self, x: NDArray[Any]) -> Any:
        differentiate = x.dtype == object
        point = ExtractValue(x).ravel() if differentiate else x
        if self._last is None or self._x is None or not np.array_equal(self._x, point):
            self._x, self._last = point.copy(), self.value_and_jacobian(point)
        value, jacobian = self._last
        if not differentiate:
            return value
        self.linearisations += 1
        return InitializeAutoDiff(value, jacobian).ravel()

    @property
    def iterations(self) -> int:
        """IPOPT's iterations since `forget`: one Jacobian each, after two at the start (one of them Drake's)."""
        return max(0, self.linearisations - 2)

    def forget(self) -> None:
        """Drop the remembered point: the function has changed."""
        self._x = self._last = None
        self.linearisations = 0
