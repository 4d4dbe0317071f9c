"""Where a run's results hold a number that a document prints: one dataclass for each kind of number."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from pipeline.config.fields import Number, Text, Whole, schema

Experiment = Annotated[Text, Field(description="the experiment whose run holds it")]
MethodOf = Annotated[Text, Field(description="the method, as in summary.csv")]
Joint = Annotated[Whole, Field(ge=1, description="the joint, from the base, from 1")]
Optimum = Annotated[Whole, Field(ge=1, description="the optimum, as in summary.csv")]


class Cell(NamedTuple):
    """Where summary.csv holds a number."""

    method: str
    optimum: int
    column: str


@schema
class Found:
    """Where a run's results hold a number."""

    experiment: Experiment = ""

    @property
    def experiments(self) -> tuple[str, ...]:
        """The experiments that the number takes."""
        return (self.experiment,)

    @property
    def cell(self) -> Cell | None:
        """The cell of summary.csv that is the number, if one is."""
        return None

    @property
    def timing(self) -> bool:
        """Whether it is a computing time: of this machine, as the printed one is of another."""
        return False

    @property
    def parts(self) -> tuple[Found, ...]:
        """The numbers that it is the ratio of, if it is one."""
        return ()


@schema
class Summary(Found):
    """A cell of summary.csv."""

    method: MethodOf = ""
    optimum: Optimum = 1
    column: Annotated[Text, Field(description="the column of summary.csv")] = ""
    kind: Literal["summary"] = "summary"

    @property
    def cell(self) -> Cell | None:
        return Cell(self.method, self.optimum, self.column)

    @property
    def timing(self) -> bool:
        return self.column == "wall_time_s"


@schema
class Peak(Found):
    """The largest velocity of one joint of a motion, up to a moment: its size, or the largest positive one."""

    method: MethodOf = ""
    joint: Joint = 1
    until: Annotated[Number | None, Field(description="[s] the moment; null: the end")] = None
    side: Annotated[Literal["both", "positive"], Field(description="both: by size")] = "both"
    kind: Literal["peak"] = "peak"

    @property
    def cell(self) -> Cell | None:
        whole = self.until is None and self.side == "both"
        return Cell(self.method, 1, f"peak_velocity_{self.joint}") if whole else None


@schema
class LimitTime(Found):
    """From or until when the planner's first optimum is at a limit [s]; a knot's velocity is the interval's to it."""

    joint: Joint = 1
    limit: Annotated[Literal["velocity", "torque", "power"], Field(description="which limit")] = "velocity"
    end: Annotated[Literal["from", "until"], Field(description="which end of the time")] = "from"
    kind: Literal["limit_time"] = "limit_time"


@schema
class JointsAtLimit(Found):
    """How many joints of the planner's first optimum are at their velocity limits at the same time, at most."""

    kind: Literal["joints_at_limit"] = "joints_at_limit"


@schema
class EndEffector(Found):
    """A coordinate of the end effector at the first or the last knot of the planner's first optimum [m]."""

    axis: Annotated[Literal["x", "y", "z"], Field(description="which coordinate")] = "x"
    end: Annotated[Literal["first", "last"], Field(description="which knot")] = "first"
    kind: Literal["end_effector"] = "end_effector"


@schema
class Validation(Found):
    """A cell of validation.csv, the planner's optima beside the calculus of variations."""

    optimum: Optimum = 1
    column: Annotated[Text, Field(description="the column of validation.csv")] = ""
    kind: Literal["validation"] = "validation"

    @property
    def cell(self) -> Cell | None:
        first = self.column == "stationary_objective" and self.optimum == 1
        return Cell("calculus_of_variations", 1, "kinetic_energy_integral") if first else None


@schema
class Minima(Found):
    """The number of the planner's optima that continuous time has too."""

    kind: Literal["minima"] = "minima"


@schema
class PowerLaw(Found):
    """The fit of the candidate study: log(distance) = intercept + exponent log(candidates)."""

    parameter: Annotated[Literal["exponent", "intercept"], Field(description="which parameter")] = "exponent"
    kind: Literal["power_law"] = "power_law"


@schema
class PredictionTime(Found):
    """The mean time of PMKE's predictions [s]: of the optimisation, of everything else, or of the whole."""

    of: Annotated[Literal["whole", "optimisation", "rest"], Field(description="of what")] = "whole"
    kind: Literal["prediction_time"] = "prediction_time"

    @property
    def timing(self) -> bool:
        return True


@schema
class SpectralRatio(Found):
    """The largest ratio over time of the spectral radius of M of one motion to that of another."""

    method: MethodOf = ""
    over: Annotated[Text, Field(description="the method of the other motion")] = ""
    kind: Literal["spectral_ratio"] = "spectral_ratio"


@schema
class RangeShare(Found):
    """How far the joints of a motion are from the middle of their ranges, at most, relative to half of them."""

    method: MethodOf = ""
    kind: Literal["range_share"] = "range_share"


@schema
class Mass(Found):
    """The identified mass of a link [kg]."""

    link: Annotated[Whole, Field(ge=1, description="the link, from the base, from 1")] = 1
    kind: Literal["mass"] = "mass"


Simple = (
    Summary
    | Peak
    | LimitTime
    | JointsAtLimit
    | EndEffector
    | Validation
    | Minima
    | PowerLaw
    | PredictionTime
    | SpectralRatio
    | RangeShare
    | Mass
)


@schema
class Ratio:
    """`of` over `to`: the ratio, how much larger in percent, or the size of that."""

    of: Annotated[Simple, Field(discriminator="kind")] = Summary()
    to: Annotated[Simple, Field(discriminator="kind")] = Summary()
    unit: Annotated[Literal["1", "percent", "percent_of_size"], Field(description="how it is told")] = "1"
    kind: Literal["ratio"] = "ratio"
    cell: ClassVar[None] = None
    timing: ClassVar[bool] = False

    @property
    def parts(self) -> tuple[Found, ...]:
        """Both numbers."""
        return self.of, self.to

    @property
    def experiments(self) -> tuple[str, ...]:
        """The experiments that the number takes, each once."""
        return tuple(dict.fromkeys((self.of.experiment, self.to.experiment)))
