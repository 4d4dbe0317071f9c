"""An arm as its base sees it (`pipeline.model.base.System`), on the kernel: what many configurations at once need."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import energy, mass_matrix

BLOCK = 512  # configurations per call: more leave the processor's cache


class KernelSystem:
    """The coordinates of a moving base are the chain's first joints."""

    def __init__(self, arm: Arm, chain: Chain) -> None:
        self.n, self.mounting, self.chain = arm.n, arm.mounting, chain

    def mass_matrix(self, q: Array) -> Array:
        """M(q) (K, n, n)."""
        parts = (q[k : k + BLOCK] for k in range(0, max(1, len(q)), BLOCK))
        return np.concatenate([mass_matrix(self.chain, part) for part in parts])

    def momentum_gradient(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """M(q) qd (K, n) and its derivative by q (K, n, n), which is d2T/dqd dq."""
        found = energy(self.chain, q, qd)
        return found.by_qd, found.mixed
