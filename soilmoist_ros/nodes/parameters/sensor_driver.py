# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of ``sensor_driver``."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.declaration import Parameter
from soilmoist_ros.nodes.parameters.lever_arms import ANTENNA, SENSOR
from soilmoist_ros.sensing import FORMAT_NAME

PARAMETERS: Final = (
    Parameter(
        name="logger_uri",
        default="tcp://127.0.0.1:4001",
        description="address of the neutron logger: tcp://HOST:PORT, udp://0.0.0.0:PORT?from=ADDRESS, "
        "serial:///dev/ttyUSB0?baud=115200 or file:///PATH?speed=10; tcp and udp take interface=NAME of a network",
    ),
    Parameter(name="logger_format", default=FORMAT_NAME, description="name of a shipped logger format, or a file"),
    Parameter(
        name="gnss_uri",
        default="",
        description="address of the GNSS receiver (NMEA), like logger_uri; empty to read fixes from the topic fix",
    ),
    Parameter(name="field", default="", description="field file, or the name of a shipped one"),
    Parameter(
        name="site", default="", description="site file, or the name of a shipped one; empty for the defaults"
    ),
    Parameter(
        name="silence_limit_s",
        default=35.0,
        description="time without data after which the driver reconnects; to the logger after 3.5 record periods "
        "if these are longer",
        unit="s",
        low=0.1,
        high=86_400.0,
    ),
    Parameter(
        name="fix_wait_s",
        default=2.0,
        description="longest wait of a record for a fix from after the middle of its interval",
        unit="s",
        low=0.0,
        high=60.0,
    ),
    Parameter(
        name="intensity_topic",
        default="",
        description="topic of the incoming cosmic-ray intensity (std_msgs/Float64), in the unit of the site's "
        "reference; empty to use only the site file",
    ),
    Parameter(
        name="record_dir",
        default="",
        description="folder where records are stored before they are published, for mappers with the same folder, "
        "and the logger's last header, for a driver that is started again; "
        "empty to store none",
    ),
    Parameter(name="frame_id", default="map", description="frame of the records: east, north, up about the datum"),
    Parameter(name="sensor_frame", default="crs", description="frame of the weather sensors"),
    Parameter(name="gnss_frame", default="gnss", description="frame of the GNSS antenna"),
    *ANTENNA,
    *SENSOR,
    Parameter(
        name="autostart",
        default=True,
        description="whether the driver configures and activates itself at the start",
    ),
)
SETTINGS: Final = ("logger_uri", "logger_format", "gnss_uri", "silence_limit_s", "fix_wait_s")
"""Parameters that are fields of :class:`DriverSettings`."""
