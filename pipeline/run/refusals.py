"""What Hydra and OmegaConf refuse, in one line: the key or option, what is allowed, and the closest name."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import yaml
from hydra import compose, initialize_config_dir
from hydra._internal.utils import get_args_parser
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from pipeline.common.errors import ConfigError
from pipeline.common.files import shipped
from pipeline.config.messages import unknown_key, unknown_option
from pipeline.config.options import HIDDEN, chosen, options

UNKNOWN = r"Could not (?:override|append to config\.?[^']*|find) '([^']+)'"
EXTRAS = {"hydra/sweeper": "optuna", "hydra/launcher": "launchers"}  # plugins of Hydra are extras of the package
GROUP = r"\+?[a-z_/]+=[\w,]+"  # a word that may pick an option


def refuse(words: Sequence[str]) -> None:
    """Raise ConfigError for what Hydra takes silently: a deleted option, or one only there to be inherited from."""
    parser = get_args_parser()
    parser.error = _unreadable  # type: ignore[method-assign]
    parser.parse_args(words)
    for word in words:
        if "\0" in word or word != word.encode(errors="replace").decode():
            raise ConfigError(f"{word!a}: not UTF-8 text")
        if word.startswith("~") and _deletes_an_option(word):
            raise ConfigError(f"{word}: options cannot be deleted, only entries of tables; give it another value")
        group, _, option = word.lstrip("+").partition("=")
        hidden = [name for name in option.split(",") if name.startswith(HIDDEN)]
        if hidden and options(group):
            raise ConfigError(unknown_option(group, hidden[0], sorted(options(group))))


def _unreadable(message: str) -> NoReturn:
    raise ConfigError(f"{message}; see --help")


def _deletes_an_option(word: str) -> bool:
    """Whether `~key` would take the default in place of what the files say."""
    from pipeline.config.run import RunConfig

    found = re.fullmatch(r"~(\w[\w./]*)(@.*)?(=.*)?", word)
    if found is None:
        return False
    first, *rest = found.group(1).replace("/", ".").split(".")
    value: Any = RunConfig()
    if not hasattr(value, first):
        return False
    for part in (first, *rest):
        if value is None or isinstance(value, Mapping):
            return False  # an entry of a table, such as robot.locked
        value = getattr(value, part, value)
    return True


def in_one_line(error: Exception) -> str:
    """The line for an error of composition."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, option = error.missing_cfg_file.rpartition("/")
        allowed = sorted(name for name in error.options or [] if not name.startswith(HIDDEN))
        brought = f"; pip install '.[{EXTRAS[group]}]' brings more" if group in EXTRAS else ""
        return unknown_option(group or "config", option, allowed) + brought
    message = str(error.__cause__ or error)
    if isinstance(error, OverrideParseException):
        message = _quoted(error.override) or f"in {' '.join(sys.argv[1:])}: {error}"
    unknown = re.search(UNKNOWN, str(error))
    if unknown:
        key = unknown.group(1)
        inner = re.search(r"is not in struct\s+full_key: (\S+)", str(error.__cause__))
        if inner and inner.group(1).startswith(f"{key}."):  # of a table that was given whole
            key, beside = inner.group(1), _keys_beside(inner.group(1))
            return unknown_key(key, beside) if beside else f"{key}: entries are added with a plus, as +{key}=..."
        return _without_its_plus(key) or _of_another_option(key) or unknown_key(key, _keys_beside(key))
    return " ".join(line.strip() for line in message.splitlines() if line.strip() and not line.startswith("See http"))


def _quoted(word: str | None) -> str:
    """The line for a value that Hydra reads in quotes only, as a path with an umlaut; empty if they do not help."""
    key, sign, value = (word or "").partition("=")
    inner = value.replace("\\", "\\\\").replace('"', '\\"')
    better = f'{key}="{inner}"'
    try:
        OverridesParser.create().parse_override(better if sign else "")
    except HydraException:
        return ""
    shell = better.replace("'", "'\\''")
    return f"{word}: such a value is written in quotes: '{shell}'"


def _without_its_plus(key: str) -> str:
    """The line for a group that nothing is picked from unless it is added, such as `experiment=traj3`."""
    if key in chosen() or not options(key):
        return ""
    word = next((word for word in sys.argv[1:] if word.startswith(f"{key}=")), f"{key}=...")
    return f"{word}: no option stands there yet; did you mean +{word}?"


def _of_another_option(key: str) -> str:
    """The line for a key of a group whose option has none at all, such as `base.mass` of a base that is fixed."""
    group = key.partition(".")[0]
    if _keys_beside(key) or group not in chosen():
        return ""
    having = " or ".join(f"{group}={one}" for one in options(group) if key.rpartition(".")[2] in _keys_of(group, one))
    return f"{key}: the option picked in {group} has no keys" + (f"; {having} has this one" if having else "")


def _keys_of(group: str, option: str) -> list[str]:
    """The keys of an option, as its own file writes them."""
    read = yaml.safe_load((shipped("conf") / group / f"{option}.yaml").read_text(encoding="utf-8"))
    return list(read or ())


def _keys_beside(key: str) -> list[str]:
    """The keys that may stand where `key` does not: those of the composed configuration at the same place."""
    words = [word for word in sys.argv[1:] if re.fullmatch(GROUP, word) and word.split("=")[0] != key]
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(shipped("conf")), version_base="1.3"):
        try:
            composed = compose("config", overrides=words)
        except (HydraException, OmegaConfBaseException):
            composed = compose("config")
    parent, _, _ = key.rpartition(".")
    while parent:
        there = OmegaConf.select(composed, parent)
        if isinstance(there, DictConfig):
            return [str(name) for name in there if name != "kind"]
        parent = parent.rpartition(".")[0]
    return [str(name) for name in composed]
