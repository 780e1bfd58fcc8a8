# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A visit: a stop that a robot has driven to and counted at. Light to import: many read only visits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum


class VisitEnd(StrEnum):
    """Reason why counting ended at a stop."""

    ENOUGH = "enough"  # the dwell rule was met
    MAX_DWELL = "max_dwell"  # the longest dwell was over before the dwell rule was met
    TIME_UP = "time_up"  # the rest of the budget was needed for the way home, or there was none
    MOVED = "moved"  # the robot was moved away from the stop, in a pause or while it counted
    SKIPPED = "skipped"  # the stop was skipped, by the operator or for another robot
    ABORTED = "aborted"  # the operator aborted the mission
    SILENT_SENSOR = "silent_sensor"  # no record arrived; in recordings of earlier versions
    RETURNED = "returned"  # the operator sent the robot home
    FAILSAFE = "failsafe"  # the guard reported a danger that ended the mission
    UNKNOWN = "unknown"  # the recording does not say


@dataclass(frozen=True)
class Visit:
    """Visit of a stop: place, times and counts, from arrival to the end of counting.

    Only records that were counted wholly after the arrival, outside pauses, and near the stop belong to it. Its
    counts are those that the mission decided on; nothing is added afterwards.

    :param arrival_stamp_s: time of arrival on the clock that stamps the records: ROS time, or the simulator's [s];
        NaN if unknown
    """

    name: str  # name of the stop
    x_m: float  # place of the robot: east of the field's datum [m]
    y_m: float  # place of the robot: north of the field's datum [m]
    arrived_s: float  # mission time of arrival, from the start of the mission [s]
    dwell_s: float  # time spent counting, pauses left out [s]
    raw_counts: int  # raw counts of its records
    reason: str  # why the stop was chosen
    robot: int = 1  # number of the robot, from 1
    records: int = 0  # number of its records; 0 if unknown
    exposure_s: float = math.nan  # exposure of the records [s]; NaN if unknown
    effective_exposure_s: float = math.nan  # effective exposure of the records [s]; NaN if unknown
    ended: VisitEnd = VisitEnd.UNKNOWN  # why counting ended
    outcome: str = ""  # end of counting in words, with what was reached
    dwell: str = ""  # dwell rule of the mission, as text
    arrival_stamp_s: float = math.nan
    end_stamp_s: float = math.nan  # end of counting, on the clock of arrival_stamp_s [s]; NaN if unknown
    stop_x_m: float = math.nan  # place of the stop as planned: east [m]; NaN if unknown
    stop_y_m: float = math.nan  # north [m]; NaN if unknown
