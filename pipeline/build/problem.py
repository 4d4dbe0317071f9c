"""From a configuration to the problem that it states; bad input ends here, in one line."""

from __future__ import annotations

import numpy as np

from pipeline.build import base
from pipeline.build.anywhere import from_anywhere
from pipeline.build.checks import check_problem, require_reach
from pipeline.build.collision import make_own, require_free_path
from pipeline.build.goal import make_limits, make_objective, make_obstacles
from pipeline.build.path import make_knots, make_reference, make_task
from pipeline.build.rest import check_rest, ends_at_rest, unless_unlimited
from pipeline.build.robot import initial, load
from pipeline.build.tool import check_tool
from pipeline.config.run import RunConfig
from pipeline.config.steps import refuse_endless
from pipeline.problem.problem import Boundary, Problem
from pipeline.robot.limits import require_held_within


def prepare(config: RunConfig) -> Problem:
    """The problem that a configuration states; raises InputError, one line, if it cannot be posed."""
    robot = config.robot
    arm = load(robot, config.gravity)
    if config.limits.kind != "none":
        require_held_within(arm.description)
    task = make_task(robot, arm)
    given = initial(robot, arm)
    reference, q_init, in_world = make_reference(config.path, config.timing, task, given)
    if config.timing.law == "from_file":
        refuse_endless(config, reference.duration, "path.file, which takes ")
    free_law, free_duration = config.timing.law == "optimal", config.timing.duration == "shortest"
    rest = ends_at_rest(config, reference)
    problem = Problem(
        task,
        reference,
        q_init,
        make_knots(config.timing, reference.duration),
        objective=make_objective(config, arm),
        limits=make_limits(config.limits, arm, config.robot.limits if any(rest) else None),
        boundary=Boundary(config.boundary.kind),
        obstacles=make_obstacles(config.obstacles, config.collision, arm),
        own=make_own(config.collision, arm, robot.srdf),
        rest=rest,
        zero_acceleration=config.boundary.zero_acceleration,
        free_law=free_law,
        free_duration=free_duration,
    )
    if robot.q_init is None and in_world:
        problem = from_anywhere(problem)
    problem = unless_unlimited(config, problem)
    check_problem(problem, moved=not np.array_equal(given, q_init))
    if config.base.kind == "fixed":
        require_reach(problem)
        require_free_path(problem)
    check_rest(problem)
    check_tool(problem)
    return base.place(problem, config)
