# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts lines of the neutron logger and the GNSS receiver to corrected, geo-tagged records."""

from __future__ import annotations

import json
import logging
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure, NavSatFix, PointCloud2, RelativeHumidity, Temperature
from std_msgs.msg import String

from msg_adapters import (
    counts_from_message,
    counts_to_message,
    diagnostics_to_message,
    fix_to_message,
    line_to_message,
    quarantined_to_message,
    weather_to_messages,
)
from soilmoist_ros.foundation import LatLon, resource
from soilmoist_ros.mapping import load_field
from soilmoist_ros.nodes.node_process import Soon, run
from soilmoist_ros.nodes.parameter_tables import DRIVER_SETTINGS
from soilmoist_ros.nodes.parameter_tables import SENSOR_DRIVER as PARAMETERS
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import DEFAULT, RECORDS, SENSOR, VISITS, every, other_type, ros_now_s
from soilmoist_ros.recording import DRIVER, QUARANTINED, RecordLog, write_whole
from soilmoist_ros.sensing import (
    DOUBTS,
    FIX_TYPE,
    Batch,
    CountRecord,
    Doubt,
    Driver,
    DriverSettings,
    LogHeader,
    Site,
    fix_from_message,
    load_site,
)

_RELEASE_S = 0.1
_DIAGNOSTICS_S = 1.0
NAME: Final = "header.json"
_log = logging.getLogger(__name__)


class SensorDriver(Node):
    """Publishes the records, fixes and weather of the devices."""

    def __init__(self) -> None:
        super().__init__("sensor_driver")
        given = Parameters(self, PARAMETERS)
        options = given.as_dict()
        field, site = load_field(resource("fields", given.text("field"))), given.text("site")
        settings: dict[str, Any] = {name: options[name] for name in DRIVER_SETTINGS}
        self._driver = Driver(DriverSettings(**settings), load_site(site) if site else Site(), field.frame)
        self._hears_fixes = not given.text("gnss_uri")
        if self._hears_fixes:
            self.create_subscription(NavSatFix, "fix", self._on_fix, SENSOR)
        self.create_subscription(String, DOUBTS, self._on_doubt, VISITS)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        self._outputs = DriverOutputs(self, given, (field.frame.latitude_deg, field.frame.longitude_deg))
        if (header := self._outputs.header) is not None:
            self._driver.stream.parser.use_header(header)
        self._arrived = Soon(self, self._step)
        self._driver.start(self._arrived.ask)
        every(self, _RELEASE_S, self._step)
        every(self, _DIAGNOSTICS_S, self._report)

    def close(self) -> None:
        """Disconnect."""
        self._driver.stop()
        self._outputs.close()

    def _step(self) -> None:
        batch = self._driver.step(ros_now_s(self))
        self._outputs.publish(batch)
        if batch.more:
            self._arrived.ask()

    def _on_fix(self, message: NavSatFix) -> None:
        self._driver.stream.take_fix(fix_from_message(message, ros_now_s(self)))
        self._step()

    def _on_doubt(self, message: String) -> None:
        try:
            doubt = Doubt.from_text(message.data)
        except ValueError as error:
            self.get_logger().warning(f"{DOUBTS} is ignored: {error}", throttle_duration_sec=60.0)
            return
        self._driver.doubts.take(doubt)

    def _report(self) -> None:
        now_s, stream = ros_now_s(self), self._driver.stream
        heard = stream.survey.heard
        if not heard.epochs and self._hears_fixes:
            heard.other_type = other_type(self, "fix", FIX_TYPE)
        parts, name = self._driver.health(now_s), self.get_fully_qualified_name()
        self._diagnostics.publish(diagnostics_to_message(parts, now_s, name, stream.parser.serial))


# What the driver publishes and stores: records, fixes, weather and the lines of the devices ---------------------


class DriverOutputs:
    """Publishers of the driver, and its log of records; ``datum`` is that of their places [deg]."""

    def __init__(self, node: Node, given: Parameters, datum: LatLon) -> None:
        self._node, self._datum = node, datum
        self._frames = given.text("frame_id"), given.text("sensor_frame"), given.text("gnss_frame")
        topics: dict[str, tuple[type, Any]] = {
            "counts": (PointCloud2, RECORDS), QUARANTINED: (PointCloud2, RECORDS),
            "pressure": (FluidPressure, SENSOR), "temperature": (Temperature, SENSOR),
            "relative_humidity": (RelativeHumidity, SENSOR), "raw/logger": (String, RECORDS),
        }  # fmt: skip
        if given.text("gnss_uri"):
            topics |= {"fix": (NavSatFix, SENSOR), "raw/gnss": (String, RECORDS)}
        self._publishers = {
            name: node.create_publisher(kind, name, profile) for name, (kind, profile) in topics.items()
        }
        self._log: RecordLog | None = None
        self._header: StoredHeader | None = None
        if given.text("record_dir"):
            folder = Path(given.text("record_dir")).expanduser() / DRIVER
            self._log = RecordLog(folder, self._frames[0])
            self._header = StoredHeader(folder, given.text("logger_uri"), given.text("logger_format"))
            if self._header.header is not None:
                node.get_logger().info(f"until the logger sends its header, the one of {folder} is used")

    @property
    def header(self) -> LogHeader | None:
        """The header of the logger that is stored with the records, if there is one."""
        return None if self._header is None else self._header.header

    def close(self) -> None:
        """Close the log of records."""
        if self._log is not None:
            self._log.close()

    def publish(self, batch: Batch) -> None:
        """Publish what has come; each record is stored before."""
        (frame, sensor, gnss), datum = self._frames, self._datum
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

    def _store(self, records: list[CountRecord], header: LogHeader | None) -> None:
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


# The last header of a logger on the disk: some loggers send it only when they are switched on -------------------


class StoredHeader:
    """The header of one logger, stored for a driver that starts again."""

    def __init__(self, folder: Path, logger_uri: str, logger_format: str) -> None:
        self._path = folder / NAME
        self._logger = {"logger_uri": logger_uri, "logger_format": logger_format}
        self.header = self._read()
        """The last header, ``None`` if there is none."""

    def update(self, header: LogHeader) -> None:
        """Store a header, unless it is stored already."""
        if header != self.header:
            content = {**self._logger, **asdict(header)}
            del content["stored_s"]  # the time of the file
            write_whole(self._path, json.dumps(content, indent=1).encode())
            self.header = header

    def _read(self) -> LogHeader | None:
        if not self._path.exists():
            return None
        try:
            content = json.loads(self._path.read_bytes())
            if any(content[key] != value for key, value in self._logger.items()):
                return None
            names, units = (tuple(map(str, content[key])) for key in ("names", "units"))
            values = {str(key): str(value) for key, value in content["values"].items()}
            return LogHeader(names, units, values, self._path.stat().st_mtime)
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            _log.warning("%s is ignored, it cannot be read: %s", self._path, error)
            return None


def main() -> None:
    """Run the node."""
    run(SensorDriver)


if __name__ == "__main__":
    main()
