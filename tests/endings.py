"""Runs that are ended from outside, at any moment: python -m tests.endings [--seed 1] [--count 24] [--busy].

A run, a front and a sweep, with one worker and two, by SIGKILL and by SIGTERM, in turn, each at a random moment of it.
Within GONE seconds every process must have left (--busy: only seen, on a machine that has much else to do), SIGTERM
must answer with 143, and a new start must end with what an undisturbed one has, to the last bit, and no file more.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from pipeline.run.ownership import LOCK
from tests.support import ROOT
from tests.tasks import HUNG, wait_until

SIZES = ("configurations=4", "candidates=24", "optimised=6", "solver=ipopt", "starts=population", "coarse_steps=12")
FEW = tuple(f"method.global.{size}" for size in SIZES)
PLAN = ("+experiment=sim1", "methods=[global]", "timing.steps=14", *FEW)
FRONT = ("+experiment=pareto", "timing.steps=12", "method.pareto.steps=3", *FEW)
SWEEP = ("-m", *PLAN, "seed=1,2")
WHAT = {"plan": PLAN, "front": FRONT, "sweep": SWEEP}
GONE = 2.0  # [s] by when every process has left
SAID = "error: terminated; what is finished is kept, start again to go on\n"


def begin(*words: str, cwd: Path, module: str = "pipeline") -> subprocess.Popen[str]:
    """The command line, with its workers in a session of its own and its temporary files in `cwd`/temporary."""
    temporary = cwd / "temporary"
    temporary.mkdir(exist_ok=True)
    places = {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary), "JOBLIB_TEMP_FOLDER": str(temporary)}
    return subprocess.Popen(
        [sys.executable, "-m", module, *words],
        cwd=cwd,
        env={**os.environ, "OMP_NUM_THREADS": "1", **places},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def placed(what: str, folder: Path) -> str:
    """The word that puts the results there."""
    return f"hydra.{'sweep' if what == 'sweep' else 'run'}.dir={folder}"


def session(leader: int) -> set[int]:
    """The living processes of a session; what waits for its parent to look is dead."""
    found = set()
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == leader and fields[0] not in "ZX":
                found.add(int(folder.name))
    return found


def strays(folder: Path) -> list[str]:
    """Half-written files and locks."""
    return [str(file) for file in folder.rglob(".*") if re.fullmatch(r"\.\d+\..+", file.name) or file.name == LOCK]


def motions(folder: Path) -> dict[str, pd.DataFrame]:
    """All that a run, or the runs of a sweep, have found."""
    return {str(f.relative_to(folder)): pd.read_parquet(f) for f in sorted(folder.rglob("trajectories.parquet"))}


def files(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*")}


def assert_same(folder: Path, whole: Path) -> None:
    found, expected = motions(folder), motions(whole)
    assert set(found) == set(expected)
    for name, motion in found.items():
        pd.testing.assert_frame_equal(motion, expected[name], check_exact=True)


def end(running: subprocess.Popen[str], how: signal.Signals) -> tuple[str, float]:
    """Send the signal: what the process then said, and the time [s] after which nobody of its session lived."""
    running.send_signal(how)
    asked = time.monotonic()
    # Not `communicate` first: whoever holds the pipe is one that must be gone.
    wait_until(lambda: running.poll() is not None and not session(running.pid))
    took = time.monotonic() - asked
    return running.communicate()[1], took


def once(what: str, how: signal.Signals, workers: int, after: float, whole: Path, folder: Path) -> tuple[float, str]:
    """End it `after` so many seconds, start it again, compare: how long [s] until all were gone, and where it was."""
    words = (*WHAT[what], f"parallel.workers={workers}", placed(what, folder / "out"))
    running = begin(*words, cwd=folder)
    with suppress(subprocess.TimeoutExpired):
        running.wait(after)
    finished = running.poll() is not None
    said, took = end(running, how)
    at = sorted(files(folder / "out")) if (folder / "out").exists() else []
    point = "finished" if finished else f"{len(at)} files"
    if not finished and how is signal.SIGTERM and at:
        # Beside: it was just leaving, or had not yet begun.
        assert running.returncode in (143, 0, -signal.SIGTERM), (running.returncode, said)
        assert said == (SAID if running.returncode == 143 else ""), said
        assert not strays(folder), strays(folder)
    again = begin(*words, cwd=folder)
    _, said = again.communicate(timeout=HUNG)
    assert (again.returncode, said) == (0, ""), (again.returncode, said)
    assert_same(folder / "out", whole)
    assert files(folder / "out") == files(whole), files(folder / "out") ^ files(whole)
    assert not list((folder / "temporary").iterdir()), list((folder / "temporary").iterdir())
    return took, point + f", exit code {running.returncode}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--busy", action="store_true")
    asked = parser.parse_args()
    chance = random.Random(asked.seed)
    wrong = 0
    with TemporaryDirectory() as place:
        lasts = {}
        for what in WHAT:
            started = time.monotonic()
            running = begin(*WHAT[what], "parallel.workers=1", placed(what, Path(place, what)), cwd=Path(place))
            assert (running.wait(HUNG), running.communicate()[1]) == (0, "")
            lasts[what] = time.monotonic() - started
        kinds = list(product(WHAT, (signal.SIGKILL, signal.SIGTERM), (1, 2)))
        for number in range(asked.count):
            what, how, workers = kinds[number % len(kinds)]
            after = chance.uniform(0.0, lasts[what])
            folder = Path(place, str(number))
            folder.mkdir()
            line = f"{number}: {what}, {workers} workers, {how.name} after {after:.2f} of {lasts[what]:.1f} s"
            try:
                took, point = once(what, how, workers, after, Path(place, what), folder)
            except AssertionError as error:
                wrong += 1
                print(f"{line}: WRONG: {error}", flush=True)
                continue
            late = took > GONE and not asked.busy
            wrong += late
            print(
                f"{line} ({point}): all gone {took:.2f} s later{', LATE' if late else ''}; the same again", flush=True
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
