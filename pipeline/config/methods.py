"""Group `method`: the options of every method."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from pipeline.config.fields import Number, Switch, Whole, WordOrWords, Words, schema
from pipeline.config.goal import Integral, Positive

MethodName = Literal[
    "lsv",
    "inertia_weighted",
    "pmke",
    "receding",
    "global",
    "pareto",
    "dynamic_programming",
    "lower_bound",
    "calculus_of_variations",
    "pontryagin",
    "pontryagin_as_printed",
    "segments",
]
METHODS: tuple[str, ...] = get_args(MethodName)

# A count is bounded where memory or days of work would end a run instead of a line.
MOST_KNOTS = 100_000  # of a prediction or grid: each has a mass matrix and its derivatives
FEWEST_PLACES = 20  # along a path that may have to be cut
MOST_STARTS = 100_000  # each is a solve
MOST_MOTIONS = 1_000_000  # each is followed along the coarsest grid

Step = Annotated[Positive, Field(description="[s] integration step")]
Gain = Annotated[
    Number, Field(ge=0, description="[1/s] closed-loop correction of the tracking error; 0: as in the paper")
]
Tolerance = Annotated[Positive, Field(description="of the solver, relative to the objective of the start")]
Iterations = Annotated[Whole, Field(ge=1, le=1_000_000, description="of the solver, at most")]
MaxTime = Annotated[
    Positive | None,
    Field(description="[s] of one solve, which is stopped then: results depend on the machine; null: no limit"),
]
Singular = Annotated[
    Positive, Field(description="smallest over largest singular value of J below which a motion counts as singular")
]
Prediction = Annotated[
    Literal["problem", "kinetic_energy", "torque"],
    Field(description="of a prediction; problem: the problem's, kinetic energy in place of torques"),
]
Confirm = Annotated[
    Literal["every", "last", "none"],
    Field(
        description="of the windows that Newton's method solved, those that ipopt solves again from its answer: every "
        "one; last: a sample of ten, after the motion; none"
    ),
]
Drift = Annotated[Positive, Field(description="[m] tracking error above which the motion is not confirmed")]
Apart = Annotated[Number, Field(gt=0, le=3.14)]  # [rad]: no two joint angles are farther apart, but for full turns


@schema
class LsvOptions:
    """Least-squares velocities: qd = J+ (xd + gain (x_ref - x))."""

    dt: Step = 0.01
    integrator: Annotated[Literal["euler", "heun"], Field(description="of the joint velocities")] = "heun"
    gain: Gain = 0.0
    singular_value: Singular = 0.03
    max_drift: Drift = 0.01


@schema
class PmkeOptions:
    """Predictive minimisation of the kinetic energy: the parameters of Table 2 of its paper."""

    dt: Step = 0.01
    prediction_step: Annotated[Positive, Field(description="[s] spacing of the predicted knots (Delta T)")] = 1.0
    horizon: Annotated[Whole, Field(ge=1, le=1000, description="predicted knots (h)")] = 2
    update_interval: Annotated[Positive, Field(description="[s] between predictions (I)")] = 0.5
    objective: Prediction = "problem"
    interpolation: Annotated[
        Literal["quartic", "quintic", "cubic"],
        Field(description="through the predicted knots; quartic: the paper's, with a knot inside each interval"),
    ] = "quartic"
    gain: Gain = 0.0
    project: Annotated[
        Switch, Field(description="whether every step is put back onto the path, which leaves no drift; without gain")
    ] = False
    confirm: Confirm = "every"
    tolerance: Annotated[Positive, Field(description="of a prediction, relative to its energy")] = 1e-8
    singular_value: Singular = 0.03
    max_drift: Drift = 0.01


@schema
class RecedingOptions:
    """PMKE with limits: a receding horizon that keeps limits and obstacles; its knots are executed as they are."""

    prediction_step: Annotated[Positive, Field(description="[s] spacing of the knots")] = 1.0
    horizon: Annotated[Whole, Field(ge=1, le=1000, description="predicted knots")] = 2
    update_interval: Annotated[Positive, Field(description="[s] between predictions")] = 0.5
    objective: Prediction = "problem"
    tail: Annotated[
        Whole,
        Field(ge=0, le=1000, description="coarse knots from the horizon to the end of the path, against dead ends"),
    ] = 8
    real_time_iterations: Annotated[
        Annotated[Whole, Field(ge=1, le=1000)] | None,
        Field(description="quadratic programs of every update; null: as many as it takes"),
    ] = None
    confirm: Annotated[
        Literal["every", "last", "none"],
        Field(description="which windows ipopt checks, after the motion: every one; last: a sample of ten; none"),
    ] = "last"
    tolerance: Annotated[Positive, Field(description="of the predictions by ipopt, relative to their objective")] = 1e-8


@schema
class GlobalOptions:
    """The interpolation-based Global Kinematic Planner; counts as in its paper."""

    starts: Annotated[
        WordOrWords[Literal["roadmap", "population", "dynamic_programming"]],
        Field(
            description="where the solver starts from, one or a list; population: as in the paper; "
            "dynamic_programming: r = 1"
        ),
    ] = "roadmap"
    solver: Annotated[
        Literal["newton", "ipopt"],
        Field(description="newton, confirmed by ipopt, where it serves the problem (the log says so); ipopt: alone"),
    ] = "newton"
    transcription: Annotated[
        Literal["differences", "spline"] | None,
        Field(
            description="differences: backward, as in the papers; spline: a smooth curve that keeps its limits between "
            "the knots too; null: spline where boundary.rest, limits of acceleration or jerk, or an obstacle ask for it"
        ),
    ] = None
    nodes: Annotated[Whole, Field(ge=8, le=10_000, description="of the roadmap, in each layer")] = 300
    layers: Annotated[
        Whole, Field(ge=2, le=1000, description="of the roadmap, after the first; more in cycles round the base")
    ] = 6
    configurations: Annotated[
        Whole,
        Field(ge=1, le=MOST_STARTS, description="initial ones by random self-motion (boundaries free and cyclic)"),
    ] = 66
    draw: Annotated[
        Literal["normal", "latin_hypercube", "uniform"],
        Field(description="of the self-motion; uniform reaches every component of the manifold"),
    ] = "normal"
    candidates: Annotated[
        Annotated[Whole, Field(ge=1, le=MOST_MOTIONS)] | None,
        Field(
            description="weighted-pseudoinverse motions that are ranked; null: (points x joints)^2 of the coarsest grid"
        ),
    ] = None
    optimised: Annotated[
        Whole, Field(ge=1, le=MOST_STARTS, description="motions that are optimised on the coarsest grid")
    ] = 64
    budget: Annotated[
        Whole,
        Field(ge=1, le=MOST_STARTS, description="starts at most, while the last half of them brought something new"),
    ] = 1024
    limit_weight: Annotated[
        Number, Field(ge=0, description="k_L of eq. (14): distance from the joint limits in the ranking")
    ] = 0.01
    coarse_steps: Annotated[
        Annotated[Whole, Field(ge=2, le=MOST_KNOTS)] | None,
        Field(
            description="intervals of the coarsest grid, at most; null: 25, and 12 where ipopt works alone, or as many "
            "as show the path's shape"
        ),
    ] = None
    refine_to: Annotated[
        Annotated[Whole, Field(ge=2, le=MOST_KNOTS)] | None,
        Field(
            description="intervals up to which a grid is refined on which a motion would leave path.tolerance between "
            "its knots; null: those of timing.steps are kept"
        ),
    ] = 2000
    tolerance: Tolerance = 1e-8
    max_iterations: Iterations = 300
    max_time: MaxTime = None
    same_path: Annotated[
        Apart, Field(description="[rad] motions that differ by less at every knot, but for full turns, are one optimum")
    ] = 0.05

    @property
    def generators(self) -> tuple[str, ...]:
        """The words of `starts`."""
        return (self.starts,) if isinstance(self.starts, str) else self.starts


@schema
class DynamicProgrammingOptions:
    """Dynamic programming on a grid of the self-motion manifold (r = 1): an estimate of the best, and starts."""

    nodes: Annotated[Whole, Field(ge=8, le=10_000, description="on the longest manifold along the path")] = 360
    intervals: Annotated[
        Annotated[Whole, Field(ge=2, le=MOST_KNOTS)] | None,
        Field(description="of the time grid; null: those of timing.steps"),
    ] = 25
    velocity_slack: Annotated[
        Number, Field(ge=0, description="node spacings by which a step may exceed a velocity limit")
    ] = 0.0
    same_path: Annotated[
        Apart, Field(description="[rad] paths closer than this, but for full turns, are one optimum")
    ] = 0.2


@schema
class LowerBoundOptions:
    """A bound from below on the cost of every motion on a grid's knots, by cells of the self-motion loops (r = 1)."""

    intervals: Annotated[
        Annotated[Whole, Field(ge=5, le=MOST_KNOTS)] | None,
        Field(description="of the time grid; null: those of timing.steps"),
    ] = 50
    gap: Annotated[Number, Field(ge=1e-6, lt=1, description="relative, to the best motion found: where to stop")] = 1e-3
    cells: Annotated[Whole, Field(ge=8, le=10_000, description="on the longest manifold, before any is halved")] = 120


@schema
class CalculusOfVariationsOptions:
    """Stationary motions of the kinetic-energy integral (r = 1, no limits)."""

    spacing: Annotated[
        Number, Field(ge=1e-5, description="[rad] of the scan along the initial self-motion manifold")
    ] = 0.03
    refinements: Annotated[
        Whole, Field(ge=0, le=20, description="how often a scan interval is split where the final configuration jumps")
    ] = 3
    scan_tolerance: Annotated[Positive, Field(description="of the integration while scanning")] = 1e-6
    tolerance: Annotated[Positive, Field(description="of the integration of the motions found")] = 1e-10
    max_speed: Annotated[
        Positive | None,
        Field(description="[rad/s] largest initial null-space speed scanned for a fixed start; null: chosen by size"),
    ] = None


@schema
class PontryaginOptions:
    """The maximum principle as the two-point boundary-value problem that it is."""

    guesses: Annotated[
        Whole, Field(ge=1, le=MOST_STARTS, description="motions that the boundary-value problem is started from")
    ] = 24
    intervals: Annotated[Whole, Field(ge=4, le=MOST_KNOTS, description="of the mesh it starts on")] = 40
    tolerance: Annotated[
        Positive, Field(description="of the collocation's relative residual and of the boundary conditions")
    ] = 1e-9
    max_nodes: Annotated[Whole, Field(ge=10, le=MOST_KNOTS, description="of the mesh it ends on")] = 20000
    same_path: Annotated[
        Apart, Field(description="[rad] extremals that differ by less at every knot, but for full turns, are the same")
    ] = 0.01


@schema
class PontryaginAsPrintedOptions:
    """The maximum principle as the report prints it (eqs (21), (22)), integrated as it stands."""

    dt: Step = 0.01
    max_drift: Drift = 0.1


@schema
class SegmentsOptions:
    """Where a path must be cut, the optimum of each piece, and the transits between them."""

    intervals: Annotated[
        Annotated[Whole, Field(ge=FEWEST_PLACES, le=MOST_KNOTS)],
        Field(description="of the path, at whose ends it may be cut"),
    ] = 200
    nodes: Annotated[
        Whole,
        Field(ge=8, le=10_000, description="on the longest self-motion manifold (r = 1); of the samples of each place"),
    ] = 300
    planner: Annotated[GlobalOptions, Field(description="set method.global instead")] = GlobalOptions()


@schema
class ParetoOptions:
    """The front of two integrals; `planner` finds its extremes and its first motions."""

    method: Annotated[
        Literal["epsilon_constraint", "weighting"], Field(description="how the points between the extremes are found")
    ] = "epsilon_constraint"
    objectives: Annotated[
        Words[Literal[Integral, "duration", "path_tolerance"]],
        Field(
            description="the two integrals; duration and one of them: the law is free (timing=optimal); path_tolerance "
            "and one of them: the path need not be kept exactly (path.exact=false)"
        ),
    ] = ("kinetic_energy", "torque")
    steps: Annotated[Whole, Field(ge=2, le=10_000, description="of each of the two directions")] = 10
    rounds: Annotated[Whole, Field(ge=0, le=1000, description="of starts from both neighbours, at most")] = 3
    tolerance: Tolerance = 1e-8
    max_iterations: Iterations = 200
    max_time: MaxTime = None
    planner: Annotated[GlobalOptions, Field(description="set method.global instead")] = GlobalOptions()


@schema
class MethodConfig:
    """Group `method`: the options of every method; the key `methods` says which of them run."""

    lsv: LsvOptions = LsvOptions()
    inertia_weighted: LsvOptions = LsvOptions()
    pmke: PmkeOptions = PmkeOptions()
    receding: RecedingOptions = RecedingOptions()
    global_: Annotated[GlobalOptions, Field(alias="global")] = GlobalOptions()
    segments: SegmentsOptions = SegmentsOptions()
    pareto: ParetoOptions = ParetoOptions()
    dynamic_programming: DynamicProgrammingOptions = DynamicProgrammingOptions()
    lower_bound: LowerBoundOptions = LowerBoundOptions()
    calculus_of_variations: CalculusOfVariationsOptions = CalculusOfVariationsOptions()
    pontryagin: PontryaginOptions = PontryaginOptions()
    pontryagin_as_printed: PontryaginAsPrintedOptions = PontryaginAsPrintedOptions()

    def of(self, name: str) -> Any:
        """The options of the method `name`; None for one that has none."""
        return getattr(self, "global_" if name == "global" else name, None)
