"""The model of a run with its maps, and its outputs: report, GeoTIFF, GeoJSON, tables and summary."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

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

_MODULES = {
    "FieldSurvey": "field_survey",
    "MapRun": "run",
    "OpenedRun": "opened_run",
    "open_run": "opened_run",
    "open_survey": "field_survey",
    "summary": "files.summary",
    "write_campaign_report": "campaign.report",
    "write_geotiff": "files.geotiff",
    "write_mission": "mission_report",
    "write_outputs": "outputs",
    "write_report": "page.report",
    "write_samples": "files.geojson",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
