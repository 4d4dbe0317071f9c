"""One number, one meaning: what is taken is what every reader of XML takes, the rest is refused with its text."""

from __future__ import annotations

import pytest

from pipeline.common.errors import RobotError
from pipeline.robot.numbers import number, numbers


@pytest.mark.parametrize(
    ("text", "value"), [("1", 1.0), ("-0.5", -0.5), ("+.5", 0.5), ("5.", 5.0), ("1e-3", 1e-3), (" 2E+2\n", 200.0)]
)
def test_decimals(text: str, value: float) -> None:
    assert number(text, "here") == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1_0",
        "\uff11",
        "\u0661",
        "nan",
        "NaN",
        "inf",
        "-Infinity",
        "0x10",
        "1,5",
        "1e999",
        "1 2",
        "1f",
        "1\u00a0",
        "${m}",
        "--1",
    ],
)
def test_what_is_no_number_is_refused_with_its_text(text: str) -> None:
    with pytest.raises(RobotError, match=r"^link 'a' has the mass '.*', expected a number$") as caught:
        number(text, "link 'a' has the mass")
    assert text.strip() in str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"), [("inf", float("inf")), ("-INF", -float("inf")), ("+Infinity", float("inf"))]
)
def test_infinity_where_it_has_a_meaning(text: str, value: float) -> None:
    assert number(text, "here", infinite=True) == value
    with pytest.raises(RobotError):
        number("infinit", "here", infinite=True)
    with pytest.raises(RobotError):
        number("nan", "here", infinite=True)


def test_several_numbers() -> None:
    assert numbers("1 2\t3", 3, "here") == (1.0, 2.0, 3.0)
    assert numbers("1 2", (1, 2), "here") == (1.0, 2.0)
    for text in ("", "1 2", "1 2 3 4", "1 2\u30003", "1,2,3"):
        with pytest.raises(RobotError, match=r"^here '"):
            numbers(text, 3, "here")
    with pytest.raises(RobotError, match=r"expected a number or three numbers$"):
        numbers("1 2", (1, 3), "here")


def test_long_text_stays_one_short_line() -> None:
    with pytest.raises(RobotError) as caught:
        number("9 \n" * 1000, "here")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 120
