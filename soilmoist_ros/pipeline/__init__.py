# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps recorded runs and the logs of a survey."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.pipeline.bag_map import Replay as Replay, ReplaySettings as ReplaySettings, replay_bag as replay_bag
    from soilmoist_ros.pipeline.map_certificate import Certificate as Certificate, certify as certify, run_certificate as run_certificate
    from soilmoist_ros.pipeline.earlier_runs import EARLIER as EARLIER, MAX_AHEAD_S as MAX_AHEAD_S, EarlierTarget as EarlierTarget, earlier_doubts as earlier_doubts, find_runs as find_runs, mean_rate as mean_rate, mission_earlier as mission_earlier, read_earlier_runs as read_earlier_runs, read_run as read_run, run_change as run_change, simulated_runs as simulated_runs
    from soilmoist_ros.pipeline.field_survey import FieldSurvey as FieldSurvey, make_run as make_run, open_survey as open_survey, planning_curve as planning_curve, planning_thresholds as planning_thresholds, site_facts as site_facts
    from soilmoist_ros.pipeline.file_facts import FileFinding as FileFinding, contradictions as contradictions, field_findings as field_findings, graph_findings as graph_findings, log_findings as log_findings, logger_findings as logger_findings, position_findings as position_findings, site_findings as site_findings, truth_findings as truth_findings
    from soilmoist_ros.pipeline.log_map import MapSettings as MapSettings, map_logs as map_logs, write_sensor_site as write_sensor_site
    from soilmoist_ros.pipeline.logs import log_positions as log_positions, log_times as log_times, position_source as position_source, read_logs as read_logs, read_track as read_track, reading_of as reading_of, skipped_text as skipped_text
    from soilmoist_ros.pipeline.results import REMEDY as REMEDY, calibration_method as calibration_method, curve_of as curve_of, is_illustrative as is_illustrative, read_features as read_features, read_summary as read_summary, shape_of as shape_of
    from soilmoist_ros.pipeline.run import EARLIEST_STAMP_S as EARLIEST_STAMP_S, CalibrationInfo as CalibrationInfo, EarlierRun as EarlierRun, FailedRun as FailedRun, LossRow as LossRow, MapRun as MapRun, NoMapError as NoMapError, Note as Note, NoteCode as NoteCode, RunChange as RunChange, date_text as date_text, inside_boundary as inside_boundary, local_time as local_time, track_xy as track_xy
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "bag_map": "Replay ReplaySettings replay_bag",
        "map_certificate": "Certificate certify run_certificate",
        "earlier_runs": "EARLIER EarlierTarget MAX_AHEAD_S earlier_doubts find_runs mean_rate mission_earlier read_earlier_runs read_run run_change simulated_runs",
        "field_survey": "FieldSurvey make_run open_survey planning_curve planning_thresholds site_facts",
        "file_facts": "FileFinding contradictions field_findings graph_findings log_findings logger_findings position_findings site_findings truth_findings",
        "log_map": "MapSettings map_logs write_sensor_site",
        "logs": "log_positions log_times position_source read_logs read_track reading_of skipped_text",
        "results": "REMEDY calibration_method curve_of is_illustrative read_features read_summary shape_of",
        "run": "CalibrationInfo EARLIEST_STAMP_S EarlierRun FailedRun LossRow MapRun NoMapError Note NoteCode RunChange date_text inside_boundary local_time track_xy",
    },
)
