# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Logger bytes and NMEA sentences to corrected, geo-tagged records of neutron counts.

>>> from soilmoist_ros.sensing import load_site, process_logs, read_log
>>> site = load_site("gypsum_transect")
>>> log = read_log(
...     "examples/rover_gypsum_transect_2018-05-01.KSU",
...     longitude=site.longitude,
...     utc_offset_hours=site.logger_utc_offset_hours,
... )
>>> log
LogFile('rover_gypsum_transect_2018-05-01.KSU', 201 records, 0 lost)
>>> survey = process_logs([log], site)
>>> survey
SurveyRecords(200 records, 1 lost, 8 tubes)
>>> survey.records[0]
CountRecord(2018-05-01 14:15:00Z, x=4059.1 m, y=-4486.0 m, 305 counts, 5.68 counts/s)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.sensing.formats.logger_format import load_logger_format, logger_names
    from soilmoist_ros.sensing.formats.logger_reader import read_log
    from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
    from soilmoist_ros.sensing.moisture.site import Site, load_site
    from soilmoist_ros.sensing.position.nmea import read_nmea
    from soilmoist_ros.sensing.position.track import Track
    from soilmoist_ros.sensing.records import CountRecord, LoggerRecord
    from soilmoist_ros.sensing.survey.logs import process_logs
    from soilmoist_ros.sensing.survey.survey import Survey

__all__ = [
    "CalibrationCurve",
    "CountRecord",
    "LoggerRecord",
    "Site",
    "Survey",
    "Track",
    "load_logger_format",
    "load_site",
    "logger_names",
    "process_logs",
    "read_log",
    "read_nmea",
]

__getattr__ = load_on_use(__name__, __file__)
