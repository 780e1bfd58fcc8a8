# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topics of a recording without ROS: definitions and bytes of the messages that a robot's nodes publish."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import Health
from soilmoist_ros.recording.bag.messages import (
    CLOUD,
    DATATYPES,
    FRAME,
    QUARANTINED,
    VISIT,
    count_points,
    line_text,
    stamp_parts,
    visit_values,
)
from soilmoist_ros.recording.bag.metadata import Definition, Qos, Topic
from soilmoist_ros.sensing import CountRecord, CovarianceKind, Fix

GNSS_FRAME: Final = "gnss"
_SERVICE_GPS: Final = 1
_VISIT: Final = (
    "std_msgs/Header header;string robot;string stop;geometry_msgs/Point stop_position;"
    "geometry_msgs/Point position;"
    "builtin_interfaces/Time arrival;float64 arrival_s;float64 dwell_s;string dwell_rule;uint32 records;"
    "uint64 raw_counts;float64 exposure_s;float64 effective_exposure_s;"
    "string choice;string reason_code;string reason"
)
"""Fields of interfaces/soilmoist_msgs/msg/Visit.msg, which only robots have."""


class PlainTopics:
    """Makes topics and messages, which ROS reads as those of ``msg_adapters``."""

    def __init__(self) -> None:
        self._topics: dict[str, Topic] = {}

    @cached_property
    def _store(self) -> Any:
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register(get_types_from_msg(_VISIT.replace(";", "\n"), VISIT))
        return store

    def topic(self, name: str, kind: str) -> Topic:
        """A topic with the definition of its type."""
        if name not in self._topics:
            text = self._store.generate_msgdef(kind, ros_version=2)[0]
            definition = Definition(kind, text, type_hash=self._store.hash_rihs01(kind))
            self._topics[name] = Topic(name, definition, (Qos(),))
        return self._topics[name]

    def counts(self, record: CountRecord, datum: tuple[float, float]) -> tuple[Topic, Any]:
        """Topic and message of a record, a good or a quarantined one; :func:`count_records` reads the message."""
        bad = bool(record.quarantine)
        points, stamp_s = count_points([record], None if bad else datum, bad)
        return self.topic(f"/{QUARANTINED if bad else 'counts'}", CLOUD), self.cloud(points, stamp_s)

    def cloud(self, table: NDArray[Any], stamp_s: float) -> Any:
        """Message of points: of the samples, or of a map."""
        height, width = table.shape if table.ndim == 2 else (1, len(table))
        fields = table.dtype.fields
        assert fields is not None
        return self._new(
            CLOUD,
            header=self._header(stamp_s, FRAME),
            height=int(height),
            width=int(width),
            fields=[
                self._new(
                    "sensor_msgs/msg/PointField",
                    name=name,
                    offset=int(kind[1]),
                    datatype=DATATYPES[kind[0].str],
                    count=1,
                )
                for name, kind in fields.items()
            ],
            is_bigendian=False,
            point_step=table.dtype.itemsize,
            row_step=table.dtype.itemsize * int(width),
            data=np.frombuffer(table.tobytes(), np.uint8),
            is_dense=all(bool(np.isfinite(table[axis]).all()) for axis in ("x", "y", "z")),
        )

    def fix(self, fix: Fix) -> tuple[Topic, Any]:
        """Topic and message of a fix."""
        covariance = np.zeros(9)
        known = fix.covariance_kind is not CovarianceKind.UNKNOWN
        if known:
            covariance[:] = np.ravel(fix.covariance_m2)
        kind = "sensor_msgs/msg/NavSatFix"
        return self.topic("/fix", kind), self._new(
            kind,
            header=self._header(fix.stamp_s, GNSS_FRAME),
            status=self._new("sensor_msgs/msg/NavSatStatus", status=int(fix.status), service=_SERVICE_GPS),
            latitude=float(fix.position.latitude_deg),
            longitude=float(fix.position.longitude_deg),
            altitude=float(fix.position.altitude_m + fix.geoid_separation_m),
            position_covariance=covariance,
            position_covariance_type=int(fix.covariance_kind) if known else 0,
        )

    def line(self, name: str, line: bytes) -> tuple[Topic, Any]:
        """Topic and message of a line of a device."""
        return self.text(name, line_text(line))

    def text(self, name: str, text: str) -> tuple[Topic, Any]:
        """Topic and message of a text."""
        kind = "std_msgs/msg/String"
        return self.topic(name, kind), self._new(kind, data=text)

    def health(self, name: str, health: Health) -> tuple[Topic, Any]:
        """Topic and message of a state of health, such as that of a mission."""
        kind, pair = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/KeyValue"
        values = [self._new(pair, key=str(key), value=str(value)) for key, value in health.values.items()]
        return self.topic(name, kind), self._new(
            kind, level=int(health.level), name=health.name, message=health.message, hardware_id="", values=values
        )

    def visit(self, visit: Visit) -> tuple[Topic, Any]:
        """Topic and message of a visit."""
        point = "geometry_msgs/msg/Point"
        return self.topic("/visits", VISIT), self._new(
            VISIT,
            header=self._header(visit.end_stamp_s, FRAME),
            robot="",
            stop_position=self._new(point, x=float(visit.stop_x_m), y=float(visit.stop_y_m), z=0.0),
            position=self._new(point, x=float(visit.x_m), y=float(visit.y_m), z=0.0),
            arrival=self._time(visit.arrival_stamp_s),
            **visit_values(visit),
        )

    def data(self, topic: Topic, message: Any) -> bytes:
        """A message as CDR."""
        return bytes(self._store.serialize_cdr(message, topic.definition.type_name))

    def _new(self, kind: str, **values: Any) -> Any:
        return self._store.types[kind](**values)

    def _header(self, stamp_s: float, frame: str) -> Any:
        return self._new("std_msgs/msg/Header", stamp=self._time(stamp_s), frame_id=frame)

    def _time(self, stamp_s: float) -> Any:
        second, nanosecond = stamp_parts(stamp_s)
        return self._new("builtin_interfaces/msg/Time", sec=second, nanosec=nanosecond)
