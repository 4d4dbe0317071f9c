"""Zero, negative, huge and infinite limits, and joints that are locked outside theirs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import RobotError
from pipeline.robot import urdf
from pipeline.robot.limits import require_held_within, require_room
from tests.robot.test_urdf import LIMIT, ROBOT


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """The robot with other limits of its shoulder."""

    def to_file(**limit: str) -> Path:
        stated = {"lower": "-1.5", "upper": "2.5", "effort": "40", "velocity": "3", **limit}
        text = " ".join(f'{key}="{value}"' for key, value in stated.items())
        (tmp_path / "robot.urdf").write_text(ROBOT.replace(LIMIT, f"<limit {text}/>", 1))
        return tmp_path / "robot.urdf"

    return to_file


@pytest.mark.parametrize("word", ["1e16", "inf", "+Infinity", "1e300", "1e6"])
def test_what_says_that_there_is_no_limit(write: Callable[..., Path], word: str) -> None:
    got = urdf.read(write(lower=f"-{word.lstrip('+')}", upper=word, effort=word, velocity=word), "hand")
    assert [got.lower[0], got.upper[0], got.effort[0], got.velocity[0]] == [-np.inf, np.inf, np.inf, np.inf]


@pytest.mark.parametrize("word", ["-1e16", "-inf"])
def test_a_bound_from_below_that_is_none(write: Callable[..., Path], word: str) -> None:
    got = urdf.read(write(lower=word, effort=word, velocity=word), "hand")
    assert [got.lower[0], got.effort[0], got.velocity[0]] == [-np.inf, np.inf, np.inf]


@pytest.mark.parametrize(("key", "word"), [("lower", "1e16"), ("lower", "inf"), ("upper", "-inf"), ("velocity", "nan")])
def test_bounds_that_no_position_meets(write: Callable[..., Path], key: str, word: str) -> None:
    with pytest.raises(RobotError, match=rf"joint 'shoulder' has the {key} limit '{word}'"):
        urdf.read(write(**{key: word}), "hand")


@pytest.mark.parametrize("word", ["0", "-3", "9e-10"])
@pytest.mark.parametrize(("key", "override"), [("velocity", r"limits\.velocity"), ("effort", r"limits\.torque")])
def test_nothing_moves_within_a_limit_of_zero(write: Callable[..., Path], key: str, override: str, word: str) -> None:
    got = urdf.read(write(**{key: word}), "hand")
    message = rf"the {key} limit of shoulder is {float(word):g}, .* {override} .* robot\.unlimited=\[{key}\]"
    with pytest.raises(RobotError, match=message):
        require_room(got, key, getattr(got, key))
    freed = urdf.read(write(**{key: word}), "hand", unlimited=[key])
    require_room(freed, key, getattr(freed, key))
    assert getattr(freed, key)[0] == np.inf
    assert freed.notes == (
        f"robot.unlimited: the {key} limits of shoulder are none or next to none in the file, taken as no limits",
    )
    require_room(got, key, np.full(2, 1e-9))


def test_a_lock_within_and_outside_the_limits(write: Callable[..., Path]) -> None:
    for inside in (-1.5, 0.0, 2.5):
        require_held_within(urdf.read(write(), "hand", locked={"shoulder": inside}))
    with pytest.raises(
        RobotError, match=r"^robot\.locked\.shoulder = 9: outside the limits of the joint, -1\.5 to 2\.5$"
    ):
        require_held_within(urdf.read(write(), "hand", locked={"shoulder": 9.0}))
    require_held_within(urdf.read(write(), "hand", locked={"wrist": 9.0}))  # turns without end
