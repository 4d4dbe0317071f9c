from __future__ import annotations

import re

import pytest

from pipeline.config.options import options
from pipeline.run.usage import text
from tests.config.test_json_schema import LEAVES

HELP = text("python -m pipeline")


def test_it_fits_a_terminal() -> None:
    assert max(map(len, HELP.splitlines())) <= 80


@pytest.mark.parametrize("group", ["robot", "path", "timing", "objective", "limits", "boundary", "base", "parallel"])
def test_every_option_of_a_group(group: str) -> None:
    for name in options(group):
        assert f"\n  {group}={name}" in HELP
    assert "_common" not in HELP


def test_every_experiment() -> None:
    for name in options("experiment"):
        assert re.search(rf"\n  \+experiment={name}\s", HELP)
    assert "trajectory 4: a long line." in HELP


def test_every_key_with_its_default() -> None:
    missing = [key for key, _ in LEAVES if f"\n  {key}=" not in HELP and "planner" not in key]
    assert missing == []
    assert "  timing.duration=10          [s] motion time" in HELP
    assert "  methods=[lsv,pmke,global]" in HELP
    assert "  obstacles.shapes={}" in HELP
    assert "  parallel.workers=null" in HELP


def test_a_command_that_reads_little_says_little() -> None:
    short = text("python -m pipeline.describe", ("robot", "gravity"))
    assert "robot.payload=0" in short
    assert "gravity=none" in short
    assert "timing" not in short
    assert "+experiment=traj1" not in short
