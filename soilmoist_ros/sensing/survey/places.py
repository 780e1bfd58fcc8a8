# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the records of a survey were counted."""

from __future__ import annotations

import math

from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.checked_track import CheckedTrack
from soilmoist_ros.sensing.position.lever_arms import NO_ARMS, LeverArms
from soilmoist_ros.sensing.position.track import EDGE_TOLERANCE_S, Track
from soilmoist_ros.sensing.records import NAN, LoggerRecord, Position
from soilmoist_ros.sensing.survey.correction import position_gap_s

MAX_FIXES = 20_000
"""Fixes kept during a survey: 5 h at 1 Hz, because a receiver may be far ahead of the logger."""
MAX_EDGE_TOLERANCE_S = 5.0
"""Maximum time between the middle of a counting interval and a single fix used as its position [s]."""
MAX_ALTITUDE_AGE_S = 300.0
"""Maximum time between a record and a position that shows its altitude [s]."""


class SurveyPlaces:
    """Positions of a separate receiver, else those in the log, else the location of the site.

    :param site: location of a stationary probe
    :param track: positions of a separate receiver, if known in advance
    :param arms: where antenna and sensor sit on the robot
    :param grows: whether records come one by one, so that early positions may be forgotten
    """

    def __init__(self, site: Site, track: Track | None, arms: LeverArms, grows: bool) -> None:
        self._site, self._arms = site, arms
        self.track = CheckedTrack(max_positions=MAX_FIXES) if track is None else track
        """Positions of a separate receiver."""
        self._grows = grows
        self._own = CheckedTrack(max_positions=MAX_FIXES if grows else None)

    def add(self, record: LoggerRecord) -> None:
        """Store the position in a record for other records."""
        if record.position is not None:
            # After the clock was set back, its times come again.
            if self._grows and record.stamp_s < self._own.reached_s:
                self._own = CheckedTrack(max_positions=MAX_FIXES)
            self._own.add(record.stamp_s, record.position)

    def take_fix(self, fix: Fix) -> None:
        """Add an epoch of a separate receiver, with or without a fix."""
        self.track.heard.add(fix)
        self.track.add(fix.stamp_s, None if fix.status is FixStatus.NO_FIX else fix.position)

    def at(self, record: LoggerRecord, interval_s: float, clock_ahead_s: float) -> Position | None:
        """Position at the middle of a record's counting interval, ``None`` if unknown.

        :param interval_s: duration of the interval [s]
        :param clock_ahead_s: logger's clock minus GNSS time [s]
        """
        middle_s, gap_s = record.stamp_s - interval_s / 2, position_gap_s(interval_s)
        if self._has_receiver:
            tolerance_s = max(EDGE_TOLERANCE_S, min(interval_s / 2, MAX_EDGE_TOLERANCE_S))
            place = self.track.at(middle_s - clock_ahead_s, gap_s, tolerance_s)
        else:  # positions in the log have the time of the logger's clock
            place = self._own.at(middle_s, gap_s)
        if place is not None:
            return place
        if record.position is not None and self._own.jumped.at(record.stamp_s, 0.0, 0.0) is None:
            return record.position
        location = self._site.location
        if location is None or self._moves:
            return None
        altitude_m = NAN if location.altitude_m is None else location.altitude_m
        return Position(location.latitude_deg, location.longitude_deg, altitude_m)

    def altitude_m(self, record: LoggerRecord) -> float:
        """Altitude of the probe about the time of a record [m], NaN if unknown."""
        place = record.position or self.track.at(record.stamp_s, MAX_ALTITUDE_AGE_S, MAX_ALTITUDE_AGE_S)
        if place is not None:
            return place.altitude_m
        location = self._site.location
        return NAN if location is None or location.altitude_m is None or self._moves else location.altitude_m

    def jumped_at(self, record: LoggerRecord, interval_s: float, clock_ahead_s: float) -> Position | None:
        """Position of a record that the receiver reports after a jump, ``None`` without a jump; as :meth:`at`."""
        track = self.track if self._has_receiver else self._own
        if not isinstance(track, CheckedTrack):
            return None
        middle_s = record.stamp_s - interval_s / 2 - (clock_ahead_s if self._has_receiver else 0.0)
        return track.jumped.at(middle_s, position_gap_s(interval_s), max(interval_s / 2, EDGE_TOLERANCE_S))

    def sensor_offset_m(self, middle_s: float, clock_ahead_s: float) -> tuple[float, float] | None:
        """East and north from the antenna to the sensor [m], ``None`` if the heading is unknown.

        :param middle_s: middle of a counting interval, by the logger's clock [s since 1970 UTC]
        :param clock_ahead_s: logger's clock minus GNSS time [s]
        """
        if self._arms == NO_ARMS or not self._moves:  # a probe at a fixed location is its place
            return 0.0, 0.0
        separate = bool(len(self.track))
        course = (self.track if separate else self._own).course
        return self._arms.sensor_from_antenna(course.at(middle_s - (clock_ahead_s if separate else 0.0)))

    @property
    def _has_receiver(self) -> bool:
        return self.track.reached_s > -math.inf

    @property
    def _moves(self) -> bool:
        return bool(len(self.track) or len(self._own))
