"""`python -m tests.reproduce.errata [FOLDER]`: every command of docs/errata.md, and its numbers beside what it says.

`make reproduce` ends with it. What the reproduction in FOLDER (outputs/reproduction) has run is read from there; what
else a line asks for is run beside it, resumed. Exit code 1 if a command fails or a number is not the one that stands
there.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.common.errors import InputError
from pipeline.config.documents import half_width
from pipeline.config.found import EndEffector, Mass, Peak, Simple, SpectralRatio, Summary, Validation
from pipeline.reproduce.__main__ import FOLDER
from pipeline.reproduce.recompute import Runs, recompute
from pipeline.reproduce.results import Results

ROOT = Path(__file__).resolve().parents[2]
ENERGY, PRINTED, TRUE = "kinetic_energy_integral", "pontryagin_as_printed", "pontryagin"


def objective(case: str, method: str) -> Summary:
    return Summary(case, method, 1, "objective")


# Numbers, each with the words of the text that end in it, of the runs of a reproduction: those that the tests make too,
QUICK: tuple[tuple[Simple, str], ...] = (
    (Peak("traj2", "lsv", 1), "LSV peak of joint 1 is 0.176"),
    (Peak("traj2", "lsv", 3), "that of joint 3 is 0.548"),
    (Peak("traj3", "lsv", 2, until=6.2), "downwards it reaches 0.207"),
    (Summary("traj4", "global", 1, ENERGY), '"global" 3.03e-2'),
    (Summary("traj2", "pmke", 1, ENERGY), "gives 3.92e-3"),
    (Summary("traj3", "pmke", 1, ENERGY), "and 6.93e-3"),
    (EndEffector("sim2", "y", "first"), "starts at y = -0.0004"),
    (Summary("sim1_validation", "global", 3, ENERGY), "A fourth optimum, 0.0573"),
    (Summary("sim3", "global", 1, "torque_integral"), "not optimal: 0.09066"),
    (Summary("sim4", "global", 1, "torque_integral"), "and 0.09109"),
    (Validation("sim1_validation", 1, "stationary_objective"), "stationary motions' 0.0527"),
    (Validation("sim1_validation", 4, "stationary_objective"), "0.0560, 0.0666"),
    (Peak("sim1_validation", "global", 1), "joint 1 is 1.564"),
    (Summary("case1", PRINTED, 1, "transversality_end"), "As printed it is 0.0081"),
    (Summary("case4a", PRINTED, 1, "transversality_end"), "in case 1 and 16.5"),
    (objective("case2", PRINTED), "not far: -22.06"),
    (Summary("case4a", PRINTED, 1, "final_error"), "0.0253 and 0.0615"),
    (Summary("case4b", PRINTED, 1, "final_error"), "to 0.0055"),
)
# and those that it makes alone.
WHOLE: tuple[tuple[Simple, str], ...] = (
    (Mass("identify_masses", 1), "95 %): 0.618"),
    (Mass("identify_masses", 2), "± 0.002 kg, 0.8146"),
    (Mass("identify_masses", 3), "± 0.0009 kg, 0.5058"),
    (SpectralRatio("traj4", "pmke", "lsv"), "% above, 1.0011"),
    (Summary("case1", TRUE, 1, "objective_of_method"), "The optimum costs 0.1529170"),
    (objective("case1", "lsv"), "the pseudoinverse 0.1529191"),
    (objective("case2", TRUE), "instead of -23.32"),
    (objective("case3", PRINTED), "The printed motion costs 44.4"),
    (objective("case3", "lsv"), "no better than the pseudoinverse (44.3"),
    (objective("case3", "global"), "the optimum costs 25.35"),
    (objective("case4a", PRINTED), "as far from optimal (-427"),
    (objective("case4b", PRINTED), "(-427, -440"),
    (objective("case4a", TRUE), "optimum -507.36"),
)
# Of runs beside the reproduction: a word of their command, the number, and the words.
BESIDE: tuple[tuple[str, Simple, str], ...] = (
    ("starts=dynamic_programming", Summary("traj4", "global", 1, ENERGY), "the same path needs 2.301e-2"),
    ("lsv.dt", Summary("traj3", "lsv", 1, ENERGY), "from 1.691e-2"),
    ("lsv.dt", Summary("traj3", "lsv", 1, ENERGY), "to 1.753e-2"),
)


def text() -> str:
    return (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")


def commands() -> list[str]:
    """Of all lines, each once, in their order."""
    lines = [line.split("|")[-2] for line in text().splitlines() if line.startswith("| ")]
    return list(dict.fromkeys(command for line in lines for command in re.findall(r"`python -m ([^`]+)`", line)))


def wrong(numbers: Sequence[tuple[Simple, str]], runs: Runs) -> list[str]:
    """What does not stand in the text, is not in the runs, or is not the number that stands there."""
    whole, found = text(), []
    for number, said in numbers:
        printed = re.split(r"[ (]", said)[-1]
        try:
            value = recompute(number, runs)
        except InputError as error:
            found.append(f"{said}: {error}")
            continue
        if said not in whole or not abs(value - float(printed)) <= half_width(printed) * (1 + 1e-9):
            found.append(f"{said}: {value:.6g}")
    return found


def run(command: str, folder: Path, beside: Path) -> int:
    """Its exit code; 0 where the reproduction in `folder` has run it; other runs stand in `beside`."""
    module, *words = shlex.split(command)
    if module == "pipeline.reproduce":
        return 0
    if module == "pipeline":
        words = [word for word in words if word != "-m"]
        if len(words) == 1 and all((folder / "runs" / n / "run.json").is_file() for n in experiments(words[0])):
            return 0
        words = ["-m", *words, f"hydra.sweep.dir={beside}"]
    return subprocess.run([sys.executable, "-m", module, *words], cwd=ROOT, check=False).returncode


def experiments(word: str) -> list[str]:
    return word.removeprefix("+experiment=").split(",")


def main(words: Sequence[str]) -> int:
    folder = Path(words[0] if words else FOLDER).absolute()
    found = []
    for number, command in enumerate(commands(), 1):
        beside = folder / "errata" / f"{number:02d}"
        code = run(command, folder, beside)
        print(f"python -m {command}: {'ends as it should' if code == 0 else f'exit code {code}'}", flush=True)
        found += [f"{command}: exit code {code}"] * (code != 0)
        for word, one, said in BESIDE:
            if word in command:
                made = [Results(file.parent) for file in sorted(beside.glob("*/run.json"))]
                # Of several runs one is enough: the text gives the ends of a range.
                tried = [wrong([(one, said)], {one.experiment: results}) for results in made]
                found += [] if [] in tried else [f"{said}: not in {beside}"]
    found += wrong(
        (*QUICK, *WHOLE), {file.parent.name: Results(file.parent) for file in folder.glob("runs/*/run.json")}
    )
    print("\n".join(found) if found else f"docs/errata.md: {len(QUICK + WHOLE) + len(BESIDE)} numbers are what it says")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
