"""A small ROS 2 in one process: messages by their real definitions (rosbags'), a robot, and a controller that takes a
FollowJointTrajectory goal as it would come over the wire.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

GOAL = """trajectory_msgs/JointTrajectory trajectory
control_msgs/JointTolerance[] path_tolerance
control_msgs/JointTolerance[] goal_tolerance
builtin_interfaces/Duration goal_time_tolerance
"""
TOLERANCE = "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
NAMES = {
    "builtin_interfaces.msg": ["builtin_interfaces/msg/Duration"],
    "sensor_msgs.msg": ["sensor_msgs/msg/JointState"],
    "trajectory_msgs.msg": ["trajectory_msgs/msg/JointTrajectory", "trajectory_msgs/msg/JointTrajectoryPoint"],
}
GOAL_TYPE = "control_msgs/msg/FollowJointTrajectory_Goal"

store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg(TOLERANCE, "control_msgs/msg/JointTolerance"))
store.register(get_types_from_msg(GOAL, GOAL_TYPE))


def message(name: str) -> Callable[..., Any]:
    """The constructor of a message as ROS has it: every field has a default, and no other may be given."""

    def made(**given: Any) -> Any:
        fields = {key: _default(kind) for key, kind in store.fielddefs[name][1]}
        assert set(given) <= set(fields), f"{name} has no {set(given) - set(fields)}"
        return store.types[name](**{**fields, **given})

    return made


def _default(kind: Any) -> Any:
    node, what = kind
    if node.name == "NAME":
        return message(what)()
    if node.name == "BASE":
        return "" if what[0] == "string" else 0
    return []


def _arrays(value: Any) -> Any:
    """Numbers as the wire's writer wants them: arrays of float64."""
    for key in value.__dataclass_fields__:
        inner = getattr(value, key)
        if isinstance(inner, list) and inner and isinstance(inner[0], float | int):
            object.__setattr__(value, key, np.array(inner, dtype=np.float64))
        elif isinstance(inner, list) and not inner and key in ("positions", "velocities", "accelerations", "effort"):
            object.__setattr__(value, key, np.array([], dtype=np.float64))
        elif isinstance(inner, list) and inner and hasattr(inner[0], "__dataclass_fields__"):
            for one in inner:
                _arrays(one)
        elif hasattr(inner, "__dataclass_fields__"):
            _arrays(inner)
    return value


@dataclass
class Robot:
    """Where it stands [rad], and what its controller was sent."""

    standing: dict[str, float]
    controller: str = "/arm"
    goals: list[Any] = field(default_factory=list)

    def follow(self, goal: Any) -> tuple[int, str]:
        """As joint_trajectory_controller judges a goal: its joints, and times that increase."""
        goal = store.deserialize_cdr(store.serialize_cdr(_arrays(goal), GOAL_TYPE), GOAL_TYPE)
        self.goals.append(goal)
        points = goal.trajectory.points
        if set(goal.trajectory.joint_names) != set(self.standing):
            return -2, "joints that the controller does not have"
        times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
        if any(later <= earlier for earlier, later in itertools.pairwise(times)):
            return -1, "times that do not increase"
        return 0, ""


def modules(robot: Robot) -> dict[str, ModuleType]:
    """What a script imports, with this robot behind it."""

    class Node(SimpleNamespace):
        def create_subscription(self, kind: Any, topic: str, heard: Callable[[Any], None], qos: Any) -> None:
            if topic == "/joint_states" and robot.standing:
                names = list(robot.standing)[::-1]  # in an order of its own
                heard(kind(name=names, position=[robot.standing[name] for name in names]))

        def destroy_subscription(self, _: Any) -> None: ...

        def destroy_node(self) -> None: ...

        def get_clock(self) -> Any:
            ticks = itertools.count(0, 10**9)
            clock.append(next(ticks) + 10**9 * len(clock))
            return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=clock[-1]))

    class ActionClient:
        def __init__(self, node: Any, action: Any, name: str) -> None:
            self.name = name

        def wait_for_server(self, timeout_sec: float) -> bool:
            return self.name == f"{robot.controller}/follow_joint_trajectory"

        def send_goal_async(self, goal: Any) -> Any:
            code, said = robot.follow(goal)
            result = SimpleNamespace(result=SimpleNamespace(error_code=code, error_string=said))
            handle = SimpleNamespace(accepted=True, get_result_async=lambda: SimpleNamespace(result=lambda: result))
            return SimpleNamespace(result=lambda: handle)

    def nothing(*_: Any, **__: Any) -> None: ...

    clock: list[int] = []
    found = {"rclpy": _module(init=nothing, shutdown=nothing, spin_once=nothing, spin_until_future_complete=nothing)}
    found["rclpy"].create_node = lambda _: Node()  # type: ignore[attr-defined]
    found["rclpy.action"] = _module(ActionClient=ActionClient)
    found["rclpy.qos"] = _module(qos_profile_sensor_data=None)
    action = SimpleNamespace(Goal=message(GOAL_TYPE))
    found["control_msgs.action"] = _module(FollowJointTrajectory=action)
    for module, names in NAMES.items():
        found[module] = _module(**{name.rpartition("/")[2]: message(name) for name in names})
    return {**{name.partition(".")[0]: _module() for name in found}, **found}


def _module(**content: Any) -> ModuleType:
    made = ModuleType("ros2")
    vars(made).update(content)
    return made
