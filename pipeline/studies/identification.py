"""The masses of an arm from the numbers that documents print: nonlinear least squares over re-optimised motions.

The documents state masses that do not give their own results. Here the masses are unknowns, started at the stated ones:
every residual is (recomputed - printed) over the standard deviation of the printed rounding, half a unit of the last
digit over sqrt(3). An optimum moves when the masses change, so it is optimised again, from where it was. Since another
optimum can become the best one on the way, all are searched afresh at the masses found, until that changes nothing.
Quadratures are the documents' (`costs.py`): backward differences on their own grids.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.common.markdown import cells, markdown_table
from pipeline.common.workers import Workers
from pipeline.config import documents
from pipeline.config.compose import experiment
from pipeline.config.documents import half_width
from pipeline.config.found import Summary
from pipeline.config.methods import GlobalOptions
from pipeline.config.studies import IdentificationConfig
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.model.arm import Arm
from pipeline.model.task import PositionTask
from pipeline.problem.costs import integrals, velocities
from pipeline.problem.problem import Problem
from pipeline.program.newton.newton import WARM
from pipeline.program.newton.serve import Solver, why_not
from pipeline.program.transcription import transcribe
from pipeline.robot.description import Description
from pipeline.studies import style
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEW = GlobalOptions(starts="population", candidates=60, optimised=12)
ROUNDS = 5  # of fits, at most, each from the optima at the masses of the one before
SETTLED = 1e-4  # relative: masses that change less are found
STEP = 1e-3  # relative, of the differences by the masses
Key = tuple[str, str, int]  # experiment, method, optimum: one motion


@dataclass(frozen=True)
class Printed:
    """One printed number that depends on the masses. sigma: standard deviation of its rounding."""

    document: str
    place: str
    row: documents.Row
    found: Summary

    @property
    def motion(self) -> Key:
        return self.found.experiment, self.found.method, self.found.optimum

    @property
    def value(self) -> float:
        return self.row.value

    @property
    def half_width(self) -> float:
        return half_width(self.row.reading or self.row.printed)

    @property
    def sigma(self) -> float:
        return float(self.half_width / np.sqrt(3))


@dataclass(frozen=True)
class Identification(Result):
    """masses: link, printed, identified, and the bounds low and high of the confidence interval [kg].

    numbers: a row per printed number, with what both sets of masses give and the residuals in units of the rounding.
    """

    name: ClassVar[str] = "identification"
    masses: pd.DataFrame
    numbers: pd.DataFrame
    confidence: float = 0.95
    rounds: int = 0
    evaluations: int = 0

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"masses": self.masses, "identification": self.numbers}

    def section(self) -> list[str]:
        lines = [f"## Masses [kg], with intervals of {self.confidence:.0%} confidence", ""]
        lines += markdown_table(cells(self.masses))
        lines += ["", "## What the printed and the identified masses give (residuals in units of the rounding)", ""]
        return lines + markdown_table(cells(self.numbers))

    def figures(self, title: str) -> Mapping[str, Figure]:
        return {"identification": draw(self, title)}


def study(motions: Motions) -> Identification | None:
    """Where it is asked for. Its many small results are not worth keeping for a resumed run."""
    config = motions.config
    if not config.identification.run:
        return None
    return identify(motions.problem.task.arm, config.identification, config.seed, replace(motions.workers, store=None))


def identify(arm: Arm, config: IdentificationConfig, seed: int, workers: Workers) -> Identification:
    """The masses of the links of `arm`, from its own on, and what they explain; raises ConfigError if nothing does."""
    printed = _printed(config)
    fitted = [entry for entry in printed if entry.row.masses == "fit"]
    start = masses_of(arm.description)
    if len(fitted) <= len(start):
        raise ConfigError(f"identification.documents: {len(fitted)} numbers to fit for {len(start)} masses")
    masses, rounds, evaluations, settled = start, 0, 0, False
    before: dict[Key, Array] = {}
    motions: dict[Key, Array] = {}
    target, sigma = (np.array([getattr(e, key) for e in fitted]) for key in ("value", "sigma"))
    while not settled and rounds < ROUNDS:
        motions = _solve(_wanted(fitted), masses, seed, workers)
        if rounds == 0:
            before = dict(motions)

        def residuals(unknowns: Array, motions: dict[Any, Array] = motions) -> Array:
            moved = _follow(motions, unknowns, workers)
            motions.update({key: q for key, (q, _) in moved.items()})
            found = [moved[entry.motion][1][entry.found.column] for entry in fitted]
            return (np.array(found) - target) / sigma

        fit = least_squares(residuals, masses, method="lm", x_scale=start, diff_step=STEP, xtol=1e-6)
        rounds, evaluations = rounds + 1, evaluations + fit.nfev
        settled, masses = bool(np.abs(fit.x / masses - 1).max() < SETTLED), fit.x
    # Printed numbers that fit worse than their rounding widen the intervals: s^2 is estimated where it exceeds 1.
    freedom = len(fitted) - len(masses)
    variance = max(1.0, float((fit.fun**2).sum()) / freedom)
    spread = np.sqrt(variance * np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    from scipy.stats import t as student  # takes a quarter of a second to import

    spread *= student.ppf((1 + config.confidence) / 2, freedom)
    table = pd.DataFrame(
        {
            "link": np.arange(1, len(masses) + 1),
            "printed": start,
            "identified": masses,
            "low": masses - spread,
            "high": masses + spread,
        }
    )
    after = {key: q for key, (q, _) in _follow(motions, masses, workers).items()}
    both = [_under(printed, values, known, seed, workers) for values, known in ((start, before), (masses, after))]
    return Identification(table, _residuals(printed, *both), config.confidence, rounds, evaluations)


def masses_of(description: Description) -> Array:
    """The masses [kg] (n,) of the links that the moving joints carry."""
    return np.array([float(element.get("value", "nan")) for element in _mass_elements(description)[1]])


def with_masses(arm: Arm, masses: Array) -> Arm:
    """The same arm with other masses [kg] (joints,); all else of its links, its mounting and its base stay."""
    description = arm.on_fixed_base.description
    root, elements = _mass_elements(description)
    for element, mass in zip(elements, masses, strict=True):
        element.set("value", repr(float(mass)))
    return Arm(replace(description, xml=ET.tostring(root, encoding="unicode")), arm.mounting, arm.base)


def _mass_elements(description: Description) -> tuple[ET.Element, list[ET.Element]]:
    root = ET.fromstring(description.xml)
    found = []
    for name in description.joints:
        joint = next(joint for joint in root.findall("joint") if joint.get("name") == name)
        child = joint.find("child")
        link = "" if child is None else child.get("link", "")
        mass = root.find(f"link[@name='{link}']/inertial/mass")
        if mass is None:
            raise ConfigError(f"identification: link {link} of {description.name} states no mass")
        found.append(mass)
    return root, found


def _printed(config: IdentificationConfig) -> list[Printed]:
    """The rows of the documents that depend on the masses."""
    found = []
    for name in config.documents:
        for place, row in documents.read(name).rows:
            if row.masses == "no":
                continue
            if not isinstance(row.found, Summary) or row.between is not None:
                raise ConfigError(f"{name}, {place.place}, {row.quantity}: masses need a number of summary.csv")
            found.append(Printed(name, place.place, row, row.found))
    return found


def _wanted(printed: Sequence[Printed]) -> list[Key]:
    return list(dict.fromkeys(entry.motion for entry in printed))


@cache
def _as_printed(name: str) -> Problem:
    """The problem of an experiment with the arm as printed: composed once in every process."""
    return prepare(experiment(name, "robot=planar3r_printed"))


def _problem(name: str, masses: Array) -> Problem:
    """The same with other masses."""
    problem = _as_printed(name)
    assert isinstance(problem.task, PositionTask)
    return replace(problem, task=PositionTask(with_masses(problem.task.arm, masses), problem.task.axes))


def _solve(wanted: Sequence[Key], masses: Array, seed: int, workers: Workers) -> dict[Key, Array]:
    """The motions asked for, found from nothing at these masses: (experiment, method, optimum) -> q (N + 1, n)."""
    motions = {}
    for name, method in dict.fromkeys(key[:2] for key in wanted):
        problem = _problem(name, masses)
        solutions = METHODS[method](problem, FEW if method == "global" else None, Context(seed, workers))
        found = {s.optimum: s.trajectory.q for s in solutions if s.found}
        for key in wanted:
            if key[:2] == (name, method):
                if key[2] not in found:
                    raise ConfigError(f"identification: {name} has no optimum {key[2]} of {method} at masses {masses}")
                motions[key] = found[key[2]]
    return motions


def _follow(motions: dict[Key, Array], masses: Array, workers: Workers) -> dict[Key, tuple[Array, dict[str, float]]]:
    """Every motion optimised again at other masses, and its numbers."""
    items = [(*key, q) for key, q in motions.items()]
    return dict(zip(motions, workers.map(_moved, masses, items), strict=True))


def _moved(masses: Array, item: tuple[str, str, int, Array]) -> tuple[Array, dict[str, float]]:
    name, method, _, q = item
    problem = _problem(name, masses)
    if method == "global":
        q = _again(problem, q)
    return q, quantities(problem, q)


def _again(problem: Problem, q: Array) -> Array:
    """The optimum near q (N + 1, n): by Newton's method where it serves and ends, else by IPOPT."""
    if why_not(problem) is None:
        answer = Solver(problem).on(problem.times).solve(q[None], WARM)
        if answer.converged[0]:
            return answer.q[0]
    return transcribe(problem, problem.times, q).solve(tolerance=1e-8, max_iterations=200)[0]


def quantities(problem: Problem, q: Array) -> dict[str, float]:
    """The numbers of a motion (N + 1, n) on even knots, by the names of summary.csv."""
    times = np.linspace(0.0, problem.reference.duration, len(q))
    costs, qd = integrals(problem, times, q), velocities(problem, times, q)
    radius = np.linalg.eigvalsh(problem.task.arm.mass_matrix(q))[:, -1]
    row = {
        "kinetic_energy_integral": costs.integrals["kinetic_energy"],
        "torque_integral": costs.integrals["torque"],
        "min_spectral_radius": float(radius.min()),
        "min_spectral_radius_time": float(times[radius.argmin()]),
    }
    for name, values in (("velocity", qd), ("torque", costs.tau), ("power", costs.tau * qd)):
        row |= {f"peak_{name}_{j + 1}": float(peak) for j, peak in enumerate(np.abs(values).max(axis=0))}
    return row


def _under(
    printed: Sequence[Printed], masses: Array, known: dict[Key, Array], seed: int, workers: Workers
) -> list[float]:
    """What these masses give for every printed number; motions that are not `known` at them are found from nothing."""
    motions = known | _solve([key for key in _wanted(printed) if key not in known], masses, seed, workers)
    found = {key: quantities(_problem(key[0], masses), q) for key, q in motions.items()}
    return [found[entry.motion][entry.found.column] for entry in printed]


def _residuals(printed: Sequence[Printed], before: list[float], after: list[float]) -> pd.DataFrame:
    rows = []
    for entry, old, new in zip(printed, before, after, strict=True):
        row = entry.row
        rows.append(
            {
                "document": entry.document,
                "place": entry.place,
                "quantity": row.quantity,
                "printed": row.printed,
                "read_as": row.reading or row.printed,
                "unit": row.unit,
                "used": row.masses,
                "with_printed_masses": old,
                "with_identified_masses": new,
                "residual_printed": (old - entry.value) / entry.half_width,
                "residual_identified": (new - entry.value) / entry.half_width,
            }
        )
    return pd.DataFrame(rows)


def draw(found: Identification, title: str) -> Figure:
    """Residuals of every number, in units of its rounding, on a logarithmic scale on both sides of zero."""
    numbers = found.numbers.iloc[::-1]
    place = np.arange(len(numbers))
    figure = style.sheet(9.0, 0.27 * len(numbers) + 1.8)
    axes = figure.add_subplot()
    axes.axvspan(-1, 1, color="#E2E8F0", zorder=0, label="rounding of the printed digits")
    for column, method, label, marker in (
        ("residual_printed", "lsv", "printed masses", "x"),
        ("residual_identified", "global", "identified masses", "o"),
    ):
        axes.plot(numbers[column], place, marker, color=style.color(method), markersize=5, label=label)
    axes.set_xscale("symlog", linthresh=2.0)
    axes.set_yticks(place, _labels(numbers), fontsize=7.5)
    axes.set_ylim(-0.8, len(numbers) - 0.2)
    axes.set_xlabel("Recomputed minus printed, in half units of the last printed digit")
    masses = "  ".join(
        f"$m_{row['link']}$ = {row['identified']:.4f} ± {(row['high'] - row['low']) / 2:.4f}"
        for row in found.masses.to_dict("records")
    )
    figure.suptitle(f"{title}: {masses} kg", fontsize=11)
    axes.grid(True, axis="x", color="0.93")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _labels(numbers: pd.DataFrame) -> list[str]:
    used = np.where(numbers["used"] == "fit", "", " (not fitted)")
    return [
        f"{row['document']}, {row['place']}: {row['quantity']}{mark}"
        for row, mark in zip(numbers.to_dict("records"), used, strict=True)
    ]
