"""Nothing that is written here stays unrun: pytest passes over folders by their names, by default `build` too."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path

import pytest

TESTS = Path(__file__).parent


def test_no_folder_of_tests_is_passed_over(pytestconfig: pytest.Config) -> None:
    folders = {folder for file in TESTS.rglob("test_*.py") for folder in file.relative_to(TESTS).parts[:-1]}
    assert {"build", "run"} <= folders
    passed_over = [name for name in folders for word in pytestconfig.getini("norecursedirs") if fnmatch(name, word)]
    assert passed_over == []
