"""Numbers that YAML 1.1 reads to another base are refused with their key."""

from __future__ import annotations

import pytest
from omegaconf import OmegaConf

from pipeline.common.errors import ConfigError
from pipeline.config.as_written import keep_as_written
from pipeline.config.run import check


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("seed: 010", r"seed = '010': must be a whole number"),
        ("timing: {duration: 1:30}", r"timing\.duration = '1:30': must be shortest or a number > 0 s"),
        ("timing: {duration: 1:30.5}", r"timing\.duration = '1:30\.5': must be shortest or a number > 0 s"),
    ],
)
def test_another_base_is_refused(text: str, named: str) -> None:
    keep_as_written()
    values = OmegaConf.to_container(OmegaConf.create(text))
    with pytest.raises(ConfigError, match=named):
        check(values)  # type: ignore[arg-type]


def test_plain_numbers_stay_numbers() -> None:
    keep_as_written()
    values = OmegaConf.to_container(OmegaConf.create("a: [10, 0, -3, 0.5, 1e-3, 0x10, -0.25]"))
    assert values == {"a": [10, 0, -3, 0.5, 1e-3, 16, -0.25]}
