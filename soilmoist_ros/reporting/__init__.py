# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs and their outputs: report, GeoTIFF, GeoJSON, tables and summary."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.reporting.campaign.report import write_campaign_report
    from soilmoist_ros.reporting.field_survey import FieldSurvey, open_survey
    from soilmoist_ros.reporting.files.geojson import write_samples
    from soilmoist_ros.reporting.files.geotiff import write_geotiff
    from soilmoist_ros.reporting.files.summary import summary
    from soilmoist_ros.reporting.mission_report import write_mission
    from soilmoist_ros.reporting.opened_run import OpenedRun, open_run
    from soilmoist_ros.reporting.outputs import write_outputs
    from soilmoist_ros.reporting.page.report import write_report
    from soilmoist_ros.reporting.run import MapRun

__all__ = [
    "FieldSurvey",
    "MapRun",
    "OpenedRun",
    "open_run",
    "open_survey",
    "summary",
    "write_campaign_report",
    "write_geotiff",
    "write_mission",
    "write_outputs",
    "write_report",
    "write_samples",
]

__getattr__ = load_on_use(__name__, __file__)
