# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Outputs of runs: report, GeoTIFF, GeoJSON, tables and summary."""

from importlib import import_module
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.reporting.colours import RATE as RATE
    from soilmoist_ros.reporting.colours import UNCERTAIN as UNCERTAIN
    from soilmoist_ros.reporting.colours import between as between
    from soilmoist_ros.reporting.colours import colour_ramp as colour_ramp
    from soilmoist_ros.reporting.colours import palette_png as palette_png
    from soilmoist_ros.reporting.exports.registry import EXPORTS as EXPORTS
    from soilmoist_ros.reporting.exports.registry import Export as Export
    from soilmoist_ros.reporting.exports.registry import export_kind as export_kind
    from soilmoist_ros.reporting.exports.registry import export_run as export_run
    from soilmoist_ros.reporting.exports.source import ExportSettings as ExportSettings
    from soilmoist_ros.reporting.exports.source import RunSource as RunSource
    from soilmoist_ros.reporting.failed_outputs import write_failed as write_failed
    from soilmoist_ros.reporting.figures.run_figures import run_figures as run_figures
    from soilmoist_ros.reporting.figures.season_figures import season_figures as season_figures
    from soilmoist_ros.reporting.figures.style import write_figures as write_figures
    from soilmoist_ros.reporting.files.geojson import write_samples as write_samples
    from soilmoist_ros.reporting.files.geotiff import write_geotiff as write_geotiff
    from soilmoist_ros.reporting.files.strict_json import dumps as dumps
    from soilmoist_ros.reporting.files.strict_json import jsonable as jsonable
    from soilmoist_ros.reporting.files.summary import summary as summary
    from soilmoist_ros.reporting.live.layouts import write_layouts as write_layouts
    from soilmoist_ros.reporting.live.live_mission import LiveMap as LiveMap
    from soilmoist_ros.reporting.live.live_mission import LiveMission as LiveMission
    from soilmoist_ros.reporting.live.live_mission import LiveRobot as LiveRobot
    from soilmoist_ros.reporting.live.terminal import DRY_TO_WET as DRY_TO_WET
    from soilmoist_ros.reporting.live.terminal import render as render
    from soilmoist_ros.reporting.mission_report import mission_run as mission_run
    from soilmoist_ros.reporting.mission_report import write_mission as write_mission
    from soilmoist_ros.reporting.moisture_steps import at_one_place as at_one_place
    from soilmoist_ros.reporting.moisture_steps import moisture_of_all as moisture_of_all
    from soilmoist_ros.reporting.moisture_steps import moisture_series as moisture_series
    from soilmoist_ros.reporting.opened_run import OpenedRun as OpenedRun
    from soilmoist_ros.reporting.opened_run import open_run as open_run
    from soilmoist_ros.reporting.output_folder import earlier_outputs as earlier_outputs
    from soilmoist_ros.reporting.output_folder import remove_earlier as remove_earlier
    from soilmoist_ros.reporting.output_folder import require_free as require_free
    from soilmoist_ros.reporting.output_folder import require_writable as require_writable
    from soilmoist_ros.reporting.output_folder import results_in as results_in
    from soilmoist_ros.reporting.outputs import write_outputs as write_outputs
    from soilmoist_ros.reporting.page.covariates import covariate_importance as covariate_importance
    from soilmoist_ros.reporting.page.earlier_section import change_amount as change_amount
    from soilmoist_ros.reporting.page.earlier_section import change_since as change_since
    from soilmoist_ros.reporting.page.earlier_section import change_summary as change_summary
    from soilmoist_ros.reporting.page.earlier_section import dated as dated
    from soilmoist_ros.reporting.page.earlier_section import relations as relations
    from soilmoist_ros.reporting.page.frame import render_page as render_page
    from soilmoist_ros.reporting.page.labels import dwell_text as dwell_text
    from soilmoist_ros.reporting.page.labels import strategy_text as strategy_text
    from soilmoist_ros.reporting.page.labels import strategy_traits as strategy_traits
    from soilmoist_ros.reporting.page.notes import notes as notes
    from soilmoist_ros.reporting.page.numbers import length as length
    from soilmoist_ros.reporting.page.numbers import number as number
    from soilmoist_ros.reporting.page.numbers import percent as percent
    from soilmoist_ros.reporting.page.numbers import plain as plain
    from soilmoist_ros.reporting.page.report import write_report as write_report
    from soilmoist_ros.reporting.page.statistics import mean_moisture as mean_moisture
    from soilmoist_ros.reporting.page.statistics import truth_score as truth_score
    from soilmoist_ros.reporting.page.style import robust_range as robust_range
    from soilmoist_ros.reporting.season.season import SeasonSettings as SeasonSettings
    from soilmoist_ros.reporting.season.season import make_season as make_season
    from soilmoist_ros.reporting.season.season_files import estimate_text as estimate_text
    from soilmoist_ros.reporting.season.season_files import write_season as write_season

_open, __dir__, __all__ = open_door(
    __name__,
    {
        "colours": "RATE UNCERTAIN between colour_ramp palette_png",
        "exports.registry": "EXPORTS Export export_kind export_run",
        "exports.source": "ExportSettings RunSource",
        "failed_outputs": "write_failed",
        "figures.run_figures": "run_figures",
        "figures.season_figures": "season_figures",
        "figures.style": "write_figures",
        "files.geojson": "write_samples",
        "files.geotiff": "write_geotiff",
        "files.strict_json": "dumps jsonable",
        "files.summary": "summary",
        "live.layouts": "write_layouts",
        "live.live_mission": "LiveMap LiveMission LiveRobot",
        "live.terminal": "DRY_TO_WET render",
        "mission_report": "mission_run write_mission",
        "moisture_steps": "at_one_place moisture_of_all moisture_series",
        "opened_run": "OpenedRun open_run",
        "output_folder": "earlier_outputs remove_earlier require_free require_writable results_in",
        "outputs": "write_outputs",
        "page.covariates": "covariate_importance",
        "page.earlier_section": "change_amount change_since change_summary dated relations",
        "page.frame": "render_page",
        "page.labels": "dwell_text strategy_text strategy_traits",
        "page.notes": "notes",
        "page.numbers": "length number percent plain",
        "page.report": "write_report",
        "page.statistics": "mean_moisture truth_score",
        "page.style": "robust_range",
        "season.season": "SeasonSettings make_season",
        "season.season_files": "estimate_text write_season",
    },
)


def __getattr__(name: str) -> object:
    """Name of this door; what has moved to another one is found here for one release."""
    if name in ("FieldSurvey", "MapRun", "open_survey"):
        return getattr(import_module("soilmoist_ros.pipeline"), name)
    if name == "write_campaign_report":
        return getattr(import_module("soilmoist_ros.lab"), name)
    return _open(name)
