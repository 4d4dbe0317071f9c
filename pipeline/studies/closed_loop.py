"""Does the motion work on a controlled arm? Drake's Simulator follows it with an inverse-dynamics controller.

tau = M(q) (qdd_ref + kd (qd_ref - qd) + kp (q_ref - q)) + n(q, qd) - g(q) (computed torque; Siciliano et al. 2009,
8.5.2), held between the controller's samples and cut off at the effort limits. Gains: kp = w^2, kd = 2 zeta w.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import DiagramBuilder, EventStatus
from pydrake.systems.primitives import LogVectorOutput, Saturation, TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from pipeline.common.arrays import Array
from pipeline.config.studies import ClosedLoopConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.arm import Arm
from pipeline.model.stack import assemble
from pipeline.problem.curve import curve
from pipeline.problem.problem import Problem
from pipeline.studies import style
from pipeline.studies.export import chosen
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DIVERGED = 3.0  # [rad] of a joint from its reference: the simulation is stopped
ACCURACY = 1e-6
SATURATED = 1e-9  # relative
POINTS = 2000  # most per line of the figure


@dataclass(frozen=True)
class ClosedLoop(Result):
    """One simulation, at the controller's samples time (K,) [s].

    joint_error (K, n) [rad], end_effector_error (K,) [m] from the path, tau (K, n) [N m] as applied, saturated (K, n).
    effort (n,) [N m]: the limits. diverged: when the simulation was stopped, or None.
    """

    name: ClassVar[str] = "closed_loop"
    units: ClassVar[Mapping[str, str]] = {"closed_loop_joint_error": "rad", "closed_loop_tracking_error": "m"}
    method: str
    optimum: int
    joints: tuple[str, ...]
    time: Array
    joint_error: Array
    end_effector_error: Array
    tau: Array
    wanted: Array
    effort: Array
    diverged: float | None

    @property
    def saturated(self) -> Any:
        return np.abs(self.wanted) > self.effort * (1 + SATURATED)

    @property
    def saturation(self) -> float:
        """The share of the time for which a joint wants more than it can give."""
        return float(self.saturated.any(axis=1).mean())

    @property
    def sentence(self) -> str:
        joint, tip = np.abs(self.joint_error).max(), self.end_effector_error.max()
        text = f"followed to {joint:.2g} rad at the joints and {tip:.2g} m at the end effector"
        if self.diverged is not None:
            text = f"the controller lost the motion at t = {self.diverged:.3g} s"
        text = f"{self.method} {self.optimum}: {text}"
        if not np.isfinite(self.effort).any():
            return f"{text}; the arm states no effort limits"
        return f"{text}; a joint was at its effort limit for {100 * self.saturation:.2g} % of the time"

    def section(self) -> list[str]:
        return [f"Closed loop: {self.sentence}."]

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        if (motion.method, motion.solution.optimum) != (self.method, self.optimum):
            return {}
        return {
            "closed_loop_joint_error": np.abs(self.joint_error).max(),
            "closed_loop_tracking_error": self.end_effector_error.max(),
            "closed_loop_saturation": self.saturation,
        }

    def facts(self) -> Mapping[str, Any]:
        return {
            "method": self.method,
            "optimum": self.optimum,
            "joint_error": float(np.abs(self.joint_error).max()),
            "tracking_error": float(self.end_effector_error.max()),
            "saturation": self.saturation,
            "peak_torque_over_limit": np.abs(self.tau).max(axis=0) / self.effort,
            "diverged": self.diverged,
        }

    def figures(self, title: str) -> Mapping[str, Figure]:
        return {"closed_loop": draw(self, title)}


class NotRun(Result):
    """There is no motion to follow."""

    name = "closed_loop"

    def section(self) -> list[str]:
        return ["Closed loop: not simulated, since no motion is exported."]


def study(motions: Motions) -> Result | None:
    """Where it is asked for."""
    config = motions.config.closed_loop
    if not config.run:
        return None
    motion = chosen(motions)
    return NotRun() if motion is None else simulate(motion.solution.posed(motions.problem), motion, config)


def effort_limits(problem: Problem) -> Array:
    """(n,) [N m] what the motors can give: the description's limits, or smaller ones of the problem."""
    return np.minimum(problem.task.arm.description.effort, problem.bounds.torque)


def simulate(problem: Problem, evaluation: Evaluation, options: ClosedLoopConfig) -> ClosedLoop:
    """Follow the motion once. The controller knows the arm exactly but for options.mass_error."""
    arm, n = problem.task.arm, problem.task.arm.n
    spline = curve(problem, evaluation.time, evaluation.q, evaluation.solution.trajectory.ends)
    knots = spline.x
    # A cubic spline is the Hermite interpolant of its own slopes.
    reference = PiecewisePolynomial.CubicHermite(knots, spline(knots).T, spline(knots, 1).T)

    builder = DiagramBuilder()
    plant, model = builder.AddSystem(plant_of(arm)), plant_of(arm)
    known = model.CreateDefaultContext()
    scale_masses(model, known, 1 + options.mass_error)
    gains = np.full((2, n), [[options.bandwidth**2], [2 * options.damping * options.bandwidth]])
    controller = builder.AddSystem(InverseDynamicsController(model, gains[0], np.zeros(n), gains[1], True, known))
    states = builder.AddSystem(TrajectorySource(reference, output_derivative_order=1))
    accelerations = builder.AddSystem(TrajectorySource(reference.derivative(2)))
    effort = effort_limits(problem)
    hold = builder.AddSystem(ZeroOrderHold(1.0 / options.sampling, n))
    limit = builder.AddSystem(Saturation(-effort, effort))
    builder.Connect(plant.get_state_output_port(), controller.get_input_port_estimated_state())
    builder.Connect(states.get_output_port(), controller.get_input_port_desired_state())
    builder.Connect(accelerations.get_output_port(), controller.get_input_port_desired_acceleration())
    builder.Connect(controller.get_output_port_control(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), limit.get_input_port())
    builder.Connect(limit.get_output_port(), plant.get_actuation_input_port())
    period = 1.0 / options.sampling
    state_log = LogVectorOutput(plant.get_state_output_port(), builder, period)
    wanted_log = LogVectorOutput(hold.get_output_port(), builder, period)
    diagram = builder.Build()

    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    start = np.concatenate([spline(0.0) + options.initial_error, spline(0.0, 1)])
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(context), start)
    simulator.get_mutable_integrator().set_target_accuracy(ACCURACY)
    lost: list[float] = []

    def watch(root: Any) -> Any:
        q = plant.GetPositions(plant.GetMyContextFromRoot(root))
        if not np.all(np.abs(q - spline(root.get_time())) < DIVERGED):
            lost.append(float(root.get_time()))
            return EventStatus.ReachedTermination(diagram, "diverged")
        return EventStatus.DidNothing()

    simulator.set_monitor(watch)
    try:
        simulator.AdvanceTo(float(evaluation.time[-1]))
    except RuntimeError:  # the integrator gave up on a motion that runs away
        lost.append(float(context.get_time()))
    time = state_log.FindLog(context).sample_times()
    state, wanted = state_log.FindLog(context).data().T, wanted_log.FindLog(context).data().T
    tip = (
        arm.position(state[:, :n])[:, problem.task.rows] - problem.reference.position(time)[:, : len(problem.task.rows)]
    )
    return ClosedLoop(
        evaluation.method,
        evaluation.solution.optimum,
        arm.description.joints,
        time,
        state[:, :n] - spline(time),
        np.linalg.norm(tip, axis=1),
        np.clip(wanted, -effort, effort),
        wanted,
        effort,
        lost[0] if lost else None,
    )


def plant_of(arm: Arm) -> Any:
    """The arm with one motor per joint."""
    plant = MultibodyPlant(0.0)
    model, _ = assemble(plant, Parser(plant), arm.description, arm.mounting)
    plant.mutable_gravity_field().set_gravity_vector(arm.mounting.gravity)
    for name, rotor in zip(arm.description.joints, arm.mounting.rotors(arm.n), strict=True):
        motor = plant.AddJointActuator(name, plant.GetJointByName(name, model))
        motor.set_default_rotor_inertia(rotor)
    plant.Finalize()
    return plant


def scale_masses(plant: Any, context: Any, factor: float) -> None:
    """Make all masses and inertias larger by `factor`."""
    for index in range(1, plant.num_bodies()):  # 0 is the world
        body = plant.get_body(BodyIndex(index))
        inertia = body.default_spatial_inertia()
        if inertia.get_mass() > 0:
            scaled = SpatialInertia(inertia.get_mass() * factor, inertia.get_com(), inertia.get_unit_inertia())
            body.SetSpatialInertiaInBodyFrame(context, scaled)


def draw(loop: ClosedLoop, title: str) -> Figure:
    """Joint and end-effector errors, and torques relative to their limits (in N m without any); saturation shaded."""
    figure = style.sheet(9.0, 7.5)
    panels = figure.subplots(3, 1, sharex=True)
    thin = slice(None, None, max(1, len(loop.time) // POINTS))
    time = loop.time[thin]
    limited = bool(np.isfinite(loop.effort).all())
    torques = loop.wanted[thin] / loop.effort if limited else loop.wanted[thin]
    for j, joint in enumerate(loop.joints):
        color = style.joint_color(j)
        panels[0].plot(time, loop.joint_error[thin, j], color=color, linewidth=1.3, label=joint)
        panels[2].plot(time, torques[:, j], color=color, linewidth=1.3)
    panels[1].plot(time, loop.end_effector_error[thin], color=style.color(loop.method), linewidth=1.5)
    if limited:
        for bound in (-1.0, 1.0):
            panels[2].axhline(bound, color="#C53030", linestyle=(0, (4, 3)), linewidth=1.0)
    for axes in panels:
        axes.fill_between(
            time, 0, 1, where=loop.saturated.any(axis=1)[thin], transform=axes.get_xaxis_transform(), color="#F6D5D5"
        )
        axes.grid(color="#E2E8F0", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("Joint error [rad]")
    panels[1].set_ylabel("End-effector error [m]")
    panels[2].set_ylabel("Wanted torque / limit" if limited else "Torque [N m]")
    panels[2].set_xlabel("Time [s]; shaded: a joint is at its effort limit")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, fontsize=8, frameon=False
    )
    figure.suptitle(f"{title}: closed loop, {style.name(loop.method)}", fontweight="bold")
    return figure
