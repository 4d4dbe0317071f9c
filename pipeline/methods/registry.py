"""The methods by their names: the words of the key `methods`. A new one is one file and one line here."""

from __future__ import annotations

from pipeline.methods.calculus_of_variations.stationary import calculus_of_variations
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lower_bound import lower_bound
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.pareto import pareto
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.pmke.receding import receding
from pipeline.methods.pontryagin.as_printed import pontryagin_as_printed
from pipeline.methods.pontryagin.boundary_value import pontryagin
from pipeline.methods.segments.segments import segments

METHODS = {
    method.name: method
    for method in (
        lsv,
        inertia_weighted,
        pmke,
        receding,
        global_planner,
        pareto,
        dynamic_programming,
        lower_bound,
        calculus_of_variations,
        pontryagin,
        pontryagin_as_printed,
        segments,
    )
}
