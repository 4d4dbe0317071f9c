"""What tests compose is what Hydra composes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import ConfigRepository
from omegaconf import Container, DictConfig
from omegaconf.base import Node

from tests import composing
from tests.commands import call
from tests.support import ROOT

WORDS = ("+experiment=panda_obstacle", "limits=joint", "path.length=0.2", "~obstacles.shapes.ball", "+obstacles.more=1")


def whole(*words: str) -> DictConfig:
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return compose("config", overrides=list(words), return_hydra_config=True)


def nodes(value: Any) -> list[Any]:
    """Every node's key, kind, types, flags and, of a leaf, its unresolved value."""
    found: list[Any] = []
    if isinstance(value, Node):
        told = value._metadata
        leaf = None if isinstance(value, Container) else value._value()
        flags = {name: flag for name, flag in (told.flags or {}).items() if flag is not None}
        found.append(
            (value._get_full_key(None), type(value), told.ref_type, told.object_type, told.optional, flags, leaf)
        )
    if isinstance(value, DictConfig):
        found += [one for key in value for one in nodes(value._get_node(key))]
    elif isinstance(value, Container) and not value._is_none():
        found += [one for key in range(len(value)) for one in nodes(value._get_node(key))]  # type: ignore[arg-type]
    return found


def test_nothing_differs_and_nothing_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    first = whole(*WORDS)
    assert len(nodes(first)) > 300
    made = nodes(first)
    first.path.length = 9.0
    first.hydra.job.env_copy.append("changed")
    assert nodes(whole(*WORDS)) == made
    monkeypatch.setattr(ConfigRepository, "load_config", composing.LOAD)
    monkeypatch.setattr(ConfigLoaderImpl, "_compose_config_from_defaults_list", composing.MERGE)
    assert nodes(whole(*WORDS)) == made


def test_the_mode_is_read_where_somebody_says_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for file in (ROOT / "conf").rglob("*.yaml"):
        assert not re.search(r"^\s+mode\s*:|hydra\.mode", file.read_text(encoding="utf-8"), re.MULTILINE), file
    asked = []
    monkeypatch.setattr(composing, "MODE", lambda *words: asked.append(words[2]))
    monkeypatch.chdir(tmp_path)
    for words in (["seeed=1"], ["hydra.mode=MULTIRUN", "seeed=1"], ["--config-dir", str(tmp_path), "seeed=2"]):
        assert call(monkeypatch, None, *words).code == 2
    assert [words[0] for words in asked] == ["hydra.mode=MULTIRUN", "seeed=2"]
