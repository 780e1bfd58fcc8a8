# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exchange of records between the mappers of several robots, so that none misses any for good."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from functools import partial
from threading import Lock
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters import counts_to_messages
from soilmoist_ros.foundation import Health, Level, foreign_text, other_datum, read_json
from soilmoist_ros.mapping import Field
from soilmoist_ros.nodes.runtime.qos import LATCHED, RECORDS
from soilmoist_ros.recording import HELD, LIST_S, MAX_RECORDS, MISSED, MapRecords, RecordExchange

_REPEAT: Final = 6
"""An unchanged list is published every so many times, for receivers that have lost one."""


class MapperExchange:
    """Lists the records of a map, hears the lists of other mappers, and sends what these lack.

    :param node: node of the topics
    :param others: namespaces of the other mappers
    :param records: records of the map
    :param guard: held while the records change
    :param field: the field of the map
    :param frame: frame of the records

    Attributes
    ----------
    field : Field
        the field of the map; may be changed
    added : int
        records that came from other mappers and were missing here
    """

    def __init__(
        self, node: Node, others: Sequence[str], records: MapRecords, guard: Lock, field: Field, frame: str
    ) -> None:
        self.field, self.added = field, 0
        self._node, self._guard, self._frame = node, guard, frame
        self._exchange = RecordExchange(records)
        self._strangers: dict[str, str] = {}
        self._fields: dict[str, str] = {}  # of mappers that map another field about the same datum
        self._arrived: list[PointCloud2] = []
        self._last, self._unchanged = "", 0
        if not others:
            return
        self._held = node.create_publisher(String, HELD, LATCHED)
        self._missed = node.create_publisher(PointCloud2, MISSED, RECORDS)
        for name in others:
            node.create_subscription(String, f"{name}/{HELD}", partial(self._on_held, name), LATCHED)
            node.create_subscription(PointCloud2, f"{name}/{MISSED}", self._arrived.append, RECORDS)
        node.create_timer(LIST_S, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def take(self) -> list[PointCloud2]:
        """Messages of other mappers with records that some mapper lacks, once each."""
        taken = self._arrived[:]
        del self._arrived[: len(taken)]
        return taken

    @property
    def health(self) -> list[Health]:
        """Mappers of another field or about another datum, and robots in one namespace."""
        faults = [f"{name} is not mapped: {fault}" for name, fault in self._strangers.items()]
        faults += [f"{name} maps the field {field}, not {self.field.name}" for name, field in self._fields.items()]
        twice = [name for name in (HELD, "counts") if self._node.count_publishers(name) > 1] if self._last else []
        if twice:
            topic = self._node.resolve_topic_name(twice[0])
            faults.append(f"several nodes publish {topic}: give each robot a namespace of its own")
        if faults:
            return [Health("others", Level.ERROR, "; ".join(faults))]
        return [Health("others", Level.OK, f"{self.added} missed records came later")] if self._last else []

    def _list(self) -> dict[str, Any]:
        with self._guard:
            self._exchange.update(time.monotonic())
            held = self._exchange.held()
        frame = self.field.frame
        return {"field": self.field.name, "datum": [frame.latitude_deg, frame.longitude_deg], **held}

    def _publish(self) -> None:
        text = json.dumps(self._list())
        self._unchanged = self._unchanged + 1 if text == self._last else 0
        if self._unchanged % _REPEAT == 0:
            self._held.publish(String(data=text))
        self._last = text

    def _on_held(self, name: str, message: String) -> None:
        """Send what another mapper lacks."""
        try:
            held = read_json(message.data)
            latitude, longitude = held["datum"]
            fault = other_datum((float(latitude), float(longitude)), self.field.frame)
            if fault:
                self._strangers[name] = fault
                return
            self._strangers.pop(name, None)
            self._fields.pop(name, None)
            if (theirs := str(held.get("field", self.field.name))) != self.field.name:
                self._fields[name] = foreign_text(theirs)
            now_s = time.monotonic()
            with self._guard:
                self._exchange.update(now_s)
                missed = self._exchange.missed(name, held, now_s)[: 2 * MAX_RECORDS]
        except (ValueError, TypeError, LookupError, AttributeError) as error:
            self._node.get_logger().error(f"{name}/{HELD} cannot be read: {error}", once=True)
            return
        datum = self.field.frame.latitude_deg, self.field.frame.longitude_deg
        for part in counts_to_messages(missed, self._frame, datum):
            self._missed.publish(part)
        if missed:
            self._node.get_logger().info(f"{len(missed)} records sent that {name} may have missed")
