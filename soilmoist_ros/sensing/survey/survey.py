"""Corrects and geo-tags the records of one probe, one by one."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.checks.checks import RecordChecks
from soilmoist_ros.sensing.checks.finding import Finding
from soilmoist_ros.sensing.corrections.tubes import RunningShares, tube_shares
from soilmoist_ros.sensing.corrections.weather import WeatherSeries
from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.checked_track import CheckedTrack
from soilmoist_ros.sensing.position.lever_arms import NO_ARMS, LeverArms
from soilmoist_ros.sensing.position.track import EDGE_TOLERANCE_S, Track
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.correction import (
    UnusableRecordError,
    correct_record,
    counting_interval_s,
    intensity_source,
    place_record,
    position_gap_s,
)

MAX_FIXES = 20_000
"""Fixes kept during a survey: 5 h at 1 Hz, because a receiver may be far ahead of the logger."""
MAX_WEATHER_VALUES = 1000
MAX_EDGE_TOLERANCE_S = 5.0
"""Maximum time between the middle of a counting interval and a single fix used as its position [s]."""
MAX_TYPICAL = 500
"""Maximum number of records for the typical rate of a log."""
LINE_DELAY_S = 0.25
"""Maximum delay of the receiver's lines after their record [s]."""


@dataclass(frozen=True)
class _Waiting:
    """A corrected record that waits for its position.

    :param recorded: the same with the counts of bad tubes
    :param raw: the uncorrected record
    :param interval_s: duration of the counting interval [s]
    :param clock_ahead_s: logger's clock minus GNSS time [s]
    :param since_s: start of the wait, monotonic time [s]
    :param path: file of the record
    """

    record: CountRecord
    recorded: CountRecord
    raw: LoggerRecord
    interval_s: float
    clock_ahead_s: float
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

    :param site: corrections and tubes
    :param frame: plane in which the records are placed
    :param ahead: all records in order of time, if known in advance; tube shares, weather and positions then use
        later records, too
    :param track: positions of a separate receiver, if known in advance
    :param tubes: number of tubes, if known in advance
    :param fix_wait_s: maximum time that a record waits for a fix [s]
    :param arms: where antenna and sensor sit on the robot
    :param keep_unplaced: whether a record without a position is returned with NaN coordinates, or dropped
    :param on_problem: called with each problem
    :raises InputError: if the tube shares or the neutron-monitor file of the site cannot be used
    """

    def __init__(
        self,
        site: Site,
        frame: LocalFrame | None,
        ahead: Sequence[LoggerRecord] | None = None,
        track: Track | None = None,
        *,
        tubes: int | None = None,
        fix_wait_s: float = 2.0,
        arms: LeverArms = NO_ARMS,
        keep_unplaced: bool = True,
        on_problem: Callable[[Problem], None] = lambda problem: None,
    ) -> None:
        self.frame = frame
        self._site, self._fix_wait_s = site, fix_wait_s
        self._arms = arms
        self._keep_unplaced, self._on_problem = keep_unplaced, on_problem
        self._intensity = intensity_source(site.corrections)
        self._running_shares = RunningShares()
        self._shares: NDArray[np.float64] | None = None
        self._grows = ahead is None
        self._track = CheckedTrack(max_positions=MAX_FIXES) if track is None else track
        self._own = CheckedTrack(max_positions=MAX_FIXES if self._grows else None)
        self._weather = WeatherSeries(max_values=MAX_WEATHER_VALUES if self._grows else None)
        altitude_m = site.location.altitude_m if site.location else None
        n0_cps = site.calibration.n0_cps if site.calibration else NAN
        self.checks = RecordChecks(NAN if altitude_m is None else altitude_m, n0_cps)
        """Tests of the counts and the weather."""
        learned = self.checks.learn(ahead or ())
        for checked in learned:
            self._learn(checked.record)
        self.tube_share = _site_shares(site, len(ahead[0].tube_counts) if ahead else tubes)
        """Share of each tube, shape (tubes,); ``None`` while it is estimated from the records so far."""
        if self.tube_share is None and ahead:
            good = [checked.record for checked in learned if not checked.quarantine]
            self.tube_share = tube_shares(good or ahead)
        self.checks.totals.typical_cps = self._typical_cps([checked.record for checked in learned])
        self._last: LoggerRecord | None = None
        self._waiting: deque[_Waiting] = deque()

    def __repr__(self) -> str:
        return f"Survey(site={self._site.name!r}, {len(self._track)} fixes, {self.waiting} records waiting)"

    @property
    def waiting(self) -> int:
        """Number of records that wait for a fix."""
        return len(self._waiting)

    def take_record(
        self,
        record: LoggerRecord,
        now_s: float = 0.0,
        *,
        clock_ahead_s: float = 0.0,
        unused_tubes: Collection[int] = (),
        path: Path | None = None,
    ) -> None:
        """Check and correct a record, and queue it until its position is known; drop it if it cannot be corrected.

        A bad record is corrected as far as possible, and quarantined.

        :param record: the raw record
        :param now_s: monotonic time [s]
        :param clock_ahead_s: logger's clock minus GNSS time [s], 0 if unknown
        :param unused_tubes: indices of the tubes that the format leaves out
        :param path: file of the record, for messages
        """
        original, checked = record, self.checks.check(record, unused_tubes)
        record = checked.record
        if self._grows:
            self._learn(record)
        interval_s = counting_interval_s(record, self._last)
        self._last = record
        self._list(checked.findings, record, path)
        try:
            corrected = replace(self.correct(record, unused_tubes), quarantine=checked.quarantine)
        except UnusableRecordError as error:
            self._report(error, record, path, lost=True)
            return
        recorded = corrected
        if record.tube_counts != original.tube_counts and self._shares is not None:
            recorded = self._correct(replace(record, tube_counts=original.tube_counts), self._shares)
        self._waiting.append(_Waiting(corrected, recorded, record, interval_s, clock_ahead_s, now_s, path))

    def take_fix(self, fix: Fix) -> None:
        """Add an epoch of a separate receiver, with or without a fix."""
        self._track.add(fix.stamp_s, None if fix.status is FixStatus.NO_FIX else fix.position)

    def take_intensity(self, rate: float) -> bool:
        """Set the current incoming intensity; returns whether it is used.

        :param rate: rate of a neutron monitor, in the unit of the site's reference; used if positive and finite
        """
        good = self._site.corrections.intensity is not None and math.isfinite(rate) and rate > 0
        if good:
            self._intensity = rate
        return good

    def take_ready(self, now_s: float = math.inf) -> list[CountRecord]:
        """Remove and return the records whose wait is over, oldest first.

        :param now_s: monotonic time [s]; at infinity no record waits
        """
        ready = []
        while self._waiting and self._may_go(self._waiting[0], now_s):
            placed = self._placed(self._waiting.popleft())
            ready += [] if placed is None else [placed]
        return ready

    def correct(self, record: LoggerRecord, unused_tubes: Collection[int] = ()) -> CountRecord:
        """Correct a record without placing it.

        :raises UnusableRecordError: if no tube counted, or a value that a correction needs is missing
        """
        self._shares = self.tube_share
        if self._shares is None:
            self._shares = self._running_shares.update(record, unused_tubes)
        return self._correct(record, self._shares)

    def _correct(self, record: LoggerRecord, shares: NDArray[np.float64]) -> CountRecord:
        return correct_record(record, self._weather.at(record), self._site, self._intensity, shares)

    def _typical_cps(self, records: Sequence[LoggerRecord]) -> float:
        """Median rate of records that are known in advance [counts/s], NaN without any."""
        rates = []
        for record in records[:: max(len(records) // MAX_TYPICAL, 1)]:
            with suppress(UnusableRecordError):
                rates.append(self.correct(record).corrected_rate)
        return float(np.median(rates)) if rates else NAN

    def position(self, record: LoggerRecord, interval_s: float, clock_ahead_s: float) -> Position | None:
        """Position at the middle of a record's counting interval, ``None`` if unknown.

        :param interval_s: duration of the interval [s]
        :param clock_ahead_s: logger's clock minus GNSS time [s]
        """
        middle_s, gap_s = record.stamp_s - interval_s / 2, position_gap_s(interval_s)
        if self._track.reached_s > -math.inf:
            tolerance_s = max(EDGE_TOLERANCE_S, min(interval_s / 2, MAX_EDGE_TOLERANCE_S))
            place = self._track.at(middle_s - clock_ahead_s, gap_s, tolerance_s)
        else:  # positions in the log have the time of the logger's clock
            place = self._own.at(middle_s, gap_s)
        if place is not None:
            return place
        if record.position is not None and self._own.jumped.at(record.stamp_s, 0.0, 0.0) is None:
            return record.position
        location = self._site.location
        if location is None or len(self._track) or len(self._own):
            return None
        altitude_m = NAN if location.altitude_m is None else location.altitude_m
        return Position(location.latitude_deg, location.longitude_deg, altitude_m)

    def _jumped(self, waiting: _Waiting) -> Position | None:
        """Place of a record that the receiver reports after a jump, ``None`` without a jump."""
        separate = self._track.reached_s > -math.inf
        track = self._track if separate else self._own
        if not isinstance(track, CheckedTrack):
            return None
        middle_s = waiting.middle_s - (waiting.clock_ahead_s if separate else 0.0)
        gap_s = position_gap_s(waiting.interval_s)
        return track.jumped.at(middle_s, gap_s, max(waiting.interval_s / 2, EDGE_TOLERANCE_S))

    def _learn(self, record: LoggerRecord) -> None:
        """Store weather and position for other records."""
        self._weather.add(record)
        if record.position is not None:
            self._own.add(record.stamp_s, record.position)

    def _may_go(self, waiting: _Waiting, now_s: float) -> bool:
        if not len(self._track) and waiting.raw.position is not None:
            return True
        if self._track.fixed_s >= waiting.middle_s - waiting.clock_ahead_s:
            return True
        # The wait ends at its time limit, or when newer epochs or records have arrived without a fix.
        enough_s = waiting.record.stamp_s + self._fix_wait_s
        overtaken = self._last is not None and self._last.stamp_s >= enough_s
        return (
            now_s >= waiting.since_s + self._fix_wait_s
            or self._track.reached_s >= enough_s - waiting.clock_ahead_s
            or (overtaken and now_s >= waiting.since_s + LINE_DELAY_S)
        )

    def _placed(self, waiting: _Waiting) -> CountRecord | None:
        try:
            position = self.position(waiting.raw, waiting.interval_s, waiting.clock_ahead_s)
            if position is None and (position := self._jumped(waiting)) is not None:
                return self._at_jump(waiting, position)
            record = place_record(waiting.record, position, self.frame, self._to_sensor(waiting))
        except UnusableRecordError as error:
            self._report(error, waiting.raw, waiting.path, lost=not self._keep_unplaced)
            if not self._keep_unplaced:
                return None
            record = waiting.record
        recorded = replace(waiting.recorded, x_m=record.x_m, y_m=record.y_m)
        found = self.checks.totals.check(record, recorded)
        self._list(found, waiting.raw, waiting.path)
        return replace(record, quarantine=found[0].kind.value) if found else record

    def _at_jump(self, waiting: _Waiting, position: Position) -> CountRecord:
        record = place_record(waiting.record, position, self.frame, self._to_sensor(waiting))
        message = f"the receiver jumped to {position.latitude_deg:.5f}, {position.longitude_deg:.5f}"
        finding = Finding(Kind.PLACE_JUMP, message, "check the antenna and the view of the sky", bad=True)
        self._list([finding], waiting.raw, waiting.path)
        return replace(record, quarantine=record.quarantine or finding.kind.value)

    def _to_sensor(self, waiting: _Waiting) -> tuple[float, float]:
        """East and north from the antenna to the sensor [m]; 0 if the heading is unknown, with a note."""
        moving = bool(len(self._track) or len(self._own))  # a probe at a fixed location is its place
        if self._arms == NO_ARMS or not moving:
            return 0.0, 0.0
        ahead_s = waiting.clock_ahead_s if len(self._track) else 0.0
        course = (self._track if len(self._track) else self._own).course
        offset_m = self._arms.sensor_from_antenna(course.at(waiting.middle_s - ahead_s))
        if offset_m is None:
            message, line = "the heading of the robot is unknown", waiting.raw.line
            self._on_problem(Problem(Kind.NO_HEADING, Mistake(message, "drive some metres", waiting.path, line)))
        return offset_m or (0.0, 0.0)

    def _list(self, findings: Iterable[Finding], record: LoggerRecord, path: Path | None) -> None:
        for finding in findings:
            mistake = Mistake(finding.message, finding.remedy, path, record.line)
            self._on_problem(Problem(finding.kind, mistake, quarantined=finding.bad))

    def _report(self, error: UnusableRecordError, record: LoggerRecord, path: Path | None, lost: bool) -> None:
        self._on_problem(Problem(error.kind, Mistake(error.message, error.remedy, path, record.line), lost))


def _site_shares(site: Site, tubes: int | None) -> NDArray[np.float64] | None:
    """Tube shares from the site file, normalised to a sum of 1; ``None`` if it has none.

    :param tubes: number of tubes of the logger, ``None`` if unknown
    """
    if site.tube_shares is None:
        return None
    shares = np.array(site.tube_shares, dtype=float)
    if tubes not in (None, len(shares)) or shares.sum() <= 0:
        have = "an unknown number of" if tubes is None else str(tubes)
        raise InputError(
            f"'tube_shares' in the site file has {len(shares)} values, but the logger has {have} tubes",
            "give one share per tube, not all 0, or leave it out to have them estimated",
        )
    return np.asarray(shares / shares.sum())
