# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts lines of the neutron logger and the GNSS receiver to corrected, geo-tagged records."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Float64, String

from msg_adapters import diagnostics_to_message
from soilmoist_ros.foundation import InputError, resource
from soilmoist_ros.mapping import load_field
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.sensor_driver import PARAMETERS, SETTINGS
from soilmoist_ros.nodes.runtime import qos
from soilmoist_ros.nodes.runtime.run import run
from soilmoist_ros.nodes.runtime.soon import Soon
from soilmoist_ros.nodes.runtime.topic_types import other_type
from soilmoist_ros.nodes.wiring.driver_outputs import DriverOutputs
from soilmoist_ros.sensing import (
    DOUBTS,
    FIX_TYPE,
    Doubt,
    Driver,
    DriverSettings,
    LatestIntensity,
    LeverArms,
    Site,
    fix_from_message,
    load_site,
)

_RELEASE_S = 0.1
_DIAGNOSTICS_S = 1.0


class SensorDriver(LifecycleNode):
    """Publishes the records, fixes and weather of the devices while it is active."""

    def __init__(self) -> None:
        super().__init__("sensor_driver")
        self._given = Parameters(self, PARAMETERS)
        self._driver: Driver | None = None
        self._fault: InputError | None = None
        text = self._given.text
        if not text("gnss_uri"):
            self.create_subscription(NavSatFix, "fix", self._on_fix, qos.SENSOR)
        self.create_subscription(String, DOUBTS, self._on_doubt, qos.VISITS)
        self._outputs = DriverOutputs(self, self._given)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", qos.DEFAULT)
        self._intensity = LatestIntensity()
        if topic := text("intensity_topic"):
            # A latched subscription has the value from before this start, but of latched publishers only.
            for profile in (qos.DEFAULT, qos.LATCHED):
                self.create_subscription(Float64, topic, self._on_intensity, profile)
        self._arrived = Soon(self, self._step)
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
        if self._given.text("intensity_topic") and sensor.corrections.intensity is None:
            raise InputError(
                "intensity_topic is given, but the site file has no reference for the intensity",
                "write 'intensity: {reference: 150.0, constant: 150.0}' under 'corrections' in the site file",
            )
        settings: dict[str, Any] = {name: options[name] for name in SETTINGS}
        settings["arms"] = LeverArms.of(options)
        self._driver = Driver(DriverSettings(**settings), sensor, field.frame, self._now_s())
        if self._given.text("intensity_topic"):
            self._driver.stream.survey.latest_intensity = self._intensity

    def _activate(self) -> None:
        assert self._driver is not None  # on_configure made it
        header = self._outputs.open()
        if header is not None:
            self._driver.stream.parser.use_header(header)
        self._driver.start(self._arrived.ask)

    def _now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _step(self) -> None:
        if self._driver is not None:
            batch = self._driver.step(self._now_s())
            self._outputs.publish(batch)
            if batch.more:
                self._arrived.ask()

    def _on_fix(self, message: NavSatFix) -> None:
        if self._driver is not None:
            self._driver.stream.take_fix(fix_from_message(message, self._now_s()))
            self._step()

    def _on_doubt(self, message: String) -> None:
        try:
            doubt = Doubt.from_text(message.data)
        except ValueError as error:
            self.get_logger().warning(f"{DOUBTS} is ignored: {error}", throttle_duration_sec=60.0)
            return
        if self._driver is not None:
            self._driver.doubts.take(doubt)

    def _on_intensity(self, message: Float64) -> None:
        if not self._intensity.take(float(message.data), time.monotonic()):
            self.get_logger().warning(f"an intensity of {message.data:g} is ignored")

    def _report(self) -> None:
        now_s = self._now_s()
        if self._driver is not None:
            serial = self._driver.stream.parser.serial
            heard = self._driver.stream.survey.heard
            if not heard.epochs and not self._given.text("gnss_uri"):
                heard.other_type = other_type(self, "fix", FIX_TYPE)
            parts = self._driver.health(now_s)
            name = self.get_fully_qualified_name()
            self._diagnostics.publish(diagnostics_to_message(parts, now_s, name, serial))


def main() -> None:
    """Run the node."""
    run(SensorDriver)


if __name__ == "__main__":
    main()
