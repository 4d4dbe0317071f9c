"""The configuration of an experiment, composed from Python: within a run of Hydra as well as without one."""

from __future__ import annotations

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from pipeline.config import RunConfig
from pipeline.prepare import PROJECT


def experiment(name: str, *overrides: str) -> RunConfig:
    """The checked configuration of `+experiment=name`; raises ConfigError, one line."""
    from pipeline.session import checked

    words = [f"+experiment={name}", *overrides]
    if GlobalHydra.instance().is_initialized():
        return checked(compose("config", overrides=words))
    with initialize_config_dir(str(PROJECT / "conf"), version_base="1.3"):
        return checked(compose("config", overrides=words))
