"""Every file under conf/ composes, is checked by the schema, and says the same as the schema's own defaults."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig, OmegaConf

from pipeline.common.errors import ConfigError
from pipeline.config import compose as composing
from pipeline.config import run as schema
from pipeline.config.documents import printed_for
from pipeline.config.methods import METHODS as ALL_METHODS
from pipeline.methods.registry import METHODS as REGISTRY
from tests.support import ROOT

CONF = ROOT / "conf"
EXPERIMENTS = sorted(file.stem for file in (CONF / "experiment").glob("[!_]*.yaml"))
OPTIONS = sorted(
    f"{file.parent.name}={file.stem}"
    for file in CONF.glob("*/[!_]*.yaml")
    if file.parent.name not in ("experiment", "method", "reproduction")
)
METHODS = sorted(file.stem for file in (CONF / "method").glob("[!_]*.yaml"))


@cache
def composed(*overrides: str) -> DictConfig:
    """Nobody changes what is shared here."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        made = compose("config", overrides=list(overrides), return_hydra_config=True)
    OmegaConf.set_readonly(made, True)
    return made


@cache
def checked(*overrides: str) -> schema.RunConfig:
    """What Hydra itself is told is left out, as in a run."""
    made = composed(*overrides)
    return composing.checked(OmegaConf.masked_copy(made, [str(key) for key in made if key != "hydra"]))


def text_of(experiment: str) -> str:
    return (CONF / "experiment" / f"{experiment}.yaml").read_text(encoding="utf-8")


def plain(made: Any) -> dict[str, Any]:
    """As a file would say it: lists in place of tuples."""
    found: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(made)))
    return found


def keys(values: Any, where: str = "") -> set[str]:
    """All dotted keys of a nested mapping."""
    if not isinstance(values, dict):
        return {where}
    return {where} | {key for name, value in values.items() for key in keys(value, f"{where}.{name}")}


def test_there_is_something_to_test() -> None:
    assert {"traj1", "traj2", "traj3", "traj4", "sim1", "sim2", "sim3", "sim4", "sim5"} <= set(EXPERIMENTS)
    assert {option.split("=")[0] for option in OPTIONS} >= {
        "robot",
        "path",
        "timing",
        "objective",
        "limits",
        "boundary",
        "parallel",
    }


def test_the_files_say_what_the_schema_says() -> None:
    assert checked() == schema.RunConfig()


def test_the_files_hold_every_key_of_the_schema() -> None:
    own = OmegaConf.to_container(
        OmegaConf.masked_copy(composed(), [f.name for f in dataclasses.fields(schema.RunConfig)]), resolve=True
    )
    defaults = plain(schema.RunConfig())
    defaults["method"]["global"] = defaults["method"].pop("global_")
    defaults["collision"]["self"] = defaults["collision"].pop("own")
    assert keys(own) == keys(defaults)


@pytest.mark.slow
@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_of_every_group(option: str) -> None:
    group, _, name = option.partition("=")
    made = getattr(checked(option), group)
    file = yaml.safe_load((CONF / group / f"{name}.yaml").read_text(encoding="utf-8"))
    for key, value in file.items():
        if key != "defaults" and value not in (None, "???"):
            assert plain(made)[key] == value, key
    assert set(composed(option)[group]) == {field.name for field in dataclasses.fields(made)}
    # What an option leaves alone is the default of its kind: only what the option is for may differ.
    mounted = {"end_effector", "task", "armature", "srdf", "limits", "locked"}
    own_words = {
        "robot": {"name", "urdf", "q_init", *mounted},
        "timing": {"law"},
        "boundary": {"kind"},
        "path": {"file"},
    }
    own_words |= {"parallel": {"address"}, "objective": {"kinetic_energy", "torque"}, "limits": {"kind", "power"}}
    differing = {f.name for f in dataclasses.fields(made) if getattr(made, f.name) != getattr(type(made)(), f.name)}
    assert differing <= own_words.get(group, set())


def test_every_method_has_its_options() -> None:
    """A file, a field of the schema and an entry of the registry, which name one another's classes."""
    assert sorted(METHODS) == sorted(ALL_METHODS) == sorted(REGISTRY)
    for name, method in REGISTRY.items():
        assert type(schema.RunConfig().method.of(name)) is method.options


@pytest.mark.slow
@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_every_experiment(experiment: str) -> None:
    config = checked(f"+experiment={experiment}")
    assert config.name == experiment
    plain_run = dataclasses.replace(schema.RunConfig(), name=experiment)
    assert config != plain_run or printed_for(experiment).document, "an experiment that changes nothing"


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_an_experiment_starts_with_the_command_that_runs_it(experiment: str) -> None:
    lines = [line for line in text_of(experiment).splitlines() if not line.startswith("# @package")]
    assert lines[0] == f"# python -m pipeline +experiment={experiment}"


@pytest.mark.slow
@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_an_experiment_holds_only_differences(experiment: str) -> None:
    """A value that it inherits anyway does not belong there; methods may be said again."""
    own = yaml.safe_load(text_of(experiment))
    picks = []
    for row in own.pop("defaults", []):
        pairs = row.items() if isinstance(row, dict) else [("+experiment", row)]
        picks += [f"{key.removeprefix('override /')}={name}" for key, name in pairs]
    without = OmegaConf.to_container(composed(*picks), resolve=False)
    assert isinstance(without, dict)
    for group in ("robot", "limits", "boundary", "objective", "parallel"):
        for key, value in (own.get(group) or {}).items():
            assert without[group][key] != value, f"{group}.{key}"


@pytest.mark.parametrize("file", sorted(CONF.glob("*/_*.yaml")), ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_what_is_inherited_is_inherited_by_several(file: Path) -> None:
    heirs = [other for other in file.parent.glob("*.yaml") if inherits(other, file.stem)]
    assert len(heirs) >= 2


def inherits(file: Path, name: str) -> bool:
    return name in (yaml.safe_load(file.read_text(encoding="utf-8")).get("defaults") or [])


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_no_experiment_picks_a_launcher_or_a_sweeper(experiment: str) -> None:
    own = yaml.safe_load(text_of(experiment))
    assert "hydra" not in own
    assert not [row for row in own.get("defaults", []) if "hydra" in str(row)]
    base, chosen = composed().hydra, composed(f"+experiment={experiment}").hydra
    for part in ("launcher", "sweeper", "sweep", "run"):
        assert OmegaConf.to_container(chosen[part], resolve=False) == OmegaConf.to_container(base[part], resolve=False)


def test_a_word_that_may_stand_beside_lists_is_suggested() -> None:
    with pytest.raises(ConfigError, match=r"^sweep\.objective = 'kinetic_energy': did you mean kinetic_energy_inte"):
        checked("sweep.objective=kinetic_energy")
