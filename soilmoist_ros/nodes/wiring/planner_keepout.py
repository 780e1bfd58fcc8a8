# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Publishes the fence as a keep-out mask for the costmaps of Nav2."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Final

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node

from msg_adapters import filter_info, mask_to_message
from soilmoist_ros.exploration import Fence, keepout_mask
from soilmoist_ros.foundation import InputError, PlaneMove
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.runtime.qos import LATCHED
from soilmoist_ros.nodes.runtime.topic_types import interface_class

INFO_TOPIC: Final = "costmap_filter_info"


class PlannerKeepout:
    """Publishes the mask, and the message that names it, whenever the fence or the frame changes.

    :param node: the planner
    :param values: its parameters; without ``keepout_topic`` nothing is published
    """

    def __init__(self, node: Node, values: Parameters) -> None:
        self._node = node
        self._frame = values.text("navigation_frame") or values.text("frame")
        self._resolution_m = values.number("keepout_resolution_m")
        self._shown: tuple[Fence, PlaneMove] | None = None
        self._topic = values.text("keepout_topic")
        if not self._topic:
            return
        self._topic = node.resolve_topic_name(self._topic)
        self._work = ThreadPoolExecutor(1, "keepout")
        self._masks = node.create_publisher(OccupancyGrid, self._topic, LATCHED)
        self._infos = None
        try:
            self._kind = interface_class("nav2_msgs/msg/CostmapFilterInfo")
        except ImportError as error:
            node.get_logger().warning(
                f"nav2_msgs is not installed: {INFO_TOPIC} is not published with the mask ({error})"
            )
        else:
            self._infos = node.create_publisher(self._kind, INFO_TOPIC, LATCHED)

    def tick(self, fence: Fence | None, move: PlaneMove | None) -> None:
        """Publish what has changed; to be called every second.

        :param fence: where the robot may be, ``None`` while that is not known
        :param move: from the plane of the field to that of the navigation, ``None`` while that is not known
        """
        if not self._topic or fence is None or move is None or (fence, move) == self._shown:
            return
        self._shown = fence, move
        self._work.submit(self._publish, fence, move)  # a mask of a large field takes a second

    def close(self) -> None:
        """End the thread."""
        if self._topic:
            self._work.shutdown(wait=True, cancel_futures=True)

    def _publish(self, fence: Fence, move: PlaneMove) -> None:
        try:
            mask = keepout_mask(fence, self._resolution_m, move)
        except InputError as error:
            self._node.get_logger().error(f"{self._topic} is not published: {error}")
            return
        now_s = self._node.get_clock().now().nanoseconds * 1e-9
        self._masks.publish(mask_to_message(mask, now_s, self._frame))
        if self._infos is not None:
            self._infos.publish(filter_info(self._kind, self._topic, now_s, self._frame))
