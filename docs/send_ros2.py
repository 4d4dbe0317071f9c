"""Send a run's motion.json to a joint trajectory controller of ROS 2 (ros2_control, MoveIt's or a maker's):

python send_ros2.py outputs/mine/motion.json --controller /joint_trajectory_controller

First it looks whether the robot stands where the motion starts, and sends nothing where it does not. `--rate` thins the
points: a controller that gets positions, velocities and accelerations runs a quintic between them, and few are enough.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WAIT = 5.0  # [s] for the controller and the robot to answer


def seconds(point: dict[str, Any]) -> float:
    """When a point is passed [s]."""
    return float(point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"])


def thinned(points: list[dict[str, Any]], rate: float | None) -> list[dict[str, Any]]:
    """At most `rate` points per second [Hz], the first and the last among them; None: all."""
    kept, every = [points[0]], 0.0 if rate is None else 1.0 / rate
    for point in points[1:-1]:
        room = min(seconds(point) - seconds(kept[-1]), seconds(points[-1]) - seconds(point))
        if room >= every * (1 - 1e-6):
            kept.append(point)
    return [*kept, points[-1]]


def goal_of(motion: dict[str, Any], points: list[dict[str, Any]]) -> FollowJointTrajectory.Goal:
    """The action's goal: the times count from when the controller accepts it."""
    trajectory = JointTrajectory(joint_names=motion["joint_names"])
    trajectory.points = [
        JointTrajectoryPoint(
            positions=point["positions"],
            velocities=point["velocities"],
            accelerations=point["accelerations"],
            time_from_start=Duration(**point["time_from_start"]),
        )
        for point in points
    ]
    return FollowJointTrajectory.Goal(trajectory=trajectory)


def away(motion: dict[str, Any], state: JointState, tolerance: float) -> str:
    """Which joints do not stand where the motion starts, to `tolerance` [rad or m]; empty if all do."""
    here = dict(zip(state.name, state.position, strict=True))
    faults = []
    for name, start in zip(motion["joint_names"], motion["points"][0]["positions"], strict=True):
        if name not in here:
            faults.append(f"{name} is not in joint_states")
        elif abs(here[name] - start) > tolerance:
            faults.append(f"{name} stands at {here[name]:.4f}, the motion starts at {start:.4f}")
    return "; ".join(faults)


def where_it_stands(node: Any, topic: str) -> JointState | None:
    """The robot's next joint state, or None if it says nothing."""
    heard: list[JointState] = []
    listener = node.create_subscription(JointState, topic, heard.append, qos_profile_sensor_data)
    end = node.get_clock().now().nanoseconds + WAIT * 1e9
    while not heard and node.get_clock().now().nanoseconds < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_subscription(listener)
    return heard[0] if heard else None


def send(node: Any, motion: dict[str, Any], asked: argparse.Namespace) -> str:
    """Send it and wait for its end; returns what went wrong, empty if nothing did."""
    if "warning" in motion:
        return str(motion["warning"])
    state = where_it_stands(node, asked.joint_states)
    if state is None:
        return f"nobody publishes {asked.joint_states}"
    if fault := away(motion, state, asked.tolerance):
        return f"nothing sent: {fault}"
    client = ActionClient(node, FollowJointTrajectory, f"{asked.controller}/follow_joint_trajectory")
    if not client.wait_for_server(timeout_sec=WAIT):
        return f"no controller at {asked.controller}"
    accepted = client.send_goal_async(goal_of(motion, thinned(motion["points"], asked.rate)))
    rclpy.spin_until_future_complete(node, accepted)
    if not accepted.result().accepted:
        return "the controller does not accept it"
    done = accepted.result().get_result_async()
    rclpy.spin_until_future_complete(node, done)
    result = done.result().result
    return "" if result.error_code == 0 else f"error {result.error_code}: {result.error_string}"


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("motion", type=Path, help="motion.json of a run")
    parser.add_argument("--controller", default="/joint_trajectory_controller", help="its name space")
    parser.add_argument("--joint-states", default="/joint_states", help="topic of the robot's joint states")
    parser.add_argument("--rate", type=float, help="[Hz] points per second, at most; all of them by default")
    parser.add_argument("--tolerance", type=float, default=0.01, help="[rad or m] of every joint at the start")
    asked = parser.parse_args(words)
    rclpy.init()
    node = rclpy.create_node("selfmotion_sender")
    try:
        fault = send(node, json.loads(asked.motion.read_text(encoding="utf-8")), asked)
    finally:
        node.destroy_node()
        rclpy.shutdown()
    print(f"error: {fault}" if fault else "done", file=sys.stderr if fault else sys.stdout)
    return 1 if fault else 0


if __name__ == "__main__":
    sys.exit(main())
