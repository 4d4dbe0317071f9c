"""Hydra's hooks around `python -m pipeline.describe`."""

from __future__ import annotations

from pipeline.build.robot import initial, load
from pipeline.config.run import RunConfig
from pipeline.run import session


class Session(session.Session):
    """Hydra's hooks: nothing is planned, so neither path nor methods are checked before the output folder is made."""

    def check(self, asked: RunConfig) -> None:
        initial(asked.robot, load(asked.robot, asked.gravity))
