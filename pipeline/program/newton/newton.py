"""Many motions at once to their local optima: a Newton method on the path, an interior point within limits.

Each iteration serves all starts and all knots with one call of the kernel.

1. exact gradient and block-tridiagonal Hessian (`motion.py`), plus the path's curvature by its multipliers;
2. per knot J' = Y R and the null space Z: the step onto the path is -Y R^-T e, the multipliers are -R^-1 Y'g, and what
   is left is Z'HZ, N r unknowns in a narrow band (Nocedal and Wright 2006, Section 18.3), solved by Cholesky. Where it
   is not positive definite it fades into the stiffness M/dt, which always is;
3. limits c >= 0 by a primal-dual interior point (Nocedal and Wright, chapter 19) with slacks s and, so that a start
   beyond its limits is none the worse, an excess t that costs a penalty p each: c + t = s, z s = mu, (p - z) t = mu.
   All this is diagonal: the band stays. Where an excess remains, no motion near the start keeps the limits;
4. full steps are the rule; others are searched with the filter of Waechter and Biegler (2006), each trial bent back
   onto the path (a second-order correction);
5. a start that has converged, or whose steps vanish, leaves the batch.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.limits import Limits
from pipeline.program.newton import stencils, triangular
from pipeline.program.newton.banded import Banded
from pipeline.program.newton.bounds import Bounds
from pipeline.program.newton.inequalities import Inequalities
from pipeline.program.newton.iterates import Answer, Mask, State, Step
from pipeline.program.newton.knots import Blocks
from pipeline.program.newton.motion import Motions, Point

FILTER = 16  # entries of each start's filter
NEAR = 1e-7  # relative: where rounding decides, a full step is taken without question
LONGEST = 0.7  # [rad] of a step at any joint and knot
ON_PATH = 1e-5  # [m, rad] from where the last step is taken
NEARLY, NEARLY_ON_PATH = 0.3, 1e-3  # of the cost, [m, rad]: so near an optimum, what it will cost is clear
BARRIER_END = 1e-10
COMPLEMENTARITY = 10.0  # times BARRIER_END: how far products of slack and multiplier may be from it
ROUGHLY, ALMOST = 1e-3, 1e-4  # of the decrement, of rows that are missed: near enough for IPOPT to end it
FEASIBLE = 1e-9

BEYOND = 1e-6  # [rad] of excess that remains: infeasible
SHORT, PATIENCE = 1e-3, 3  # more than so many steps shorter than this: lost
TRIALS = 10


@dataclass(frozen=True)
class Barrier:
    """Where the interior point begins: the barrier parameter, and slacks of at least `push` of their width."""

    mu: float = 1e-2
    push: float = 1e-2


COLD, WARM = Barrier(), Barrier(1e-6, 1e-3)  # warm: a spline of a coarser optimum is nearly optimal


class Newton:
    """Solves motions of one task on one grid; `limits`: of positions and velocities."""

    def __init__(self, motions: Motions, limits: Limits) -> None:
        self.motions, self.knots = motions, motions.knots
        self.limits = Inequalities(Bounds(self.knots, limits), motions.terms.count, motions.terms.penalty)
        self.band = Banded(self.knots.count, motions.n - motions.m, self.knots.cyclic, motions.reach)

    def solve(
        self,
        q: Array,
        barrier: Barrier = COLD,
        *,
        dear: float = np.inf,
        tolerance: float = 1e-10,
        max_iterations: int = 60,
    ) -> Answer:
        """From motions q (S, N + 1, n); never raises for a start that fails. Without limits, a start is given up that
        will cost more than `dear`: that is seen some iterations before it has converged.
        """
        with np.errstate(all="ignore"):  # a start at a singularity fails alone
            begin = time.perf_counter()
            answer = self._solve(np.array(q, dtype=float), barrier, dear, tolerance, max_iterations)
            answer.wall_time = time.perf_counter() - begin
            return answer

    def _solve(self, q: Array, barrier: Barrier, dear: float, tolerance: float, max_iterations: int) -> Answer:
        count = len(q)
        unknown = np.full(count, np.inf)
        no, zero = np.zeros(count, bool), np.zeros(count, int)
        answer = Answer(q, unknown.copy(), no.copy(), zero, unknown.copy(), no.copy(), no.copy())
        if not count:
            return answer
        state = self._begin(q, barrier)
        for iteration in range(1, max_iterations + 1):
            step = self._direction(state)
            done = self._converged(state, step, tolerance)
            lost = ~np.isfinite(step.decrement) | self._infeasible(state, step, tolerance)
            too_dear = self._will_cost(state, step) > dear
            answer.dear[state.number] = too_dear
            finished = done | lost | too_dear
            if finished.any():
                self._end(answer, state, step, iteration, finished, done & ~lost & ~too_dear)
                if finished.all():
                    break
                state, step = state.take(~finished), step.take(~finished)
            state = self._advance(state, step)
            given_up = ~np.isfinite(state.point.cost) | (state.short > PATIENCE)
            if iteration == max_iterations:
                given_up[:] = True
            if given_up.any():
                answer.nearly[state.number] = self._nearly(state, step) & given_up
                self._end(answer, state, None, iteration, given_up, np.zeros_like(given_up))
                if given_up.all():
                    break
                state = state.take(~given_up)
        return answer

    def _end(self, answer: Answer, state: State, step: Step | None, iteration: int, who: Mask, converged: Mask) -> None:
        """Starts that end, after one more step without question, which needs no derivatives any more."""
        x = state.x if step is None else state.x + self._longest(state, step)[:, None, None] * step.d
        x, begin, number = x[who], state.begin[who], state.number[who]
        cost, error, _, tie = self.motions.value(x, begin)
        answer.q[number], answer.iterations[number] = self.knots.whole(x, begin), iteration
        answer.cost[number], answer.residual[number] = cost, self._missed(error, tie)
        answer.converged[number] = converged[who] & np.isfinite(cost)

    def _begin(self, q: Array, barrier: Barrier) -> State:
        count, begin, x = len(q), self.knots.begin(q), self.knots.unknown(q)
        point = self.motions.differentiate(x, begin)
        kept, mu = self.limits.values(x, begin, point.kept), np.full(count, barrier.mu if self.limits else 0.0)
        slack = np.maximum(kept, barrier.push * self.limits.width)
        z = np.minimum(mu[:, None] / slack, self.limits.penalty / 2)
        empty = np.full((count, FILTER), np.inf)
        return State(
            number=np.arange(count),
            x=x,
            begin=begin,
            scale=1.0 / np.maximum(point.cost, triangular.TINY),
            slack=slack,
            excess=np.maximum(slack - kept, mu[:, None] / (self.limits.penalty - z)),
            z=z,
            mu=mu,
            nu=np.zeros_like(point.tie),
            seen_theta=empty,
            seen_phi=empty.copy(),
            short=np.zeros(count, int),
            point=point,
        )

    # --- the direction ------------------------------------------------------------------------------------------

    def _direction(self, state: State) -> Step:
        point, limits, knots, ties = state.point, self.limits, self.knots, self.motions.ties
        scale, mu = state.scale[:, None, None], state.mu[:, None]
        YT, ZT = point.Y.swapaxes(-1, -2), point.Z.swapaxes(-1, -2)
        gradient = point.gradient * scale
        lack = self._lack(state) if limits else state.slack
        towards = gradient - limits.pull(point.by, state.z) if limits else gradient
        if ties.count:
            towards = towards + stencils.pull(knots, point.tied, state.nu)
        multipliers = triangular.backward(point.R, -(YT @ towards[..., None])[..., 0])
        hessian, stiff = (tuple(a * scale[..., None] for a in blocks) for blocks in (point.hessian, point.stiff))
        hessian[0][:] += self.motions.curvature(point, multipliers)
        more = self.motions.terms.curvature(state.x, state.begin, limits.of_rows(state.z), state.scale)
        for bends in (more, ties.curvature(state.x, state.begin, state.nu)):
            for block, bent in zip(hessian, bends, strict=False):
                block[:] += bent
        driven = gradient
        if limits:
            other = limits.penalty - state.z
            sigma = 1 / (state.slack / state.z + state.excess / other)
            off_centre = lack - mu / state.z + state.slack + mu / other - state.excess
            limits.add(point.by, sigma, hessian, stiff)
            driven = gradient - limits.pull(point.by, state.z - sigma * off_centre)
        onto = -(point.Y @ triangular.forward(point.R, point.error)[..., None])[..., 0]
        right = -(ZT @ (driven + knots.product(hessian, onto))[..., None])[..., 0]
        within, nu, pulled = self._reduced(point, hessian, stiff, right, onto)
        d = onto + (point.Z @ within[..., None])[..., 0]
        theta = np.abs(point.error).sum(axis=(1, 2)) + np.abs(point.tie).sum(axis=(1, 2))
        slope, phi = (gradient * d).sum(axis=(1, 2)), point.cost * state.scale
        slack_step = excess_step = z_step = state.slack
        if limits:
            z_step = -sigma * (limits.change(point.by, d) + off_centre)
            slack_step = (mu - state.slack * z_step) / state.z - state.slack
            excess_step = (mu + state.excess * z_step) / other - state.excess
            theta = theta + np.abs(lack).sum(axis=1)
            phi = phi + self._barrier(state.slack, state.excess, state.mu)
            slope = slope - state.mu * (slack_step / state.slack + excess_step / state.excess).sum(axis=1)
            slope = slope + excess_step @ limits.penalty
        decrement = np.abs(((right - pulled) * within).sum(axis=(1, 2)))
        return Step(d, slack_step, excess_step, z_step, nu, decrement, slope, theta, phi)

    def _lack(self, state: State) -> Array:
        return self.limits.values(state.x, state.begin, state.point.kept) + state.excess - state.slack

    def _barrier(self, slack: Array, excess: Array, mu: Array) -> Array:
        return np.asarray(excess @ self.limits.penalty - mu * (np.log(slack) + np.log(excess)).sum(axis=1))

    def _reduced(self, point: Point, blocks: Blocks, stiff: Blocks, right: Array, onto: Array) -> tuple[Array, ...]:
        """The step (S, U, r) in the null spaces, the ties' multipliers (S, U, T) and their pull on it (S, U, r)."""
        matrices = self.band.assemble(self.knots.reduce(point.Z, blocks))
        positive = self.band.assemble(self.knots.reduce(point.Z, stiff))
        # Where nothing holds the start, a uniform motion costs the stiffness nothing.
        positive[:, :, -1] += 1e-4 * positive[:, :, -1].mean(axis=1, keepdims=True)
        if not self.motions.ties.count:
            within = self.band.solve(matrices, positive, right)[0]
            return within, point.tie, np.zeros(())
        target = -(point.tie + stencils.change(self.knots, point.tied, onto))
        reduced = tuple(g @ self.knots.before(point.Z, s) for s, g in enumerate(point.tied))
        rows = stencils.dense(self.knots, reduced)
        within, nu, _ = self.band.solve(matrices, positive, right, rows, target.reshape(len(right), -1))
        nu = nu.reshape(point.tie.shape)
        return within, nu, stencils.pull(self.knots, reduced, nu)

    def _converged(self, state: State, step: Step, tolerance: float) -> Mask:
        missed = self._missed(state.point.error, state.point.tie)
        done = (step.decrement < tolerance) & (missed < ON_PATH)
        if self.limits:
            gap = np.abs(state.slack * state.z - state.mu[:, None]).max(axis=1)
            lack = np.maximum(np.abs(self._lack(state)), state.excess).max(axis=1)
            done &= (gap < COMPLEMENTARITY * BARRIER_END) & (state.mu <= BARRIER_END) & (lack < FEASIBLE)
        return done

    def _nearly(self, state: State, step: Step) -> Mask:
        """Whether a start is so near an optimum that what keeps it from there are rows that bend where it is: those of
        clearances do, as the nearest corners of two hulls change.
        """
        if not self.motions.terms.kinks:
            return np.zeros(len(state.x), bool)
        near = (step.decrement < ROUGHLY) & (self._missed(state.point.error, state.point.tie) < ON_PATH)
        if self.limits:
            lack = np.maximum(np.abs(self._lack(state)), state.excess).max(axis=1)
            near &= (state.mu <= 2 * BARRIER_END) & (lack < ALMOST)
        return near

    def _will_cost(self, state: State, step: Step) -> Array:
        """What starts (S,) come to at least if they lose twice as much as a quadratic would; nothing where the model is
        not yet to be trusted, and within limits, whose barrier costs too.
        """
        cost, fall = state.point.cost, step.decrement / state.scale
        near = (fall < NEARLY * cost) & (self._missed(state.point.error, state.point.tie) < NEARLY_ON_PATH)
        return np.where(near, cost - fall, 0.0) if not self.limits else np.zeros_like(cost)

    @staticmethod
    def _missed(error: Array, tie: Array) -> Array:
        """The largest error (S,) of the path and of ties."""
        return np.maximum(np.abs(error).max(axis=(1, 2)), np.abs(tie).max(axis=(1, 2), initial=0.0))

    def _infeasible(self, state: State, step: Step, tolerance: float) -> Mask:
        beyond = state.excess.max(axis=1, initial=0.0) > BEYOND
        return (step.decrement < tolerance) & (state.mu <= BARRIER_END) & beyond if self.limits else beyond

    # --- the step -----------------------------------------------------------------------------------------------

    def _longest(self, state: State, step: Step) -> Array:
        """How much (S,) of a step may be taken."""
        towards = np.maximum(0.99, 1 - state.mu)
        reach = np.ones(len(state.x))
        if self.limits:
            reach = np.minimum(
                _fraction(state.slack, step.slack, towards), _fraction(state.excess, step.excess, towards)
            )
        alpha = np.minimum(reach, LONGEST / np.maximum(np.abs(step.d).max(axis=(1, 2)), triangular.TINY))
        return np.where(np.isfinite(alpha), alpha, 0.0)

    def _advance(self, state: State, step: Step) -> State:
        """The next iterate. The whole next point is computed at once, since full steps are the rule."""
        alpha = self._longest(state, step)
        trial = state.x + alpha[:, None, None] * step.d
        point = self.motions.differentiate(trial, state.begin)
        refused = self._refused(state, step, alpha, trial, point.cost, point.error, point.kept, point.tie)
        searched = bad = np.flatnonzero(refused)
        for _ in range(TRIALS):
            if not len(bad):
                break
            part, direction = state.take(bad), step.take(bad)
            straight = part.x + alpha[bad, None, None] * direction.d
            missed = self.motions.missed(straight)
            bent = straight - (part.point.Y @ triangular.forward(part.point.R, missed)[..., None])[..., 0]
            trial[bad] = bent
            again = self._refused(part, direction, alpha[bad], bent, *self.motions.value(bent, part.begin))
            bad = bad[again]
            alpha[bad] *= 0.4
        if len(searched):
            point.put(searched, self.motions.differentiate(trial[searched], state.begin[searched]))
        slack, excess, z, mu = state.slack, state.excess, state.z, state.mu
        nu = state.nu + alpha[:, None, None] * (step.nu - state.nu)
        theta, phi = state.seen_theta, state.seen_phi
        oldest = np.where(step.theta > FEASIBLE, step.theta, np.inf)
        theta, phi = np.roll(theta, 1, axis=1), np.roll(phi, 1, axis=1)
        theta[:, 0], phi[:, 0] = oldest, step.phi
        if self.limits:
            slack, excess = slack + alpha[:, None] * step.slack, excess + alpha[:, None] * step.excess
            towards = np.maximum(0.99, 1 - mu)
            dual = np.minimum(_fraction(z, step.z, towards), _fraction(self.limits.penalty - z, -step.z, towards))
            z = z + dual[:, None] * step.z
            # complementarity within a factor of its target (Waechter and Biegler, eq. (16))
            z = np.clip(
                z,
                1e-10 * mu[:, None] / slack,
                np.minimum(1e10 * mu[:, None] / slack, (1 - 1e-12) * self.limits.penalty),
            )
            near = self._missed(state.point.error, state.point.tie) < 1e-4
            solved = (step.decrement < 10 * mu) & near & (alpha > 0.3)
            mu = np.where(solved, np.maximum(BARRIER_END, np.minimum(0.1 * mu, mu**1.7)), mu)
            theta[mu < state.mu] = np.inf  # another barrier, another filter
        short = np.where(alpha < SHORT, state.short + 1, 0)
        return State(state.number, trial, state.begin, state.scale, slack, excess, z, mu, nu, theta, phi, short, point)

    def _refused(
        self, state: State, step: Step, alpha: Array, trial: Array, cost: Array, error: Array, *others: Array
    ) -> Mask:
        """Whether a trial neither lowers cost nor what is missed, against the iterate and against its filter."""
        kept, tie = others
        theta, phi = np.abs(error).sum(axis=(1, 2)) + np.abs(tie).sum(axis=(1, 2)), cost * state.scale
        if self.limits:
            slack, excess = (
                a + alpha[:, None] * b for a, b in ((state.slack, step.slack), (state.excess, step.excess))
            )
            theta = theta + np.abs(self.limits.values(trial, state.begin, kept) + excess - slack).sum(axis=1)
            phi = phi + self._barrier(slack, excess, state.mu)
        rounding = 1e-10 * np.maximum(1.0, np.abs(step.phi))
        descent = (step.slope < 0) & (step.theta < 1e-4) & (theta < 1e-4)
        armijo = phi <= step.phi + 1e-4 * alpha * step.slope + rounding
        better = (theta <= (1 - 1e-5) * step.theta) | (phi <= step.phi - 1e-5 * step.theta + rounding)
        seen = (theta[:, None] <= (1 - 1e-5) * state.seen_theta) | (
            phi[:, None] <= state.seen_phi - 1e-5 * state.seen_theta
        )
        seen |= np.isinf(state.seen_theta)
        near = (step.decrement < NEAR) & (step.theta < NEAR) & (theta < NEAR)
        return np.asarray(~((np.where(descent, armijo, better) & seen.all(axis=1)) | near))


def _fraction(values: Array, change: Array, towards: Array) -> Array:
    """Per start the longest step (S,) that leaves 1 - `towards` of all values (S, L)."""
    ratio = np.where(change < 0, -towards[:, None] * values / change, np.inf)
    return np.asarray(np.minimum(1.0, ratio.min(axis=1, initial=np.inf)))
