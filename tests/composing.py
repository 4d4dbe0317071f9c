"""Hydra's composing, without what it does again and again while tests run: nobody changes the files of conf/ meanwhile.

It parses every file whenever it composes, merges the same files into the same whole, and composes everything once more
before each run, to read `hydra.mode`. What comes out is what Hydra makes (test_composing.py).
"""

from __future__ import annotations

import pickle
from collections.abc import Hashable
from dataclasses import astuple
from typing import Any

import pytest
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import ConfigRepository, IConfigRepository
from hydra._internal.hydra import Hydra
from hydra.core.default_element import ResultDefault
from hydra.plugins.config_source import ConfigResult
from omegaconf import DictConfig

from pipeline.run.main import CONF
from tests.support import ROOT

OURS = {"hydra.conf", "", str(ROOT / "conf"), CONF}
LOAD, MERGE = ConfigRepository.load_config, ConfigLoaderImpl._compose_config_from_defaults_list
MODE = Hydra.get_mode


def compose_once(patch: pytest.MonkeyPatch) -> None:
    """From now on."""
    made: dict[Hashable, bytes] = {}

    def load_once(repository: ConfigRepository, config_path: str) -> ConfigResult | None:
        places = _places(repository)
        if not {*places} <= OURS:
            return LOAD(repository, config_path)
        key = (config_path, *places)
        if key not in made:
            made[key] = pickle.dumps(LOAD(repository, config_path))
        result: ConfigResult | None = pickle.loads(made[key])
        return result

    def merge_once(loader: ConfigLoaderImpl, defaults: list[ResultDefault], repo: IConfigRepository) -> DictConfig:
        places = _places(repo)
        if not {*places} <= OURS:
            return MERGE(loader, defaults, repo)
        key = (*map(astuple, defaults), *places)
        if key not in made:
            made[key] = pickle.dumps(MERGE(loader, defaults, repo))
        result: DictConfig = pickle.loads(made[key])
        return result

    def mode_if_said(hydra: Hydra, config_name: str | None, overrides: list[str]) -> Any:
        said = any(key in word for word in overrides for key in ("mode", "searchpath"))
        if said or not {*_places(hydra.config_loader)} <= OURS:
            return MODE(hydra, config_name, overrides)
        return None  # no file of conf/ says it

    patch.setattr(ConfigRepository, "load_config", load_once)
    patch.setattr(ConfigLoaderImpl, "_compose_config_from_defaults_list", merge_once)
    patch.setattr(Hydra, "get_mode", mode_if_said)


def _places(sources: Any) -> list[str]:
    return [source.path for source in sources.get_sources()]
