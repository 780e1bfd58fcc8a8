# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs of the planner: fixes, records, the mapper's results, and the map of the navigation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, NavSatFix, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters import (
    OtherFrameError,
    battery_from_message,
    counts_from_message,
    diagnostics_from_message,
    mission_from_message,
    model_from_message,
    require_frame,
    require_plane,
    samples_from_message,
    to_seconds,
)
from soilmoist_ros.exploration import DATUM, Cause, MissionControl, TopologicalMap, parse_topological_map
from soilmoist_ros.foundation import InputError, read_json
from soilmoist_ros.nodes.parameters.declaration import other_namespaces
from soilmoist_ros.nodes.runtime.qos import DEFAULT, LATCHED, RECORDS, SENSOR
from soilmoist_ros.nodes.runtime.topic_types import other_type
from soilmoist_ros.nodes.wiring.planner_frames import PlannerFrames
from soilmoist_ros.nodes.wiring.planner_records import PlannerRecords
from soilmoist_ros.recording import quarantined_topic
from soilmoist_ros.sensing import FIX_TYPE, CountRecord, fix_from_message, logger_fault

_AGAIN_TICKS: Final = 10
"""Seconds after which a map of the navigation that could not be used is tried again."""


class PlannerInputs:
    """Subscribes to the inputs, and passes valid messages to the control; each fault is logged once.

    :param node: node of the subscriptions
    :param control: receives the inputs
    :param frames: frames of the robot and of its navigation
    :param map_topic: topic of the navigation's map; empty for no subscription
    :param others: namespaces of the planners of other robots on the field; this node's namespace is ignored
    :param properties: namespaces of the mappers of further properties
    :param edge_actions: actions of edges that the navigation knows; all if empty
    :param by_name: whether the navigation chooses the way by its own map
    """

    def __init__(
        self,
        node: Node,
        control: MissionControl,
        frames: PlannerFrames,
        map_topic: str,
        others: Sequence[str] = (),
        properties: Iterable[str] = (),
        edge_actions: Sequence[str] = (),
        by_name: bool = False,
    ) -> None:
        self._edge_actions = edge_actions
        self._by_name = by_name
        self._node = node
        self._control = control
        self._frames = frames
        self._map: TopologicalMap | None = None  # in use
        self._newer: TopologicalMap | None = None  # to be used, as soon as that is possible
        self._map_fault = ""
        self._unreadable = ""  # why the newest map is none
        self._ticks = 0
        self._faults: dict[str, str] = {}
        self._records = PlannerRecords(node, control, self._read_counts)
        node.create_subscription(NavSatFix, "fix", self._on_fix, SENSOR)
        node.create_subscription(BatteryState, "battery_state", self._on_battery, SENSOR)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEFAULT)
        for name in ("", *properties):
            below = f"{name}/" if name else ""
            counts, samples, model = (
                partial(on, name) for on in (self._records.put, self._on_samples, self._on_model)
            )
            for topic in (f"{below}counts", quarantined_topic(f"{below}counts")):
                node.create_subscription(PointCloud2, topic, counts, RECORDS)
            node.create_subscription(PointCloud2, f"{below}samples", samples, LATCHED)
            node.create_subscription(String, f"{below}model", model, LATCHED)
        if map_topic:
            node.create_subscription(String, map_topic, self._on_map, LATCHED)
        for name in other_namespaces(node, others):
            control.other(name, None)
            node.create_subscription(DiagnosticStatus, f"{name}/mission", partial(self._on_other, name), LATCHED)
        if control.team.robots:
            node.create_service(Trigger, "planner/release_lost", self._release_lost)

    def _on_fix(self, message: NavSatFix) -> None:
        fix = fix_from_message(message, self._node.get_clock().now().nanoseconds * 1e-9)
        self._control.hear(fix)
        place = self._frames.place(fix)
        if place is not None:
            self._control.fix(place, fix.position.horizontal_sd_m, fix.stamp_s)

    def _on_battery(self, message: BatteryState) -> None:
        if (battery := battery_from_message(message)) is not None:
            self._control.battery(*battery)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        fault = logger_fault(diagnostics_from_message(message), self._node.get_namespace())
        if fault is not None:
            self._control.watch.logger(fault)

    def _read_counts(self, name: str, message: PointCloud2) -> Sequence[CountRecord]:
        try:
            records = counts_from_message(message)
            require_plane(message, self._frames.settings.frame, self._control.plane)
        except OtherFrameError as error:
            self._control.watch.note(Cause.COUNTS_FRAME, str(error))
            self._ignore(f"{name} counts", error)
            return ()
        except ValueError as error:
            self._ignore(f"{name} counts", error)
            return ()
        return records

    def _on_samples(self, name: str, message: PointCloud2) -> None:
        try:
            require_frame(message, self._frames.settings.frame)
            self._control.samples(samples_from_message(message), to_seconds(message.header.stamp), name)
        except ValueError as error:
            self._ignore(f"{name} samples", error)

    def _on_model(self, name: str, message: String) -> None:
        try:
            model = model_from_message(message)
            self._control.fit(model.fit, model.stamp_s, name, model.cell_m, model.changing)
        except ValueError as error:
            self._ignore(f"{name} model", error)

    def _on_other(self, name: str, message: DiagnosticStatus) -> None:
        try:
            values = {each.key: each.value for each in message.values}
            found = read_json(values.get(DATUM, "null"))
            datum = None if found is None else (float(found[0]), float(found[1]))
            first = name < self._node.get_namespace()
            self._control.other(name, mission_from_message(message), first, datum)
        except (ValueError, TypeError, LookupError) as error:
            self._ignore(f"{name}/mission", error)

    def _release_lost(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Say that lost robots are no longer where they were heard last."""
        names = ", ".join(self._control.team.release_lost())
        response.success, response.message = bool(names), f"released: {names}" if names else "no robot is lost"
        self._node.get_logger().warning(f"planner/release_lost: {response.message}")
        return response

    def _on_map(self, message: String) -> None:
        try:
            found = parse_topological_map(message.data)
        except InputError as error:
            self._newer, self._map_fault, self._unreadable = None, "", str(error)
            self._ignore("the map of the navigation", error)
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
        """Use the travel graph of the navigation's map, as soon as the navigation's datum is known.

        :raises InputError: if it does not fit the field
        """
        if doubts := found.doubts(self._edge_actions):
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
            self._ignore("the map of the navigation", error)

    def _warn_once(self, text: str) -> None:
        if self._faults.get("warning") != text:
            self._faults["warning"] = text
            self._node.get_logger().warning(text)

    def _ignore(self, what: str, error: Exception) -> None:
        what = what.strip()
        if self._faults.get(what) != str(error):  # a faulty publisher repeats the fault
            self._faults[what] = str(error)
            self._node.get_logger().error(f"{what} cannot be used: {error}")
