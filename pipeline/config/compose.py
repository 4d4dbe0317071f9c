"""The configuration of an experiment, composed from Python: within a run of Hydra as well as without one."""

from __future__ import annotations

from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from pipeline.common.errors import ConfigError
from pipeline.common.files import shipped
from pipeline.config.as_written import keep_as_written
from pipeline.config.methods import METHODS
from pipeline.config.run import RunConfig, check
from pipeline.config.unfolding import bound_files, bounded


def experiment(name: str, *overrides: str) -> RunConfig:
    """The checked configuration of `+experiment=name`; raises ConfigError, one line."""
    keep_as_written()
    bound_files()
    words = [f"+experiment={name}", *overrides]
    if GlobalHydra.instance().is_initialized():
        return checked(compose("config", overrides=words))
    with initialize_config_dir(str(shipped("conf")), version_base="1.3"):
        return checked(compose("config", overrides=words))


def checked(values: DictConfig) -> RunConfig:
    """The typed configuration of a composed one; raises ConfigError."""
    own = OmegaConf.masked_copy(values, [str(key) for key in values if key != "hydra"])
    try:
        with bounded(together=True):
            plain = OmegaConf.to_container(own, resolve=True, throw_on_missing=False)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key}: {str(error.msg).splitlines()[0]}") from None
    assert isinstance(plain, dict)
    _require_every_method(plain.get("method"))
    return check({str(key): value for key, value in plain.items()})


def _require_every_method(group: Any) -> None:
    """Refuse `method=global`, which would leave the methods that run as they are."""
    if isinstance(group, dict) and not set(METHODS) <= set(group):
        chosen = ", ".join(map(str, group))
        raise ConfigError(
            f"method = {chosen}: the group holds the options of all methods; which of them run is said by "
            f"methods=[{chosen}]"
        )
