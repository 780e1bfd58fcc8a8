# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The logs of a survey to corrected, geo-tagged counts and a list of problems; doubts about whole logs."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, listing
from soilmoist_ros.sensing.checks.weather import unlikely_weather
from soilmoist_ros.sensing.corrections.factors import absolute_humidity_gm3
from soilmoist_ros.sensing.formats.logger_reader import LogFile
from soilmoist_ros.sensing.gnss import utc_text
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import NO_ARMS, LeverArms, Track
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.correction import counting_interval_s, unusual_factors, unusual_pressure
from soilmoist_ros.sensing.survey.survey import Survey

MIN_OVERLAP = 0.2  # share of a counting interval that lies before the record before, from which the two overlap
MIN_OVERLAP_S = 5.0  # overlap that rounded stamps and late lines do not cause [s]
MONTH_S = 20 * 86_400.0  # time between two days that is one of months [s]
MIN_MONTHS = 3  # number of such times that make the order of day and month doubtful
MIN_BARE = 0.3  # counts of a tube relative to the others below which it is not connected, rather than bare
CHANCE_SD = 4.0  # standard deviations of a count that chance explains: a log of minutes shows no bare tube
BARE_SHARE = 0.7
"""Counts of a tube relative to the others below which it may be bare: a thermal tube counts about half."""
MIN_ALIKE = 20  # number of records from which common factors of all counts are no chance
_CHANGED = re.compile(r"corr|smooth|mov_?avg|filtered|norm")


@dataclass(frozen=True, repr=False)
class SurveyRecords:
    """The processed logs of one survey: good and quarantined records, corrected and geo-tagged, in order of time.

    :param problems: faults of all records that were dropped, or kept with a note
    :param tube_share: share of each tube in the rate of the whole sensor, shape (tubes,)
    """

    records: tuple[CountRecord, ...]
    frame: LocalFrame
    problems: tuple[Problem, ...]
    tube_share: NDArray[np.float64]
    quarantined: tuple[CountRecord, ...] = ()

    def __repr__(self) -> str:
        lost = sum(problem.lost for problem in self.problems)
        return f"SurveyRecords({len(self.records)} records, {lost} lost, {len(self.tube_share)} tubes)"

    @property
    def all_records(self) -> list[CountRecord]:
        """Good and quarantined records in order of time."""
        return sorted([*self.records, *self.quarantined], key=lambda record: record.stamp_s)

    @property
    def xy_m(self) -> NDArray[np.float64]:
        """Places of the records, shape (n, 2) [m]."""
        return np.array([(record.x_m, record.y_m) for record in self.records], dtype=float).reshape(-1, 2)

    @property
    def raw_counts(self) -> NDArray[np.float64]:
        """Raw counts of the records, shape (n,)."""
        return np.array([record.raw_counts for record in self.records], dtype=float)

    @property
    def effective_exposure_s(self) -> NDArray[np.float64]:
        """Effective exposures of the records, shape (n,) [s]."""
        return np.array([record.effective_exposure_s for record in self.records], dtype=float)


@dataclass(frozen=True)
class _Entry:
    """A record, its log, and the logger's clock minus GNSS time [s], 0 if unknown."""

    log: LogFile
    record: LoggerRecord
    clock_ahead_s: float


def process_logs(
    logs: Sequence[LogFile],
    site: Site,
    frame: LocalFrame | None = None,
    track: Track | None = None,
    arms: LeverArms = NO_ARMS,
    times_s: tuple[float, float] = (-math.inf, math.inf),
) -> SurveyRecords:
    """Correct and geo-tag the records of one probe.

    :param frame: plane of the coordinates; centred on the mean position if ``None``
    :param track: positions of a separate GNSS receiver; if ``None``, the positions in the logs are used
    :param arms: where antenna and sensor sit on the robot
    :param times_s: begin and end of the part that is used, by the clock of the logger [s since 1970-01-01 UTC]
    :raises InputError: if the logs are of different probes, or were read with another clock than that of the site,
        or no record can be placed and corrected
    """
    _require_clock(logs, site.logger_clock)
    entries = [one for one in _in_order_of_time(logs) if times_s[0] < one.record.stamp_s <= times_s[1]]
    problems = [*(problem for log in logs for problem in log.problems), *log_doubts(logs)]
    remedy = "set the clock before each survey; places are found with the drift taken off"
    set_before = "set the clock before each survey; each part of the log is placed by its own offset"
    for log in logs:
        drifting = [clock for clock in log.clock.segments if clock.is_clear]
        problems += [Problem(Kind.CLOCK_DRIFT, Mistake(clock.message, remedy, log.path)) for clock in drifting]
        problems += [Problem(Kind.CLOCK_OFFSET, Mistake(step, set_before, log.path)) for step in log.clock.steps]
    entries = _without_duplicates(entries, problems)
    problems += _require_same_time(entries, track, site)
    if any(log.clock.n_steps for log in logs):
        entries = _by_gnss_time(entries)
    survey = _survey_of([entry.record for entry in entries], site, frame, track, problems, arms)
    # Positions in a log have the time of the logger's clock; positions of a separate receiver have GNSS time.
    ahead_s = [0.0 if track is None else entry.clock_ahead_s for entry in entries]
    if frame is None:
        survey.frame = _frame_about(survey, entries, ahead_s)
    found: list[CountRecord] = []
    for entry, clock_ahead_s in zip(entries, ahead_s, strict=True):
        survey.take_record(entry.record, clock_ahead_s=clock_ahead_s, path=entry.log.path)
        found += survey.take_ready()
    whole = [*survey.checks.totals.findings, *unlikely_weather([entry.record for entry in entries])]
    problems += [Problem(finding.kind, Mistake(finding.message, finding.remedy)) for finding in whole]
    records = tuple(record for record in found if not record.quarantine)
    quarantined = tuple(record for record in found if record.quarantine)
    if not records or survey.frame is None or survey.tube_share is None:
        raise InputError(_all_lost(logs, problems))
    return SurveyRecords(records, survey.frame, tuple(problems), survey.tube_share, quarantined)


def why_unplaced(records: Sequence[LoggerRecord], track: Track, clock_known: bool = False) -> Mistake | None:
    """Reason why positions of a separate receiver are not those of records, ``None`` if they are.

    :param clock_known: whether it was stated which time the logger's clock shows
    """
    first, last = (pick(records, key=lambda record: record.stamp_s) for pick in (min, max))
    begin_s = first.stamp_s - max([live for live in first.tube_live_s if math.isfinite(live)], default=0.0)
    return track.heard.why_not_at(begin_s, last.stamp_s, clock_known)


def _require_same_time(entries: Sequence[_Entry], track: Track | None, site: Site) -> list[Problem]:
    """Check that positions of a separate receiver are of the time of the records that have none."""
    if track is None or not track.heard.epochs:
        return []
    records = [replace(entry.record, stamp_s=entry.record.stamp_s - entry.clock_ahead_s) for entry in entries]
    why = why_unplaced(records, track, site.logger_clock is not None)
    if why is None:
        return []
    if not any(record.position for record in records):
        raise InputError([why])
    message = f"the positions of the separate receiver are not used: {why.message}"
    return [Problem(Kind.DOUBTFUL_POSITIONS, replace(why, message=message))]


def _require_clock(logs: Sequence[LogFile], clock: float | str | None) -> None:
    """Check that logs were read with the site's clock: otherwise all times are wrong by hours."""
    if clock is None:
        return
    used = [(log.logger.time.zone if log.logger else "") or log.utc_offset_hours for log in logs]
    mistakes = [
        Mistake(
            f"was read with a clock of {_clock_text(read)}, and the site has {_clock_text(clock)}",
            "read_log(path, utc_offset_hours=site.logger_clock)",
            log.path,
        )
        for log, read in zip(logs, used, strict=True)
        if read != clock
    ]
    if mistakes:
        raise InputError(mistakes)


def _clock_text(clock: float | str) -> str:
    return clock if isinstance(clock, str) else f"UTC{clock:+g} h"


@dataclass(frozen=True)
class CalibrationCounts:
    """What a probe counted during a calibration.

    :param raw_counts: raw counts of the good records
    :param left_out: number of records that were quarantined or cannot be corrected
    :param pressure_hpa: mean air pressure [hPa], NaN if unknown
    :param humidity_gm3: mean absolute humidity [g/m^3], NaN if unknown
    :param first_s: stamp of the first record [s since 1970-01-01 UTC], NaN without records
    :param factors: least and greatest factor of each correction [-], by its name
    :param reason: most frequent reason of the records that are left out, with an example
    """

    raw_counts: int
    effective_exposure_s: float
    records: int
    left_out: int
    pressure_hpa: float
    humidity_gm3: float
    first_s: float = math.nan
    last_s: float = math.nan
    factors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reason: str = ""

    @property
    def rate_cps(self) -> float:
        """Corrected rate [counts/s]."""
        return self.raw_counts / self.effective_exposure_s

    @property
    def rate_sd_cps(self) -> float:
        """Standard deviation of the rate [counts/s]."""
        return math.sqrt(self.raw_counts) / self.effective_exposure_s

    @property
    def factors_text(self) -> str:
        """Ranges of the factors, in words."""
        names = {"f_pressure": "pressure", "f_humidity": "humidity", "f_intensity": "incoming neutrons"}
        return ", ".join(f"{names[name]} {low:.3f} to {high:.3f}" for name, (low, high) in self.factors.items())

    def doubts(self, site: Site) -> list[str]:
        """Doubts about factors that are far from 1, and about a pressure that does not fit the altitude."""
        pressure = unusual_pressure(self.pressure_hpa, site)
        return [*unusual_factors(self.factors), *([pressure] if pressure else [])]


def calibration_counts(
    logs: Sequence[LogFile], site: Site, start_s: float = -math.inf, end_s: float = math.inf
) -> CalibrationCounts:
    """Counts and weather of the good records between two times, with or without a position.

    :raises InputError: if the logs are of different probes, or no good record lies between the times
    """
    everything = [entry.record for entry in _in_order_of_time(logs)]
    raw = [record for record in everything if start_s < record.stamp_s <= end_s]
    if not raw:
        first, last = (utc_text(everything[index].stamp_s) for index in (0, -1))
        raise InputError(
            "has no record between these times", f"the log lasts from {first} to {last} UTC", logs[0].path
        )
    problems: list[Problem] = []
    survey = _survey_of(everything, site, None, None, problems, keep_unplaced=True)
    for record in everything:
        survey.take_record(record)
    found = [record for record in survey.take_ready() if start_s < record.stamp_s <= end_s]
    good = [record for record in found if not record.quarantine]
    if not any(record.raw_counts for record in good):
        reasons = [problem for problem in problems if problem.kind is not Kind.NO_POSITION]
        if not any(problem.consequence != "kept" for problem in reasons):
            raise InputError("has no counts between these times", "check the detector", logs[0].path)
        raise InputError(_reasons([*(problem for log in logs for problem in log.problems), *reasons]))
    air = [record for record in raw if math.isfinite(record.temperature_degc + record.relative_humidity)]
    return CalibrationCounts(
        sum(record.raw_counts for record in good),
        math.fsum(record.effective_exposure_s for record in good),
        len(good),
        len(raw) - len(good),
        _mean([record.pressure_hpa for record in raw if math.isfinite(record.pressure_hpa)]),
        _mean([absolute_humidity_gm3(record.temperature_degc, record.relative_humidity) for record in air]),
        raw[0].stamp_s,
        raw[-1].stamp_s,
        {
            name: (min(values), max(values))
            for name in ("f_pressure", "f_humidity", "f_intensity")
            if (values := [getattr(record, name) for record in good])
        },
        next((str(one.message) for one in _reasons(problems)), ""),
    )


def stationary_records(logs: Sequence[LogFile], site: Site) -> list[CountRecord]:
    """Corrected good records of a stationary probe, in order of time, with or without a position.

    :raises InputError: if the logs are of different probes
    """
    everything = [entry.record for entry in _in_order_of_time(logs)]
    survey = _survey_of(everything, site, None, None, [], keep_unplaced=True)
    for record in everything:
        survey.take_record(record)
    return [record for record in survey.take_ready() if not record.quarantine]


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan


def _in_order_of_time(logs: Sequence[LogFile]) -> list[_Entry]:
    """All records of one probe, at least one."""
    probes: dict[str, LogFile] = {}
    for log in logs:
        if log.serial:
            probes.setdefault(log.serial, log)
    if len(probes) > 1:
        remedy = "map the logs of each probe separately: probes differ in sensitivity"
        raise InputError(
            [Mistake(f"was written by probe {serial}", remedy, log.path) for serial, log in probes.items()]
        )
    entries = [_Entry(log, *one) for log in logs for one in zip(log.records, _clock_ahead_s(log), strict=True)]
    if not entries:
        raise InputError(_all_lost(logs, [problem for log in logs for problem in log.problems]))
    return sorted(entries, key=lambda entry: entry.record.stamp_s)


def _without_duplicates(entries: list[_Entry], problems: list[Problem]) -> list[_Entry]:
    """Drop records that occur in two files."""
    seen: dict[tuple[object, ...], _Entry] = {}
    for entry in entries:
        record = entry.record
        # NaN differs from itself, so a missing tube is compared by its text.
        key = (record.stamp_s, record.record_number, str(record.tube_counts))
        first = seen.setdefault(key, entry)
        if first is not entry:
            message = f"repeats the record of {first.log.path}:{first.record.line}"
            mistake = Mistake(message, "give every log once", entry.log.path, record.line)
            problems.append(Problem(Kind.DUPLICATE, mistake, lost=True))
    return list(seen.values())


def _by_gnss_time(entries: Sequence[_Entry]) -> list[_Entry]:
    """Entries with stamps in GNSS time, in its order: a clock that was set mixes or parts those of a survey."""
    shifted = [
        replace(
            entry,
            record=replace(entry.record, stamp_s=entry.record.stamp_s - entry.clock_ahead_s),
            clock_ahead_s=0.0,
        )
        for entry in entries
    ]
    return sorted(shifted, key=lambda entry: entry.record.stamp_s)


def _survey_of(
    records: Sequence[LoggerRecord],
    site: Site,
    frame: LocalFrame | None,
    track: Track | None,
    problems: list[Problem],
    arms: LeverArms = NO_ARMS,
    keep_unplaced: bool = False,
) -> Survey:
    """A survey with all records known in advance."""
    if len({len(record.tube_counts) for record in records}) > 1:
        raise InputError("the logs have different numbers of tubes", "map the logs of each probe separately")
    try:
        return Survey(
            site, frame, records, track, arms=arms, keep_unplaced=keep_unplaced, on_problem=problems.append
        )
    except ValueError as error:
        raise InputError(f"the logs cannot be used: {error}", "check the detector") from None


def _clock_ahead_s(log: LogFile) -> list[float]:
    """Logger's clock minus GNSS time at each record of a log [s], 0 if unknown."""
    if not len(log.clock):
        return [log.clock_offset_s if math.isfinite(log.clock_offset_s) else 0.0] * len(log.records)
    ahead_s: list[float] = []
    rest = iter(log.records)
    # In the order of the file: after the clock was set back, its times come again.
    for clock in log.clock.segments:
        is_last, is_clear, median_s = clock is log.clock, clock.is_clear, clock.median_s
        for record in rest:
            ahead_s.append(clock.ahead_s(record.stamp_s) if is_clear else median_s)
            if record.stamp_s == clock.last_s and not is_last:
                break
    return ahead_s


def _frame_about(survey: Survey, entries: Sequence[_Entry], ahead_s: Sequence[float]) -> LocalFrame | None:
    """The plane centred on the mean position, ``None`` if no position is known."""
    places: list[Position] = []
    previous: LoggerRecord | None = None
    for entry, clock_ahead_s in zip(entries, ahead_s, strict=True):
        record = entry.record
        place = survey.position(record, counting_interval_s(record, previous), clock_ahead_s)
        places += [] if place is None else [place]
        previous = record
    if not places:
        return None
    # Rounded to about 10 m, so that users can note and retype the datum.
    latitude = float(np.mean([place.latitude_deg for place in places]))
    east = np.exp(1j * np.radians([place.longitude_deg for place in places]))
    return LocalFrame(round(latitude, 4), round(math.degrees(float(np.angle(east.mean()))), 4))


def _all_lost(logs: Sequence[LogFile], problems: Sequence[Problem]) -> list[Mistake]:
    """Reasons why no record is left, most frequent first, with one example each."""
    total = sum(len(log.records) for log in logs)
    head = Mistake(f"not one of {total} records can be placed on a map", "see the reasons below")
    return [head, *_reasons(problems)]


_NO_VALUE = (
    Kind.NOT_A_NUMBER,
    Kind.OUT_OF_RANGE,
    Kind.IMPOSSIBLE_WEATHER,
    Kind.SENTINEL,
    Kind.MISSING_COLUMN,
    Kind.OTHER_UNIT,
)
"""Kinds of problems after which a record lacks a value that its correction needs."""


def _reasons(problems: Sequence[Problem]) -> list[Mistake]:
    """Examples of the problems that took records, most frequent kind first, after values that were lost."""
    lost = [problem for problem in problems if problem.consequence != "kept"]
    if any(problem.kind is Kind.NO_POSITION for problem in lost):  # why the positions of the log are not used
        lost += [problem for problem in problems if problem.kind is Kind.BAD_POSITION]
    kinds = [kind for kind, _ in Counter(problem.kind for problem in lost).most_common()]
    values = [problem for problem in problems if problem.kind in _NO_VALUE and Kind.NO_CORRECTION in kinds]
    first = [kind for kind, _ in Counter(problem.kind for problem in values).most_common() if kind not in kinds]
    return [
        *(next(problem.mistake for problem in values if problem.kind is kind) for kind in first),
        *(next(problem.mistake for problem in lost if problem.kind is kind) for kind in kinds),
    ]


# Doubts about the meaning of whole logs: their times, and which of their tubes is moderated ---------------------


def log_doubts(logs: Sequence[LogFile]) -> Iterator[Problem]:
    """Doubts about the logs of one probe."""
    unique = {(one.stamp_s, one.record_number, str(one.tube_counts)): one for log in logs for one in log.records}
    records = sorted(unique.values(), key=lambda record: record.stamp_s)
    if not records:
        return
    found = [*_rates(records, logs), *_overlaps(records), *_units(records), *_months(records), *_tubes(logs)]
    for kind, message, remedy in found:
        yield Problem(kind, Mistake(message, remedy, logs[0].path))


def _rates(records: Sequence[LoggerRecord], logs: Sequence[LogFile]) -> Iterator[tuple[Kind, str, str]]:
    """Numbers that are read as counts, and seem to be a rate, or corrected."""
    log = logs[0]
    if log.logger is None:
        return
    names = listing(name for number, name in log.tubes.items() if number not in log.left_out_counts)
    if _CHANGED.search(names.casefold()):
        message = f"by their name, {names} are corrected or smoothed: they would be corrected twice"
        yield Kind.NOT_COUNTS, message, "take the raw counts, whose counting statistics hold"
    if log.logger.counts.unit != "counts":
        return
    unit, factor = log.count_rate, 0
    if not unit and len(records) >= MIN_ALIKE:
        numbers = [count for record in records for count in record.tube_counts if count > 0]
        factor = math.gcd(*(int(count) for count in numbers))
        unit = "counts_per_hour" if len(set(numbers)) > 3 and factor % 60 == 0 else ""
    if unit:
        why = f"all are multiples of {factor}" if factor else "so the header says"
        message = f"the counts of {names} may be a rate, {unit.replace('_', ' ')}: {why}"
        yield (
            Kind.NOT_COUNTS,
            message,
            f"if it is, write 'unit: {unit}' below 'counts' in a copy of the logger format",
        )


def _overlaps(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    """Counting intervals that begin before the record before: a clock was set back, or a live time is too long."""
    live_s = [max((live for live in one.tube_live_s if live > 0), default=0.0) for one in records]
    over = [
        (overlap_s, after)
        for (before, after), live in zip(pairwise(records), live_s[1:], strict=True)
        if (overlap_s := live - (after.stamp_s - before.stamp_s)) > max(MIN_OVERLAP * live, MIN_OVERLAP_S)
    ]
    if not over:
        return
    span_s = records[-1].stamp_s - records[0].stamp_s + live_s[0]
    first = over[0][1]
    begin, end = _minute_utc(records[0].stamp_s), _minute_utc(records[-1].stamp_s)
    many = f"{len(over)} record{'s' * (len(over) > 1)} began to count before the record before ended"
    message = (
        f"{_hours(math.fsum(live_s))} were counted in the {_hours(span_s)} from {begin} to {end}: "
        f"{many}, first at {_minute_utc(first.stamp_s)} (line {first.line})"
    )
    if len(over) > len(records) / 2:
        yield Kind.OVERLAP, message, "check live_time and record_period of the logger format, and their units"
        return
    yield (
        Kind.OVERLAP,
        message,
        "if the clock of the logger changes to summer time, name its zone in the site file "
        "(logger_time_zone: Europe/Berlin); else check if the clock was set there, or if the record was shorter",
    )


def _units(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    """A live time whose unit is another one: it is a sixtieth of the time between records, for example."""
    live_s = float(
        np.median([max((live for live in one.tube_live_s if live > 0), default=0.0) for one in records])
    )
    steps = [step_s for a, b in pairwise(records) if (step_s := b.stamp_s - a.stamp_s) > 0]
    share = live_s / float(np.median(steps)) if steps else 1.0
    for factor, words in ((60, "minutes"), (3600, "hours")):
        if 0.8 < share * factor < 1.1:
            message = (
                f"records count {live_s:g} s, 1/{factor} of the time between them: the live time may be in {words}"
            )
            yield Kind.LIVE_TIME_UNIT, message, "correct 'unit' below 'live_time' in the logger format"


def _months(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    days = sorted({int(record.stamp_s // 86_400) for record in records})
    jumps = [(one, other) for one, other in pairwise(days) if 86_400 * (other - one) > MONTH_S]
    if len(jumps) < MIN_MONTHS or 2 * len(jumps) < len(days) - 1:
        return
    one, other = (f"{datetime.fromtimestamp(86_400 * day, UTC):%Y-%m-%d}" for day in jumps[0])
    message = (
        f"the records lie on {len(days)} days, {len(jumps)} times a month or more apart, as {one} and {other}"
    )
    remedy = "if day and month are swapped, correct time.formats of the logger format; else map each survey alone"
    yield Kind.MONTHS_APART, message, remedy


def _tubes(logs: Sequence[LogFile]) -> Iterator[tuple[Kind, str, str]]:
    """Tubes that count as if another one were the moderated tube."""
    log = logs[0]
    records = [record for one in logs for record in one.records if len(record.tube_counts) == len(log.tubes)]
    if not log.tubes or not records:
        return
    numbers = list(log.tubes)
    totals = np.nansum([record.tube_counts for record in records], axis=0)
    left_out = {
        number: sum(one.left_out_counts.get(number, 0.0) for one in logs) for number in log.left_out_counts
    }
    used = {number: total for number, total in zip(numbers, totals, strict=True) if number not in left_out}
    mean = float(np.mean(list(used.values()))) if used else 0.0
    for number, total in left_out.items():
        if mean > 0 and total - CHANCE_SD * math.sqrt(total) > mean / BARE_SHARE:
            message = (
                f"tube {number}, which the format leaves out, counts {total / mean:.2f} times what tube "
                f"{', '.join(map(str, used))} counts: a moderated tube counts more than a bare one"
            )
            remedy = f"if tube {number} is the moderated one, copy the logger format and leave the other one out"
            yield Kind.OTHER_TUBE, message, remedy
    strong = float(np.median(sorted(used.values())[len(used) // 2 :])) if len(used) > 1 else 0.0
    for weak, total in used.items():
        if total <= MIN_BARE * strong or total + CHANCE_SD * math.sqrt(total) >= BARE_SHARE * strong:
            continue
        message = f"tube {weak} counts {total / strong:.2f} times what the others count: it may be bare (thermal)"
        remedy = f"if it is bare, copy the logger format and write 'left_out: [{weak}]' below 'counts'"
        yield Kind.OTHER_TUBE, message, remedy


def _hours(time_s: float) -> str:
    hours = time_s / 3600
    return f"{hours:.2f} h" if hours < 10 else f"{hours:,.0f} h"


def _minute_utc(stamp_s: float) -> str:
    return datetime.fromtimestamp(stamp_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
