# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Outputs of runs: report, GeoTIFF, GeoJSON, tables and summary."""

from importlib import import_module
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.reporting.budget import Budget as Budget, make_budget as make_budget
    from soilmoist_ros.reporting.certainty import has_no_level as has_no_level
    from soilmoist_ros.reporting.certified import certificate_of as certificate_of, check_certificate as check_certificate, sample_text as sample_text, statement_text as statement_text
    from soilmoist_ros.reporting.colours import DRY_TO_WET as DRY_TO_WET, RATE as RATE, UNCERTAIN as UNCERTAIN, between as between, palette_png as palette_png
    from soilmoist_ros.reporting.core_plan import CorePlan as CorePlan, LevelOfPlaces as LevelOfPlaces, n0_at_places as n0_at_places, plan_cores as plan_cores, write_plan as write_plan
    from soilmoist_ros.reporting.exports.registry import EXPORTS as EXPORTS, Export as Export, export_run as export_run
    from soilmoist_ros.reporting.exports.source import ExportSettings as ExportSettings, RunSource as RunSource, open_source as open_source
    from soilmoist_ros.reporting.geotiff import write_geotiff as write_geotiff
    from soilmoist_ros.reporting.live_view import LiveMission as LiveMission, LiveRobot as LiveRobot
    from soilmoist_ros.reporting.one_place import at_one_place as at_one_place, moisture_of_all as moisture_of_all
    from soilmoist_ros.reporting.opened_run import OpenedRun as OpenedRun, open_run as open_run
    from soilmoist_ros.reporting.output_folder import earlier_outputs as earlier_outputs, remove_earlier as remove_earlier, require_free as require_free
    from soilmoist_ros.reporting.outputs import mission_run as mission_run, write_failed as write_failed, write_mission as write_mission, write_outputs as write_outputs
    from soilmoist_ros.reporting.page.charts import Area as Area, Chart as Chart, ChartColour as ChartColour, Line as Line, Mark as Mark, limits_of as limits_of
    from soilmoist_ros.reporting.page.decision import decision as decision
    from soilmoist_ros.reporting.page.frame import dwell_text as dwell_text, length as length, number as number, plain as plain, render_page as render_page, strategy_text as strategy_text
    from soilmoist_ros.reporting.page.irrigation import dose_sentence as dose_sentence, irrigation as irrigation
    from soilmoist_ros.reporting.page.report import change_text as change_text, contribution as contribution, covariate_rows as covariate_rows, dated as dated, mission_sentences as mission_sentences, relations as relations
    from soilmoist_ros.reporting.page.statistics import mean_moisture as mean_moisture, truth_score as truth_score
    from soilmoist_ros.reporting.page.wording import facts as facts, notes as notes
    from soilmoist_ros.reporting.run_summary import summary as summary
    from soilmoist_ros.reporting.season import SeasonSettings as SeasonSettings, make_season as make_season
    from soilmoist_ros.reporting.season_outputs import estimate_text as estimate_text, write_season as write_season
    from soilmoist_ros.reporting.text_files import dumps as dumps, jsonable as jsonable
    # fmt: on

_open, __dir__, __all__ = open_door(
    __name__,
    {
        "budget": "Budget make_budget",
        "certainty": "has_no_level",
        "certified": "certificate_of check_certificate sample_text statement_text",
        "colours": "DRY_TO_WET RATE UNCERTAIN between palette_png",
        "core_plan": "CorePlan LevelOfPlaces n0_at_places plan_cores write_plan",
        "exports.registry": "EXPORTS Export export_run",
        "exports.source": "ExportSettings RunSource open_source",
        "geotiff": "write_geotiff",
        "live_view": "LiveMission LiveRobot",
        "one_place": "at_one_place moisture_of_all",
        "opened_run": "OpenedRun open_run",
        "output_folder": "earlier_outputs remove_earlier require_free",
        "outputs": "mission_run write_failed write_mission write_outputs",
        "page.charts": "Area Chart ChartColour Line Mark limits_of",
        "page.decision": "decision",
        "page.frame": "dwell_text length number plain render_page strategy_text",
        "page.irrigation": "dose_sentence irrigation",
        "page.report": "change_text contribution covariate_rows dated mission_sentences relations",
        "page.statistics": "mean_moisture truth_score",
        "page.wording": "facts notes",
        "run_summary": "summary",
        "season": "SeasonSettings make_season",
        "season_outputs": "estimate_text write_season",
        "text_files": "dumps jsonable",
    },
)


def __getattr__(name: str) -> object:
    """Name of this door; what has moved to another one is found here for one release."""
    if name in ("FieldSurvey", "MapRun", "open_survey"):
        return getattr(import_module("soilmoist_ros.pipeline"), name)
    if name == "write_campaign_report":
        return getattr(import_module("soilmoist_ros.lab"), name)
    return _open(name)
