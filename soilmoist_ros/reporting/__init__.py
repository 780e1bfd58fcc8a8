"""What a mapping run leaves behind: figures, HTML report, GeoTIFF, GeoJSON and a summary."""

from soilmoist_ros.reporting.geojson import write_samples
from soilmoist_ros.reporting.geotiff import write_geotiff
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.report import write_report
from soilmoist_ros.reporting.run import CalibrationInfo, CorrectionRow, InputFile, LossRow, MapRun
from soilmoist_ros.reporting.summary import summary, write_summary

__all__ = [
    "CalibrationInfo",
    "CorrectionRow",
    "InputFile",
    "LossRow",
    "MapRun",
    "summary",
    "write_geotiff",
    "write_outputs",
    "write_report",
    "write_samples",
    "write_summary",
]
