from __future__ import annotations

import pytest

from pipeline.config.options import chosen, options
from tests.support import ROOT

GROUPS = [
    folder.name for folder in sorted((ROOT / "conf").iterdir()) if folder.is_dir() and folder.name != "reproduction"
]


def test_what_the_configuration_picks() -> None:
    picks = chosen()
    assert picks["robot"] == "planar3r"
    assert picks["limits"] == "none"
    assert "experiment" not in picks
    assert set(picks) == set(GROUPS) - {"experiment"}


@pytest.mark.parametrize("group", GROUPS)
def test_every_option_says_what_it_is(group: str) -> None:
    found = options(group)
    assert len(found) >= 2
    assert not any(name.startswith("_") for name in found)
    for name, says in found.items():
        assert len(says) > 10, name
        assert not says.startswith(("@", "python"))


def test_a_group_that_does_not_exist_has_none() -> None:
    assert options("nothing") == {}
