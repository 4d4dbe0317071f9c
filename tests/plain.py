"""The command line, drawing and recording nothing, in a launcher's processes too: python -m tests.plain WORDS..."""

from __future__ import annotations

import sys

from omegaconf import DictConfig

from pipeline.artifacts.artifacts import ARTIFACTS, name
from pipeline.run import main, run

PLAIN = tuple(artifact for artifact in ARTIFACTS if name(artifact) not in ("page", "figures", "recording", "animation"))


def job(values: DictConfig) -> int:
    run.ARTIFACTS = PLAIN
    return main.job(values)


if __name__ == "__main__":
    sys.exit(main.run_job(job))
