"""`python -m pipeline.describe robot=panda`: what an arm is, before anything is planned with it.

Prints joints and limits, masses, reach and the redundancy degree for each kind of task, and writes a recording in which
one joint after the other moves through its range.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig
from rich.console import Console

from pipeline.config.compose import checked
from pipeline.describe.facts import inspect
from pipeline.describe.show import show, sweep


def job(values: DictConfig) -> int:
    """Print and record one arm."""
    from hydra.core.hydra_config import HydraConfig

    from pipeline.artifacts.recording import inspection as arm_recording

    folder = Path(HydraConfig.get().runtime.output_dir)
    config = checked(values)
    facts = inspect(config.robot, config.gravity)
    console = Console()
    show(facts, console)
    file = folder / "recording.rrd"
    arm_recording.write(file, facts.arm, *sweep(facts), name=replace(config.robot).name)
    console.print(f"recording in {file}", highlight=False, soft_wrap=True)
    return 0


def main() -> int:
    """The command line."""
    from pipeline.run.main import run_job

    hooks = "hydra.callbacks.session._target_=pipeline.describe.session.Session"
    own = ["hydra.run.dir=outputs/describe/${robot.name}", hooks]
    return run_job(job, own, "python -m pipeline.describe", ("robot", "gravity"))


if __name__ == "__main__":
    sys.exit(main())
