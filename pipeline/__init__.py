"""Selfmotion: optimal redundancy resolution for robot arms.

The names below are the public interface; each is imported when it is first used, so that importing the package costs
nothing. `examples` of their use are in the README.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

# Programs here are small and parallel work runs in processes: threads inside one solve only get in each other's way.
# It must be said before numpy and Drake load.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

_PUBLIC = {
    "Arm": "pipeline.arm",
    "FloatingArm": "pipeline.floating",
    "Spacecraft": "pipeline.floating",
    "PositionTask": "pipeline.task",
    "PoseTask": "pipeline.task",
    "Line": "pipeline.path",
    "Arc": "pipeline.path",
    "Spline": "pipeline.path",
    "circle": "pipeline.path",
    "direction_vector": "pipeline.path",
    "read_waypoints": "pipeline.path",
    "RaisedCosine": "pipeline.path",
    "ConstantSpeed": "pipeline.path",
    "Quintic": "pipeline.path",
    "Reference": "pipeline.path",
    "Problem": "pipeline.problem",
    "Solution": "pipeline.problem",
    "Status": "pipeline.problem",
    "Trajectory": "pipeline.problem",
    "lsv": "pipeline.methods.lsv",
    "pmke": "pipeline.methods.pmke",
    "global_planner": "pipeline.methods.global_planner",
    "dynamic_programming": "pipeline.methods.dynamic_programming",
    "calculus_of_variations": "pipeline.methods.calculus_of_variations",
    "Boundary": "pipeline.problem",
    "Limits": "pipeline.problem",
    "Objective": "pipeline.problem",
    "Workers": "pipeline.parallel",
    "evaluate": "pipeline.evaluation",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'pipeline' has no attribute '{name}'")
    module = importlib.import_module(_PUBLIC[name])
    return module if _PUBLIC[name].startswith("pipeline.methods.") else getattr(module, name)
