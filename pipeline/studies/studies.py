"""All studies, in the order of their sections in summary.md."""

from __future__ import annotations

from pipeline.studies import (
    candidates,
    closed_loop,
    control,
    convergence,
    deadlines,
    estimate,
    export,
    front,
    identification,
    pieces,
    retiming,
    validation,
)
from pipeline.studies.study import Study

STUDIES: tuple[Study, ...] = (
    estimate.study,
    validation.study,
    front.study,
    convergence.study,
    identification.study,
    retiming.study,
    deadlines.study,
    control.study,
    pieces.study,
    export.study,
    closed_loop.study,
    candidates.study,
)
