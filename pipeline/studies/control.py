"""PMKE's controller in the loop: at every tick it sees the simulated arm and answers with a torque (`controller.py`).

The arm is lighter than the controller believes, torques take effect some ticks late and end at the motors' limits; it
may be pushed, and the controller may miss ticks, in which the last torque stays.
"""

from __future__ import annotations

import time as clock
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import PmkeOptions
from pipeline.config.studies import ControlConfig
from pipeline.methods.pmke.controller import Controller
from pipeline.problem.problem import Problem
from pipeline.studies import style
from pipeline.studies.closed_loop import ACCURACY, plant_of, scale_masses
from pipeline.studies.deadlines import Times, histogram, load
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEAR = 1e-3  # [m, rad]: more is off the path
RUNAWAY = 1e3  # [rad/s]: the simulation is ended


@dataclass(frozen=True)
class Loop(Result):
    """One simulation, at the ticks time (K,) [s].

    error (K,): of the end effector [m], and for poses of its orientation [rad], whichever is larger; torque (K, n)
    [N m] as applied, push included; at_limit (K,); disturbed (K,): while it is pushed or not controlled. energy [J s]:
    the integral of the kinetic energy. called (C,): the ticks with an update. status: of each of these updates.
    """

    name: ClassVar[str] = "control"
    joints: tuple[str, ...]
    time: Array
    error: Array
    torque: Array
    at_limit: NDArray[np.bool_]
    disturbed: NDArray[np.bool_]
    energy: float
    times: Times
    status: tuple[str, ...]
    load: str

    @property
    def calm(self) -> float:
        """The largest error before anything disturbed it."""
        first = int(self.disturbed.argmax()) if self.disturbed.any() else len(self.time)
        return float(self.error[: max(first, 1)].max())

    @property
    def off(self) -> float:
        """[s] for which the error was larger than NEAR."""
        return float((self.error > NEAR).mean() * self.time[-1])

    def section(self) -> list[str]:
        kinds = Counter(status.partition(":")[0] for status in self.status)
        said = ", ".join(f"{word} {count}" for word, count in kinds.most_common())
        text = (
            f"Controller in the loop: off the path by at most {self.calm:.2g} m, kinetic energy {self.energy:.4g} J s, "
            f"a torque at its limit in {100 * self.at_limit.mean():.2g} % of the ticks; ticks by status: {said}."
        )
        if self.disturbed.any():
            after = float(self.error[self.disturbed.argmax() :].max())
            end = "not back at the end" if self.error[-1] > NEAR else "back at the end"
            text += (
                f" Disturbed, it was off by at most {after:.2g} m, by more than 1 mm for {self.off:.2g} s, and {end}."
            )
        return [text, f"Ticks of the controller: {self.times.sentence}. The machine: {self.load}."]

    def facts(self) -> Mapping[str, Any]:
        return {
            "tracking_error": float(self.error.max()),
            "tracking_error_undisturbed": self.calm,
            "kinetic_energy_integral": self.energy,
            "at_limit": float(self.at_limit.mean()),
            "off_by_more_than_1_mm": self.off,
            "status": dict(Counter(self.status)),
            "machine": self.load,
            **self.times.columns(),
        }

    def figures(self, title: str) -> Mapping[str, Figure]:
        return {"control": draw(self, title)}


def study(motions: Motions) -> Loop | None:
    """Where it is asked for."""
    config = motions.config
    return simulate(motions.problem, config.method.pmke, config.control) if config.control.run else None


def why_not(problem: Problem, method: PmkeOptions, options: ControlConfig) -> str | None:
    """Why the controller refuses the problem, in one line; None: it does not."""
    try:
        Controller(problem, method, period=1 / options.rate)
    except InputError as error:
        return f"control.run = true: {error}"
    return None


def simulate(problem: Problem, method: PmkeOptions, options: ControlConfig) -> Loop:
    """Once along the path."""
    arm, task, reference = problem.task.arm, problem.task, problem.reference
    period, n = 1 / options.rate, arm.n
    controller = Controller(problem, method, period=period, bandwidth=options.bandwidth, damping=options.damping)
    plant = plant_of(arm)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    simulator.get_mutable_integrator().set_target_accuracy(ACCURACY)
    scale_masses(plant, context, 1 / (1 + options.mass_error))
    plant.SetPositionsAndVelocities(context, np.concatenate([problem.q_init, np.zeros(n)]))
    port = plant.get_actuation_input_port()
    first = controller.hold(problem.q_init)
    waiting = [first] * (options.latency + 1)  # torques that are still to take effect, the last one newest

    time = period * np.arange(round(reference.duration * options.rate) + 1)
    pushed, stalled = _moments(time, options, period)
    q, qd, applied = np.empty((len(time), n)), np.empty((len(time), n)), np.empty((len(time), n))
    wall, processor, status = [], [], []
    count = len(time)
    for k, now in enumerate(time):
        q[k], qd[k] = plant.GetPositions(context), plant.GetVelocities(context)
        if not np.abs(qd[k]).max() < RUNAWAY:
            count = k
            break
        if stalled[k]:
            waiting.append(waiting[-1])
        else:
            began, used = clock.perf_counter(), clock.process_time()
            command = controller.update(now, q[k], qd[k])
            wall.append(clock.perf_counter() - began)
            processor.append(clock.process_time() - used)
            status.append(command.status)
            waiting.append(command.tau)
        waiting.pop(0)
        applied[k] = waiting[0] + (options.push_torque if pushed[k] else 0.0)
        port.FixValue(context, applied[k])
        if k + 1 < len(time):
            simulator.AdvanceTo(float(now + period))
    seen = slice(count)
    error = np.abs(task.error(q[seen], reference.position(time[seen])))
    position = np.linalg.norm(error[:, : len(task.axes)], axis=1)
    motors = applied[seen] - options.push_torque * pushed[seen, None]
    return Loop(
        arm.description.joints,
        time[seen],
        np.maximum(position, error[:, len(task.axes) :].max(axis=1, initial=0.0)),
        applied[seen],
        (np.abs(motors) >= controller.effort * (1 - 1e-9)).any(axis=1),
        (pushed | stalled)[seen],
        float(np.trapezoid(arm.kinetic_energy(q[seen], qd[seen]), time[seen])),
        Times(np.array(wall), np.array(processor), period),
        tuple(status),
        load(),
    )


def _moments(time: Array, options: ControlConfig, period: float) -> tuple[Any, Any]:
    """Which ticks are pushed, and which the controller misses."""
    pushed, stalled = np.zeros(len(time), bool), np.zeros(len(time), bool)
    if options.push_time is not None:
        pushed = _between(time, options.push_time, options.push_duration)
    if options.stall_time is not None:
        stalled = _between(time, options.stall_time, options.stall_ticks * period)
    return pushed, stalled


def _between(time: Array, begin: float, duration: float) -> Any:
    return (time >= begin - 1e-9) & (time < begin + duration - 1e-9)


def draw(loop: Loop, title: str) -> Figure:
    """The error, the torques and the histogram of the ticks' times; disturbances shaded."""
    figure = style.sheet(9.0, 8.5)
    panels = figure.subplots(3, 1)
    panels[0].plot(loop.time, 1e3 * loop.error, color=style.color("pmke"), linewidth=1.5)
    panels[0].set_ylabel("Off the path [mm]")
    for j, joint in enumerate(loop.joints):
        panels[1].step(
            loop.time, loop.torque[:, j], where="post", color=style.joint_color(j), linewidth=1.2, label=joint
        )
    panels[1].set_ylabel("Torque [N m]")
    panels[1].set_xlabel("Time [s]" + ("; shaded: pushed, or not controlled" if loop.disturbed.any() else ""))
    panels[1].legend(ncols=7, fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.22))
    for axes in panels[:2]:
        axes.fill_between(
            loop.time, 0, 1, where=loop.disturbed, transform=axes.get_xaxis_transform(), color="#F6D5D5", step="post"
        )
        axes.grid(color="#E2E8F0", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    histogram(panels[2], loop.times, style.color("pmke"))
    panels[2].set_ylabel("Ticks")
    panels[2].set_xlabel(f"Time of a tick [ms]; the machine: {loop.load}")
    figure.suptitle(f"{title}: PMKE's controller in the loop", fontweight="bold")
    return figure
