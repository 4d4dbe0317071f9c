"""What of the arm may not touch what: the pairs of links of a configuration, and paths that no arm can follow."""

from __future__ import annotations

import difflib

import numpy as np

from pipeline.common.errors import ConfigError, RobotError
from pipeline.config.robot import CollisionConfig
from pipeline.model.arm import Arm
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.model.obstacles import Own
from pipeline.robot.packages import find
from pipeline.robot.separation import Solid, distance, solids_of
from pipeline.robot.touching import Pair, apart, disabled

SAMPLES = 300  # configurations in each of which a pair touches that counts as one that always does


def make_own(collision: CollisionConfig, arm: Arm, srdf: str | None = None) -> Own | None:
    """The pairs of links that may not touch; None if nothing is to be known of them.

    By default they are kept apart where the arm moves in space. Meshes that are missing leave them unknown, unless
    collision.self asks for them: then RobotError names the link and the file. srdf: the file that comes with the arm.
    """
    kept = in_space(arm) if collision.own is None else collision.own
    if collision.own is None and not kept:
        return None
    if not arm.description.collision:
        if collision.own:
            raise ConfigError(
                f"collision.self = true: {arm.description.name} has no collision shapes; give them in robot.collision"
            )
        return None
    may, every = _allowed(collision, arm, srdf), apart(arm.description)
    pairs = tuple(pair for pair in every if frozenset(pair) not in may)
    own = Own(pairs, collision.margin, collision.influence, kept)
    try:
        always = _always(arm, own)
    except RobotError as error:
        if collision.own:
            raise
        return Own((), collision.margin, kept=False, unknown=str(error))
    left = tuple(pair for pair in pairs if pair not in always)
    return Own(
        left, collision.margin, collision.influence, kept and bool(left), tuple(sorted(always)), len(every) - len(pairs)
    )


def in_space(arm: Arm) -> bool:
    """Whether the joints' axes are not all parallel, or one slides."""
    chain = Chain.of(arm.on_fixed_base)
    return bool(chain.slides.any() or (np.abs(chain.turn[1:, 2, 2]) < 1 - 1e-9).any())


def _allowed(collision: CollisionConfig, arm: Arm, srdf: str | None) -> set[frozenset[str]]:
    links = arm.description.links
    for link in (link for pair in collision.allow for link in pair):
        if link not in links:
            close = difflib.get_close_matches(link, links, n=3, cutoff=0.4) or list(links)[:12]
            raise ConfigError(f"collision.allow: no link is called {link}; did you mean {', '.join(close)}?")
    given = {frozenset(pair) for pair in collision.allow}
    key, file = ("robot.srdf", srdf) if collision.srdf is None else ("collision.srdf", collision.srdf)
    return given if file in (None, "none") else given | disabled(find(str(file), key), key)


def _always(arm: Arm, own: Own) -> set[Pair]:
    """The pairs that do not keep their margin in any of SAMPLES configurations within the joints' ranges.

    Drake is not asked: capsules of one link that end where those of another begin can keep it searching for ever.
    """
    description, rng, left = arm.description, np.random.default_rng(0), set(own.pairs)
    if not left:
        return left
    clearance, solids = Clearance(arm, None, Own(own.pairs, own.margin)), solids_of(description)
    low, high = np.maximum(description.lower, -np.pi), np.minimum(description.upper, np.pi)
    for q in rng.uniform(low, np.maximum(low, high), (SAMPLES, arm.n)):
        at = clearance.places(q)
        placed = {link: [solid.moved(*at[link]) for solid in solids[link]] for pair in left for link in pair}
        left = {pair for pair in left if _near(placed[pair[0]], placed[pair[1]], own.margin)}
        if not left:
            break
    return left


def _near(first: list[Solid], second: list[Solid], margin: float) -> bool:
    return any(distance(a, b)[0] < margin for a in first for b in second)
