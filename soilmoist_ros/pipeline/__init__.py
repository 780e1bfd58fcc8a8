# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps recorded runs and the logs of a survey."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.pipeline.bag_map import Replay as Replay
    from soilmoist_ros.pipeline.bag_map import ReplaySettings as ReplaySettings
    from soilmoist_ros.pipeline.bag_map import replay_bag as replay_bag
    from soilmoist_ros.pipeline.earlier_runs import EARLIER as EARLIER
    from soilmoist_ros.pipeline.earlier_runs import MAX_AHEAD_S as MAX_AHEAD_S
    from soilmoist_ros.pipeline.earlier_runs import EarlierTarget as EarlierTarget
    from soilmoist_ros.pipeline.earlier_runs import earlier_doubts as earlier_doubts
    from soilmoist_ros.pipeline.earlier_runs import find_runs as find_runs
    from soilmoist_ros.pipeline.earlier_runs import mean_rate as mean_rate
    from soilmoist_ros.pipeline.earlier_runs import mission_earlier as mission_earlier
    from soilmoist_ros.pipeline.earlier_runs import read_earlier_runs as read_earlier_runs
    from soilmoist_ros.pipeline.earlier_runs import read_run as read_run
    from soilmoist_ros.pipeline.earlier_runs import run_change as run_change
    from soilmoist_ros.pipeline.earlier_runs import simulated_runs as simulated_runs
    from soilmoist_ros.pipeline.field_survey import FieldSurvey as FieldSurvey
    from soilmoist_ros.pipeline.field_survey import make_run as make_run
    from soilmoist_ros.pipeline.field_survey import open_survey as open_survey
    from soilmoist_ros.pipeline.field_survey import site_facts as site_facts
    from soilmoist_ros.pipeline.file_facts import FileFinding as FileFinding
    from soilmoist_ros.pipeline.file_facts import contradictions as contradictions
    from soilmoist_ros.pipeline.file_facts import field_findings as field_findings
    from soilmoist_ros.pipeline.file_facts import graph_findings as graph_findings
    from soilmoist_ros.pipeline.file_facts import log_findings as log_findings
    from soilmoist_ros.pipeline.file_facts import logger_findings as logger_findings
    from soilmoist_ros.pipeline.file_facts import position_findings as position_findings
    from soilmoist_ros.pipeline.file_facts import site_findings as site_findings
    from soilmoist_ros.pipeline.file_facts import truth_findings as truth_findings
    from soilmoist_ros.pipeline.log_map import MapSettings as MapSettings
    from soilmoist_ros.pipeline.log_map import map_logs as map_logs
    from soilmoist_ros.pipeline.logs import log_positions as log_positions
    from soilmoist_ros.pipeline.logs import log_times as log_times
    from soilmoist_ros.pipeline.logs import position_source as position_source
    from soilmoist_ros.pipeline.logs import read_logs as read_logs
    from soilmoist_ros.pipeline.logs import read_track as read_track
    from soilmoist_ros.pipeline.logs import reading_of as reading_of
    from soilmoist_ros.pipeline.logs import skipped_text as skipped_text
    from soilmoist_ros.pipeline.properties import PropertyComparison as PropertyComparison
    from soilmoist_ros.pipeline.results import REMEDY as REMEDY
    from soilmoist_ros.pipeline.results import calibration_method as calibration_method
    from soilmoist_ros.pipeline.results import curve_of as curve_of
    from soilmoist_ros.pipeline.results import is_illustrative as is_illustrative
    from soilmoist_ros.pipeline.results import read_features as read_features
    from soilmoist_ros.pipeline.results import read_summary as read_summary
    from soilmoist_ros.pipeline.results import shape_of as shape_of
    from soilmoist_ros.pipeline.run import EARLIEST_STAMP_S as EARLIEST_STAMP_S
    from soilmoist_ros.pipeline.run import REFERENCE as REFERENCE
    from soilmoist_ros.pipeline.run import CalibrationInfo as CalibrationInfo
    from soilmoist_ros.pipeline.run import EarlierRun as EarlierRun
    from soilmoist_ros.pipeline.run import FailedRun as FailedRun
    from soilmoist_ros.pipeline.run import LossRow as LossRow
    from soilmoist_ros.pipeline.run import MapRun as MapRun
    from soilmoist_ros.pipeline.run import NoMapError as NoMapError
    from soilmoist_ros.pipeline.run import Note as Note
    from soilmoist_ros.pipeline.run import NoteCode as NoteCode
    from soilmoist_ros.pipeline.run import RunChange as RunChange
    from soilmoist_ros.pipeline.run import date_text as date_text
    from soilmoist_ros.pipeline.run import local_time as local_time
    from soilmoist_ros.pipeline.run import track_xy as track_xy

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "bag_map": "Replay ReplaySettings replay_bag",
        "earlier_runs": "EARLIER EarlierTarget MAX_AHEAD_S earlier_doubts find_runs mean_rate mission_earlier read_earlier_runs read_run run_change simulated_runs",
        "field_survey": "FieldSurvey make_run open_survey site_facts",
        "file_facts": "FileFinding contradictions field_findings graph_findings log_findings logger_findings position_findings site_findings truth_findings",
        "log_map": "MapSettings map_logs",
        "logs": "log_positions log_times position_source read_logs read_track reading_of skipped_text",
        "properties": "PropertyComparison",
        "results": "REMEDY calibration_method curve_of is_illustrative read_features read_summary shape_of",
        "run": "CalibrationInfo EARLIEST_STAMP_S EarlierRun FailedRun LossRow MapRun NoMapError Note NoteCode REFERENCE RunChange date_text local_time track_xy",
    },
)
