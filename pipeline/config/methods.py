"""Group `method`: the options of every method."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from pipeline.config.fields import choice, choices, count, number, part
from pipeline.config.goal import INTEGRALS


@dataclass(frozen=True)
class LsvOptions:
    """Least-squares velocities: qd = J+ (xd + gain (x_ref - x))."""

    dt: float = number(0.01, above=0, unit="s")
    integrator: str = choice("heun", "euler", "heun")
    gain: float = number(0.0, low=0, unit="1/s")
    singular_value: float = number(0.03, above=0)
    max_drift: float = number(0.01, above=0, unit="m")


@dataclass(frozen=True)
class PmkeOptions:
    """Predictive minimisation of the kinetic energy: the parameters of Table 2 of its paper."""

    dt: float = number(0.01, above=0, unit="s")
    prediction_step: float = number(1.0, above=0, unit="s")
    horizon: int = count(2)
    update_interval: float = number(0.5, above=0, unit="s")
    objective: str = choice("problem", "problem", "kinetic_energy", "torque")
    interpolation: str = choice("quintic", "quintic", "cubic")
    gain: float = number(0.0, low=0, unit="1/s")
    tolerance: float = number(1e-8, above=0)
    singular_value: float = number(0.03, above=0)
    max_drift: float = number(0.01, above=0, unit="m")


@dataclass(frozen=True)
class RecedingOptions:
    """PMKE with limits: a receding horizon whose knots are executed as they are."""

    prediction_step: float = number(1.0, above=0, unit="s")
    horizon: int = count(2)
    update_interval: float = number(0.5, above=0, unit="s")
    objective: str = choice("problem", "problem", "kinetic_energy", "torque")
    tail: int = count(8, low=0)
    tolerance: float = number(1e-8, above=0)


@dataclass(frozen=True)
class GlobalOptions:
    """The interpolation-based Global Kinematic Planner; counts as in its paper."""

    starts: str = choice("roadmap", "roadmap", "population", "dynamic_programming", "both")
    solver: str = choice("newton", "newton", "ipopt")
    nodes: int = count(300, low=2)
    layers: int = count(6, low=2)
    configurations: int = count(66)
    draw: str = choice("normal", "normal", "latin_hypercube", "uniform")
    candidates: int | None = count(None)
    optimised: int = count(64)
    limit_weight: float = number(0.01, low=0)
    coarse_steps: int = count(25, low=2)
    tolerance: float = number(1e-8, above=0)
    max_iterations: int = count(300)
    same_path: float = number(0.05, above=0, unit="rad")


@dataclass(frozen=True)
class DynamicProgrammingOptions:
    """Dynamic programming on a grid of the self-motion manifold (r = 1)."""

    nodes: int = count(360, low=8)
    intervals: int | None = count(25, low=2)
    velocity_slack: float = number(0.0, low=0)
    same_path: float = number(0.2, above=0, unit="rad")


@dataclass(frozen=True)
class CalculusOfVariationsOptions:
    """Stationary motions of the kinetic-energy integral (r = 1, no limits)."""

    spacing: float = number(0.03, above=0, unit="rad")
    refinements: int = count(3, low=0)
    scan_tolerance: float = number(1e-6, above=0)
    tolerance: float = number(1e-10, above=0)
    max_speed: float | None = number(None, above=0, unit="rad/s")


@dataclass(frozen=True)
class PontryaginOptions:
    """The maximum principle as the two-point boundary-value problem that it is."""

    guesses: int = count(24)
    intervals: int = count(40, low=4)
    tolerance: float = number(1e-9, above=0)
    max_nodes: int = count(20000, low=10)
    same_path: float = number(0.01, above=0, unit="rad")


@dataclass(frozen=True)
class PontryaginAsPrintedOptions:
    """The maximum principle as the report prints it, integrated as it stands."""

    dt: float = number(0.01, above=0, unit="s")
    max_drift: float = number(0.1, above=0, unit="m")


@dataclass(frozen=True)
class ParetoOptions:
    """The front of two integrals; `planner` finds its extremes and its first motions."""

    method: str = choice("epsilon_constraint", "epsilon_constraint", "weighting")
    objectives: list[str] = choices(INTEGRALS[:2], *INTEGRALS)
    steps: int = count(10, low=2)
    rounds: int = count(3, low=0)
    tolerance: float = number(1e-8, above=0)
    max_iterations: int = count(200)
    planner: GlobalOptions = part(GlobalOptions)


@dataclass(frozen=True)
class MethodConfig:
    """Group `method`: the options of every method; the key `methods` says which of them run."""

    lsv: LsvOptions = part(LsvOptions)
    inertia_weighted: LsvOptions = part(LsvOptions)
    pmke: PmkeOptions = part(PmkeOptions)
    receding: RecedingOptions = part(RecedingOptions)
    global_: GlobalOptions = part(GlobalOptions)
    pareto: ParetoOptions = part(ParetoOptions)
    dynamic_programming: DynamicProgrammingOptions = part(DynamicProgrammingOptions)
    calculus_of_variations: CalculusOfVariationsOptions = part(CalculusOfVariationsOptions)
    pontryagin: PontryaginOptions = part(PontryaginOptions)
    pontryagin_as_printed: PontryaginAsPrintedOptions = part(PontryaginAsPrintedOptions)

    def of(self, name: str) -> Any:
        """The options of the method `name`."""
        return getattr(self, "global_" if name == "global" else name)


METHODS = tuple(field.name.rstrip("_") for field in fields(MethodConfig))


DEFAULT_METHODS = ("lsv", "pmke", "global")
