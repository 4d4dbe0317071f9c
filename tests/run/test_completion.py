"""Completion by TAB: the line of `python -m pipeline` as Hydra reads it, and the script in a shell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hydra._internal.core_plugins.bash_completion import BashCompletion

from pipeline.run import completion
from tests.support import ROOT

LINES = {
    "python -m pipeline robot=": "robot=",
    "python3 -m pipeline +experiment=traj": "+experiment=traj",
    "/usr/bin/python3.11  -m  pipeline.describe robot=pa": "robot=pa",
    "selfmotion robot=": "robot=",
    "python pipeline/__main__.py robot=": "robot=",
}


@pytest.mark.parametrize("line", LINES)
def test_the_line_that_hydra_completes(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COMP_LINE", line)
    assert completion.completes(["-sc", "query=bash"])
    assert BashCompletion.strip_python_or_app_name(os.environ["COMP_LINE"]) == LINES[line]


def test_other_command_lines_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COMP_LINE", "python -m pipeline robot=")
    assert not completion.completes(["robot=panda"])
    assert os.environ["COMP_LINE"] == "python -m pipeline robot="
    assert completion.installs(["-sc", "install=bash"])
    assert not completion.installs(["-sc", "query=bash"])
    assert not completion.installs(["robot=panda"])


def completed(line: str, breaks: str = " =") -> list[str]:
    """What a shell offers for a line."""
    script = f"""{completion.BASH}
COMP_WORDBREAKS={breaks!r}; COMP_LINE={line!r}; COMP_POINT={len(line)}
_pipeline_completion
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    folder = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.slow
def test_a_shell_offers_the_options() -> None:
    """As it is typed; a shell that breaks words at `=` replaces what stands behind it."""
    found = completed("python -m pipeline robot=pl")
    assert found == ["planar3r", "planar3r_base", "planar3r_printed", "planar4r"]
    whole = completed("python -m pipeline robot=", breaks=" ")
    assert {word.partition("=")[0] for word in whole} == {"robot"}
    assert "robot=panda" in whole
    assert not any("_common" in word for word in whole)
    assert completed("python -m pipeline path=circle path.rad") == ["path.radius="]
    assert completed("python -m pipeline.describe robot=pan") == ["panda"]
    assert completed("python something.py robot=") == []
