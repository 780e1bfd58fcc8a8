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

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.sensing.checks.record_checks import unlikely_weather as unlikely_weather
    from soilmoist_ros.sensing.corrections.factors import Corrections as Corrections
    from soilmoist_ros.sensing.corrections.factors import standard_pressure_hpa as standard_pressure_hpa
    from soilmoist_ros.sensing.corrections.intensity import LatestIntensity as LatestIntensity
    from soilmoist_ros.sensing.corrections.intensity import NeutronMonitor as NeutronMonitor
    from soilmoist_ros.sensing.corrections.reference import Reference as Reference
    from soilmoist_ros.sensing.corrections.reference import fit_reference as fit_reference
    from soilmoist_ros.sensing.corrections.settings import CorrectionSettings as CorrectionSettings
    from soilmoist_ros.sensing.corrections.settings import IntensityCorrection as IntensityCorrection
    from soilmoist_ros.sensing.formats.draft import draft_format as draft_format
    from soilmoist_ros.sensing.formats.log_layout import LogHeader as LogHeader
    from soilmoist_ros.sensing.formats.logger_format import LoggerFormat as LoggerFormat
    from soilmoist_ros.sensing.formats.logger_format import load_logger_format as load_logger_format
    from soilmoist_ros.sensing.formats.logger_format import logger_names as logger_names
    from soilmoist_ros.sensing.formats.logger_format import logger_path as logger_path
    from soilmoist_ros.sensing.formats.logger_reader import LogFile as LogFile
    from soilmoist_ros.sensing.formats.logger_reader import detect_format as detect_format
    from soilmoist_ros.sensing.formats.logger_reader import format_of_lines as format_of_lines
    from soilmoist_ros.sensing.formats.logger_reader import parse_log as parse_log
    from soilmoist_ros.sensing.formats.logger_reader import read_log as read_log
    from soilmoist_ros.sensing.formats.notation import UndecidedOrderError as UndecidedOrderError
    from soilmoist_ros.sensing.formats.notation import matching_formats as matching_formats
    from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME as FORMAT_NAME
    from soilmoist_ros.sensing.formats.robot_logger import RECORDS_PER_HEADER as RECORDS_PER_HEADER
    from soilmoist_ros.sensing.formats.robot_logger import TUBES as TUBES
    from soilmoist_ros.sensing.formats.robot_logger import format_header as format_header
    from soilmoist_ros.sensing.formats.robot_logger import format_record as format_record
    from soilmoist_ros.sensing.gnss import FIX_TYPE as FIX_TYPE
    from soilmoist_ros.sensing.gnss import UNKNOWN_COVARIANCE as UNKNOWN_COVARIANCE
    from soilmoist_ros.sensing.gnss import Covariance as Covariance
    from soilmoist_ros.sensing.gnss import CovarianceKind as CovarianceKind
    from soilmoist_ros.sensing.gnss import Fix as Fix
    from soilmoist_ros.sensing.gnss import FixStatus as FixStatus
    from soilmoist_ros.sensing.gnss import Heard as Heard
    from soilmoist_ros.sensing.gnss import clock_words as clock_words
    from soilmoist_ros.sensing.gnss import fix_from_message as fix_from_message
    from soilmoist_ros.sensing.gnss import stamp_of as stamp_of
    from soilmoist_ros.sensing.gnss import utc_text as utc_text
    from soilmoist_ros.sensing.lines import log_files as log_files
    from soilmoist_ros.sensing.lines import read_data as read_data
    from soilmoist_ros.sensing.lines import split_lines as split_lines
    from soilmoist_ros.sensing.moisture.combined import DISAGREEMENT_SD as DISAGREEMENT_SD
    from soilmoist_ros.sensing.moisture.combined import PROFILE_SD as PROFILE_SD
    from soilmoist_ros.sensing.moisture.combined import CombinedN0 as CombinedN0
    from soilmoist_ros.sensing.moisture.combined import N0Source as N0Source
    from soilmoist_ros.sensing.moisture.combined import combine_n0 as combine_n0
    from soilmoist_ros.sensing.moisture.combined import combined_calibration as combined_calibration
    from soilmoist_ros.sensing.moisture.combined import difference_sd as difference_sd
    from soilmoist_ros.sensing.moisture.combined import earlier_source as earlier_source
    from soilmoist_ros.sensing.moisture.combined import level_vwc_sd as level_vwc_sd
    from soilmoist_ros.sensing.moisture.cores import SoilCore as SoilCore
    from soilmoist_ros.sensing.moisture.cores import possible_days as possible_days
    from soilmoist_ros.sensing.moisture.cores import profiles_of as profiles_of
    from soilmoist_ros.sensing.moisture.cores import read_soil_cores as read_soil_cores
    from soilmoist_ros.sensing.moisture.curve import CalibrationCurve as CalibrationCurve
    from soilmoist_ros.sensing.moisture.curve import MoistureCurve as MoistureCurve
    from soilmoist_ros.sensing.moisture.curve import SoilLimits as SoilLimits
    from soilmoist_ros.sensing.moisture.curve import UniversalCurve as UniversalCurve
    from soilmoist_ros.sensing.moisture.curve import soil_limits as soil_limits
    from soilmoist_ros.sensing.moisture.footprint import CoreMean as CoreMean
    from soilmoist_ros.sensing.moisture.footprint import Footprint as Footprint
    from soilmoist_ros.sensing.moisture.footprint import SensedSoil as SensedSoil
    from soilmoist_ros.sensing.moisture.footprint import Weighting as Weighting
    from soilmoist_ros.sensing.moisture.footprint import mean_of_cores as mean_of_cores
    from soilmoist_ros.sensing.moisture.footprint import sensed_soil as sensed_soil
    from soilmoist_ros.sensing.moisture.general import DAY_SD as DAY_SD
    from soilmoist_ros.sensing.moisture.general import GENERAL_SD as GENERAL_SD
    from soilmoist_ros.sensing.moisture.general import SENSITIVITIES as SENSITIVITIES
    from soilmoist_ros.sensing.moisture.general import SurveyAir as SurveyAir
    from soilmoist_ros.sensing.moisture.general import general_calibration as general_calibration
    from soilmoist_ros.sensing.moisture.general import named_sensor as named_sensor
    from soilmoist_ros.sensing.moisture.general import sensitivity_of as sensitivity_of
    from soilmoist_ros.sensing.moisture.general import unknown_sensor as unknown_sensor
    from soilmoist_ros.sensing.moisture.general import why_no_soil as why_no_soil
    from soilmoist_ros.sensing.moisture.site import UNKNOWN_SENSOR as UNKNOWN_SENSOR
    from soilmoist_ros.sensing.moisture.site import Calibration as Calibration
    from soilmoist_ros.sensing.moisture.site import Irrigation as Irrigation
    from soilmoist_ros.sensing.moisture.site import N0Estimate as N0Estimate
    from soilmoist_ros.sensing.moisture.site import SensorModel as SensorModel
    from soilmoist_ros.sensing.moisture.site import Site as Site
    from soilmoist_ros.sensing.moisture.site import Soil as Soil
    from soilmoist_ros.sensing.moisture.site import UncertaintyPart as UncertaintyPart
    from soilmoist_ros.sensing.moisture.site import estimate_n0 as estimate_n0
    from soilmoist_ros.sensing.moisture.site import load_site as load_site
    from soilmoist_ros.sensing.moisture.site import n0_in_other_time as n0_in_other_time
    from soilmoist_ros.sensing.moisture.site import unusual_n0 as unusual_n0
    from soilmoist_ros.sensing.moisture.site import write_calibration as write_calibration
    from soilmoist_ros.sensing.moisture.site import write_site_values as write_site_values
    from soilmoist_ros.sensing.moisture.texture import TEXTURES as TEXTURES
    from soilmoist_ros.sensing.moisture.texture import SoilTexture as SoilTexture
    from soilmoist_ros.sensing.position.nmea import parse_nmea as parse_nmea
    from soilmoist_ros.sensing.position.place_doubt import DOUBTS as DOUBTS
    from soilmoist_ros.sensing.position.place_doubt import Doubt as Doubt
    from soilmoist_ros.sensing.position.place_doubt import Doubts as Doubts
    from soilmoist_ros.sensing.position.place_doubt import none_since as none_since
    from soilmoist_ros.sensing.position.place_doubt import placed_of_any as placed_of_any
    from soilmoist_ros.sensing.position.place_judge import REPEATED_M as REPEATED_M
    from soilmoist_ros.sensing.position.place_judge import Expected as Expected
    from soilmoist_ros.sensing.position.place_judge import PlaceAges as PlaceAges
    from soilmoist_ros.sensing.position.place_judge import PlaceFix as PlaceFix
    from soilmoist_ros.sensing.position.place_judge import PlaceJudge as PlaceJudge
    from soilmoist_ros.sensing.position.place_judge import PlaceLimits as PlaceLimits
    from soilmoist_ros.sensing.position.place_judge import Verdict as Verdict
    from soilmoist_ros.sensing.position.track import NO_ARMS as NO_ARMS
    from soilmoist_ros.sensing.position.track import CheckedTrack as CheckedTrack
    from soilmoist_ros.sensing.position.track import LeverArms as LeverArms
    from soilmoist_ros.sensing.position.track import Track as Track
    from soilmoist_ros.sensing.position.track import distance_m as distance_m
    from soilmoist_ros.sensing.position.track_file import read_positions as read_positions
    from soilmoist_ros.sensing.problems import Consequence as Consequence
    from soilmoist_ros.sensing.problems import Kind as Kind
    from soilmoist_ros.sensing.problems import Problem as Problem
    from soilmoist_ros.sensing.problems import Severity as Severity
    from soilmoist_ros.sensing.problems import reason_text as reason_text
    from soilmoist_ros.sensing.records import FIRST_STAMP_S as FIRST_STAMP_S
    from soilmoist_ros.sensing.records import LAST_STAMP_S as LAST_STAMP_S
    from soilmoist_ros.sensing.records import CountRecord as CountRecord
    from soilmoist_ros.sensing.records import LoggerRecord as LoggerRecord
    from soilmoist_ros.sensing.records import Position as Position
    from soilmoist_ros.sensing.survey.correction import intensity_source as intensity_source
    from soilmoist_ros.sensing.survey.correction import unusual_factors as unusual_factors
    from soilmoist_ros.sensing.survey.driver import Batch as Batch
    from soilmoist_ros.sensing.survey.driver import Driver as Driver
    from soilmoist_ros.sensing.survey.driver import DriverSettings as DriverSettings
    from soilmoist_ros.sensing.survey.driver import logger_fault as logger_fault
    from soilmoist_ros.sensing.survey.logs import CalibrationCounts as CalibrationCounts
    from soilmoist_ros.sensing.survey.logs import SurveyRecords as SurveyRecords
    from soilmoist_ros.sensing.survey.logs import calibration_counts as calibration_counts
    from soilmoist_ros.sensing.survey.logs import log_doubts as log_doubts
    from soilmoist_ros.sensing.survey.logs import process_logs as process_logs
    from soilmoist_ros.sensing.survey.logs import stationary_records as stationary_records
    from soilmoist_ros.sensing.survey.logs import why_unplaced as why_unplaced
    from soilmoist_ros.sensing.survey.side_by_side import SideBySide as SideBySide
    from soilmoist_ros.sensing.survey.side_by_side import compare_side_by_side as compare_side_by_side

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "checks.record_checks": "unlikely_weather",
        "corrections.factors": "Corrections standard_pressure_hpa",
        "corrections.intensity": "LatestIntensity NeutronMonitor",
        "corrections.reference": "Reference fit_reference",
        "corrections.settings": "CorrectionSettings IntensityCorrection",
        "formats.draft": "draft_format",
        "formats.log_layout": "LogHeader",
        "formats.logger_format": "LoggerFormat load_logger_format logger_names logger_path",
        "formats.logger_reader": "LogFile detect_format format_of_lines parse_log read_log",
        "formats.notation": "UndecidedOrderError matching_formats",
        "formats.robot_logger": "FORMAT_NAME RECORDS_PER_HEADER TUBES format_header format_record",
        "gnss": "Covariance CovarianceKind FIX_TYPE Fix FixStatus Heard UNKNOWN_COVARIANCE clock_words fix_from_message stamp_of utc_text",
        "lines": "log_files read_data split_lines",
        "moisture.combined": "DISAGREEMENT_SD PROFILE_SD CombinedN0 N0Source combine_n0 combined_calibration difference_sd earlier_source level_vwc_sd",
        "moisture.cores": "SoilCore possible_days profiles_of read_soil_cores",
        "moisture.curve": "CalibrationCurve MoistureCurve SoilLimits UniversalCurve soil_limits",
        "moisture.footprint": "CoreMean Footprint SensedSoil Weighting mean_of_cores sensed_soil",
        "moisture.general": "DAY_SD GENERAL_SD SENSITIVITIES SurveyAir general_calibration named_sensor sensitivity_of unknown_sensor why_no_soil",
        "moisture.site": "UNKNOWN_SENSOR Calibration Irrigation N0Estimate SensorModel Site Soil UncertaintyPart estimate_n0 load_site n0_in_other_time unusual_n0 write_calibration write_site_values",
        "moisture.texture": "SoilTexture TEXTURES",
        "position.nmea": "parse_nmea",
        "position.place_doubt": "DOUBTS Doubt Doubts none_since placed_of_any",
        "position.place_judge": "Expected PlaceAges PlaceFix PlaceJudge PlaceLimits REPEATED_M Verdict",
        "position.track": "CheckedTrack LeverArms NO_ARMS Track distance_m",
        "position.track_file": "read_positions",
        "problems": "Consequence Kind Problem Severity reason_text",
        "records": "CountRecord FIRST_STAMP_S LAST_STAMP_S LoggerRecord Position",
        "survey.correction": "intensity_source unusual_factors",
        "survey.driver": "Batch Driver DriverSettings logger_fault",
        "survey.logs": "CalibrationCounts SurveyRecords calibration_counts log_doubts process_logs stationary_records why_unplaced",
        "survey.side_by_side": "SideBySide compare_side_by_side",
    },
)
