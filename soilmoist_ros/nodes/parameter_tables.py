# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the parameters of the nodes; ``scripts/parameter_tables`` makes documents and files from them.

The table of the planner is in ``planner_parameters``, with the settings that are made of it.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

from soilmoist_ros.mapping import StampLimits
from soilmoist_ros.nodes.parameters import Parameter, Parameters, Value
from soilmoist_ros.sensing import FORMAT_NAME
from soilmoist_ros.simulation import PRESETS, SETTINGS, MissionSettings, PropertySettings


def row(
    name: str,
    default: Value,
    description: str,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    **more: Any,
) -> Parameter:
    """Row of a table, see :class:`Parameter`."""
    return Parameter(name=name, default=default, description=description, unit=unit, low=low, high=high, **more)


def of_setting(name: str, **changes: Any) -> Parameter:
    """Row of a setting that nodes share with simulated missions."""
    setting = SETTINGS[name]
    about: dict[str, Any] = {
        "default": PRESETS["recommended"].get(name, setting.default),
        "description": (setting.help[:1].lower() + setting.help[1:]).rstrip("."),
        "unit": setting.unit,
        "low": setting.low,
        "choices": tuple(setting.registered()) if setting.registered else setting.choices,
    }
    return Parameter(name=name, **(about | changes))


def table_of(node: str) -> tuple[Parameter, ...]:
    """Table of a node."""
    planner = "soilmoist_ros.nodes.planner_parameters"
    found: tuple[Parameter, ...] = import_module(planner).PARAMETERS if node == "planner" else TABLES[node]
    return found


# Rows that several nodes share ----------------------------------------------------------------------------------

EARLIER: Final = row("earlier", [], "earlier runs of the field whose counts inform map and plan: output folders, "
    "recordings, or folders of such; mapper and planner need the same ones", live=True)  # fmt: skip
COVARIATES: Final = row("covariates", [], "files that may explain the map, as FILE or FILE:BAND, in addition to "
    "those of the field file: rasters, what is derived from elevations, polygons; mapper and planner need the "
    "same ones", live=True)  # fmt: skip
_STAMPS = StampLimits()
STAMP_LIMITS: Final = (
    row("max_stamp_ahead_s", _STAMPS.max_ahead_s, "records stamped farther in the future are skipped; 0 for no "
        "limit", "s", 0),
    row("max_stamp_age_s", _STAMPS.max_age_s, "records stamped farther in the past are skipped; 0 for no limit",
        "s", 0),
)  # fmt: skip


def stamp_limits(parameters: Parameters) -> StampLimits:
    """Limits of the stamps, from the values of :data:`STAMP_LIMITS`."""
    return StampLimits(parameters.number("max_stamp_ahead_s"), parameters.number("max_stamp_age_s"))


# The nodes ------------------------------------------------------------------------------------------------------

CONSOLE: Final = (
    row("field", "", "field file, or name of a shipped one"),
    row("host", "127.0.0.1", "address to listen on; 0.0.0.0 for all networks. From other machines the page is "
        "read-only, unless it is opened with the token that the console prints"),
    row("port", 8050, "TCP port of the page; 0 for a free one", low=0, high=65535),
    row("names", [], "host names under which the page is reached; addresses, localhost and the name of this "
        "computer are always allowed"),
    row("robots", [], "namespaces of the robots on the field; that of this node if empty"),
    row("runs", "recordings", "folder whose runs the page shows, and where comparisons are written"),
    row("field_dir", "fields", "folder of field files; drawn fields are saved there"),
    row("map_topic", "/topological_map_2", "topic of the navigation's map"),
)  # fmt: skip

FIELD_SIMULATOR: Final = (
    of_setting("field", description="surrogate field: a name, or a field file with a truth"),
    row("properties", [], "surrogate fields whose rates are the truth of further properties, on the same "
        "ground; the records of each are published on NAME/counts with the NAME of the field"),
    of_setting("seed"),
    of_setting("robots", high=30, description="number of robots; several have the namespaces robot_1, robot_2, "
        "... below that of this node"),
    row("speed", 60.0, "simulated time per wall time", low=0.01, high=10000.0),
    row("start_time", "2026-06-01T06:00:00Z", "simulated time at the start, ISO 8601"),
    row("start_when_connected", True, "whether time stands still until loggers, receivers and the records of "
        "each property have a receiver"),
    row("wait_limit_s", 120.0, "longest time for which simulated time stands still for a planner; what a "
        "simulated fault has swallowed is waited for in vain", "s", 0.0),
    row("graph", "", "topological map, a file; empty for a lattice of about 300 nodes"),
    row("host", "127.0.0.1", "address on which logger and receiver are served"),
    row("logger_port", 4001, "TCP port of the logger, two higher for each further robot; 0 for a free one",
        low=0, high=65535),
    row("gnss_port", 4002, "TCP port of the receiver, two higher for each further robot; 0 for a free one",
        low=0, high=65535),
    row("ports_file", "", "file to which the actual ports are written, as JSON: logger and gnss, with several "
        "robots robot_1/logger ...; empty for none"),
    of_setting("speed_mps", low=0.01, high=100.0),
    of_setting("stop_overhead_s"),
    of_setting("cadence_s", low=1.0, high=3600.0),
    row("gnss_period_s", 1.0, "time between epochs of the receiver", "s", 0.05, 60.0),
    of_setting("position_sd_m"),
    of_setting("footprint_m"),
    of_setting("weather"),
    row("scenario", "", "faults of navigation, links and sensor: a name or a file; empty for none"),
)  # fmt: skip

MAPPER: Final = (
    row("field", "", "field file, or the name of a shipped one", live=True),
    row("site", "", "site file, or the name of a shipped one; empty for a rate map only"),
    row("cell_m", 0.0, "cell size of the map; 0 for the cell size of the field file", "m", 0),
    of_setting("model", description="variogram model"),
    of_setting("fit"),
    of_setting("noise"),
    of_setting("drift_model"),
    of_setting("prior", default=""),
    row("keep_nugget", True, "whether the map includes the micro-scale variation (the nugget)"),
    row("merge_radius_m", 0.0, "records within this distance become one sample; 0 for a radius chosen from "
        "footprint and extent of the field", "m", 0, 1000),
    *STAMP_LIMITS,
    row("frame", "map", "frame of all published messages"),
    row("start_from", "", "save folder or bag whose records the map starts with; empty for none"),
    row("start_property", "", "property in start_from whose records the map starts with, as in the planner's "
        "properties; empty for the planner's own field"),
    EARLIER,
    COVARIATES,
    row("record_dir", "", "folder where driver and mapper store the records of this map, so that a restart "
        "continues it; empty to store none"),
    row("others", [], "namespaces of other robots on the field whose counts are mapped as well; the own "
        "namespace is ignored"),
    row("save_dir", "soilmoist_map", "folder that the service save writes to"),
    row("simulated", False, "whether the counts are simulated; every output is marked then"),
)  # fmt: skip

RECORDER: Final = (
    row("out", "recordings", "folder for bags; created if missing"),
    row("name", "", "name of the bag; its start time if empty"),
    row("include", ".*", "regular expression for the full names of topics to record"),
    row("exclude", "", "regular expression for the full names of topics to exclude; empty for none"),
    row("autostart", True, "whether to record from the start; otherwise the service recorder/start starts it"),
)  # fmt: skip

SENSOR_DRIVER: Final = (
    row("logger_uri", "tcp://127.0.0.1:4001", "address of the neutron logger: tcp://HOST:PORT, "
        "udp://0.0.0.0:PORT or serial:///dev/ttyUSB0?baud=115200"),
    row("logger_format", FORMAT_NAME, "name of a shipped logger format, or a file"),
    row("gnss_uri", "", "address of the GNSS receiver (NMEA), like logger_uri; empty to read fixes from the "
        "topic fix"),
    row("field", "", "field file, or the name of a shipped one"),
    row("site", "", "site file, or the name of a shipped one; empty for the defaults"),
    row("silence_limit_s", 35.0, "time without data after which the driver reconnects; to the logger after 3.5 "
        "record periods if these are longer", "s", 0.1, 86400.0),
    row("fix_wait_s", 2.0, "longest wait of a record for a fix from after the middle of its interval", "s", 0.0,
        60.0),
    row("record_dir", "", "folder where records are stored before they are published, for mappers with the same "
        "folder, and the logger's last header, for a driver that is started again; empty to store none"),
    row("frame_id", "map", "frame of the records: east, north, up about the datum"),
    row("sensor_frame", "crs", "frame of the weather sensors"),
    row("gnss_frame", "gnss", "frame of the GNSS antenna"),
)  # fmt: skip
WATCHDOG: Final = (
    row("pose_action", "", "action of which all goals are taken for the planner's, such as navigate_to_pose, "
        "where the planner's navigator is goal_pose; goals that it sends itself are known"),
    row("silent_s", 0.8, "longest time between two heartbeats of the planner, which come every 0.2 s", "s",
        0.3, 60),
    row("heartbeats", [], "further heartbeats (std_msgs/Bool) without which the robot must not drive, such as "
        "/safety/heartbeat; one that is false, silent or missing cancels the goals"),
    row("heartbeat_silent_s", 2.0, "longest time between two messages of one of heartbeats", "s", 0.1, 60),
    row("heartbeat_out", "", "topic for others, such as /warning/heartbeat: true every second while the planner "
        "is heard and nothing is cancelled; empty for none"),
)  # fmt: skip
DRIVER_SETTINGS: Final = ("logger_uri", "logger_format", "gnss_uri", "silence_limit_s", "fix_wait_s")
"""Parameters of the driver that are fields of :class:`DriverSettings`."""
TABLES: Final = {
    "console": CONSOLE,
    "field_simulator": FIELD_SIMULATOR,
    "mapper": MAPPER,
    "recorder": RECORDER,
    "sensor_driver": SENSOR_DRIVER,
    "watchdog": WATCHDOG,
}


def mission_settings(given: Parameters) -> MissionSettings:
    """Settings of the simulated field, robot and devices, as for a simulation without ROS."""
    return MissionSettings(
        field=given.text("field"), properties=tuple(map(PropertySettings, given.texts("properties"))),
        seed=given.whole("seed"), robots=given.whole("robots"), travel="graph", graph=given.text("graph") or None,
        speed_mps=given.number("speed_mps"), stop_overhead_s=given.number("stop_overhead_s"),
        cadence_s=given.number("cadence_s"), footprint_m=given.number("footprint_m"),
        position_sd_m=given.number("position_sd_m"), weather=given.flag("weather"),
    )  # fmt: skip
