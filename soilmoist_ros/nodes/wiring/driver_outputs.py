# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the driver publishes and stores: records, fixes, weather and the lines of the devices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import FluidPressure, NavSatFix, PointCloud2, RelativeHumidity, Temperature
from std_msgs.msg import String

from msg_adapters import (
    counts_from_message,
    counts_to_message,
    fix_to_message,
    line_to_message,
    quarantined_to_message,
    weather_to_messages,
)
from soilmoist_ros.foundation import LatLon
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.runtime import qos
from soilmoist_ros.nodes.wiring.driver_header import StoredHeader
from soilmoist_ros.recording import DRIVER, QUARANTINED, RecordLog
from soilmoist_ros.sensing import Batch, CountRecord, Header


class DriverOutputs:
    """Publishers of the driver, and its log of records.

    :param node: the node that publishes
    :param given: parameters of the node

    Attributes
    ----------
    datum : tuple[float, float] or None
        datum of the places of the records [deg]
    """

    def __init__(self, node: Node, given: Parameters) -> None:
        self.datum: LatLon | None = None
        self._node = node
        self._frames = given.text("frame_id"), given.text("sensor_frame"), given.text("gnss_frame")
        self._folder = given.text("record_dir")
        self._logger = given.text("logger_uri"), given.text("logger_format")
        self._log: RecordLog | None = None
        self._header: StoredHeader | None = None
        topics: dict[str, tuple[type, Any]] = {
            "counts": (PointCloud2, qos.RECORDS),
            QUARANTINED: (PointCloud2, qos.RECORDS),
            "pressure": (FluidPressure, qos.SENSOR),
            "temperature": (Temperature, qos.SENSOR),
            "relative_humidity": (RelativeHumidity, qos.SENSOR),
            "raw/logger": (String, qos.RECORDS),
        }
        if given.text("gnss_uri"):
            topics |= {"fix": (NavSatFix, qos.SENSOR), "raw/gnss": (String, qos.RECORDS)}
        self._publishers = {
            name: node.create_publisher(kind, name, profile) for name, (kind, profile) in topics.items()
        }

    def open(self) -> Header | None:
        """Open the log of records, if there is one.

        :return: the last header of the logger, if it is stored there
        :raises InputError: if the folder cannot be written
        """
        if not self._folder:
            return None
        folder = Path(self._folder).expanduser() / DRIVER
        self._log = RecordLog(folder, self._frames[0])
        self._header = StoredHeader(folder, *self._logger)
        if self._header.header is not None:
            self._node.get_logger().info(f"until the logger sends its header, the one of {folder} is used")
        return self._header.header

    def close(self) -> None:
        """Close the log of records."""
        if self._log is not None:
            self._log.close()
            self._log = self._header = None

    def publish(self, batch: Batch) -> None:
        """Publish what has come; each record is stored before."""
        (frame, sensor, gnss), datum = self._frames, self.datum
        for name, lines in (("raw/logger", batch.logger_lines), ("raw/gnss", batch.gnss_lines)):
            for line in lines:
                self._publishers[name].publish(line_to_message(line))
        for fix in batch.fixes:
            self._publishers["fix"].publish(fix_to_message(fix, gnss))
        for reading in batch.readings:
            for name, message in weather_to_messages(reading, sensor).items():
                self._publishers[name].publish(message)
        good = [counts_to_message([record], frame, datum) for record in batch.records if not record.quarantine]
        bad = [quarantined_to_message([record], frame) for record in batch.records if record.quarantine]
        self._store([record for message in (*good, *bad) for record in counts_from_message(message)], batch.header)
        for name, messages in (("counts", good), (QUARANTINED, bad)):
            for message in messages:
                self._publishers[name].publish(message)

    def _store(self, records: list[CountRecord], header: Header | None) -> None:
        """Write records as receivers read them. A disk that fails does not stop the survey."""
        if self._log is None or self._header is None:
            return
        try:
            if records:
                self._log.write(records)
            if header is not None:
                self._header.update(header)
        except OSError as error:
            self._node.get_logger().error(
                f"records or their header are not stored, only published: {error.strerror or error}",
                throttle_duration_sec=60.0,
            )
