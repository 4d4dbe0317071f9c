"""What of the arm may not touch what: the pairs of links of a configuration, and paths that no arm can follow."""

from __future__ import annotations

import difflib
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.config.robot import CollisionConfig
from pipeline.model.arm import Arm
from pipeline.model.kernel.chain import Chain
from pipeline.model.obstacles import Own
from pipeline.model.places import Places
from pipeline.problem.problem import Problem
from pipeline.robot.packages import find
from pipeline.robot.separation import Solid, depth, distance, solids_of
from pipeline.robot.shapes import Shape
from pipeline.robot.touching import Pair, apart, disabled, groups

ANGLES = 128  # of the first joint at which a path is compared with what it carries
POINTS = 101  # of the path
SAMPLES = 300  # configurations in each of which a pair is near that counts as one that always is


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


def require_free_path(problem: Problem) -> None:
    """Refuse a path inside an obstacle, the base, or what the first joint turns wherever that stands: no motion of the
    other joints helps. Raises PathError that names the path and the solid.

    The end effector's point need not be on a solid: the path must be deeper inside than the tool's next one is far.
    """
    arm, own = problem.task.arm, problem.own
    pairs = own.pairs if own is not None and own.kept else ()
    if arm.base.count or len(problem.task.axes) < 3 or not (pairs or problem.obstacles):
        return
    carried, solids = groups(arm.description), solids_of(arm.description)
    around = Around(arm, Places(arm), solids)
    s = np.linspace(0.0, problem.reference.geometry.length, POINTS)
    path = problem.reference.geometry.sample(s)[0]
    tools = [link for link in solids if carried[link] == arm.n]
    for shape in () if problem.obstacles is None else problem.obstacles.shapes:
        kept = [tool for tool in tools if problem.obstacles is not None and problem.obstacles.keeps(tool, shape)]
        if kept:
            _refuse(f"obstacle {shape.name}", depth(Solid.of(shape), path), s, around.tool(kept))
    for link in solids:
        touching = [tool for tool in tools if (link, tool) in pairs]
        if carried[link] <= 1 and touching:
            _refuse(f"link {link}", around.inside(link, carried[link], path), s, around.tool(touching))


@dataclass(frozen=True)
class Around:
    """What a path is compared with: where the tool is from the end effector's point, and how deep it is in links."""

    arm: Arm
    places: Places
    solids: dict[str, list[Solid]]

    def tool(self, links: list[str]) -> float:
        """How far [m] the end effector's point is from the next solid of these links, which move with it."""
        q = np.zeros(self.arm.n)
        point, at = Solid(self.arm.position(q[None])), self.places(q)
        apart = (distance(point, solid.moved(*at[link]))[1] for link in links for solid in self.solids[link])
        return max(0.0, min(apart, default=np.inf))

    def inside(self, link: str, joints: int, path: Array) -> Array:
        """How deep (K,) [m] points of the path (K, 3) are inside a link, wherever its `joints` (0 or 1) stand."""
        description, q = self.arm.description, np.zeros((ANGLES if joints else 1, self.arm.n))
        if joints:
            if not description.revolute[0]:
                return np.full(len(path), -np.inf)
            low, high = max(description.lower[0], -np.pi), min(description.upper[0], np.pi)
            q[:, 0] = np.linspace(low, high, ANGLES)
        places = (self.places(one)[link] for one in q)
        seen = np.concatenate([(path - position) @ rotation for rotation, position in places])
        of_each = [depth(solid, seen).reshape(len(q), -1) for solid in self.solids[link]]
        found, first = np.max(of_each, axis=0).min(axis=0), self.arm.first_joint()
        step = np.ptp(q[:, 0]) / max(1, len(q) - 1) / 2
        return np.asarray(found - step * np.linalg.norm(path - first, axis=1))


def _refuse(name: str, inside: Array, s: Array, tool: float) -> None:
    worst = int(np.argmax(inside))
    if inside[worst] > tool:
        raise PathError(
            f"path: it runs {inside[worst]:.3g} m inside {name} (at {s[worst]:.3g} m along it), where the end effector "
            f"cannot be: its own solids are {tool:.3g} m away"
        )


def in_space(arm: Arm) -> bool:
    """Whether the joints' axes are not all parallel, or one slides."""
    chain = Chain.of(arm.on_fixed_base)
    return bool(chain.slides.any() or (np.abs(chain.turn[1:, 2, 2]) < 1 - 1e-9).any())


def may_touch(collision: CollisionConfig, arm: Arm, shapes: Collection[Shape]) -> frozenset[tuple[str, str]]:
    """The links and obstacles of collision.allow; raises ConfigError for a name that neither a link nor an obstacle
    has, and for two obstacles.
    """
    links, solids = arm.description.links, {shape.name for shape in shapes}
    found = set()
    for pair in collision.allow:
        for name in pair:
            if name not in (*links, *solids):
                close = difflib.get_close_matches(name, (*links, *solids), n=3, cutoff=0.4) or list(links)[:12]
                raise ConfigError(f"collision.allow: no link is called {name}; did you mean {', '.join(close)}?")
        if not set(pair) & set(links):
            raise ConfigError(f"collision.allow: {pair[0]} and {pair[1]} are both obstacles; one must be a link")
        found |= {(link, solid) for link, solid in (pair, pair[::-1]) if link in links and solid in solids}
    return frozenset(found)


def _allowed(collision: CollisionConfig, arm: Arm, srdf: str | None) -> set[frozenset[str]]:
    links = arm.description.links
    given = {frozenset(pair) for pair in collision.allow if set(pair) <= set(links)}
    key, file = ("robot.srdf", srdf) if collision.srdf is None else ("collision.srdf", collision.srdf)
    return given if file in (None, "none") else given | disabled(find(str(file), key), key)


def _always(arm: Arm, own: Own) -> set[Pair]:
    """The pairs whose gap no motion changes: in SAMPLES configurations within the joints' ranges it is never the
    margin, or always between three quarters and twice of it, as between the shells of a wrist.

    Drake is not asked: capsules of one link that end where those of another begin can keep it searching for ever.
    """
    description, rng, margin = arm.description, np.random.default_rng(0), own.margin
    gaps: dict[Pair, tuple[float, float]] = dict.fromkeys(own.pairs, (np.inf, -np.inf))
    if not gaps:
        return set()
    places, solids = Places(arm), solids_of(description)
    low, high = np.maximum(description.lower, -np.pi), np.minimum(description.upper, np.pi)
    for q in rng.uniform(low, np.maximum(low, high), (SAMPLES, arm.n)):
        at = places(q)
        placed = {link: [solid.moved(*at[link]) for solid in solids[link]] for pair in gaps for link in pair}
        for pair, (least, most) in list(gaps.items()):
            gap = _gap(placed[pair[0]], placed[pair[1]], 2 * margin)
            least, most = min(least, gap), max(most, gap)
            gaps[pair] = least, most
            if most >= margin and (most >= 2 * margin or least < 0.75 * margin):
                del gaps[pair]
        if not gaps:
            break
    return set(gaps)


def too_near(problem: Problem, q: Array) -> bool:
    """Whether the arm at q (n,) is within a margin of an obstacle or of itself."""
    at, solids = Places(problem.task.arm)(q), solids_of(problem.task.arm.description)
    placed = {link: [solid.moved(*at[link]) for solid in of_link] for link, of_link in solids.items()}
    around, own, carried = problem.obstacles, problem.own, groups(problem.task.arm.description)
    if around is not None:
        others = [(shape, Solid.of(shape)) for shape in around.shapes]
        for link, of_link in placed.items():
            kept = [solid for shape, solid in others if around.keeps(link, shape)]
            if carried[link] and _near(of_link, kept, around.margin):
                return True
    pairs = own.pairs if own is not None and own.kept else ()
    return own is not None and any(_near(placed[first], placed[second], own.margin) for first, second in pairs)


def _near(first: list[Solid], second: list[Solid], margin: float) -> bool:
    return any(_within(a, b, margin) and distance(a, b)[0] < margin for a in first for b in second)


def _gap(first: list[Solid], second: list[Solid], most: float) -> float:
    """The least distance [m] between them, infinite where the balls around them are farther apart than `most`."""
    return min((distance(a, b)[0] for a in first for b in second if _within(a, b, most)), default=np.inf)


def _within(a: Solid, b: Solid, margin: float) -> bool:
    """Whether the balls around them are so near."""
    apart = float(np.linalg.norm(a.center - b.center))
    return apart - a.reach(a.center) - b.reach(b.center) < margin
