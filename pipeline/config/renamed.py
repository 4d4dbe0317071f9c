"""Keys that have another name now, so that an old command line or file is told the new one."""

from __future__ import annotations

RENAMED = {
    "pareto": "method.pareto",
    "method.pareto.planner": "method.global",  # an interpolation, which takes no values of its own
    "method.pmke.tail": "method.receding.tail",
    "method.pontryagin.dt": "method.pontryagin_as_printed.dt",
    "method.pontryagin.max_drift": "method.pontryagin_as_printed.max_drift",
}


METHODS_NOW = {
    "method.pmke.limits": "methods=[receding], whose options are method.receding.*",
    "method.pontryagin.formulation": "methods=[pontryagin_as_printed], [pontryagin], or both",
}


def renamed(key: str) -> str | None:
    """What `key`, or the part of the configuration that it is in, is called now, as the rest of a line; or None."""
    if key in METHODS_NOW:
        return f"is said by methods now: {METHODS_NOW[key]}"
    for old, new in RENAMED.items():
        if key == old or key.startswith(f"{old}."):
            return f"is {new}{key.removeprefix(old)} now"
    return None
