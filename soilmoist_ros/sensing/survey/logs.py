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
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, listing
from soilmoist_ros.sensing.checks.record_checks import unlikely_weather
from soilmoist_ros.sensing.corrections.factors import absolute_humidity_gm3
from soilmoist_ros.sensing.formats.logger_reader import MAX_CLOCK_CHANGE_S, LogFile
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import Track
from soilmoist_ros.sensing.problems import Finding, Kind, Problem
from soilmoist_ros.sensing.records import CountRecord, LoggerRecord, Position, utc_text
from soilmoist_ros.sensing.survey.correction import (
    counting_interval_s,
    live_time_s,
    unusual_factors,
    unusual_pressure,
)
from soilmoist_ros.sensing.survey.survey import Survey

MIN_OVERLAP = 0.2  # share of a counting interval that lies before the record before, from which the two overlap
MIN_OVERLAP_S = 5.0  # overlap that rounded stamps and late lines do not cause [s]
MIN_BARE = 0.3  # counts of a tube relative to the others below which it is not connected, rather than bare
CHANCE_SD = 4.0  # standard deviations of a count that chance explains: a log of minutes shows no bare tube
BARE_SHARE = 0.7
"""Counts of a tube relative to the others below which it may be bare: a thermal tube counts about half."""
MIN_ALIKE = 20  # number of records from which common factors of all counts are no chance
_CHANGED = re.compile(r"corr|smooth|mov_?avg|filtered|norm")
_Entry = tuple[Path, LoggerRecord]
"""A log and one of its records."""


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


def process_logs(
    logs: Sequence[LogFile],
    site: Site,
    frame: LocalFrame | None = None,
    track: Track | None = None,
    times_s: tuple[float, float] = (-math.inf, math.inf),
) -> SurveyRecords:
    """Correct and geo-tag the records of one probe.

    :param frame: plane of the coordinates; centred on the mean position if ``None``
    :param track: positions of a separate GNSS receiver; if ``None``, the positions in the logs are used
    :param times_s: begin and end of the part that is used, by the clock of the logger [s since 1970-01-01 UTC]
    :raises InputError: if the logs are of different probes, or were read with another clock than that of the site,
        or no record can be placed and corrected
    """
    _require_clock(logs, site.logger_clock)
    entries = [one for one in _in_order_of_time(logs) if times_s[0] < one[1].stamp_s <= times_s[1]]
    problems = [*(problem for log in logs for problem in log.problems), *log_doubts(logs)]
    entries = _without_duplicates(entries, problems)
    problems += _require_same_time([record for _, record in entries], track, site)
    if any(map(_was_set, logs)):
        # A clock that was set mixes or parts the records of a survey: their order is that of GNSS time.
        shifted = ((path, _by_gnss_time(record)) for path, record in entries)
        entries = sorted(shifted, key=lambda entry: entry[1].stamp_s)
    elif track is None:  # positions in a log have the time of the logger's clock, those of a receiver GNSS time
        entries = [(path, replace(record, clock_ahead_s=0.0)) for path, record in entries]
    records = [record for _, record in entries]
    survey = _survey_of(records, site, frame, track, problems)
    if frame is None:
        survey.frame = _frame_about(survey, records)
    found: list[CountRecord] = []
    for path, record in entries:
        survey.take_record(record, path=path)
        found += survey.take_ready()
    whole = [*survey.checks.totals.findings, *unlikely_weather(records)]
    problems += [finding.at() for finding in whole]
    good = tuple(record for record in found if not record.quarantine)
    quarantined = tuple(record for record in found if record.quarantine)
    if not good or survey.frame is None or survey.tube_share is None:
        raise InputError(_all_lost(logs, problems))
    return SurveyRecords(good, survey.frame, tuple(problems), survey.tube_share, quarantined)


def _was_set(log: LogFile) -> bool:
    """True if the logger's clock was set during a log, by its offsets from GNSS time."""
    changes_s = (abs(after.clock_ahead_s - before.clock_ahead_s) for before, after in pairwise(log.records))
    return any(change_s > MAX_CLOCK_CHANGE_S for change_s in changes_s)


def _by_gnss_time(record: LoggerRecord) -> LoggerRecord:
    return replace(record, stamp_s=record.stamp_s - record.clock_ahead_s, clock_ahead_s=0.0)


def why_unplaced(records: Sequence[LoggerRecord], track: Track, clock_known: bool = False) -> Mistake | None:
    """Reason why positions of a separate receiver are not those of records, ``None`` if they are.

    :param clock_known: whether it was stated which time the logger's clock shows
    """
    first, last = (pick(records, key=lambda record: record.stamp_s) for pick in (min, max))
    begin_s = first.stamp_s - live_time_s(first)
    return track.heard.why_not_at(begin_s, last.stamp_s, clock_known)


def _require_same_time(records: Sequence[LoggerRecord], track: Track | None, site: Site) -> list[Problem]:
    """Check that positions of a separate receiver are of the time of the records that have none."""
    if track is None or not track.heard.epochs:
        return []
    why = why_unplaced(list(map(_by_gnss_time, records)), track, site.logger_clock is not None)
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
    for log in logs:
        read = log.logger.time.zone or log.logger.time.utc_offset_hours
        if read != clock:
            used, wanted = (one if isinstance(one, str) else f"UTC{one:+g} h" for one in (read, clock))
            remedy = "read_log(path, utc_offset_hours=site.logger_clock)"
            raise InputError(f"was read with a clock of {used}, and the site has {wanted}", remedy, log.path)


@dataclass(frozen=True)
class CalibrationCounts:
    """Counts of a probe during a calibration, with the mean weather.

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
    everything = [record for _, record in _in_order_of_time(logs)]
    raw = [record for record in everything if start_s < record.stamp_s <= end_s]
    if not raw:
        first, last = (utc_text(everything[index].stamp_s) for index in (0, -1))
        raise InputError(
            "has no record between these times", f"the log lasts from {first} to {last} UTC", logs[0].path
        )
    problems: list[Problem] = []
    found = _corrected(everything, site, problems)
    good = [record for record in found if start_s < record.stamp_s <= end_s and not record.quarantine]
    if not any(record.raw_counts for record in good):
        reasons = [problem for problem in problems if problem.kind is not Kind.NO_POSITION]
        if not any(problem.consequence != "kept" for problem in reasons):
            raise InputError("has no counts between these times", "check the detector", logs[0].path)
        raise InputError(_reasons([*(problem for log in logs for problem in log.problems), *reasons]))
    pressures = [record.pressure_hpa for record in raw]
    humidities = [
        absolute_humidity_gm3(record.temperature_degc, record.relative_humidity)
        for record in raw
        if math.isfinite(record.temperature_degc + record.relative_humidity)
    ]
    return CalibrationCounts(
        sum(record.raw_counts for record in good), math.fsum(record.effective_exposure_s for record in good),
        len(good), len(raw) - len(good), _mean(pressures), _mean(humidities), raw[0].stamp_s, raw[-1].stamp_s,
        {
            name: (min(values), max(values))
            for name in ("f_pressure", "f_humidity", "f_intensity")
            if (values := [getattr(record, name) for record in good])
        },
        next((one.message for one in _reasons(problems)), ""),
    )  # fmt: skip


def stationary_records(logs: Sequence[LogFile], site: Site) -> list[CountRecord]:
    """Corrected good records of a stationary probe, in order of time, with or without a position.

    :raises InputError: if the logs are of different probes
    """
    found = _corrected([record for _, record in _in_order_of_time(logs)], site, [])
    return [record for record in found if not record.quarantine]


def _corrected(records: Sequence[LoggerRecord], site: Site, problems: list[Problem]) -> list[CountRecord]:
    """Corrected records with or without a position."""
    survey = _survey_of(records, site, None, None, problems, keep_unplaced=True)
    for record in records:
        survey.take_record(record)
    return survey.take_ready()


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return math.fsum(finite) / len(finite) if finite else math.nan


def _in_order_of_time(logs: Sequence[LogFile]) -> list[_Entry]:
    """All records of one probe, at least one."""
    probes: dict[str, Path] = {}
    for log in logs:
        if log.serial:
            probes.setdefault(log.serial, log.path)
    if len(probes) > 1:
        remedy = "map the logs of each probe separately: probes differ in sensitivity"
        raise InputError([Mistake(f"was written by probe {one}", remedy, path) for one, path in probes.items()])
    entries = [(log.path, record) for log in logs for record in log.records]
    if not entries:
        raise InputError(_all_lost(logs, [problem for log in logs for problem in log.problems]))
    return sorted(entries, key=lambda entry: entry[1].stamp_s)


def _identity(record: LoggerRecord) -> tuple[float, int, str]:
    """Key of a record that is in two files; NaN differs from itself, so a missing tube is compared by its text."""
    return record.stamp_s, record.record_number, str(record.tube_counts)


def _without_duplicates(entries: list[_Entry], problems: list[Problem]) -> list[_Entry]:
    """Drop records that occur in two files."""
    seen: dict[tuple[float, int, str], _Entry] = {}
    for entry in entries:
        path, record = entry
        first = seen.setdefault(_identity(record), entry)
        if first is not entry:
            mistake = Mistake(
                f"repeats the record of {first[0]}:{first[1].line}", "give every log once", path, record.line
            )
            problems.append(Problem(Kind.DUPLICATE, mistake, lost=True))
    return list(seen.values())


def _survey_of(
    records: Sequence[LoggerRecord],
    site: Site,
    frame: LocalFrame | None,
    track: Track | None,
    problems: list[Problem],
    keep_unplaced: bool = False,
) -> Survey:
    """A survey with all records known in advance."""
    if len({len(record.tube_counts) for record in records}) > 1:
        raise InputError("the logs have different numbers of tubes", "map the logs of each probe separately")
    try:
        return Survey(site, frame, records, track, keep_unplaced=keep_unplaced, on_problem=problems.append)
    except ValueError as error:
        raise InputError(f"the logs cannot be used: {error}", "check the detector") from None


def _frame_about(survey: Survey, records: Sequence[LoggerRecord]) -> LocalFrame | None:
    """The plane centred on the mean position, ``None`` if no position is known."""
    places: list[Position] = []
    previous: LoggerRecord | None = None
    for record in records:
        place = survey.places.at(record, counting_interval_s(record, previous))
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
    Kind.NOT_A_NUMBER, Kind.OUT_OF_RANGE, Kind.IMPOSSIBLE_WEATHER, Kind.SENTINEL, Kind.MISSING_COLUMN,
    Kind.OTHER_UNIT,
)  # fmt: skip
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
    unique = {_identity(record): record for log in logs for record in log.records}
    records = sorted(unique.values(), key=lambda record: record.stamp_s)
    if not records:
        return
    stamps = np.array([record.stamp_s for record in records])
    live_s = np.array(list(map(live_time_s, records)))
    for found in (
        *_rates(records, logs[0]),
        *_overlaps(stamps, live_s, records),
        *_units(stamps, live_s),
        *_tubes(logs),
    ):
        yield found.at(logs[0].path)


def _rates(records: Sequence[LoggerRecord], log: LogFile) -> Iterator[Finding]:
    """Numbers that are read as counts, and seem to be a rate, or corrected."""
    names = listing(name for number, name in log.tubes.items() if number not in log.left_out_counts)
    if _CHANGED.search(names.casefold()):
        message = f"by their name, {names} are corrected or smoothed: they would be corrected twice"
        yield Finding(Kind.NOT_COUNTS, message, "take the raw counts, whose counting statistics hold")
    if log.logger.counts.unit != "counts":
        return
    unit, why = log.count_rate, "so the header says"
    if not unit and len(records) >= MIN_ALIKE:
        numbers = {int(count) for record in records for count in record.tube_counts if count > 0}
        factor = math.gcd(*numbers)
        unit = "counts_per_hour" if len(numbers) > 3 and factor % 60 == 0 else ""
        why = f"all are multiples of {factor}"
    if unit:
        message = f"the counts of {names} may be a rate, {unit.replace('_', ' ')}: {why}"
        remedy = f"if it is, write 'unit: {unit}' below 'counts' in a copy of the logger format"
        yield Finding(Kind.NOT_COUNTS, message, remedy)


def _overlaps(
    stamps: NDArray[np.float64], live_s: NDArray[np.float64], records: Sequence[LoggerRecord]
) -> Iterator[Finding]:
    """Counting intervals that begin before the record before: a clock was set back, or a live time is too long."""
    overlap_s = live_s[1:] - np.diff(stamps)
    over = np.flatnonzero(overlap_s > np.maximum(MIN_OVERLAP * live_s[1:], MIN_OVERLAP_S)) + 1
    if not len(over):
        return
    first = records[over[0]]
    begin, end, at = (
        f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d %H:%M UTC}"
        for stamp_s in (stamps[0], stamps[-1], first.stamp_s)
    )
    message = (
        f"{_hours(math.fsum(live_s))} were counted in the {_hours(stamps[-1] - stamps[0] + live_s[0])} from "
        f"{begin} to {end}: {len(over)} record{'s' * (len(over) > 1)} began to count before the record before "
        f"ended, first at {at} (line {first.line})"
    )
    remedy = (
        "if the clock of the logger changes to summer time, name its zone in the site file "
        "(logger_time_zone: Europe/Berlin); else check if the clock was set there, or if the record was shorter"
    )
    if len(over) > len(records) / 2:
        remedy = "check live_time and record_period of the logger format, and their units"
    yield Finding(Kind.OVERLAP, message, remedy)


def _units(stamps: NDArray[np.float64], live_s: NDArray[np.float64]) -> Iterator[Finding]:
    """A live time whose unit is another one: it is a sixtieth of the time between records, for example."""
    steps_s, usual_s = np.diff(stamps), float(np.median(live_s))
    steps_s = steps_s[steps_s > 0]
    share = usual_s / float(np.median(steps_s)) if len(steps_s) else 1.0
    for factor, words in ((60, "minutes"), (3600, "hours")):
        if 0.8 < share * factor < 1.1:
            part = f"{usual_s:g} s, 1/{factor} of the time between them"
            message = f"records count {part}: the live time may be in {words}"
            remedy = "correct 'unit' below 'live_time' in the logger format"
            yield Finding(Kind.LIVE_TIME_UNIT, message, remedy)


def _tubes(logs: Sequence[LogFile]) -> Iterator[Finding]:
    """Tubes that count as if another one were the moderated tube."""
    numbers, out = list(logs[0].tubes), logs[0].left_out_counts
    counts = [one.tube_counts for log in logs for one in log.records if len(one.tube_counts) == len(numbers)]
    if not numbers or not counts:
        return
    totals = dict(zip(numbers, np.nansum(counts, axis=0).tolist(), strict=True))
    left_out = {number: sum(log.left_out_counts.get(number, 0.0) for log in logs) for number in out}
    used = {number: total for number, total in totals.items() if number not in left_out}
    mean = float(np.mean(list(used.values()))) if used else 0.0
    for number, total in left_out.items():
        if mean > 0 and total - CHANCE_SD * math.sqrt(total) > mean / BARE_SHARE:
            message = (
                f"tube {number}, which the format leaves out, counts {total / mean:.2f} times what tube "
                f"{', '.join(map(str, used))} counts: a moderated tube counts more than a bare one"
            )
            remedy = f"if tube {number} is the moderated one, copy the logger format and leave the other one out"
            yield Finding(Kind.OTHER_TUBE, message, remedy)
    strong = float(np.median(sorted(used.values())[len(used) // 2 :])) if len(used) > 1 else 0.0
    for weak, total in used.items():
        if MIN_BARE * strong < total < BARE_SHARE * strong - CHANCE_SD * math.sqrt(total):
            message = (
                f"tube {weak} counts {total / strong:.2f} times what the others count: it may be bare (thermal)"
            )
            remedy = f"if it is bare, copy the logger format and write 'left_out: [{weak}]' below 'counts'"
            yield Finding(Kind.OTHER_TUBE, message, remedy)


def _hours(time_s: float) -> str:
    hours = time_s / 3600
    return f"{hours:.2f} h" if hours < 10 else f"{hours:,.0f} h"
