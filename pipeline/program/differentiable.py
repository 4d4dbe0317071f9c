"""Hand a value and its analytic gradient to Drake's solvers, which ask for both through AutoDiffXd arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff

from pipeline.common.arrays import Array


class _Remembering:
    """The last point of a function and its derivatives: IPOPT asks for the value and then for the derivatives there."""

    def __init__(self, function: Callable[[Array], tuple[Any, Array]]) -> None:
        self._function = function
        self._x: Array | None = None
        self._last: tuple[Any, Array] | None = None

    def at(self, x: NDArray[Any]) -> tuple[Any, Array]:
        """The value and its derivatives."""
        point = ExtractValue(x).ravel() if x.dtype == object else x
        if self._last is None or self._x is None or not np.array_equal(self._x, point):
            self._x, self._last = point.copy(), self._function(point)
        return self._last

    def forget(self) -> None:
        """Drop the remembered point: the function has changed."""
        self._x = self._last = None


class DifferentiableCost(_Remembering):
    """A Drake cost from value_and_gradient(x) -> (float, (len(x),)).

    Drake's IPOPT interface seeds every binding with the identity, so the gradient by x is the gradient by the seeds.
    """

    def __call__(self, x: NDArray[Any]) -> Any:
        value, gradient = self.at(x)
        return AutoDiffXd(value, gradient) if x.dtype == object else value


class DifferentiableConstraint(_Remembering):
    """A Drake constraint from value_and_jacobian(x) -> ((rows,), (rows, len(x)))."""

    def __init__(self, value_and_jacobian: Callable[[Array], tuple[Array, Array]]) -> None:
        super().__init__(value_and_jacobian)
        self.linearisations = 0

    def __call__(self, x: NDArray[Any]) -> Any:
        value, jacobian = self.at(x)
        if x.dtype != object:
            return value
        self.linearisations += 1
        return InitializeAutoDiff(value, jacobian).ravel()

    @property
    def iterations(self) -> int:
        """IPOPT's iterations since `forget`: one Jacobian each, after two at the start (one of them Drake's)."""
        return max(0, self.linearisations - 2)

    def forget(self) -> None:
        """Also how many iterations there were."""
        super().forget()
        self.linearisations = 0
