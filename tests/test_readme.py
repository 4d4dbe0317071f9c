"""The README and the guides are true: its Python runs, its commands are accepted, its files exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from pipeline.common.files import shipped
from pipeline.config.compose import checked
from pipeline.describe.facts import inspect
from pipeline.run import own_robot
from pipeline.run.main import CONF
from pipeline.run.state import state

ROOT = Path(__file__).resolve().parent.parent
GUIDES = [str(file.relative_to(ROOT)) for file in sorted((ROOT / "docs" / "guide").glob("*.md"))]
NAMES = ["README.md", "docs/errata.md", "docs/tour.md", *GUIDES]
QUESTIONS = (" --help", " -sc ", " --config-dir")  # the last has a test of its own in run/test_main.py


def _read(name: str) -> str:
    """The text as a shell would take its commands: lines that go on joined, variables replaced."""
    text = re.sub(r"\\\n\s*", "", (ROOT / name).read_text(encoding="utf-8"))
    for variable, value in re.findall(r"^([A-Z]\w*)=(\S+)$", text, re.MULTILINE):
        text = text.replace(f"${variable}", value)
    return text


TEXTS = {name: _read(name) for name in NAMES}
COMMANDS = sorted(
    {
        line.split("  ")[0]
        for text in TEXTS.values()
        for line in re.findall(r"python -m pipeline(?![.\w])([^`\n]*)", text)
        if not line.startswith(QUESTIONS)
    }
)
INSPECTED = sorted(set(re.findall(r"python -m pipeline\.describe([^`\n]*)", "\n".join(TEXTS.values()))))


def _values(word: str) -> list[str]:
    """One override per value of a swept key."""
    key, _, value = word.partition("=")
    if interval := re.fullmatch(r"interval\((.*)\)", value):  # a sweeper picks from it: both ends are values
        value = interval.group(1)
    return [f"{key}={one}" for one in value.split(",")] if not value.startswith(("[", "{")) else [word]


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_commands_state_a_problem(command: str) -> None:
    words = [word for word in shlex.split(command) if word not in ("-m", "--cfg", "job")]
    for number in range(max(len(_values(word)) for word in words) if words else 1):
        overrides = [_values(word)[min(number, len(_values(word)) - 1)] for word in words]
        own, _ = own_robot.words(overrides)
        with initialize_config_dir(CONF, version_base="1.3"):
            state(checked(compose("config", overrides=[*own, *overrides])))


@pytest.mark.parametrize("command", INSPECTED)
def test_arms_are_inspected(command: str) -> None:
    words = shlex.split(command)
    with initialize_config_dir(CONF, version_base="1.3"):
        asked = checked(compose("config", overrides=[*own_robot.words(words)[0], *words]))
    assert inspect(asked.robot, asked.gravity).reach > 0


def test_every_module_that_is_called_is_checked() -> None:
    called = {name for text in TEXTS.values() for name in re.findall(r"python -m (pipeline[\w.]*)", text)}
    assert called == {"pipeline", "pipeline.describe", "pipeline.compare", "pipeline.reproduce"}
    # The last two have tests of their own: compare/test_compare.py and reproduce/test_pages.py.


@pytest.mark.slow
def test_python_example_runs(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    (example,) = re.findall(r"```python\n(.*?)```", TEXTS["README.md"], re.S)
    exec(compile(example, "README.md", "exec"), {})
    first = capsys.readouterr().out.splitlines()[0].split()
    assert first[:2] == ["global", "solved"]
    assert float(first[2]) == pytest.approx(6.093e-3, rel=1e-3)
    assert float(first[3]) < 1e-8


@pytest.mark.parametrize("name", TEXTS)
def test_files_named_exist(name: str) -> None:
    named = re.findall(r"`((?:pipeline|conf|docs|tests|robots)/[\w/.]*)`", TEXTS[name])
    pictures = re.findall(r"\]\(([\w/]+\.png)\)", TEXTS[name])
    assert all(shipped(file.removeprefix("pipeline/")).exists() or (ROOT / file).exists() for file in named)
    assert all(((ROOT / name).parent / file).exists() for file in pictures)
    assert named or name in GUIDES


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="targets belong to a checkout; this is beside none")
def test_make_targets_exist() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert set(re.findall(r"(?<=make )(?:run|test|help|bench|reproduce)", "".join(TEXTS.values()))) <= targets
