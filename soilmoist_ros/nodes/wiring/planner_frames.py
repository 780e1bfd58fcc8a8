# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Frames of the planner: TF and the datum service come in, the robot's pose in the plane of the field goes out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from threading import Lock
from typing import Any, Final

from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.task import Future

from msg_adapters import pose_to_message, transforms_from_message
from soilmoist_ros.exploration import ASKED_M, ROBOT, FrameSettings, RobotFrames, Transform
from soilmoist_ros.foundation import Health
from soilmoist_ros.mapping import Field
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.runtime.qos import DEFAULT, TF, TF_STATIC
from soilmoist_ros.nodes.runtime.quiet_node import quiet_node
from soilmoist_ros.nodes.runtime.topic_types import interface_class
from soilmoist_ros.sensing import Fix, LeverArms

ASK_AGAIN_S: Final = 5.0
DATUM_TYPE: Final = "robot_localization/srv/ToLL"
"""Service of navsat_transform that gives the latitude and longitude of a place in the frame of the navigation."""


class PlannerFrames:
    """Listens to TF if its message type is installed, and publishes ``robot_pose`` with each fix.

    :param node: the planner
    :param values: its parameters
    :param field: the field
    :raises InputError: if the navigation's datum is invalid

    Attributes
    ----------
    robot : RobotFrames
        the frames
    """

    def __init__(self, node: Node, values: Parameters, field: Field) -> None:
        self._node = node
        self.settings = frame_settings(values)
        self.robot = RobotFrames(field, self.settings)
        self._poses = node.create_publisher(PoseWithCovarianceStamped, "robot_pose", DEFAULT)
        self._ask = self._datum_client(values.text("datum_service"))
        self._listener: _Listener | None = None
        try:
            kind = interface_class("tf2_msgs/msg/TFMessage")
        except ImportError as error:
            node.get_logger().warning(f"the frames are not checked: tf2_msgs is not installed ({error})")
        else:
            self._listener = _Listener(node, kind)

    def close(self) -> None:
        """Stop listening to TF."""
        if self._listener is not None:
            self._listener.close()

    def place(self, fix: Fix) -> tuple[float, float] | None:
        """Place of the robot's base by a fix of its antenna [m], ``None`` without a fix; publishes the pose."""
        self._take_transforms()
        now_s = self._now_s()
        pose = self.robot.take_fix(fix, now_s)
        if pose is None:
            return None
        stamp_s = fix.stamp_s if fix.stamp_s > 0 else now_s
        frame = self.settings.frame
        self._poses.publish(pose_to_message(pose.place_m, pose.yaw_rad, pose.covariance_m2, stamp_s, frame))
        return pose.place_m

    def health(self) -> Health:
        """State of the frames."""
        return self.robot.health(self._now_s())

    def tick(self) -> str:
        """Ask for the datum until it is known; to be called every second.

        :returns: why the robot must not drive; empty if nothing is known against it
        """
        self._take_transforms()
        self._ask()
        return self.robot.fault

    def _take_transforms(self) -> None:
        if self._listener is not None:
            self.robot.take_transforms(self._listener.take(), self._now_s())

    def _now_s(self) -> float:
        return float(self._node.get_clock().now().nanoseconds * 1e-9)

    def _datum_client(self, service: str) -> Callable[[], None]:
        """Function that asks the robot's datum service, if the datum comes from the robot."""
        if self.settings.datum != ROBOT:
            return lambda: None
        try:
            kind = interface_class(DATUM_TYPE)
        except ImportError as error:
            self._node.get_logger().warning(
                f"{DATUM_TYPE} is not installed, so the datum of the navigation is found from a drive ({error})"
            )
            return lambda: None
        client = self._node.create_client(kind, service)
        asked: list[tuple[float, list[Future]]] = []

        def ask() -> None:
            if asked and all(future.done() for future in asked[0][1]):
                answers = [future.result() for _, futures in asked for future in futures]
                asked.clear()
                if all(answer is not None for answer in answers):
                    self.robot.take_datum_answers([_position(answer) for answer in answers])
            if asked and time.monotonic() - asked[0][0] > ASK_AGAIN_S:
                for future in asked.pop()[1]:
                    client.remove_pending_request(future)
            if self.robot.move is None and not asked and client.service_is_ready():
                places = (ASKED_M + self.robot.ask_about_m).tolist()
                questions = [kind.Request(map_point=Point(x=float(x), y=float(y))) for x, y in places]
                asked.append((time.monotonic(), [client.call_async(question) for question in questions]))

        return ask


class _Listener:
    """Takes the messages of TF when asked, instead of one by one as they come.

    TF has some hundred messages a second, and each would wake the executor of the planner.
    """

    def __init__(self, node: Node, kind: Any) -> None:
        self._node = quiet_node(node, "tf")
        self._topics = [
            (static, self._node.create_subscription(kind, node.resolve_topic_name(topic), print, profile))
            for topic, static, profile in (("/tf_static", True, TF_STATIC), ("/tf", False, TF))
        ]
        self._lock = Lock()

    def take(self) -> Iterator[Transform]:
        """Transforms that have come since the last call."""
        with self._lock:
            for static, subscription in self._topics:
                with subscription.handle:
                    while (taken := subscription.handle.take_message(subscription.msg_type, False)) is not None:
                        yield from transforms_from_message(taken[0], static)

    def close(self) -> None:
        """Stop listening."""
        with self._lock:
            self._topics = []
            self._node.destroy_node()


def frame_settings(values: Parameters) -> FrameSettings:
    """Frames that the parameters of the planner name."""
    frame = values.text("frame")
    return FrameSettings(
        frame=frame,
        navigation_frame=values.text("navigation_frame") or frame,
        base_frame=values.text("base_frame"),
        datum=values.text("navigation_datum"),
        limit_m=values.number("frame_limit_m"),
        arms=LeverArms.of(values.as_dict()),
    )


def _position(answer: Any) -> tuple[float, float]:
    return float(answer.ll_point.latitude), float(answer.ll_point.longitude)
