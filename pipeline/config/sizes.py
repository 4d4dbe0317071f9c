"""Numbers of a size that no double can square, or divide by: refused before anything overflows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.common.errors import ConfigError

SMALLEST, LARGEST = 1e-30, 1e30  # nothing that moves is so small or so big, and its fourth power is still a double


def refuse_overflow(values: Any, key: str = "") -> None:
    """Raise ConfigError for the first such number in `values`, a table, list or value with that key."""
    if isinstance(values, Mapping):
        for name, value in values.items():
            refuse_overflow(value, f"{key}.{name}" if key else str(name))
    elif isinstance(values, list | tuple):
        for index, value in enumerate(values):
            refuse_overflow(value, f"{key}[{index}]")
    elif isinstance(values, float) and math.isfinite(values) and values and not SMALLEST <= abs(values) <= LARGEST:
        raise ConfigError(f"{key} = {values:g}: must be 0 or of a size from {SMALLEST:g} to {LARGEST:g}")
