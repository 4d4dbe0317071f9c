"""From a problem on a fixed base to the same on a base that floats, or that is held so that what it feels can count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.build.regular import require_regular
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.config.messages import shown
from pipeline.config.robot import FreeBaseConfig
from pipeline.config.run import RunConfig
from pipeline.model.arm import Arm
from pipeline.model.base import Base, Held
from pipeline.model.coordinates import PLANE, Coordinates
from pipeline.model.floating import Floating, pose_coordinates
from pipeline.problem.integrals import INTEGRALS
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.robot.spacecraft import Spacecraft
from pipeline.robot.urdf import check_root, root_mass


def place(problem: Problem, config: RunConfig) -> Problem:
    """The problem on the base that `config` asks for; raises ConfigError if they do not go together."""
    wanted = {key for key, weight in config.objective.weights.items() if weight}
    wanted |= INTEGRALS.keys() & set(config.method.pareto.objectives) if "pareto" in config.methods else set()
    bases = {INTEGRALS[name].base for name in wanted}
    free = isinstance(config.base, FreeBaseConfig)
    if "floating" in bases and not free:
        raise ConfigError("base_rotation: the base does not move; set base=free")
    if "held" in bases and free:
        raise ConfigError("reaction: nothing acts on a base that floats; set base=fixed")
    if np.isfinite(problem.bounds.attitude) and not free:
        raise ConfigError(f"limits.attitude = {problem.bounds.attitude:g}: the base does not move; set base=free")
    arm = problem.task.arm
    base: Base
    if isinstance(config.base, FreeBaseConfig):
        spacecraft = _spacecraft(config.base, arm)
        base = Floating(spacecraft, _coordinates(arm, spacecraft))
    elif "held" in bases:
        base = Held(pose_coordinates(arm, Held.spacecraft))
    else:
        return problem
    if config.closed_loop.run:
        raise ConfigError("closed_loop.run: the controller is one for arms on a fixed base")
    if problem.objective.secondary is not None:
        raise ConfigError("objective.secondary: secondary criteria are for arms on a fixed base")
    if np.any(arm.mounting.gravity) and free:
        raise ConfigError("gravity: a floating base falls under it, and its momentum is not constant; set gravity=none")
    return _moved(problem, base)


def _coordinates(arm: Arm, spacecraft: Spacecraft) -> Coordinates:
    found = pose_coordinates(arm, spacecraft)
    if found is PLANE and any(spacecraft.momentum[i] for i in (2, 3, 4)):
        raise ConfigError("base: a planar arm has linear momentum in x and y, and angular momentum about z only")
    return found


def _moved(problem: Problem, base: Base) -> Problem:
    """The same task, path and limits, with the base's coordinates before the joints: no limits but on its attitude."""
    fixed = problem.task.arm
    arm = Arm(fixed.description, fixed.mounting, base)
    if base.kind == "floating":
        require_regular(arm)
    free = np.full(base.count, np.inf)

    def padded(values: Array, sign: float = 1.0) -> Array:
        return np.concatenate([sign * free, values])

    own = problem.bounds
    limits = Limits(
        padded(own.lower, -1.0),
        padded(own.upper),
        padded(own.velocity),
        padded(own.torque),
        padded(own.power),
        own.attitude,
        padded(np.broadcast_to(own.acceleration, fixed.n)),
        padded(np.broadcast_to(own.jerk, fixed.n)),
        own.tool_speed,
        own.tool_acceleration,
    )
    q_init = np.concatenate([np.zeros(base.count), problem.q_init])
    return replace(problem, task=replace(problem.task, arm=arm), q_init=q_init, limits=limits)


def _spacecraft(base: FreeBaseConfig, arm: Arm) -> Spacecraft:
    check_root(arm.description)
    momentum = (*base.linear_momentum, *base.angular_momentum)
    if base.mass is None:
        for key, value in (("inertia", base.inertia), ("com", base.com)):
            if np.any(value):
                raise ConfigError(f"base.{key} = {shown(value)}: that of a spacecraft; give its base.mass too")
        if root_mass(arm.description) <= 0:
            raise ConfigError(
                f"base.mass: not given, and the root link {arm.description.base} of {arm.description.name} has no mass"
            )
        return Spacecraft(momentum=momentum)
    given = np.atleast_1d(np.asarray(base.inertia, dtype=float))
    if len(given) not in (1, 3, 6):
        raise ConfigError(
            f"base.inertia = {shown(base.inertia)}: must be one moment, three or six (ixx, iyy, izz, ixy, ixz, iyz)"
        )
    xx, yy, zz = np.broadcast_to(given[:3], 3) if len(given) > 1 else np.repeat(given, 3)
    xy, xz, yz = given[3:] if len(given) == 6 else np.zeros(3)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    a, b, c = np.linalg.eigvalsh(inertia)
    if a < 0 or a + b < c * (1 - 1e-9):
        raise ConfigError(
            f"base.inertia = {shown(base.inertia)}: no body has the principal moments "
            f"{a:.3g}, {b:.3g}, {c:.3g} kg m^2; each is at most the sum of the others"
        )
    rows = tuple(tuple(map(float, row)) for row in inertia)
    return Spacecraft(base.mass, rows, tuple(base.com), momentum)
