# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Outputs of the planner: status and plan of the mission, visits, health, the fence, requests to save the map."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from msg_adapters import (
    FRAME,
    diagnostics_to_message,
    filter_info,
    mask_to_message,
    mission_to_message,
    plan_to_markers,
    plan_to_path,
)
from soilmoist_ros.exploration import Fence, Finish, MissionStatus, Polygons, Stop, Visit, keepout_mask
from soilmoist_ros.foundation import Health, PlaneMove, foreign_text
from soilmoist_ros.nodes.node_process import Soon
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import DEFAULT, HEARTBEAT, LATCHED, VISITS, interface_class, ros_now_s
from soilmoist_ros.sensing import DOUBTS, Doubt

SAVE_LIMIT_S: Final = 120.0  # longest wait for the saved map at the end of the process [s]
INFO_TOPIC: Final = "costmap_filter_info"
CELL_M: Final = 0.2
MIN_CELL_M: Final = 0.05
"""Usual and smallest side of a cell of the keep-out mask [m]; smaller ones fill the memory of Nav2."""


class PlannerOutputs:
    """The :class:`Outputs` of a node."""

    def __init__(
        self, node: Node, hand_on: Callable[[], None], properties: Iterable[str] = (), frame: str = FRAME
    ) -> None:
        self._node = node
        self._frame = frame
        self._mission = node.create_publisher(DiagnosticStatus, "mission", LATCHED)
        self._path = node.create_publisher(Path, "plan", LATCHED)
        self._markers = node.create_publisher(MarkerArray, "plan_markers", LATCHED)
        self._publish_visit, self._publish_state = self._typed_publishers()
        self._doubts = node.create_publisher(String, DOUBTS, VISITS)
        self._beats = node.create_publisher(Bool, HEARTBEAT, DEFAULT)
        self._warnings = node.create_publisher(Bool, "about_to_move", LATCHED)
        self._warned: bool | None = None
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        services = ("mapper/save", *(f"{name}/mapper/save" for name in properties))
        self._saves = [node.create_client(Trigger, service) for service in services]
        self._planned = Soon(node, hand_on)
        self._shown: tuple[tuple[Stop, ...], float, Polygons] | None = None
        self._reason = ""
        self._saving: list[Future] = []
        self._leave_by_s: float | None = None

    @property
    def all_done(self) -> bool:
        """True if the mission has ended, and all save requests have finished or :data:`SAVE_LIMIT_S` is over."""
        if self._leave_by_s is None:
            return False
        return all(saving.done() for saving in self._saving) or time.monotonic() > self._leave_by_s

    def now_s(self) -> float:
        """ROS time [s]."""
        return ros_now_s(self._node)

    def show(self, status: MissionStatus, ahead: tuple[Stop, ...], more: Mapping[str, str]) -> None:
        """Publish the status, and the plan if it has changed."""
        if status.reason != self._reason:
            self._reason = status.reason
            self._node.get_logger().info(f"{status.phase}: {status.reason}")
        self._mission.publish(mission_to_message(status, more))
        self._publish_state(status)
        shown = ahead, status.planned_dwell_s, status.ruled_out
        if shown != self._shown:
            self._shown = shown
            self._path.publish(plan_to_path(ahead, self.now_s(), self._frame))
            self._markers.publish(plan_to_markers(*shown, self.now_s(), self._frame))

    def visit(self, visit: Visit) -> None:
        """Log a visit, and publish it."""
        self._node.get_logger().info(f"visit: {visit.name}, {visit.raw_counts} counts in {visit.exposure_s:.0f} s")
        self._publish_visit(visit)

    def doubt(self, doubts: Iterable[Doubt]) -> None:
        """Publish doubts about the place that have begun or ended."""
        for doubt in doubts:
            self._doubts.publish(String(data=doubt.to_text()))

    def beat(self, good: bool, about_to_move: bool) -> None:
        """Publish the heartbeat, and a warning before the robot moves."""
        self._beats.publish(Bool(data=good))
        if about_to_move != self._warned:
            self._warned = about_to_move
            self._warnings.publish(Bool(data=about_to_move))

    def diagnose(self, parts: list[Health]) -> None:
        """Publish the planner's health."""
        name = self._node.get_fully_qualified_name()
        self._diagnostics.publish(diagnostics_to_message(parts, self.now_s(), name))

    def finish(self, finish: Finish) -> None:
        """Handle the end of the mission: ask the mappers to save, without waiting."""
        self._saving = []
        for save in self._saves:
            if not save.service_is_ready():
                self._node.get_logger().warning(
                    f"the map is not saved ({finish.reason}): there is no {save.srv_name}"
                )
                continue
            saving = save.call_async(Trigger.Request())
            saving.add_done_callback(self._on_saved)
            self._saving.append(saving)
        self._leave_by_s = time.monotonic() + SAVE_LIMIT_S

    def wake(self) -> None:
        """Make the executor pass plans to the mission."""
        self._planned.ask()

    def _typed_publishers(self) -> tuple[Callable[[Visit], None], Callable[[MissionStatus], None]]:
        try:
            visit_kind, mission_kind = (
                interface_class(f"soilmoist_msgs/msg/{one}") for one in ("Visit", "Mission")
            )

            from msg_adapters import mission_state_to_message, visit_to_message
        except ImportError as error:
            self._node.get_logger().warning(
                f"visits and mission_state are not published: soilmoist_msgs is not installed ({error}; build "
                "interfaces/soilmoist_msgs); visits are in the log and the journal"
            )
            return lambda visit: None, lambda status: None
        visits = self._node.create_publisher(visit_kind, "visits", VISITS)
        states = self._node.create_publisher(mission_kind, "mission_state", LATCHED)
        robot = self._node.get_namespace().strip("/")
        return (
            lambda visit: visits.publish(visit_to_message(visit, robot, self._frame)),
            lambda status: states.publish(mission_state_to_message(status, self.now_s(), robot, self._frame)),
        )

    def _on_saved(self, future: Future) -> None:
        answer = future.result()
        if answer is not None and not answer.success:
            self._node.get_logger().error(f"the mapper did not save: {foreign_text(answer.message)}")


# Publishes the fence as a keep-out mask for the costmaps of Nav2 ------------------------------------------------


class PlannerKeepout:
    """Publishes the mask, and the message that names it, whenever the fence or the frame changes."""

    def __init__(self, node: Node, values: Parameters) -> None:
        self._node = node
        self._frame = values.text("navigation_frame") or values.text("frame")
        radius_m = values.number("robot_radius_m")
        # With half of the radius or less, no cell of a no-go area is free.
        self._cell_m = min(CELL_M, max(radius_m / 2, MIN_CELL_M)) if radius_m else CELL_M
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
        """Publish a changed fence or move, once a second; each is ``None`` while it is unknown."""
        if not self._topic or fence is None or move is None or (fence, move) == self._shown:
            return
        self._shown = fence, move
        self._work.submit(self._publish, fence, move)  # a mask of a large field takes a second

    def close(self) -> None:
        """End the thread."""
        if self._topic:
            self._work.shutdown(wait=True, cancel_futures=True)

    def _publish(self, fence: Fence, move: PlaneMove) -> None:
        mask = keepout_mask(fence, self._cell_m, move)
        beyond_m = mask.resolution_m * math.sqrt(2) - fence.margin_m
        if mask.resolution_m > self._cell_m and beyond_m > 0:
            self._node.get_logger().warning(
                f"{self._topic} has cells of {mask.resolution_m:.2f} m, as the field is large: free ones reach up "
                f"to {beyond_m:.2f} m into no-go areas"
            )
        now_s = ros_now_s(self._node)
        self._masks.publish(mask_to_message(mask, now_s, self._frame))
        if self._infos is not None:
            self._infos.publish(filter_info(self._kind, self._topic, now_s, self._frame))
