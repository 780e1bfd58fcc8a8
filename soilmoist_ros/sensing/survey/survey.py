"""Logs of a survey -> corrected, geo-tagged counts, with an account of everything that was lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.corrections.tubes import tube_shares
from soilmoist_ros.sensing.formats.logger_reader import LogFile
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import Track
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.record_correction import (
    UnusableRecordError,
    Weather,
    correct_record,
    counting_interval_s,
    intensity_source,
    place_record,
    position_gap_s,
)

MAX_WEATHER_GAP_S = 1800.0
"""Missing weather values are interpolated in time over gaps up to this long [s]."""


@dataclass(frozen=True)
class Survey:
    """The processed logs of one survey.

    :param records: corrected, geo-tagged records in order of time
    :param frame: plane in which they lie
    :param problems: everything that was dropped or kept with a reservation
    :param tube_share: share of each tube in the rate of the whole sensor, shape (tubes,)
    """

    records: tuple[CountRecord, ...]
    frame: LocalFrame
    problems: tuple[Problem, ...]
    tube_share: NDArray[np.float64]

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
    """One record on its way through the survey."""

    log: LogFile
    record: LoggerRecord


def process_logs(
    logs: Sequence[LogFile],
    site: Site,
    frame: LocalFrame | None = None,
    track: Track | None = None,
) -> Survey:
    """Correct and geo-tag the records of one probe.

    :param logs: parsed logs, in any order
    :param site: corrections and tubes
    :param frame: plane to place the records in; about the first position if ``None``
    :param track: positions of a separate GNSS receiver; those of the logger are used if ``None``
    :raises InputError: if the logs are of different probes, or not one record can be placed and corrected
    """
    _require_one_probe(logs)
    entries = sorted(
        (_Entry(log, record) for log in logs for record in log.records), key=lambda entry: entry.record.stamp_s
    )
    problems = [problem for log in logs for problem in log.problems]
    entries = _without_duplicates(entries, problems)
    if not entries:
        raise InputError(_all_lost(logs, problems))
    shares = _shares([entry.record for entry in entries], site)
    places = _positions(entries, site, track)
    frame = frame or _frame_about(places)
    weather = fill_weather([entry.record for entry in entries])
    monitor = intensity_source(site.corrections)
    records = []
    for entry, position, air in zip(entries, places, weather, strict=True):
        try:
            corrected = correct_record(entry.record, air, site, monitor, shares)
            records.append(place_record(corrected, position, frame))
        except UnusableRecordError as loss:
            mistake = Mistake(loss.message, loss.remedy, entry.log.path, entry.record.line)
            problems.append(Problem(loss.kind, mistake, lost=True))
    if not records or frame is None:
        raise InputError(_all_lost(logs, problems))
    return Survey(tuple(records), frame, tuple(problems), shares)


def fill_weather(records: Sequence[LoggerRecord]) -> list[Weather]:
    """Weather at each record; short gaps are interpolated in time, long ones stay NaN.

    :param records: records in order of time
    """
    stamps = np.array([record.stamp_s for record in records], dtype=float)
    columns = [
        _fill(stamps, np.array([getattr(record, name) for record in records], dtype=float))
        for name in ("pressure_hpa", "temperature_degc", "relative_humidity")
    ]
    return [Weather(*map(float, values)) for values in zip(*columns, strict=True)]


def _fill(stamps: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    at = stamps[known]
    after = np.clip(np.searchsorted(at, stamps), 1, max(len(at) - 1, 1))
    before_s, after_s = at[after - 1], at[np.minimum(after, len(at) - 1)]
    inside = (stamps >= before_s) & (stamps <= after_s) & (after_s - before_s <= MAX_WEATHER_GAP_S)
    nearest_s = np.minimum(np.abs(stamps - before_s), np.abs(stamps - after_s))
    usable = inside | (nearest_s <= MAX_WEATHER_GAP_S / 2)
    return np.asarray(np.where(known, values, np.where(usable, np.interp(stamps, at, values[known]), np.nan)))


def corrected_counts(logs: Sequence[LogFile], site: Site) -> tuple[list[int], list[float]]:
    """Raw counts and effective exposures [s] of all records, wherever they were taken, as for a calibration.

    :raises InputError: if the logs are of different probes, or a record cannot be corrected
    """
    _require_one_probe(logs)
    records = sorted((record for log in logs for record in log.records), key=lambda record: record.stamp_s)
    if not records:
        raise InputError(_all_lost(logs, [problem for log in logs for problem in log.problems]))
    shares, monitor = _shares(records, site), intensity_source(site.corrections)
    try:
        corrected = [
            correct_record(record, air, site, monitor, shares)
            for record, air in zip(records, fill_weather(records), strict=True)
        ]
    except UnusableRecordError as loss:
        raise InputError(loss.message, loss.remedy, logs[0].path) from None
    return [record.raw_counts for record in corrected], [record.effective_exposure_s for record in corrected]


def _require_one_probe(logs: Sequence[LogFile]) -> None:
    probes: dict[str, LogFile] = {}
    for log in logs:
        if log.serial:
            probes.setdefault(log.serial, log)
    if len(probes) > 1:
        remedy = "map the logs of each probe on their own: probes differ in sensitivity"
        raise InputError(
            [Mistake(f"was written by probe {serial}", remedy, log.path) for serial, log in probes.items()]
        )


def _without_duplicates(entries: list[_Entry], problems: list[Problem]) -> list[_Entry]:
    """Drop records that stand in two of the files."""
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


def _shares(records: Sequence[LoggerRecord], site: Site) -> NDArray[np.float64]:
    tubes = len(records[0].tube_counts)
    if any(len(record.tube_counts) != tubes for record in records):
        raise InputError("the logs have different numbers of tubes", "map the logs of each probe on their own")
    if site.tube_shares is None:
        return tube_shares(records)
    shares = np.array(site.tube_shares, dtype=float)
    if len(shares) != tubes or shares.sum() <= 0:
        raise InputError(
            f"'tube_shares' in the site file has {len(shares)} values, but the log has {tubes} tubes",
            "give one share per tube, or leave it out to have them estimated",
        )
    return np.asarray(shares / shares.sum())


def _positions(entries: Sequence[_Entry], site: Site, track: Track | None) -> list[Position | None]:
    """Position at the middle of each counting interval."""
    records = [entry.record for entry in entries]
    # A logger's own positions carry its own clock; a separate receiver's carry GNSS time.
    ahead_s = [0.0 if track is None else _clock_ahead_s(entry.log) for entry in entries]
    if track is None:
        own = [(record.stamp_s, record.position) for record in records if record.position is not None]
        if not own and site.location is not None:
            stand = site.location
            altitude = math.nan if stand.altitude_m is None else stand.altitude_m
            return [Position(stand.latitude_deg, stand.longitude_deg, altitude) for _ in records]
        track = Track.from_positions(own)
    places = []
    for index, record in enumerate(records):
        period_s = counting_interval_s(records[index], records[index - 1] if index else None)
        middle_s = record.stamp_s - period_s / 2 - ahead_s[index]
        place = track.at(middle_s, max_gap_s=position_gap_s(period_s))
        places.append(place if place is not None else record.position)
    return places


def _clock_ahead_s(log: LogFile) -> float:
    """What the logger's clock is ahead of GNSS time [s], as far as the log tells."""
    return log.clock_offset_s if math.isfinite(log.clock_offset_s) else 0.0


def _frame_about(places: Sequence[Position | None]) -> LocalFrame | None:
    known = [place for place in places if place is not None]
    if not known:
        return None
    # Rounded to about 10 m, so that the datum can be written down and typed in again.
    latitude = float(np.mean([place.latitude_deg for place in known]))
    east = np.exp(1j * np.radians([place.longitude_deg for place in known]))
    return LocalFrame(round(latitude, 4), round(math.degrees(float(np.angle(east.mean()))), 4))


def _all_lost(logs: Sequence[LogFile], problems: Sequence[Problem]) -> list[Mistake]:
    """Why nothing is left, most frequent reason first, one example each."""
    lost = [problem for problem in problems if problem.lost]
    kinds = sorted({problem.kind for problem in lost}, key=lambda kind: -sum(p.kind == kind for p in lost))
    examples = [next(problem.mistake for problem in lost if problem.kind == kind) for kind in kinds]
    total = sum(len(log.records) for log in logs)
    head = Mistake(f"not one of {total} records can be placed on a map", "see the reasons below")
    return [head, *examples]
