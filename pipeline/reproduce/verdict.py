"""The verdict on one printed number: a pure rule, with no knowledge of where either number comes from."""

from __future__ import annotations

import math

from pipeline.config.documents import half_width

REPRODUCED, BETTER, MISPRINT, DIFFERS = VERDICTS = ("reproduced", "better", "misprint", "differs")
NOT_RUN = "not run"  # in place of a verdict: nobody has computed the number yet
TIMING = "timing"  # in place of a verdict: what a machine of today computes in says nothing of a document
_EDGE = 1 + 1e-9  # a value on the edge of the rounding still rounds to what is printed


def verdict(
    printed: str,
    recomputed: float,
    *,
    reading: str = "",
    between: tuple[float, float] | None = None,
    better: str = "neither",
) -> str:
    """`reproduced`, `better`, `misprint` or `differs`, in this order of preference but for `better`.

    reproduced: within the rounding of the printed digits, nothing wider; where the document says it in words, within
    the interval `between` that the words stand for.
    misprint: not so, but within the rounding of `reading`, another way to read what is printed.
    better: the value lies on the `better` side (lower, higher) of the printed one, beyond its rounding; only what the
    document minimises or maximises has such a side.
    differs: all else, a value that is not finite included.
    """
    if not math.isfinite(recomputed):
        return DIFFERS
    if between is not None:
        return REPRODUCED if between[0] <= recomputed <= between[1] else DIFFERS

    def fits(text: str) -> bool:
        return abs(recomputed - float(text)) <= half_width(text) * _EDGE

    if fits(printed):
        return REPRODUCED
    if reading and fits(reading):
        return MISPRINT
    gain = {"lower": -1.0, "higher": 1.0}.get(better, 0.0) * (recomputed - float(reading or printed))
    return BETTER if gain > half_width(reading or printed) else DIFFERS
