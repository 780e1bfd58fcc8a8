# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of ``field_simulator``, and the settings made from them."""

from __future__ import annotations

from soilmoist_ros.nodes.parameters.declaration import Parameter, Parameters, of_setting
from soilmoist_ros.simulation import MissionSettings, PropertySettings

PARAMETERS = (
    of_setting("field", description="surrogate field: a name, or a field file with a truth"),
    Parameter(name="properties", default=[], old_names=("also",),
              description="surrogate fields whose rates are the truth of further properties, on the same ground; "
              "the records of each are published on NAME/counts with the NAME of the field"),
    of_setting("seed"),
    of_setting("robots", high=30, description="number of robots; several have the namespaces robot_1, robot_2, "
        "... below that of this node"),
    Parameter(name="speed", default=60.0, description="simulated time per wall time", low=0.01, high=10000.0),
    Parameter(name="start_time", default="2026-06-01T06:00:00Z",
              description="simulated time at the start, ISO 8601"),
    Parameter(name="start_when_connected", default=True,
              description="whether time stands still until loggers, receivers and the records of each property "
              "have a receiver"),
    Parameter(name="wait_limit_s", default=120.0,
              description="longest time for which simulated time stands still for a planner; what a simulated "
              "fault has swallowed is waited for in vain", unit="s", low=0.0),
    Parameter(name="graph", default="",
              description="topological map, a file; empty for a lattice of about 300 nodes"),
    Parameter(name="host", default="127.0.0.1", description="address on which logger and receiver are served"),
    Parameter(name="logger_port", default=4001,
              description="TCP port of the logger, two higher for each further robot; 0 for a free one",
              low=0, high=65535),
    Parameter(name="gnss_port", default=4002,
              description="TCP port of the receiver, two higher for each further robot; 0 for a free one",
              low=0, high=65535),
    Parameter(name="ports_file", default="",
              description="file to which the actual ports are written, as JSON: logger and gnss, with several "
              "robots robot_1/logger ...; empty for none"),
    of_setting("speed_mps", low=0.01, high=100.0),
    of_setting("stop_overhead_s"),
    of_setting("turn_s_per_rad"),
    of_setting("cadence_s", low=1.0, high=3600.0),
    Parameter(name="gnss_period_s", default=1.0,
              description="time between epochs of the receiver", unit="s", low=0.05, high=60.0),
    of_setting("position_sd_m"),
    of_setting("footprint_m"),
    of_setting("weather"),
    Parameter(name="scenario", default="", description="faults of navigation, links and sensor: a name or a file; "
        "empty for none"),
    Parameter(name="field_file", default="",
              description="file to which the field is written without its truth; empty for none"),
    Parameter(name="site_file", default="",
              description="file to which soil and calibration are written; empty for none"),
    Parameter(name="truth_file", default="",
              description="file to which the field is written with its truth; empty for none"),
)  # fmt: skip


def mission_settings(given: Parameters) -> MissionSettings:
    """Settings of the simulated field, robot and devices, as for a simulation without ROS."""
    return MissionSettings(
        field=given.text("field"),
        properties=tuple(map(PropertySettings, given.texts("properties"))),
        seed=given.whole("seed"),
        robots=given.whole("robots"),
        travel="graph",
        graph=given.text("graph") or None,
        speed_mps=given.number("speed_mps"),
        stop_overhead_s=given.number("stop_overhead_s"),
        turn_s_per_rad=given.number("turn_s_per_rad"),
        cadence_s=given.number("cadence_s"),
        footprint_m=given.number("footprint_m"),
        position_sd_m=given.number("position_sd_m"),
        weather=given.flag("weather"),
    )
