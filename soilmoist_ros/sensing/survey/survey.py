# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The survey: corrects and geo-tags the records of one probe, one by one."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.sensing.checks.record_checks import N0_KEY, RecordChecks
from soilmoist_ros.sensing.checks.tubes import tube_shares
from soilmoist_ros.sensing.gnss import Fix, FixStatus, Heard
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import EDGE_TOLERANCE_S, CheckedTrack, Track
from soilmoist_ros.sensing.problems import Finding, Kind, LostRecordError, Problem
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.correction import (
    WeatherSeries,
    correct_record,
    counting_interval_s,
    intensity_source,
    place_record,
    position_gap_s,
    uncorrected_record,
)

MAX_WEATHER_VALUES = 1000
MAX_TYPICAL = 500  # maximum number of records for the typical rate of a log
LINE_DELAY_S = 0.25  # maximum delay of the receiver's lines after their record [s]
MAX_FIXES = 20_000  # fixes kept during a survey: 5 h at 1 Hz, because a receiver may be far ahead of the logger
MAX_EDGE_TOLERANCE_S = 5.0
"""Maximum time between the middle of a counting interval and a single fix used as its position [s]."""
MAX_ALTITUDE_AGE_S = 300.0  # maximum time between a record and a position that shows its altitude [s]


@dataclass(frozen=True)
class _Waiting:
    """A corrected record that waits for its position since a monotonic time; ``recorded`` has bad tubes, too."""

    record: CountRecord
    recorded: CountRecord
    raw: LoggerRecord
    interval_s: float
    since_s: float
    path: Path | None

    @property
    def middle_s(self) -> float:
        return self.record.stamp_s - self.interval_s / 2


class Survey:
    """Corrects and places the records of one probe from files, links or replays.

    The output has the order of the input. The position of a record is the receiver's position at the middle of the
    counting interval. The record waits for a fix after the middle; without one, a fix from within the interval is
    used. Without a separate receiver, the positions in the log are used.

    >>> survey = Survey(Site(corrections={"pressure": None, "humidity": None}), LocalFrame(50.0, 10.0))
    >>> survey.take_record(LoggerRecord(1714557610.0, (5.0, 6.0), (10.0, 10.0), position=Position(50.0, 10.0)))
    >>> survey.take_ready()
    [CountRecord(2024-05-01 10:00:10Z, x=0.0 m, y=0.0 m, 11 counts, 1.10 counts/s)]

    :param ahead: all records in order of time, if known in advance; tube shares, weather and positions then use
        later records, too
    :param track: positions of a separate receiver, if known in advance
    :param fix_wait_s: maximum time that a record waits for a fix [s]
    :param keep_unplaced: whether a record without a position is returned with NaN coordinates, or dropped
    :raises InputError: if the neutron-monitor file of the site cannot be used
    :raises ValueError: if the records ahead have different numbers of tubes, or counted nothing
    """

    def __init__(
        self,
        site: Site,
        frame: LocalFrame | None,
        ahead: Sequence[LoggerRecord] | None = None,
        track: Track | None = None,
        *,
        fix_wait_s: float = 2.0,
        keep_unplaced: bool = True,
        on_problem: Callable[[Problem], None] = lambda problem: None,
    ) -> None:
        self.frame = frame
        self._site, self._fix_wait_s = site, fix_wait_s
        self._keep_unplaced, self._on_problem = keep_unplaced, on_problem
        self._intensity = intensity_source(site.corrections)
        self._grows = ahead is None
        self.places = SurveyPlaces(site, track, self._grows)
        """Places at which the records were counted."""
        self._weather = WeatherSeries(max_values=MAX_WEATHER_VALUES if self._grows else None)
        n0_cps = site.calibration.n0_cps if site.calibration else NAN
        general = site.calibration is not None and site.calibration.method == "general"
        n0_from = "--sensor or 'sensor_sensitivity' in the site file" if general else N0_KEY
        self.checks = RecordChecks(n0_cps, self.places.altitude_m, n0_from)
        """Tests of the counts and the weather."""
        learned = self.checks.learn(ahead or ())
        for checked in learned:
            self._weather.add(checked.record)
            self.places.add(checked.record)
        self.tube_share: NDArray[np.float64] | None = None
        """Share of each tube, shape (tubes,); ``None`` while it is estimated from the records so far."""
        if ahead:
            self.tube_share = tube_shares([one.record for one in learned if not one.quarantine] or ahead)
            rates = []
            for checked in learned[:: max(len(learned) // MAX_TYPICAL, 1)]:
                with suppress(LostRecordError):
                    rates.append(self._correct(checked.record, self.tube_share).corrected_rate)
            self.checks.totals.typical_cps = float(np.median(rates)) if rates else NAN
        self._last: LoggerRecord | None = None
        self._waiting: deque[_Waiting] = deque()

    @property
    def waiting(self) -> int:
        """Number of records that wait for a fix."""
        return len(self._waiting)

    @property
    def heard(self) -> Heard:
        """Messages received so far from a separate GNSS receiver."""
        return self.places.track.heard

    def take_record(
        self,
        record: LoggerRecord,
        now_s: float = 0.0,
        *,
        unused_tubes: Collection[int] = (),
        path: Path | None = None,
    ) -> None:
        """Check and correct a record, and queue it until its position is known; drop it if it cannot be corrected.

        A bad record is corrected as far as possible, and quarantined.

        :param now_s: monotonic time [s]
        :param unused_tubes: indices of the tubes that the format leaves out
        """
        original, checked = record, self.checks.check(record, unused_tubes)
        record = checked.record
        if self._grows:
            self._weather.add(record)
            self.places.add(record)
        interval_s = counting_interval_s(record, self._last)
        self._last = record
        findings = checked.findings
        shares = self.checks.shares if self.tube_share is None else self.tube_share
        try:
            corrected = replace(self._correct(record, shares), quarantine=checked.quarantine)
        except LostRecordError as error:
            weather = Kind.IMPOSSIBLE_WEATHER
            findings = tuple(replace(one, bad=one.bad or one.kind is weather) for one in findings)
            if error.finding.kind is not Kind.NO_CORRECTION or not any(one.kind is weather for one in findings):
                self._on_problem(error.finding.at(path, record.line, lost=True))
                return
            corrected = uncorrected_record(record, shares, weather.value)
        self._list(findings, record, path)
        recorded = corrected
        if record.tube_counts != original.tube_counts:
            with suppress(LostRecordError):
                recorded = self._correct(replace(record, tube_counts=original.tube_counts), shares)
        self._waiting.append(_Waiting(corrected, recorded, record, interval_s, now_s, path))

    def take_fix(self, fix: Fix) -> None:
        """Add an epoch of a separate receiver, with or without a fix."""
        self.heard.add(fix)
        self.places.track.add(fix.stamp_s, None if fix.status is FixStatus.NO_FIX else fix.position)

    def take_ready(self, now_s: float = math.inf) -> list[CountRecord]:
        """Remove and return the records whose wait is over, oldest first."""
        ready = []
        while self._waiting and self._may_go(self._waiting[0], now_s):
            placed = self._placed(self._waiting.popleft())
            ready += [] if placed is None else [placed]
        return ready

    def _correct(self, record: LoggerRecord, shares: NDArray[np.float64]) -> CountRecord:
        return correct_record(self._weather.filled(record), self._site, self._intensity, shares)

    def _may_go(self, waiting: _Waiting, now_s: float) -> bool:
        track = self.places.track
        if not len(track) and waiting.raw.position is not None:
            return True
        # The wait ends with a fix after the middle, at its time limit, or when newer epochs or records have come.
        enough_s = waiting.record.stamp_s + self._fix_wait_s
        overtaken = self._last is not None and self._last.stamp_s >= enough_s
        return (
            track.fixed_s >= waiting.middle_s - waiting.raw.clock_ahead_s
            or now_s >= waiting.since_s + self._fix_wait_s
            or track.reached_s >= enough_s - waiting.raw.clock_ahead_s
            or (overtaken and now_s >= waiting.since_s + LINE_DELAY_S)
        )

    def _placed(self, waiting: _Waiting) -> CountRecord | None:
        raw, path = waiting.raw, waiting.path
        when = raw, waiting.interval_s
        position, findings = self.places.at(*when), []
        if position is None and (position := self.places.jumped_at(*when)) is not None:
            message = f"the receiver jumped to {position.latitude_deg:.5f}, {position.longitude_deg:.5f}"
            remedy = "check the antenna and the view of the sky"
            findings = [Finding(Kind.PLACE_JUMP, message, remedy, bad=True)]
        try:
            record = place_record(waiting.record, position, self.frame)
        except LostRecordError as error:
            lost = error.finding
            if position is None and self.heard.first_s < math.inf:
                message = "the receiver has no position at the time of this record"
                remedy = f"{self.heard.span}: check the receiver, or give its whole log"
                lost = replace(lost, message=message, remedy=remedy)
            self._on_problem(lost.at(path, raw.line, lost=not self._keep_unplaced))
            if not self._keep_unplaced:
                return None
            record = waiting.record
        if not findings:
            recorded = replace(waiting.recorded, x_m=record.x_m, y_m=record.y_m)
            findings = self.checks.totals.check(record, recorded)
        self._list(findings, raw, path)
        return replace(record, quarantine=record.quarantine or findings[0].kind.value) if findings else record

    def _list(self, findings: Iterable[Finding], record: LoggerRecord, path: Path | None) -> None:
        for finding in findings:
            self._on_problem(finding.at(path, record.line))


# Where the records of a survey were counted ---------------------------------------------------------------------


class SurveyPlaces:
    """Positions of a separate receiver, else those in the log, else the location of the site.

    If records come one by one (``grows``), early positions may be forgotten.
    """

    def __init__(self, site: Site, track: Track | None, grows: bool) -> None:
        self._site = site
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

    def at(self, record: LoggerRecord, interval_s: float) -> Position | None:
        """Position at the middle of a record's counting interval, ``None`` if unknown."""
        track, middle_s = self._receiver(record, interval_s)
        single_s = 0.0 if track is self._own else min(interval_s / 2, MAX_EDGE_TOLERANCE_S)
        place = track.at(middle_s, position_gap_s(interval_s), max(single_s, EDGE_TOLERANCE_S))
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

    def jumped_at(self, record: LoggerRecord, interval_s: float) -> Position | None:
        """Position of a record that the receiver reports after a jump, ``None`` without a jump; as :meth:`at`."""
        track, middle_s = self._receiver(record, interval_s)
        if not isinstance(track, CheckedTrack):
            return None
        return track.jumped.at(middle_s, position_gap_s(interval_s), max(interval_s / 2, EDGE_TOLERANCE_S))

    def _receiver(self, record: LoggerRecord, interval_s: float) -> tuple[Track, float]:
        """Positions of the separate receiver, else those in the log; and the middle of a record on their clock."""
        middle_s = record.stamp_s - interval_s / 2
        if self.track.reached_s > -math.inf:
            return self.track, middle_s - record.clock_ahead_s
        return self._own, middle_s

    @property
    def _moves(self) -> bool:
        return bool(len(self.track) or len(self._own))
