"""All studies, in the order of their sections in summary.md."""

from __future__ import annotations

from pipeline.studies import (
    candidates,
    certificate,
    closed_loop,
    convergence,
    export,
    front,
    identification,
    validation,
)
from pipeline.studies.study import Study

STUDIES: tuple[Study, ...] = (
    certificate.study,
    validation.study,
    front.study,
    convergence.study,
    identification.study,
    export.study,
    closed_loop.study,
    candidates.study,
)
