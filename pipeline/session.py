"""What Hydra calls around a run or a sweep: check before anything is written, collect the sweep's table at the end."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from pipeline import config as schema
from pipeline.errors import InputError

exit_code = 0  # of the process: 0 all confirmed, 1 a method failed, 2 bad input


def checked(values: DictConfig) -> schema.RunConfig:
    """The typed configuration of a composed one; raises ConfigError."""
    own = OmegaConf.masked_copy(values, [str(key) for key in values if key != "hydra"])
    plain = OmegaConf.to_container(own, resolve=True, throw_on_missing=False)
    assert isinstance(plain, dict)
    return schema.check({str(key): value for key, value in plain.items()})


class Session(Callback):
    """Hydra's hooks. Hydra swallows exceptions of a callback, so bad input ends the process here."""

    def on_run_start(self, config: DictConfig, **_: Any) -> None:
        """Refuse bad input before Hydra makes the output folder."""
        from pipeline.prepare import prepare

        try:
            prepare(checked(config))
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            raise SystemExit(2) from None

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        """Put the summaries of all runs of the sweep into one table."""
        from pipeline.artifacts import tables

        tables.write_sweep(Path(config.hydra.sweep.dir))
