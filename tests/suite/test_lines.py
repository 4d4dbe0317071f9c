"""One of the random lines, whose motion comes to 8 mm of the arm itself: coal and the certificate say the same."""

from __future__ import annotations

import pytest

from tests.suite.lines import compared
from tests.suite.self_collision import lines
from tests.support import FEW_STARTS


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_line_close_to_the_arm_itself() -> None:
    found = compared("line0", (*dict(lines())["line0"], "timing.steps=20", *FEW_STARTS))
    assert found.was_clear
    assert found.certified - 1e-6 <= found.coal < found.certified + 0.01
    assert found.energy == pytest.approx(found.energy_without, rel=1e-5)
