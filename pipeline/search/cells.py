"""Cells: short arcs of the self-motion loops of all knots (r = 1), which together cover every motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.manifold import Manifold
from pipeline.search.quadratics import AT
from pipeline.search.self_motion import Loop, manifolds

Index = NDArray[np.intp]

TRACED = 180  # nodes of the longest manifold, between which its curves are interpolated
FEWEST = 8  # cells of a loop
ON_PATH = 1e-11  # [m, rad]
BULGE = 0.5  # share of what a cell spans by which it may reach beyond what is seen of it
ROOM = 0.02  # of a cell, by which it is cut outside a limit


class Curves:
    """The loops of every knot of `times`, and where on them joints are represented.

    A joint whose limits leave at most a turn is `held` within them; the other revolute ones are `turning`: their
    differences are taken to the nearest turn, and their limits, if any, are not looked at.
    """

    def __init__(self, problem: Problem, times: Array) -> None:
        self.problem, self.manifold = problem, Manifold(problem)
        self.x, self.last = problem.reference.position(times), len(times) - 1
        bounds, revolute = problem.bounds, np.asarray(problem.task.arm.description.revolute)
        self.held = revolute & (bounds.upper - bounds.lower <= 2 * np.pi)
        self.turning = revolute & ~self.held
        self.period = np.where(revolute, 2 * np.pi, 0.0)
        self.lower = np.where(self.turning, -np.inf, bounds.lower)
        self.upper = np.where(self.turning, np.inf, bounds.upper)
        fixed, cyclic = problem.boundary is Boundary.FIXED, problem.boundary is Boundary.CYCLIC
        wanted = self.x[1:] if fixed else self.x[:-1] if cyclic else self.x
        self.loops = manifolds(problem.task, wanted, np.random.default_rng(0), nodes=TRACED, seeds=problem.q_init[None])
        if fixed:
            self.loops.insert(0, [])
        if cyclic:
            self.loops.append(self.loops[0])

    def cells(self, count: int) -> Cells:
        """All of all loops: `count` on the longest manifold; of a fixed start one without extent."""
        longest = max(sum(loop.length for loop in loops) for loops in self.loops)
        parts = []
        for layer, loops in enumerate(self.loops):
            if not loops:
                parts.append(np.array([[layer, 0, 0.0, 0.0]]))
            for number, loop in enumerate(loops):
                of_loop = max(FEWEST, int(np.ceil(loop.length / longest * count)))
                width = loop.length / of_loop
                row = np.broadcast_to([layer, number, 0.0, width], (of_loop, 4)).copy()
                row[:, 2] = np.arange(of_loop) * width
                parts.append(row)
        rows = np.concatenate(parts)
        return self.at(rows[:, 0].astype(np.intp), rows[:, 1].astype(np.intp), rows[:, 2], rows[:, 3])

    def at(self, layer: Index, loop: Index, low: Array, width: Array) -> Cells:
        """The cells that begin at arc lengths `low` and are `width` long, ordered by layer and loop; those that reach
        beyond a limit are cut there.
        """
        q = self._configurations(layer, loop, low, width)
        outside = np.maximum(self.lower - q, q - self.upper)
        span = np.ptp(q, axis=1)
        allowed = (outside.min(axis=1) <= BULGE * span + 1e-9).all(axis=1)
        cut = np.flatnonzero(allowed & (outside > 0).any(axis=(1, 2)) & (width > 0))
        if len(cut):
            begin, end = _inside(outside[cut])
            low, width = low.copy(), width.copy()
            low[cut] += begin * width[cut]
            width[cut] *= end - begin
            q[cut] = self._configurations(layer[cut], loop[cut], low[cut], width[cut])
        metric = self.manifold.metric(q.reshape(-1, self.manifold.n))
        root = np.linalg.cholesky(metric).reshape(*q.shape, self.manifold.n)
        return Cells(self, layer, loop, low, width, q, root, allowed)

    def along(self, layer: Index, loop: Index, s: Array) -> Array:
        """Configurations (C, K, n) at arc lengths s (C, K), on the path; rows ordered by layer and loop."""
        q = np.empty((*s.shape, self.manifold.n))
        heads = np.flatnonzero(np.r_[True, (np.diff(layer) != 0) | (np.diff(loop) != 0)])
        for first, end in zip(heads, [*heads[1:], len(s)], strict=True):
            loops: list[Loop] = self.loops[layer[first]]
            if not loops:
                q[first:end] = self.problem.q_init
                continue
            curve, here = loops[loop[first]], s[first:end]
            here = np.where(np.abs(here - curve.length) < 1e-9, 0.0, here)
            q[first:end] = curve.interpolate(here.ravel()).reshape(*here.shape, -1)
        target = np.repeat(self.x[layer], s.shape[1], axis=0)
        flat, _ = self.manifold.project(q.reshape(-1, self.manifold.n), target, tolerance=ON_PATH)
        return np.asarray(flat.reshape(q.shape))

    def _configurations(self, layer: Index, loop: Index, low: Array, width: Array) -> Array:
        """(C, 5, n) at `AT`, without jumps by full turns; held joints in their turn."""
        q = self.along(layer, loop, low[:, None] + AT * width[:, None])
        change = q - q[:, :1]
        q = q[:, :1] + change - self.period * np.rint(change / (2 * np.pi))
        lowest = np.where(self.held, self.lower, 0.0)
        turns = np.floor((q[:, 2] - lowest + np.ptp(q, axis=1)) / (2 * np.pi))
        return np.asarray(q - np.where(self.held, 2 * np.pi * turns, 0.0)[:, None])


@dataclass(frozen=True)
class Cells:
    """Cells ordered by layer (the knot's number): their loop, where they begin on it, and their width [rad].

    q (C, 5, n) and the roots (C, 5, n, n) of the objective's metric at `AT` along them. allowed: not beyond a limit.
    """

    curves: Curves
    layer: Index
    loop: Index
    low: Array
    width: Array
    q: Array
    root: Array
    allowed: NDArray[np.bool_]

    def halved(self, keep: Index) -> Cells:
        """The halves of the cells `keep`: those of the k-th are 2 k and 2 k + 1. What is a point has one half."""
        width = np.repeat(self.width[keep] / 2, 2)
        low = np.repeat(self.low[keep], 2)
        low[1::2] += width[1::2]
        halves = self.curves.at(np.repeat(self.layer[keep], 2), np.repeat(self.loop[keep], 2), low, width)
        halves.allowed[1::2] &= self.width[keep] > 0
        return halves


def _inside(outside: Array) -> tuple[Array, Array]:
    """Where cells begin and end to be inside all limits, as shares (C,), with `ROOM`; outside (C, 5, n) at `AT`.

    What crosses a limit between two places is taken to do so in a straight line.
    """
    count = len(outside)
    begin, end = np.zeros(count), np.ones(count)
    for joint in range(outside.shape[2]):
        beyond = outside[:, :, joint]
        within = beyond <= 0
        some = within.any(axis=1)
        first, last = within.argmax(axis=1), len(AT) - 1 - within[:, ::-1].argmax(axis=1)
        rows, step = np.arange(count), AT[1]
        before, after = np.maximum(first - 1, 0), np.minimum(last + 1, len(AT) - 1)
        with np.errstate(all="ignore"):
            share = beyond[rows, before] / (beyond[rows, before] - beyond[rows, first])
            enter = np.where(first > 0, AT[before] + step * share, 0.0)
            share = beyond[rows, last] / (beyond[rows, last] - beyond[rows, after])
            leave = np.where(last < len(AT) - 1, AT[last] + step * share, 1.0)
        begin = np.where(some & np.isfinite(enter), np.maximum(begin, enter), begin)
        end = np.where(some & np.isfinite(leave), np.minimum(end, leave), end)
    begin, end = np.maximum(begin - ROOM, 0.0), np.minimum(end + ROOM, 1.0)
    crossed = begin >= end
    return np.where(crossed, 0.0, begin), np.where(crossed, 1.0, end)
