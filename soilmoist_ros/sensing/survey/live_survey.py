"""Lines of a logger and of a GNSS receiver, as they come -> corrected, geo-tagged counts."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.corrections.running_shares import RunningShares
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.sensing.position.recent_track import RecentTrack
from soilmoist_ros.sensing.position.track import EDGE_TOLERANCE_S
from soilmoist_ros.sensing.problems import Kind, Problem, Severity
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.record_correction import (
    UnusableRecordError,
    Weather,
    correct_record,
    counting_interval_s,
    intensity_source,
    place_record,
    position_gap_s,
)
from soilmoist_ros.sensing.survey.survey import MAX_WEATHER_GAP_S

LAST_RECORDS = 20
"""Records by which the present state is judged."""
OTHER_WAY_S = 0.25
"""Lines of the receiver may come so much later than a record to which they belong [s]."""
_WEATHER = ("pressure_hpa", "temperature_degc", "relative_humidity")


class ProblemCount:
    """Problems counted by kind, and the last one that cost something."""

    def __init__(self) -> None:
        self.lost: Counter[Kind] = Counter()
        """What was dropped; a repeated record is, too, but is no loss."""
        self.noted: Counter[Kind] = Counter()
        self.last_loss: Problem | None = None

    def take(self, problem: Problem) -> None:
        """Count a problem."""
        (self.lost if problem.lost else self.noted)[problem.kind] += 1
        if problem.severity is Severity.ERROR:
            self.last_loss = problem

    @property
    def losses(self) -> int:
        """How many have cost something."""
        return self.lost.total() - self.lost[Kind.DUPLICATE]


@dataclass(frozen=True)
class _Held:
    """A corrected record that waits for its position.

    :param own: position that the logger has written with it
    :param interval_s: duration of the counting interval [s]
    :param since_s: when the waiting began, monotonic time [s]
    """

    record: CountRecord
    own: Position | None
    interval_s: float
    since_s: float

    @property
    def middle_s(self) -> float:
        return self.record.stamp_s - self.interval_s / 2


class LiveSurvey:
    """What :func:`process_logs` does, for data that are still coming in.

    The order of the records is kept. A record is placed where the receiver was at the middle of its counting
    interval; it waits until a fix from after that has come. If none comes, a fix from within the interval serves;
    without one the record goes out with NaN for its place, since its counts are good. If there are no other
    fixes, the positions that the logger itself has written are used.

    :param site: corrections and tubes
    :param frame: plane to place the records in
    :param logger: format of the logger, or the name of a shipped one
    :param fix_wait_s: longest time that a record waits for a fix [s]
    :param reference_stamp_s: a time within 12 h of the first fix [s since 1970 UTC], for receivers that send no
        date; NaN if unknown
    :raises InputError: if format, tube shares or the file of a neutron monitor cannot be used
    """

    def __init__(
        self,
        site: Site,
        frame: LocalFrame,
        logger: LoggerFormat | str,
        fix_wait_s: float = 2.0,
        reference_stamp_s: float = NAN,
    ) -> None:
        self.logger_problems, self.gnss_problems = ProblemCount(), ProblemCount()
        self.parser = RecordParser(logger, site.longitude, self.logger_problems.take)
        self.last_record: LoggerRecord | None = None
        self.last_fix: Fix | None = None
        self.records_out = 0
        self.records_without_position = 0
        self._nmea = NmeaParser(reference_stamp_s=reference_stamp_s, on_problem=self.gnss_problems.take)
        self._site, self._frame, self._fix_wait_s = site, frame, fix_wait_s
        self._intensity = intensity_source(site.corrections)
        self._fixed_shares = self._shares_of_site()
        self._running_shares: RunningShares | None = None
        self._fixes, self._own = RecentTrack(), RecentTrack()
        self._weather: dict[str, tuple[float, float]] = {}
        self._held: deque[_Held] = deque()
        self._stamps: deque[float] = deque(maxlen=LAST_RECORDS)
        self._good: deque[bool] = deque(maxlen=LAST_RECORDS)
        self._clock_differences_s: deque[float] = deque(maxlen=LAST_RECORDS)

    def take_logger_line(self, line: bytes, now_s: float) -> LoggerRecord | None:
        """Take a line of the logger; gives the record in it, with the weather as it was logged.

        :param line: the line, with or without its end
        :param now_s: monotonic time [s]
        """
        losses = self.logger_problems.losses
        record = self.parser.feed(line)
        if record is None:
            if self.logger_problems.losses > losses:
                self._good.append(False)
            return None
        previous, self.last_record = self.last_record, record
        self._stamps.append(record.stamp_s)
        self._own.add(record.stamp_s, record.position)
        try:
            corrected = correct_record(
                record, self._air(record), self._site, self._intensity, self._shares(record)
            )
        except UnusableRecordError as error:
            self._report(error, lost=True)
        else:
            interval_s = counting_interval_s(record, previous)
            self._held.append(_Held(corrected, record.position, interval_s, now_s))
        return record

    def take_nmea_line(self, line: bytes) -> Fix | None:
        """Take a line of the GNSS receiver; gives the fix that it completes, if any."""
        fix = self._nmea.feed(line)
        if fix is not None:
            self.take_fix(fix)
        return fix

    def take_fix(self, fix: Fix) -> None:
        """Take a fix of another source; also one that says that there is none."""
        self.last_fix = fix
        place = fix.position
        known = math.isfinite(place.latitude_deg) and math.isfinite(place.longitude_deg)
        self._fixes.add(fix.stamp_s, place if known and fix.status is not FixStatus.NO_FIX else None)

    def take_intensity(self, rate: float) -> bool:
        """Take the present incoming intensity; gives whether it is used.

        :param rate: rate of a neutron monitor, in the unit of the site's reference; used if positive and finite
        """
        good = self._site.corrections.intensity is not None and math.isfinite(rate) and rate > 0
        if good:
            self._intensity = rate
        return good

    def compare_clocks(self, stamp_s: float, now_s: float) -> None:
        """Note how far the logger's clock is from ours; nothing is corrected by it.

        :param stamp_s: time in a line that has just come [s since 1970 UTC]
        :param now_s: time of our clock [s since 1970 UTC]
        """
        self._clock_differences_s.append(stamp_s - now_s)

    def take_ready(self, now_s: float) -> list[CountRecord]:
        """Records that need not wait any longer, oldest first.

        :param now_s: monotonic time [s]
        """
        ready = []
        while self._held and self._may_go(self._held[0], now_s):
            ready.append(self._placed(self._held.popleft()))
        return ready

    @property
    def waiting(self) -> int:
        """Number of records that wait for a fix."""
        return len(self._held)

    @property
    def clock_difference_s(self) -> float:
        """Logger's clock less ours [s], NaN if unknown: the smallest of late, since lines may come late."""
        return min(self._clock_differences_s, key=abs, default=NAN)

    @property
    def record_rate_hz(self) -> float:
        """Records per second of the logger's time of late, NaN with fewer than two."""
        spent_s = self._stamps[-1] - self._stamps[0] if self._stamps else 0.0
        return (len(self._stamps) - 1) / spent_s if spent_s > 0 else NAN

    @property
    def losses_of_late(self) -> int:
        """Records lost among the last ones."""
        return self._good.count(False)

    def _shares_of_site(self) -> NDArray[np.float64] | None:
        if self._site.tube_shares is None:
            return None
        shares = np.array(self._site.tube_shares, dtype=float)
        layout = self.parser.layout
        if shares.sum() <= 0 or (layout is not None and len(layout.tubes) != len(shares)):
            tubes = "no tube known yet" if layout is None else f"{len(layout.tubes)} tubes"
            raise InputError(
                f"'tube_shares' in the site file has {len(shares)} values, but the logger has {tubes}",
                "give one share per tube, not all 0, or leave it out to have them estimated",
            )
        return np.asarray(shares / shares.sum())

    def _shares(self, record: LoggerRecord) -> NDArray[np.float64]:
        if self._fixed_shares is not None:
            return self._fixed_shares
        if self._running_shares is None:
            tubes = self.parser.layout.tubes if self.parser.layout else ()
            left_out = self.parser.format.counts.left_out
            self._running_shares = RunningShares([i for i, tube in enumerate(tubes) if tube in left_out])
        return self._running_shares.take(record)

    def _air(self, record: LoggerRecord) -> Weather:
        """Weather of the record; what is missing is the last value that is not too old."""
        values = []
        for name in _WEATHER:
            value = getattr(record, name)
            if math.isfinite(value):
                self._weather[name] = (record.stamp_s, value)
            stamp_s, last = self._weather.get(name, (-math.inf, NAN))
            values.append(last if abs(record.stamp_s - stamp_s) <= MAX_WEATHER_GAP_S else NAN)
        return Weather(*values)

    def _may_go(self, held: _Held, now_s: float) -> bool:
        if not len(self._fixes) and held.own is not None:
            return True
        ahead_s = self._clock_ahead_s
        if self._fixes.fixed_s >= held.middle_s - ahead_s:
            return True
        # Given up by the clock, or since receiver or logger have gone on without a fix.
        enough_s = held.record.stamp_s + self._fix_wait_s
        overtaken = bool(self._stamps) and self._stamps[-1] >= enough_s
        return (
            now_s >= held.since_s + self._fix_wait_s
            or self._fixes.reached_s >= enough_s - ahead_s
            or (overtaken and now_s >= held.since_s + OTHER_WAY_S)
        )

    @property
    def _clock_ahead_s(self) -> float:
        """What the logger's clock is ahead of GNSS time [s], as far as its own receiver tells."""
        offsets = self.parser.gnss_offsets_s
        return float(np.median(offsets)) if offsets else 0.0

    def _placed(self, held: _Held) -> CountRecord:
        self.records_out += 1
        self._good.append(True)
        try:
            return place_record(held.record, self._place(held), self._frame)
        except UnusableRecordError as error:
            self.records_without_position += 1
            self._report(error, lost=False)
            return held.record

    def _place(self, held: _Held) -> Position | None:
        gap_s = position_gap_s(held.interval_s)
        if self._fixes.reached_s > -math.inf:
            tolerance_s = max(EDGE_TOLERANCE_S, held.interval_s / 2)  # any fix from within the interval
            place = self._fixes.at(held.middle_s - self._clock_ahead_s, gap_s, tolerance_s)
        else:
            place = self._own.at(held.middle_s, gap_s, EDGE_TOLERANCE_S)
        if place is not None or held.own is not None:
            return place or held.own
        stand = self._site.location
        if stand is None or len(self._fixes) or len(self._own):
            return None
        return Position(
            stand.latitude_deg, stand.longitude_deg, NAN if stand.altitude_m is None else stand.altitude_m
        )

    def _report(self, error: UnusableRecordError, lost: bool) -> None:
        mistake = Mistake(error.message, error.remedy, None, self.parser.line_number)
        self.logger_problems.take(Problem(error.kind, mistake, lost))
        if lost:
            self._good.append(False)
