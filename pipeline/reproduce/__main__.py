"""`python -m pipeline.reproduce [pmke] [global] [pontryagin] [--folder DIR] [key=value ...]`: every printed number.

One sweep over the experiments of the documents, resumed where it was; then printed and recomputed side by side in
reproduction.csv, reproduction.md and reproduction.html. `key=value` is an override for every run. Exit code 0 if every
run confirmed its motions and every number was found, whatever the verdicts; 1 if not; 2 for bad input.
"""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from pipeline.common.errors import ConfigError, InputError
from pipeline.common.files import write_beside
from pipeline.config import documents
from pipeline.reproduce import pages, tables
from pipeline.reproduce.results import Results
from pipeline.reproduce.table import compare
from pipeline.run import main as command_line

FOLDER = Path("outputs") / "reproduction"


def main(words: Sequence[str]) -> int:
    """The sweep, then its tables and pages; returns the exit code."""
    if {"--help", "-h"} & {*words}:
        print(__doc__)
        return 0
    try:
        names, folder, overrides = parse(words)
        asked = [documents.read(name) for name in names]
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    wanted = list(dict.fromkeys(name for document in asked for name in document.experiments))
    code = sweep(wanted, folder / "runs", overrides)
    if code >= 2:
        return code
    missing = write(asked, folder)
    return max(code, 1 if missing else 0)


def parse(words: Sequence[str]) -> tuple[list[str], Path, list[str]]:
    """Documents (all of them if none is named), folder and overrides; raises ConfigError."""
    names, overrides, folder = [], [], FOLDER.absolute()
    rest = iter(words)
    for word in rest:
        if word == "--folder":
            given = next(rest, None)
            if given is None:
                raise ConfigError("--folder: needs a folder")
            folder = Path(given).absolute()
        elif "=" in word:
            overrides.append(word)
        elif word in documents.DOCUMENTS:
            names.append(word)
        else:
            allowed = ", ".join(documents.DOCUMENTS)
            raise ConfigError(f"{word}: no such document; allowed: {allowed}, --folder DIR and key=value")
    return list(dict.fromkeys(names)) or list(documents.DOCUMENTS), folder, overrides


def sweep(experiments: Sequence[str], folder: Path, overrides: Sequence[str] = ()) -> int:
    """Run what is not finished, a line per experiment; returns the exit code."""

    def job(values: DictConfig) -> int:
        own = HydraConfig.get()
        begin, log = time.perf_counter(), io.StringIO()
        with redirect_stdout(log):
            code = command_line.job(values)
        said, run = log.getvalue(), Path(own.runtime.output_dir)
        skipped = "skipped (sweep.resume)" in said
        if not skipped:
            write_beside(run / "log.txt", lambda file: file.write_text(said, encoding="utf-8"))
        ended = {0: "confirmed", 1: "not all confirmed", 2: "bad input"}.get(code, f"exit code {code}")
        took = "finished before" if skipped else f"{time.perf_counter() - begin:.0f} s"
        print(f"[{own.job.num + 1:2d}/{len(experiments)}] {run.name}: {ended}, {took}", flush=True)
        return code

    sys.argv[1:] = []
    return command_line.run_job(
        job,
        [
            "-m",
            f"+experiment={','.join(experiments)}",
            f"hydra.sweep.dir={folder}",
            "hydra.sweep.subdir=${name}",
            *overrides,
        ],
    )


def write(asked: Sequence[documents.Document], folder: Path) -> int:
    """Tables and pages from the runs in `folder`; returns how many printed numbers no run holds."""
    runs = {file.parent.name: Results(file.parent) for file in (folder / "runs").glob("*/run.json")}
    table = compare(asked, runs)
    tables.write(folder, asked, table)
    written = pages.write(folder, asked, table, runs)
    print(f"{tables.sentence(table)}\npages in {written[0]}")
    return int(table["recomputed"].isna().sum())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
