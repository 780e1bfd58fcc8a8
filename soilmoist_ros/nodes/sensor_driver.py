"""Converts lines of the neutron logger and the GNSS receiver to corrected, geo-tagged records."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import FluidPressure, NavSatFix, PointCloud2, RelativeHumidity, Temperature
from std_msgs.msg import Float64, String

from msg_adapters.counts import (
    counts_from_message,
    counts_to_message,
    quarantined_to_message,
)
from msg_adapters.diagnostics import diagnostics_to_message
from msg_adapters.environment import fix_from_message, fix_to_message, weather_to_messages
from msg_adapters.raw_line import line_to_message
from soilmoist_ros.foundation.configuration import resource
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.sensor_driver import PARAMETERS, SETTINGS
from soilmoist_ros.nodes.runtime import qos
from soilmoist_ros.nodes.runtime.run import run
from soilmoist_ros.recording.bag.point_cloud import QUARANTINED
from soilmoist_ros.recording.map_sources import DRIVER
from soilmoist_ros.recording.record_log import RecordLog
from soilmoist_ros.sensing.moisture.site import Site, load_site
from soilmoist_ros.sensing.position.lever_arms import LeverArms
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.sensing.survey.driver import Batch, Driver, DriverSettings

_RELEASE_S = 0.1
_DIAGNOSTICS_S = 1.0


class SensorDriver(LifecycleNode):
    """Publishes the records, fixes and weather of the devices while it is active."""

    def __init__(self) -> None:
        super().__init__("sensor_driver")
        self._given = Parameters(self, PARAMETERS)
        self._driver: Driver | None = None
        self._fault: InputError | None = None
        self._log: RecordLog | None = None
        text = self._given.text
        outputs: dict[str, tuple[type, Any]] = {
            "counts": (PointCloud2, qos.RECORDS),
            QUARANTINED: (PointCloud2, qos.RECORDS),
            "pressure": (FluidPressure, qos.SENSOR),
            "temperature": (Temperature, qos.SENSOR),
            "relative_humidity": (RelativeHumidity, qos.SENSOR),
            "raw/logger": (String, qos.RECORDS),
        }
        if text("gnss_uri"):
            outputs |= {"fix": (NavSatFix, qos.SENSOR), "raw/gnss": (String, qos.RECORDS)}
        else:
            self.create_subscription(NavSatFix, "fix", self._on_fix, qos.SENSOR)
        self._outputs = {
            name: self.create_publisher(kind, name, profile) for name, (kind, profile) in outputs.items()
        }
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", qos.DEFAULT)
        if text("intensity_topic"):
            self.create_subscription(Float64, text("intensity_topic"), self._on_intensity, qos.DEFAULT)
        self._arrived = self.create_guard_condition(self._step)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(_RELEASE_S, self._step, clock=steady)
        self.create_timer(_DIAGNOSTICS_S, self._report, clock=steady)
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
        if self._log is not None:
            self._log.close()
            self._log = None

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
        site = self._given.text("site")
        sensor = load_site(site) if site else Site()
        if self._given.text("intensity_topic") and sensor.corrections.intensity is None:
            raise InputError(
                "intensity_topic is given, but the site file has no reference for the intensity",
                "write 'intensity: {reference: 150.0, constant: 150.0}' under 'corrections' in the site file",
            )
        settings: dict[str, Any] = {name: options[name] for name in SETTINGS}
        settings["arms"] = LeverArms.of(options)
        self._driver = Driver(DriverSettings(**settings), sensor, field.frame, self._now_s())

    def _activate(self) -> None:
        assert self._driver is not None  # on_configure made it
        if folder := self._given.text("record_dir"):
            self._log = RecordLog(Path(folder).expanduser() / DRIVER, self._given.text("frame_id"))
        self._driver.start(self._arrived.trigger)

    def _now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _step(self) -> None:
        if self._driver is not None:
            batch = self._driver.step(self._now_s())
            self._publish(batch)
            if batch.more:
                self._arrived.trigger()

    def _publish(self, batch: Batch) -> None:
        frame, sensor, gnss = (self._given.text(name) for name in ("frame_id", "sensor_frame", "gnss_frame"))
        for name, lines in (("raw/logger", batch.logger_lines), ("raw/gnss", batch.gnss_lines)):
            for line in lines:
                self._outputs[name].publish(line_to_message(line))
        for fix in batch.fixes:
            self._outputs["fix"].publish(fix_to_message(fix, gnss))
        for reading in batch.readings:
            for name, message in weather_to_messages(reading, sensor).items():
                self._outputs[name].publish(message)
        good = [counts_to_message([record], frame) for record in batch.records if not record.quarantine]
        bad = [quarantined_to_message([record], frame) for record in batch.records if record.quarantine]
        self._store([record for message in (*good, *bad) for record in counts_from_message(message)])
        for name, messages in (("counts", good), (QUARANTINED, bad)):
            for message in messages:
                self._outputs[name].publish(message)

    def _store(self, records: list[CountRecord]) -> None:
        """Write records as receivers read them. A disk that fails does not stop the survey."""
        if self._log is None or not records:
            return
        try:
            self._log.write(records)
        except OSError as error:
            self.get_logger().error(
                f"records are published, but not stored: {error.strerror or error}", throttle_duration_sec=60.0
            )

    def _on_fix(self, message: NavSatFix) -> None:
        if self._driver is not None:
            self._driver.stream.take_fix(fix_from_message(message))
            self._step()

    def _on_intensity(self, message: Float64) -> None:
        if self._driver is not None and not self._driver.stream.survey.take_intensity(float(message.data)):
            self.get_logger().warning(f"an intensity of {message.data:g} is ignored")

    def _report(self) -> None:
        now_s = self._now_s()
        if self._driver is not None:
            serial = self._driver.stream.parser.serial
            parts = self._driver.health(now_s)
            name = self.get_fully_qualified_name()
            self._diagnostics.publish(diagnostics_to_message(parts, now_s, name, serial))


def main() -> None:
    """Run the node."""
    run(SensorDriver, threads=1)


if __name__ == "__main__":
    main()
