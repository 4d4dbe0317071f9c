from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.common.errors import RobotError
from pipeline.robot.mounting import Mounting


def test_lists_and_arrays_become_what_can_be_compared() -> None:
    mounting = Mounting([0, 0, 1], np.array([0.1, 0.2, 0.3]), armature=np.array([1.0, 2.0]))  # type: ignore[arg-type]
    assert mounting == Mounting((0.0, 0.0, 1.0), (0.1, 0.2, 0.3), armature=(1.0, 2.0))
    assert hash(mounting) != hash(Mounting())


def test_one_rotor_for_all_or_one_for_each() -> None:
    np.testing.assert_array_equal(Mounting(armature=0.2).rotors(3), [0.2, 0.2, 0.2])
    np.testing.assert_array_equal(Mounting(armature=(0.1, 0.2)).rotors(2), [0.1, 0.2])
    with pytest.raises(RobotError, match=r"^armature has 2 values, the arm has 7 moving joints$"):
        Mounting(armature=(0.1, 0.2)).rotors(7)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"offset": (0.0, 1.0)}, r"offset = \[0\.0, 1\.0\]: expected three finite numbers"),
        ({"gravity": (0.0, 0.0, np.nan)}, r"gravity = \[0\.0, 0\.0, nan\]: expected three finite numbers"),
        ({"payload": -1.0}, r"payload = -1\.0: expected finite numbers >= 0"),
        ({"armature": (0.1, -0.1)}, r"armature = \(0\.1, -0\.1\): expected finite numbers >= 0"),
    ],
)
def test_what_cannot_be(values: dict[str, Any], message: str) -> None:
    with pytest.raises(RobotError, match=message):
        Mounting(**values)
