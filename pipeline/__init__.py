"""Selfmotion: optimal redundancy resolution for robot arms.

The public names stand in `__init__.pyi`; each is imported when it is first used, so that importing the package costs
nothing. The README and docs/guide/python.md show their use.
"""

from __future__ import annotations

import os

import lazy_loader

# Programs here are small and parallel work runs in processes: threads inside one solve only get in each other's way.
# It must be said before numpy and Drake load.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
