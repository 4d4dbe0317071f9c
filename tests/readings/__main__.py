"""`python -m tests.readings`: what the documents' open steps can be read as, and what each reading gives.

Writes docs/readings.md. Nothing is tuned: the readings are all listed, the printed numbers that come out are marked.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from pipeline.build.problem import prepare
from pipeline.common.markdown import markdown_table
from pipeline.config.compose import experiment
from pipeline.config.documents import half_width
from pipeline.methods.global_planner.planner import global_planner
from tests.readings import nedungadi, peak, pmke
from tests.readings.planar import Values

FILE = Path(__file__).resolve().parents[2] / "docs" / "readings.md"
SHOWN = 8  # of the other readings of PMKE


def marked(values: Iterable[float], printed: Sequence[str]) -> list[str]:
    """As many digits as printed and one more; bold where the printed one comes out."""
    cells = []
    for value, text in zip(values, printed, strict=True):
        half = half_width(text)
        digits = max(0, round(-np.log10(2 * half))) + 1
        shown = f"{value:.{len(text.split('e')[0].split('.')[1]) + 1}e}" if "e" in text else f"{value:.{digits}f}"
        cells.append(f"**{shown}**" if abs(value - float(text)) <= half * (1 + 1e-9) else shown)
    return cells


def planned() -> Values:
    """The planner's three motions (3, N + 1, 3) that the Global paper prints, of simulation 1."""
    words = ("method.global.starts=dynamic_programming", "method.global.solver=newton")
    config = experiment("sim1_validation", *words)
    found = global_planner(prepare(config), config.method.of("global"))
    return np.array([found[k].trajectory.q for k in (0, 1, 3)])  # the paper misses the third


def of_pmke() -> list[str]:
    """All that differ in one step, and of the others those that give most printed numbers."""
    readings = list(pmke.readings())
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(pmke.numbers, readings, chunksize=8))
    printed = [text for *_, text in pmke.PRINTED]
    rows = [(reading, marked(values, printed)) for reading, values in zip(readings, found, strict=True)]
    single = [row for row in rows if ";" not in row[0].name]
    others = sorted((row for row in rows if ";" in row[0].name), key=lambda row: -hits(row[1]))[:SHOWN]
    head = ["reading", *(f"{number}, {quantity}" for number, quantity, _ in pmke.PRINTED), "of 13"]
    lines = [head, ["*printed*", *printed, ""]]
    lines += [[reading.name, *cells, str(hits(cells))] for reading, cells in single + others]
    both = sum(cells[10].startswith("*") and cells[0].startswith("*") for _, cells in rows)
    return [
        "## PMKE, Table 1 (`tests/readings/pmke.py`)",
        "",
        f"{len(rows)} readings: step 6 (a spline of degree 4 with knots at 0.75 and 1.25 s, at 0.5 and 1.5 s or twice "
        "at 1 s, of degree 5 or 3; the acceleration at its start), step 4 (its guess; M at the end or begin of an "
        "interval or both), eq. (2) (the velocity of a step at its end or begin, or the one that leads back to the "
        "path), and step 9 (the last prediction). Energies in J s, joints in rad/s, radius in kg m²; before each the "
        "number of the trajectory.",
        "",
        *markdown_table(lines),
        "",
        f"The most printed numbers that one reading gives: {max(hits(cells) for _, cells in rows)} of 13. "
        "The energies 4.08e-3 and 7.57e-3 "
        + ("come out of none" if not any(c[3][0] == "*" or c[6][0] == "*" for _, c in rows) else "come out")
        + f"; readings that give 0.780 rad/s on trajectory 4 and the energy of trajectory 1: {both}. The guess changes "
        "nothing: the paper's solver has not found worse predictions from a single one.",
        "",
    ]


def hits(cells: Sequence[str]) -> int:
    """How many are marked."""
    return sum(cell.startswith("**") for cell in cells)


def of_nedungadi(planned: Values) -> list[str]:
    """The three steps of every integrator with the right sign, and the nearest with the others."""
    printed = ["0.0532", "0.0567", "0.0673", "8.5e-3", "2.2e-2", "3.8e-3"]
    lines = [
        ["sign", "integrator", "step [s]", *(f"E {k}" for k in (1, 2, 3)), *(f"difference {k}" for k in (1, 2, 3))]
    ]
    lines.append(["*printed*", "", "", *printed])
    nearest = {}
    for integrator, sign, step in nedungadi.readings():
        with np.errstate(all="ignore"):  # the wrong signs run away
            energies, differences = nedungadi.follow(integrator, sign, step, planned)
        off = float(np.abs(energies - nedungadi.PRINTED["energies"]).max())
        nearest[sign] = min(nearest.get(sign, np.inf), off)
        if sign == "- M^-1 n":
            lines.append([sign, integrator, f"{step:g}", *marked([*energies, *differences], printed)])
    return [
        "## Global paper, Table 4 (`tests/readings/nedungadi.py`)",
        "",
        "Ten integrators, four readings of eq. (20), three steps, from the planner's configurations; energies in J s, "
        "mean joint differences in rad. No reading gives more than one of the six numbers.",
        "",
        *markdown_table(lines),
        "",
        "The three energies are missed by at least "
        + ", ".join(f"{off:.2g} with {sign}" for sign, off in nearest.items())
        + ": the printed sign and the missing inverse are excluded.",
        "",
    ]


def of_peaks(planned: Values) -> list[str]:
    """All of them."""
    lines = [["inertia of an interval", "differences", "joint 1", "joint 2", "joint 3"]]
    printed = [f"{value:.3f}" for value in peak.PRINTED]
    lines.append(["*printed*", "", *printed])
    lines += [[place, rule, *marked(values, printed)] for place, rule, values in peak.readings(planned[0])]
    return [
        "## Global paper, Section 4.2: peak velocities of simulation 1 (`tests/readings/peak.py`)",
        "",
        "In rad/s. Backward differences with M at the end of an interval give two of the three, nothing gives joint 1 "
        "with them.",
        "",
        *markdown_table(lines),
        "",
    ]


def main() -> None:
    """Write the file."""
    motions = planned()
    head = [
        "# What the documents leave open, and what each reading gives",
        "",
        "Written by `python -m tests.readings` (`make readings`). Bold: the printed digits come out. Where none fits, "
        "that is the result; no number of the project depends on these searches.",
        "",
    ]
    FILE.write_text("\n".join([*head, *of_pmke(), *of_nedungadi(motions), *of_peaks(motions)]), encoding="utf-8")


if __name__ == "__main__":
    main()
