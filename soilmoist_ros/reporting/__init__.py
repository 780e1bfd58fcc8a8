"""What a mapping run leaves behind: figures, HTML report, GeoTIFF, GeoJSON and a summary."""

from soilmoist_ros.reporting.files.geojson import write_samples
from soilmoist_ros.reporting.files.geotiff import write_geotiff
from soilmoist_ros.reporting.files.summary import summary, write_summary
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.page.report import write_report
from soilmoist_ros.reporting.run import CalibrationInfo, CorrectionRow, InputFile, LossRow, MapRun

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
