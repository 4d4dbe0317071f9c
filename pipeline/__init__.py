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
    "Arm": "pipeline.model.arm",
    "Floating": "pipeline.model.floating",
    "Mounting": "pipeline.robot.mounting",
    "Spacecraft": "pipeline.robot.spacecraft",
    "PositionTask": "pipeline.model.task",
    "PoseTask": "pipeline.model.task",
    "Line": "pipeline.path.curves",
    "Arc": "pipeline.path.curves",
    "Spline": "pipeline.path.spline",
    "circle": "pipeline.path.curves",
    "direction_vector": "pipeline.path.curves",
    "read_waypoints": "pipeline.path.waypoints",
    "RaisedCosine": "pipeline.path.timing",
    "ConstantSpeed": "pipeline.path.timing",
    "Quintic": "pipeline.path.timing",
    "Reference": "pipeline.path.reference",
    "Problem": "pipeline.problem.problem",
    "Solution": "pipeline.problem.solution",
    "Status": "pipeline.problem.solution",
    "Trajectory": "pipeline.problem.solution",
    "Context": "pipeline.methods.method",
    "METHODS": "pipeline.methods.registry",
    "lsv": "pipeline.methods.lsv",
    "inertia_weighted": "pipeline.methods.lsv",
    "pmke": "pipeline.methods.pmke.predictive",
    "receding": "pipeline.methods.pmke.receding",
    "global_planner": "pipeline.methods.global_planner.planner",
    "pareto": "pipeline.methods.pareto",
    "dynamic_programming": "pipeline.methods.dynamic_programming",
    "calculus_of_variations": "pipeline.methods.calculus_of_variations.stationary",
    "pontryagin": "pipeline.methods.pontryagin.boundary_value",
    "pontryagin_as_printed": "pipeline.methods.pontryagin.as_printed",
    "Boundary": "pipeline.problem.problem",
    "Limits": "pipeline.problem.limits",
    "Objective": "pipeline.problem.objective",
    "Workers": "pipeline.common.workers",
    "evaluate": "pipeline.evaluation.evaluation",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'pipeline' has no attribute '{name}'")
    return getattr(importlib.import_module(_PUBLIC[name]), name)
