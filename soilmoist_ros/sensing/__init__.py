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
    # fmt: off
    from soilmoist_ros.sensing.checks.record_checks import unlikely_weather as unlikely_weather
    from soilmoist_ros.sensing.corrections.factors import Corrections as Corrections, standard_pressure_hpa as standard_pressure_hpa
    from soilmoist_ros.sensing.corrections.intensity import NeutronMonitor as NeutronMonitor
    from soilmoist_ros.sensing.corrections.settings import CorrectionSettings as CorrectionSettings, IntensityCorrection as IntensityCorrection
    from soilmoist_ros.sensing.formats.draft import draft_format as draft_format
    from soilmoist_ros.sensing.formats.log_layout import LogHeader as LogHeader
    from soilmoist_ros.sensing.formats.logger_format import LoggerFormat as LoggerFormat, load_logger_format as load_logger_format, logger_names as logger_names, logger_path as logger_path
    from soilmoist_ros.sensing.formats.logger_reader import LogFile as LogFile, detect_format as detect_format, format_of_lines as format_of_lines, parse_log as parse_log, read_log as read_log
    from soilmoist_ros.sensing.formats.notation import UndecidedOrderError as UndecidedOrderError
    from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME as FORMAT_NAME, RECORDS_PER_HEADER as RECORDS_PER_HEADER, TUBES as TUBES, format_header as format_header, format_record as format_record
    from soilmoist_ros.sensing.gnss import FIX_TYPE as FIX_TYPE, UNKNOWN_COVARIANCE as UNKNOWN_COVARIANCE, Covariance as Covariance, CovarianceKind as CovarianceKind, Fix as Fix, FixStatus as FixStatus, Heard as Heard, clock_words as clock_words, fix_from_message as fix_from_message, stamp_of as stamp_of
    from soilmoist_ros.sensing.lines import log_files as log_files, split_lines as split_lines
    from soilmoist_ros.sensing.moisture.combined import DISAGREEMENT_SD as DISAGREEMENT_SD, PROFILE_DENSITY_SD_GCM3 as PROFILE_DENSITY_SD_GCM3, PROFILE_SD as PROFILE_SD, N0Source as N0Source, combine_n0 as combine_n0, combined_calibration as combined_calibration, difference_sd as difference_sd, earlier_source as earlier_source
    from soilmoist_ros.sensing.moisture.cores import SoilCore as SoilCore, possible_days as possible_days, profiles_of as profiles_of, read_soil_cores as read_soil_cores
    from soilmoist_ros.sensing.moisture.curve import CalibrationCurve as CalibrationCurve, MoistureCurve as MoistureCurve, SoilLimits as SoilLimits, UniversalCurve as UniversalCurve, soil_limits as soil_limits
    from soilmoist_ros.sensing.moisture.footprint import CoreMean as CoreMean, Footprint as Footprint, SensedSoil as SensedSoil, Weighting as Weighting, bare_radius_m as bare_radius_m, mean_of_cores as mean_of_cores, sensed_soil as sensed_soil
    from soilmoist_ros.sensing.moisture.general import DAY_SD as DAY_SD, DENSITY_ERROR as DENSITY_ERROR, GENERAL_SD as GENERAL_SD, GIVEN_SD as GIVEN_SD, SCALING_SD as SCALING_SD, SENSITIVITIES as SENSITIVITIES, SurveyAir as SurveyAir, general_calibration as general_calibration, named_sensor as named_sensor, sensitivity_of as sensitivity_of, soil_of as soil_of, unknown_sensor as unknown_sensor, unknown_share as unknown_share, why_no_soil as why_no_soil
    from soilmoist_ros.sensing.moisture.site import UNKNOWN_SENSOR as UNKNOWN_SENSOR, Calibration as Calibration, Irrigation as Irrigation, N0Estimate as N0Estimate, SensorModel as SensorModel, Site as Site, Soil as Soil, UncertaintyPart as UncertaintyPart, estimate_n0 as estimate_n0, load_site as load_site, n0_in_other_time as n0_in_other_time, unusual_n0 as unusual_n0, write_calibration as write_calibration, write_site_values as write_site_values
    from soilmoist_ros.sensing.position.nmea import nmea_sentences as nmea_sentences, parse_nmea as parse_nmea, sentences_without_fix as sentences_without_fix
    from soilmoist_ros.sensing.position.phone import PHONE as PHONE, PhoneReceiver as PhoneReceiver
    from soilmoist_ros.sensing.position.place_doubt import DOUBTS as DOUBTS, Doubt as Doubt, Doubts as Doubts, none_since as none_since, placed_of_any as placed_of_any
    from soilmoist_ros.sensing.position.place_judge import REPEATED_M as REPEATED_M, Expected as Expected, PlaceAges as PlaceAges, PlaceFix as PlaceFix, PlaceJudge as PlaceJudge, PlaceLimits as PlaceLimits, Verdict as Verdict
    from soilmoist_ros.sensing.position.track import CheckedTrack as CheckedTrack, Course as Course, Track as Track, base_from_antenna as base_from_antenna, distance_m as distance_m
    from soilmoist_ros.sensing.position.track_file import read_positions as read_positions
    from soilmoist_ros.sensing.problems import Consequence as Consequence, Kind as Kind, Problem as Problem, Severity as Severity, reason_text as reason_text
    from soilmoist_ros.sensing.records import FIRST_STAMP_S as FIRST_STAMP_S, LAST_STAMP_S as LAST_STAMP_S, CountRecord as CountRecord, LoggerRecord as LoggerRecord, Position as Position, utc_text as utc_text
    from soilmoist_ros.sensing.survey.correction import intensity_source as intensity_source, unusual_factors as unusual_factors
    from soilmoist_ros.sensing.survey.driver import Batch as Batch, Driver as Driver, DriverSettings as DriverSettings
    from soilmoist_ros.sensing.survey.logs import CalibrationCounts as CalibrationCounts, SurveyRecords as SurveyRecords, calibration_counts as calibration_counts, log_doubts as log_doubts, process_logs as process_logs, why_unplaced as why_unplaced
    from soilmoist_ros.sensing.survey.side_by_side import compare_side_by_side as compare_side_by_side
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "checks.record_checks": "unlikely_weather",
        "corrections.factors": "Corrections standard_pressure_hpa",
        "corrections.intensity": "NeutronMonitor",
        "corrections.settings": "CorrectionSettings IntensityCorrection",
        "formats.draft": "draft_format",
        "formats.log_layout": "LogHeader",
        "formats.logger_format": "LoggerFormat load_logger_format logger_names logger_path",
        "formats.logger_reader": "LogFile detect_format format_of_lines parse_log read_log",
        "formats.notation": "UndecidedOrderError",
        "formats.robot_logger": "FORMAT_NAME RECORDS_PER_HEADER TUBES format_header format_record",
        "gnss": "Covariance CovarianceKind FIX_TYPE Fix FixStatus Heard UNKNOWN_COVARIANCE clock_words fix_from_message stamp_of",
        "lines": "log_files split_lines",
        "moisture.combined": "DISAGREEMENT_SD PROFILE_DENSITY_SD_GCM3 PROFILE_SD N0Source combine_n0 combined_calibration difference_sd earlier_source",
        "moisture.cores": "SoilCore possible_days profiles_of read_soil_cores",
        "moisture.curve": "CalibrationCurve MoistureCurve SoilLimits UniversalCurve soil_limits",
        "moisture.footprint": "CoreMean Footprint SensedSoil Weighting bare_radius_m mean_of_cores sensed_soil",
        "moisture.general": "DAY_SD DENSITY_ERROR GENERAL_SD GIVEN_SD SCALING_SD SENSITIVITIES SurveyAir general_calibration named_sensor sensitivity_of soil_of unknown_sensor unknown_share why_no_soil",
        "moisture.site": "UNKNOWN_SENSOR Calibration Irrigation N0Estimate SensorModel Site Soil UncertaintyPart estimate_n0 load_site n0_in_other_time unusual_n0 write_calibration write_site_values",
        "position.nmea": "nmea_sentences parse_nmea sentences_without_fix",
        "position.phone": "PHONE PhoneReceiver",
        "position.place_doubt": "DOUBTS Doubt Doubts none_since placed_of_any",
        "position.place_judge": "Expected PlaceAges PlaceFix PlaceJudge PlaceLimits REPEATED_M Verdict",
        "position.track": "CheckedTrack Course Track base_from_antenna distance_m",
        "position.track_file": "read_positions",
        "problems": "Consequence Kind Problem Severity reason_text",
        "records": "CountRecord FIRST_STAMP_S LAST_STAMP_S LoggerRecord Position utc_text",
        "survey.correction": "intensity_source unusual_factors",
        "survey.driver": "Batch Driver DriverSettings",
        "survey.logs": "CalibrationCounts SurveyRecords calibration_counts log_doubts process_logs why_unplaced",
        "survey.side_by_side": "compare_side_by_side",
    },
)
