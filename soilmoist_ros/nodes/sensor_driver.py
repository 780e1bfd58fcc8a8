# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts lines of the neutron logger and the GNSS receiver to corrected, geo-tagged records."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
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
from soilmoist_ros.foundation import InputError, LatLon, resource
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
    LeverArms,
    LogHeader,
    Site,
    fix_from_message,
    load_site,
)

_RELEASE_S = 0.1
_DIAGNOSTICS_S = 1.0
NAME: Final = "header.json"
_log = logging.getLogger(__name__)


class SensorDriver(LifecycleNode):
    """Publishes the records, fixes and weather of the devices while it is active."""

    def __init__(self) -> None:
        super().__init__("sensor_driver")
        self._given = Parameters(self, PARAMETERS)
        self._driver: Driver | None = None
        self._fault: InputError | None = None
        text = self._given.text
        if not text("gnss_uri"):
            self.create_subscription(NavSatFix, "fix", self._on_fix, SENSOR)
        self.create_subscription(String, DOUBTS, self._on_doubt, VISITS)
        self._outputs = DriverOutputs(self, self._given)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        self._arrived = Soon(self, self._step)
        every(self, _RELEASE_S, self._step)
        every(self, _DIAGNOSTICS_S, self._report)
        if self._given.flag("autostart"):
            for trigger in (self.trigger_configure, self.trigger_activate):
                trigger()
                if self._fault is not None:
                    raise self._fault

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the files and check the addresses."""
        return self._attempt(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Connect to the devices."""
        return self._attempt(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Disconnect."""
        return self._attempt(self.close)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the driver."""
        self._driver = None
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Disconnect."""
        return self._attempt(self.close)

    def close(self) -> None:
        """Disconnect."""
        if self._driver is not None:
            self._driver.stop()
        self._outputs.close()

    def _attempt(self, transition: Callable[[], None]) -> TransitionCallbackReturn:
        self._fault = None
        try:
            transition()
        except InputError as error:
            self._fault = error
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        options = self._given.as_dict()
        field = load_field(resource("fields", self._given.text("field")))
        self._outputs.datum = field.frame.latitude_deg, field.frame.longitude_deg
        site = self._given.text("site")
        sensor = load_site(site) if site else Site()
        settings: dict[str, Any] = {name: options[name] for name in DRIVER_SETTINGS}
        settings["arms"] = LeverArms.of(options)
        self._driver = Driver(DriverSettings(**settings), sensor, field.frame)

    def _activate(self) -> None:
        assert self._driver is not None  # on_configure made it
        header = self._outputs.open()
        if header is not None:
            self._driver.stream.parser.use_header(header)
        self._driver.start(self._arrived.ask)

    def _step(self) -> None:
        if self._driver is not None:
            batch = self._driver.step(ros_now_s(self))
            self._outputs.publish(batch)
            if batch.more:
                self._arrived.ask()

    def _on_fix(self, message: NavSatFix) -> None:
        if self._driver is not None:
            self._driver.stream.take_fix(fix_from_message(message, ros_now_s(self)))
            self._step()

    def _on_doubt(self, message: String) -> None:
        try:
            doubt = Doubt.from_text(message.data)
        except ValueError as error:
            self.get_logger().warning(f"{DOUBTS} is ignored: {error}", throttle_duration_sec=60.0)
            return
        if self._driver is not None:
            self._driver.doubts.take(doubt)

    def _report(self) -> None:
        now_s = ros_now_s(self)
        if self._driver is not None:
            serial = self._driver.stream.parser.serial
            heard = self._driver.stream.survey.heard
            if not heard.epochs and not self._given.text("gnss_uri"):
                heard.other_type = other_type(self, "fix", FIX_TYPE)
            parts = self._driver.health(now_s)
            name = self.get_fully_qualified_name()
            self._diagnostics.publish(diagnostics_to_message(parts, now_s, name, serial))


# What the driver publishes and stores: records, fixes, weather and the lines of the devices ---------------------


class DriverOutputs:
    """Publishers of the driver, and its log of records; ``datum`` is that of their places [deg]."""

    def __init__(self, node: Node, given: Parameters) -> None:
        self.datum: LatLon | None = None
        self._node = node
        self._frames = given.text("frame_id"), given.text("sensor_frame"), given.text("gnss_frame")
        self._folder = given.text("record_dir")
        self._logger = given.text("logger_uri"), given.text("logger_format")
        self._log: RecordLog | None = None
        self._header: StoredHeader | None = None
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

    def open(self) -> LogHeader | None:
        """Open the log of records, if there is one; returns the header of the logger that is stored there."""
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
