# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs of the planner: fixes, records, frames, the mapper's results, and the map of the navigation."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from threading import Lock
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, NavSatFix, PointCloud2
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from msg_adapters import (
    OtherFrameError,
    battery_from_message,
    counts_from_message,
    diagnostics_from_message,
    mission_from_message,
    model_from_message,
    pose_to_message,
    require_frame,
    require_plane,
    samples_from_message,
    to_seconds,
    transforms_from_message,
)
from soilmoist_ros.exploration import (
    DATUM,
    KNOWN_ACTIONS,
    Cause,
    FrameSettings,
    MissionControl,
    RobotFrames,
    TopologicalMap,
    Transform,
    logger_fault,
    parse_topological_map,
)
from soilmoist_ros.foundation import Health, InputError, foreign_text, read_json
from soilmoist_ros.mapping import Field
from soilmoist_ros.nodes.node_process import Soon
from soilmoist_ros.nodes.parameters import Parameters, other_namespaces
from soilmoist_ros.nodes.topics import (
    DEFAULT,
    LATCHED,
    NO_EVENTS,
    RECORDS,
    SENSOR,
    TF,
    TF_STATIC,
    Faults,
    every,
    interface_class,
    other_type,
    quiet_node,
    ros_now_s,
)
from soilmoist_ros.recording import quarantined_topic
from soilmoist_ros.sensing import FIX_TYPE, CountRecord, Fix, fix_from_message

_AGAIN_TICKS: Final = 10  # seconds after which a map of the navigation that could not be used is tried again
SLICE: Final = 100  # records that are taken at a time; some 20 ms of work
PAUSE_S: Final = 0.05  # shortest time between the slices of different messages [s]: each costs a sync of the disk
MAX_MESSAGES: Final = 20_000


class PlannerInputs:
    """Subscribes to the inputs, and passes valid messages to the control; each fault is logged once.

    :param map_topic: topic of the navigation's map; empty for no subscription
    :param by_name: whether the navigation chooses the way by its own map
    :param robot: properties of the robot, for the restrictions of the map
    """

    def __init__(
        self,
        node: Node,
        control: MissionControl,
        frames: PlannerFrames,
        map_topic: str,
        others: Sequence[str] = (),
        properties: Iterable[str] = (),
        by_name: bool = False,
        robot: Sequence[str] = (),
    ) -> None:
        self._by_name, self._robot = by_name, robot
        self._node = node
        self._control = control
        self._frames = frames
        self._map: TopologicalMap | None = None  # in use
        self._newer: TopologicalMap | None = None  # to be used, as soon as that is possible
        self._map_fault = ""
        self._unreadable = ""  # why the newest map is none
        self._ticks = 0
        self._faults = Faults(node)
        self._warned = ""
        self._records = PlannerRecords(node, control, self._read_counts)

        def hear(kind: Any, topic: str, take: Callable[[Any], None]) -> None:
            node.create_subscription(kind, topic, self._faults.guarded(topic, take), LATCHED)

        node.create_subscription(NavSatFix, "fix", self._on_fix, SENSOR)
        node.create_subscription(BatteryState, "battery_state", self._on_battery, SENSOR)
        node.create_subscription(Bool, "operator_present", self._on_operator, SENSOR, event_callbacks=NO_EVENTS)
        hear(DiagnosticStatus, "watchdog", self._on_watchdog)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEFAULT)
        for name in ("", *properties):
            below = f"{name}/" if name else ""
            for topic in (f"{below}counts", quarantined_topic(f"{below}counts")):
                node.create_subscription(PointCloud2, topic, partial(self._records.put, name), RECORDS)
            hear(PointCloud2, f"{below}samples", partial(self._on_samples, name))
            hear(String, f"{below}model", partial(self._on_model, name))
        if map_topic:
            node.create_subscription(String, map_topic, self._on_map, LATCHED)
        for name in other_namespaces(node, others):
            control.other(name, None)
            hear(DiagnosticStatus, f"{name}/mission", partial(self._on_other, name))
        if control.team.robots:
            node.create_service(Trigger, "planner/release_lost", self._release_lost)

    def _on_fix(self, message: NavSatFix) -> None:
        fix = fix_from_message(message, ros_now_s(self._node))
        self._control.hear(fix)
        place = self._frames.place(fix)
        if place is not None:
            self._control.fix(place, fix.position.horizontal_sd_m, fix.stamp_s)

    def _on_battery(self, message: BatteryState) -> None:
        if (battery := battery_from_message(message)) is not None:
            self._control.battery(*battery)

    def _on_operator(self, message: Bool) -> None:
        watch, now_s = self._control.watch, self._control.now_s()
        if message.data:
            watch.hear("operator", now_s)
        else:
            watch.operator_absent(now_s)

    def _on_watchdog(self, message: DiagnosticStatus) -> None:
        watch = self._control.watch
        watch.hear("watchdog", self._control.now_s())
        watch.report(
            Cause.WATCHDOG, foreign_text(message.message) if message.level == DiagnosticStatus.ERROR else ""
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        fault = logger_fault(diagnostics_from_message(message), self._node.get_namespace())
        if fault is not None:
            self._control.watch.logger_fault = fault

    def _read_counts(self, name: str, message: PointCloud2) -> Sequence[CountRecord]:
        try:
            records = counts_from_message(message)
            require_plane(message, self._frames.settings.frame, self._control.plane)
        except ValueError as error:
            if isinstance(error, OtherFrameError):
                self._control.watch.note(Cause.COUNTS_FRAME, str(error))
            self._faults.ignore(f"{name} counts", error)
            return ()
        return records

    def _on_samples(self, name: str, message: PointCloud2) -> None:
        require_frame(message, self._frames.settings.frame)
        self._control.samples(samples_from_message(message), to_seconds(message.header.stamp), name)

    def _on_model(self, name: str, message: String) -> None:
        model = model_from_message(message)
        self._control.fit(model.fit, model.stamp_s, name, model.cell_m, model.changing)

    def _on_other(self, name: str, message: DiagnosticStatus) -> None:
        values = {each.key: each.value for each in message.values}
        found = read_json(values.get(DATUM, "null"))
        datum = None if found is None else (float(found[0]), float(found[1]))
        first = name < self._node.get_namespace()
        self._control.other(name, mission_from_message(message), first, datum)

    def _release_lost(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Release the places at which lost robots were heard last."""
        names = ", ".join(self._control.team.release_lost())
        response.success, response.message = bool(names), f"released: {names}" if names else "no robot is lost"
        self._node.get_logger().warning(f"planner/release_lost: {response.message}")
        return response

    def _on_map(self, message: String) -> None:
        try:
            found = parse_topological_map(message.data).for_robot(self._robot)
        except InputError as error:
            self._newer, self._map_fault, self._unreadable = None, "", str(error)
            self._faults.ignore("the map of the navigation", error)
            return
        self._unreadable = ""
        if self._map is not None and found.has_ways_of(self._map):
            self._newer, self._map_fault = None, ""  # it is published again, or is back
            self._frames.robot.take_map_datum(found.datum, found.frame)  # an unusable one may have named another
            return
        self._newer, self._map_fault = found, ""
        if not self._control.takes_graph:
            self._warn_once("a new map of the navigation came in mid-mission: it is used once the robot stands")
        self._use_newer()

    def use_map(self, found: TopologicalMap) -> None:
        """Use the travel graph of the navigation's map, as soon as the navigation's datum is known."""
        if doubts := found.doubts(KNOWN_ACTIONS if self._by_name else ()):
            self._warn_once("; ".join(doubts))
        self._frames.robot.take_map_datum(found.datum, found.frame)
        move = self._frames.robot.move
        self._newer = found if move is None else None
        if move is not None:
            self._control.use_graph(found.graph.moved(move.inverse))
            self._map = found

    def tick(self) -> None:
        """Check the frames, and use a map that waits; to be called every second."""
        self._control.watch.report(Cause.FRAME_MISMATCH, self._frames.tick())
        self._control.second()
        if not self._control.heard.epochs:
            self._control.heard.other_type = other_type(self._node, "fix", FIX_TYPE)
        self._ticks += 1
        if self._ticks % _AGAIN_TICKS == 0:
            self._map_fault = ""  # home or field may be others now
        if self._newer is not None and self._frames.robot.move is not None:
            self._use_newer()
        self._control.watch.report(Cause.MAP_CHANGED, self._map_changed)

    @property
    def _map_changed(self) -> str:
        if self._map is None or not self._by_name or (self._newer is None and not self._unreadable):
            return ""
        fault = self._map_fault or self._unreadable
        why = f", which cannot be used ({fault})" if fault else ""
        return f"the navigation has another map than the planner{why}"

    def _use_newer(self) -> None:
        newer = self._newer
        if newer is None or self._map_fault or not self._control.takes_graph:
            return
        try:
            self.use_map(newer)
        except InputError as error:
            self._newer, self._map_fault = newer, str(error)
            self._faults.ignore("the map of the navigation", error)

    def _warn_once(self, text: str) -> None:
        if self._warned != text:
            self._warned = text
            self._node.get_logger().warning(text)


class PlannerRecords:
    """Passes the records of messages to the control.

    A callback takes a slice at most, and the executor serves others before the next one. Messages that have
    arrived meanwhile are one slice, with one sync of the disk.
    """

    def __init__(
        self, node: Node, control: MissionControl, read: Callable[[str, PointCloud2], Sequence[CountRecord]]
    ) -> None:
        self._logger = node.get_logger()
        self._control = control
        self._read = read
        self._messages: deque[tuple[str, PointCloud2]] = deque()
        self._name = ""
        self._records: list[CountRecord] = []
        self._taken_s = 0.0
        self._continue = Soon(node, self.take)
        every(node, 2 * PAUSE_S, self.take)

    def put(self, name: str, message: PointCloud2) -> None:
        """Queue a message with records of a property."""
        if len(self._messages) >= MAX_MESSAGES:
            self._logger.error("counts arrive faster than they can be stored: some are left out", once=True)
            return
        self._messages.append((name, message))
        if time.monotonic() - self._taken_s >= PAUSE_S:
            self.take()

    def take(self) -> None:
        """Take a slice of the records that wait."""
        while self._messages and len(self._records) < SLICE:
            name, message = self._messages[0]
            if self._records and name != self._name:
                break
            self._messages.popleft()
            self._name = name
            self._records += self._read(name, message)
        part, self._records = self._records[:SLICE], self._records[SLICE:]
        if not part:
            return
        self._taken_s = time.monotonic()
        self._control.records(part, self._name, more=bool(self._records))
        if self._records or self._messages:
            self._continue.ask()


class PlannerFrames:
    """Listens to TF if its message type is installed, and publishes ``robot_pose`` with each fix."""

    def __init__(self, node: Node, values: Parameters, field: Field) -> None:
        self._node = node
        self.settings = frame_settings(values)
        self.robot = RobotFrames(field, self.settings)
        self._poses = node.create_publisher(PoseWithCovarianceStamped, "robot_pose", DEFAULT)
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
        now_s = ros_now_s(self._node)
        pose = self.robot.take_fix(fix, now_s)
        if pose is None:
            return None
        stamp_s = fix.stamp_s if fix.stamp_s > 0 else now_s
        frame = self.settings.frame
        self._poses.publish(pose_to_message(pose.place_m, pose.yaw_rad, pose.covariance_m2, stamp_s, frame))
        return pose.place_m

    def health(self) -> Health:
        """State of the frames."""
        return self.robot.health(ros_now_s(self._node))

    def tick(self) -> str:
        """Take in what TF has sent, once a second; returns why the robot must not drive, or nothing."""
        self._take_transforms()
        return self.robot.fault

    def _take_transforms(self) -> None:
        if self._listener is not None:
            self.robot.take_transforms(self._listener.take(), ros_now_s(self._node))


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
        antenna_m=(values.number("antenna_x_m"), values.number("antenna_y_m")),
    )
