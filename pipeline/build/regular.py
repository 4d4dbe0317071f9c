"""Refuse an arm whose mass matrix is singular wherever it stands: its joints' accelerations would be anything."""

from __future__ import annotations

import numpy as np

from pipeline.common.errors import ConfigError, RobotError
from pipeline.model.arm import Arm
from pipeline.robot.urdf import carried_by

ROUNDING = 1e-13  # of the largest entry of M: an inertia below it is none; the lightest real wrists have 1e-8
SINGULAR = 1e-11  # of M scaled to a unit diagonal: what rounding leaves of an eigenvalue that is zero
SAMPLES = 4


def require_regular(arm: Arm) -> None:
    """Raise RobotError naming the link, or ConfigError naming base.inertia, if M is singular by construction."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, arm.n))
    mass = arm.mass_matrix(q)
    diagonal = np.einsum("kii->ki", mass)
    involved = np.flatnonzero((diagonal <= ROUNDING * diagonal.max()).all(axis=0))
    if not involved.size:
        scale = 1.0 / np.sqrt(np.maximum(diagonal, ROUNDING * diagonal.max()))
        values, vectors = np.linalg.eigh(mass * scale[:, :, None] * scale[:, None, :])
        if values[:, 0].max() > SINGULAR:
            return
        still = np.abs(vectors[-1, :, 0])
        involved = np.flatnonzero(still > 1e-3 * still.max())
    if involved[0] < arm.base.count:
        raise ConfigError(
            "base.inertia = 0, and the root link has none: turning the base moves no mass, so that the mass matrix is "
            "singular; give base.inertia"
        )
    description = arm.description
    names = [description.joints[joint] for joint in involved]
    links = [carried_by(description, name) for name in names]
    several = len(names) > 1
    raise RobotError(
        f"robot.urdf = {description.file}: link{'s' * several} {', '.join(links)}: moving joint{'s' * several} "
        f"{', '.join(names)} moves no mass, or next to none beside that of others: all of it lies on the "
        f"ax{'e' if several else 'i'}s and has no inertia, so that the mass matrix is singular; give the link an "
        "inertia, or robot.armature"
    )
