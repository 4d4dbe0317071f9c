"""The self-motion manifold: all configurations that hold the end effector at one task point.

For redundancy degree r = 1 it consists of closed curves (loops) in joint space, whose number can change along a path
(planar 3R: one or two). They are traced by a predictor-corrector in arc length, many task points at once, and sampled
evenly. The tangent is the vector of signed minors of J, so that its sense is continuous over the whole manifold, and
opposite on the two branches that meet where the manifold changes its topology.
Random self-motions, for any r: Global paper Section 3.1.3, eq. (17).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError, PathError
from pipeline.model.kinematics import wrap, wrap_angles
from pipeline.model.task import Task

CLOSED = 1e-11  # [m] how well a node holds its task point


LONGEST_STEP = 0.3  # [rad] of the tracing; the Hermite curve through its points is then good to about 1e-5 rad


SMALLEST_STEP = 1e-6  # [rad] below: the task point is a critical value of the kinematics to machine precision


NEAR = 0.05  # [rad] a seed this close to a traced loop, running the same way, lies on it


MOST_STEPS = 4000


SHIFTS = (0.2, -0.2, 0.4, -0.4)  # of the spacing of nodes


NUDGE = 1e-9  # [m] from a critical task point to one with a regular manifold


ENOUGH = 100  # random configurations, none of which arrives at a point that is out of reach


@dataclass(frozen=True)
class Loop:
    """One closed curve of the manifold: nodes q (K, n) [rad], unit tangents (K, n), arc length s (K,) and in all [rad].

    Turning joints are wrapped to (-pi, pi]; the last node is followed by the first.
    """

    q: Array
    tangent: Array
    s: Array
    length: float
    revolute: NDArray[np.bool_]

    def interpolate(self, s: Array) -> Array:
        """Configurations (P, n) at arc lengths s (P,), by cubic Hermite: close enough for a Newton step to finish."""
        s = np.mod(s, self.length)
        left = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 1)
        right = (left + 1) % len(self.s)
        span = np.where(right == 0, self.length, self.s[right]) - self.s[left]
        chord = wrap(self.q[right] - self.q[left], self.revolute)
        return self.q[left] + _hermite(
            ((s - self.s[left]) / span)[:, None], chord, self.tangent[left], self.tangent[right], span[:, None]
        )


def tangent(jacobian: Array) -> Array:
    """Unit null vectors (K, n) of J (K, n - 1, n): its signed minors, so that [J; t'] has a positive determinant."""
    n = jacobian.shape[-1]
    others = np.array([[j for j in range(n) if j != i] for i in range(n)])
    minors = np.linalg.det(jacobian[:, :, others].transpose(0, 2, 1, 3)) * (-1.0) ** (np.arange(n) + n - 1)
    return np.asarray(minors / np.maximum(np.linalg.norm(minors, axis=1, keepdims=True), 1e-300))


def manifold(
    task: Task, x: Array, rng: np.random.Generator, *, spacing: float = 0.05, seeds: Array | None = None
) -> list[Loop]:
    """All loops of the manifold of the task point x (m,), nodes `spacing` [rad] apart; see `manifolds`."""
    return manifolds(task, np.asarray(x)[None], rng, spacing=spacing, seeds=seeds)[0]


def manifolds(
    task: Task,
    x: Array,
    rng: np.random.Generator,
    *,
    spacing: float | None = None,
    nodes: int | None = None,
    seeds: Array | None = None,
    random_seeds: int = 8,
) -> list[list[Loop]]:
    """The manifolds of task points x (P, m) along a path, all points in step: for each the list of its loops.

    Give `spacing` [rad] or `nodes`, the number for the longest manifold of all. Every loop has an even number of nodes.
    Loops are looked for from `seeds` (S, n), from random configurations, and from the neighbouring points' loops.
    """
    if task.redundancy != 1:
        raise InputError(
            f"the self-motion manifold is a curve for redundancy degree 1 only; this task has r = {task.redundancy}"
        )
    traced = _all_loops(task, x, _seeds(task, x, rng, seeds, random_seeds))
    for i in [i for i, loops in enumerate(traced) if not loops]:
        # At a critical value of the kinematics loops meet or shrink to a point: the manifold of a point beside it.
        for direction in rng.normal(size=(8, x.shape[1])):
            beside = x[i : i + 1] + NUDGE * direction / np.linalg.norm(direction)
            traced[i] = traced[i] or _all_loops(task, beside, _seeds(task, beside, rng, seeds, random_seeds))[0]
        if not traced[i]:
            raise PathError(_why_none(task, x, i, rng))
    if spacing is None:
        spacing = max(sum(loop.length for loop in loops) for loops in traced) / (nodes or 180)
    return _resample(task, x, traced, spacing)


def on_manifold(task: Task, loop: Loop, s: Array, x: Array) -> Array:
    """Configurations (P, n) at arc lengths s (P,) of the loop, closed on its task point x (m,)."""
    return close_gap(task, loop.interpolate(s), np.broadcast_to(x, (len(s), task.m)), steps=10, tolerance=1e-14)[0]


def _why_none(task: Task, x: Array, i: int, rng: np.random.Generator) -> str:
    """What is known of point i of x, of whose manifold no loop was found."""
    arrived = len(_seeds(task, x[i : i + 1], rng, None, ENOUGH)[0])
    point = f"point {i + 1} of {len(x)} of the path ({', '.join(f'{v:.4g}' for v in x[i])}) m"
    if not arrived:
        return f"{point} is out of the arm's reach: none of {ENOUGH} attempts, from anywhere, arrives there"
    return f"{point}: no self-motion that closes was found there, although {arrived} of {ENOUGH} attempts arrive"


# --- finding every loop ---------------------------------------------------------------------------------------------


def _seeds(task: Task, x: Array, rng: np.random.Generator, given: Array | None, count: int) -> list[Array]:
    """Configurations on the manifold of each point: the given ones first, then random ones."""
    n = task.arm.n
    random = rng.uniform(-np.pi, np.pi, size=(len(x), count, n))
    if given is not None:
        random = np.concatenate([np.broadcast_to(given, (len(x), *given.shape)), random], axis=1)
    q, on = close_gap(task, random.reshape(-1, n), np.repeat(x, random.shape[1], axis=0), steps=30, tolerance=1e-6)
    split = random.shape[1]
    return [q[i * split : (i + 1) * split][on[i * split : (i + 1) * split]] for i in range(len(x))]


def _all_loops(task: Task, x: Array, seeds: list[Array]) -> list[list[Loop]]:
    """Trace one seed per point in step, drop the seeds that lie on it, repeat; then seed from the neighbours' loops."""
    traced: list[list[Loop]] = [[] for _ in x]
    fresh: list[list[Loop]] = [[] for _ in x]
    while True:
        while any(len(of_point) for of_point in seeds):
            points = [i for i, of_point in enumerate(seeds) if len(of_point)]
            curves = _trace(task, x[points], np.array([seeds[i][0] for i in points]))
            for i, loop in zip(points, curves, strict=True):
                seeds[i] = seeds[i][1:]
                if loop is not None and not _known(loop, traced[i]):
                    traced[i].append(loop)
                    fresh[i].append(loop)
            seeds = _unexplained(task, seeds, traced)
        proposals = [
            np.concatenate(
                [loop.q[:: max(1, len(loop.q) // 6)] for j in (i - 1, i + 1) if 0 <= j < len(x) for loop in fresh[j]]
                or [np.empty((0, task.arm.n))]
            )
            for i in range(len(x))
        ]
        fresh = [[] for _ in x]
        counts = [len(proposal) for proposal in proposals]
        if not sum(counts):
            return traced
        q, on = close_gap(task, np.concatenate(proposals), np.repeat(x, counts, axis=0), steps=8, tolerance=1e-6)
        ends = np.cumsum(counts)[:-1]
        seeds = [part[good] for part, good in zip(np.split(q, ends), np.split(on, ends), strict=True)]
        seeds = _unexplained(task, seeds, traced)


def _unexplained(task: Task, seeds: list[Array], traced: list[list[Loop]]) -> list[Array]:
    """The seeds that do not lie on a traced loop."""
    counts = [len(of_point) for of_point in seeds]
    if not sum(counts):
        return seeds
    along = np.split(tangent(task.jacobian(np.concatenate(seeds))), np.cumsum(counts)[:-1])
    return [
        of_point[~np.any([_on(of_point, way, loop) for loop in loops], axis=0)] if len(of_point) and loops else of_point
        for of_point, way, loops in zip(seeds, along, traced, strict=True)
    ]


def _on(q: Array, way: Array, loop: Loop) -> NDArray[np.bool_]:
    """Whether configurations (P, n) with tangents `way` lie on the loop, up to `NEAR`."""
    s = np.linspace(0.0, loop.length, max(8, int(2 * loop.length / NEAR)), endpoint=False)
    nodes = loop.interpolate(s)
    direction = wrap(np.roll(nodes, -1, axis=0) - np.roll(nodes, 1, axis=0), loop.revolute)
    gap = wrap(q[:, None] - nodes, loop.revolute)
    near = (gap**2).sum(axis=2) < NEAR**2
    return np.asarray((near & (way @ direction.T > 0)).any(axis=1))


def _known(loop: Loop, others: Sequence[Loop]) -> bool:
    """Whether most of the loop lies on one that was traced before."""
    return any(np.mean(_on(loop.q, loop.tangent, other)) > 0.5 for other in others)


# --- tracing --------------------------------------------------------------------------------------------------------


def _trace(task: Task, x: Array, seed: Array) -> list[Loop | None]:
    """The loops through seed (P, n), each at its task point x (P, m); None where a curve does not close."""
    revolute = task.arm.description.revolute
    q, _ = close_gap(task, seed, x, steps=6, tolerance=CLOSED)
    way = tangent(task.jacobian(q))
    start, start_way = q.copy(), way.copy()
    step, travelled, bend = np.full(len(q), 0.1), np.zeros(len(q)), np.zeros_like(q)
    history = [(np.arange(len(q)), q.copy(), way.copy(), np.zeros(len(q)))]
    length = np.full(len(q), np.nan)
    live = np.arange(len(q))
    for _ in range(MOST_STEPS):
        if not live.size:
            break
        h, a, ta = step[live, None], q[live], way[live]
        b = a + h * (ta + 0.5 * h * bend[live])
        for _ in range(2):
            gap, jacobian = task.error_and_jacobian(b, x[live])
            b = b - least_move(jacobian, gap)
        tb = tangent(jacobian)
        chord = b - a
        distance = np.linalg.norm(chord, axis=1)
        turn = np.arccos(np.clip((ta * tb).sum(axis=1), -1.0, 1.0))
        good = (np.linalg.norm(gap, axis=1) < 1e-5) & (turn < 0.5) & (np.abs(distance / step[live] - 1) < 0.2)
        arc = distance * (1 + turn**2 / 24)  # of a circular arc with this chord and turn

        ahead = wrap(start[live] - a, revolute)
        u = ((ahead * chord).sum(axis=1) / distance**2)[:, None]
        miss = np.linalg.norm(ahead - _hermite(u, chord, ta, tb, arc[:, None]), axis=1)
        same_way = (start_way[live] * ta).sum(axis=1) > 0.5
        closing = (u[:, 0] > 1e-9) & (u[:, 0] <= 1) & (miss < 0.1 * distance) & same_way & (travelled[live] > 0)
        ended = good & closing
        reach = np.linalg.norm(ahead, axis=1)
        last = reach * (1 + (turn * u[:, 0]) ** 2 / 24)
        length[live[ended]] = (travelled[live] + last)[ended]

        on = good & ~ended
        moved = live[on]
        bend[moved] = ((tb - ta) / arc[:, None])[on]
        q[moved], way[moved] = b[on], tb[on]
        travelled[moved] += arc[on]
        history.append((moved, b[on], tb[on], travelled[moved]))
        factor = np.where(good, np.clip(0.3 / np.maximum(turn, 1e-9), 0.5, 1.5), 0.5)
        step[live] = np.minimum(step[live] * factor, LONGEST_STEP)
        live = live[~ended & (step[live] > SMALLEST_STEP)]

    owner, nodes, ways, s = (np.concatenate(column) for column in zip(*history, strict=True))
    nodes = wrap_angles(nodes, revolute)
    loops: list[Loop | None] = []
    for i, total in enumerate(length):
        mine = owner == i
        loops.append(None if np.isnan(total) else Loop(nodes[mine], ways[mine], s[mine], float(total), revolute))
    return loops


def _resample(task: Task, x: Array, traced: list[list[Loop]], spacing: float) -> list[list[Loop]]:
    """The same loops with evenly spaced nodes, closed on their task points; all nodes of all points in one batch."""
    counts = [[2 * max(4, int(np.ceil(loop.length / spacing / 2))) for loop in loops] for loops in traced]
    even = [
        [np.arange(count) * (loop.length / count) for loop, count in zip(loops, of_point, strict=True)]
        for loops, of_point in zip(traced, counts, strict=True)
    ]
    rough = [
        loop.interpolate(s)
        for loops, all_s in zip(traced, even, strict=True)
        for loop, s in zip(loops, all_s, strict=True)
    ]
    target = np.repeat(x, [sum(of_point) for of_point in counts], axis=0)
    q, on = close_gap(task, np.concatenate(rough), target, steps=30, tolerance=CLOSED)
    for shift in SHIFTS:  # a node at a singular configuration gives way to one beside it
        if on.all():
            break
        beside = [
            loop.interpolate(s + shift * loop.length / len(s))
            for loops, all_s in zip(traced, even, strict=True)
            for loop, s in zip(loops, all_s, strict=True)
        ]
        lost = np.flatnonzero(~on)
        q[lost], on[lost] = close_gap(task, np.concatenate(beside)[lost], target[lost], steps=30, tolerance=CLOSED)
    if not on.all():
        raise PathError(f"the self-motion manifold was lost at the task point {target[~on][0]}, where it was sampled")
    ways = tangent(task.jacobian(q))
    revolute = task.arm.description.revolute
    q = wrap_angles(q, revolute)
    out: list[list[Loop]] = []
    first = 0
    for loops, all_s in zip(traced, even, strict=True):
        out.append([])
        for loop, s in zip(loops, all_s, strict=True):
            part = slice(first, first + len(s))
            out[-1].append(Loop(q[part], ways[part], s, loop.length, revolute))
            first += len(s)
    return out


def close_gap(task: Task, q: Array, x: Array, *, steps: int, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Newton steps of least length from q (P, n) to the task points x (P, m), only where still needed; q, success."""
    q, open_ = q.copy(), np.arange(len(q))
    for _ in range(steps + 1):
        gap, jacobian = task.error_and_jacobian(q[open_], x[open_])
        far = np.linalg.norm(gap, axis=1) > tolerance
        open_ = open_[far]
        if not open_.size:
            break
        move = -least_move(jacobian[far], gap[far])
        q[open_] += move * np.minimum(1.0, 0.5 / np.maximum(np.linalg.norm(move, axis=1, keepdims=True), 1e-300))
    return q, ~np.isin(np.arange(len(q)), open_)


def least_move(jacobian: Array, gap: Array) -> Array:
    """J'(J J')^-1 gap (P, n), kept finite where J loses rank."""
    square = jacobian @ np.swapaxes(jacobian, 1, 2)
    m = square.shape[1]
    square[:, range(m), range(m)] += 1e-14 * np.trace(square, axis1=1, axis2=2)[:, None]
    return np.asarray((np.swapaxes(jacobian, 1, 2) @ np.linalg.solve(square, gap[:, :, None]))[:, :, 0])


def _hermite(u: Array, chord: Array, left: Array, right: Array, span: Array) -> Array:
    """Displacement (P, n) from the left end at fraction u (P, 1) of a cubic with these slopes over `span` (P, 1)."""
    return u * u * (3 - 2 * u) * chord + span * u * (1 - u) * ((1 - u) * left - u * right)
