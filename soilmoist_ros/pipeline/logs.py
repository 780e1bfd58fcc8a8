# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads the logs of a survey: records of the logger, and positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, Mistake, distance_text, listing
from soilmoist_ros.mapping import PositionSource
from soilmoist_ros.recording import bag_of, is_bag
from soilmoist_ros.sensing import (
    CheckedTrack,
    Fix,
    Kind,
    LogFile,
    LoggerFormat,
    Problem,
    Site,
    Track,
    UndecidedOrderError,
    detect_format,
    distance_m,
    format_of_lines,
    load_logger_format,
    log_files,
    parse_log,
    read_log,
    read_positions,
    utc_text,
)

MAX_GAP_S = 60.0
"""Time between two fixes up to which a record counts as placed in the first check of the places [s]."""
MAX_APART_M = 2.0  # greatest distance of the positions of two files at the same time [m]
MAX_APART_AT_ONCE_M = 10.0
"""Greatest distance of positions of one file with one time: a fast vehicle, with times in whole seconds [m]."""
MIN_COMMON = 5  # least number of common times at which two files are compared
COMMON_GAP_S = 10.0  # time between two fixes of a file up to which those of another file are compared with it [s]
Progress = Callable[[str, float], None]
"""Called with the current step and its finished share [0..1]."""


def read_logs(
    paths: Sequence[Path],
    logger: str | None,
    site: Site,
    progress: Progress = lambda step, share: None,
    topic: str = "",
    skipped: list[Mistake] | None = None,
) -> list[LogFile]:
    """Read the logs of one probe.

    :param paths: log files, bags, or folders with such files, at least one
    :param logger: format, a shipped name or a file; detected from the header of the first log if ``None``
    :param topic: topic with the lines in bags; see :func:`.logger_topic` if empty
    :param skipped: gets the faults of files that cannot be used; errors if ``None``, or if no file can be used
    :raises InputError: if a file cannot be used, or if none can
    """
    form = load_logger_format(logger) if logger else None
    files = [one for path in map(bag_of, paths) for one in ([path] if is_bag(path) else log_files([path]))]
    mistakes, undecided = list[Mistake](), list[Path]()
    logs: dict[Path, LogFile] = {}
    for index, path in enumerate(files):
        progress("reading logs", index / len(files))
        try:
            if form is None:
                lines = _lines_of_bag(path, topic) if is_bag(path) else None
                form = detect_format(path) if lines is None else format_of_lines(lines, path)
            logs[path] = _read(path, form, site, topic)
        except InputError as error:
            first = next(iter(logs.values()), None)
            if isinstance(error, UndecidedOrderError):
                undecided.append(path)
            elif (
                first is not None and form is not None and (log := _continued(path, form, site, first)) is not None
            ):
                logs[path] = log
                continue
            mistakes += error.mistakes
    orders = (log.logger.time.date_order for log in logs.values() if log.logger.time.rivals)
    order = next(orders, "auto")
    if undecided and form is not None and order != "auto":
        ordered = form.model_copy(update={"time": form.time.model_copy(update={"date_order": order})})
        logs |= {path: _read(path, ordered, site, topic) for path in undecided}
        mistakes, undecided = [one for one in mistakes if one.path not in undecided], []
    if mistakes and (skipped is None or undecided or not logs):
        raise InputError(mistakes)
    if skipped is not None:
        skipped += mistakes
    return [logs[path] for path in files if path in logs]


def _read(path: Path, form: LoggerFormat, site: Site, topic: str) -> LogFile:
    """Read one log file or bag."""
    if not is_bag(path):
        return read_log(path, form, site.longitude, site.logger_clock)
    return parse_log(_lines_of_bag(path, topic), form.on_clock(site.logger_clock), site.longitude, path)


def _continued(path: Path, form: LoggerFormat, site: Site, first: LogFile) -> LogFile | None:
    """A file that continues another one without a header of its own; ``None`` if it does not."""
    named = form.header.model_copy(update={"columns": first.columns})
    try:
        log = read_log(path, form.model_copy(update={"header": named}), site.longitude, site.logger_clock)
    except InputError:
        return None
    first_line = 2 if form.live_time.from_stamps else 1  # the first record may lack its live time
    if log.columns != first.columns or not log.records or log.records[0].line > first_line:
        return None  # a header that the format does not know stands before the records
    choice = f"{path.name} has no header: its columns are those of {first.path.name}"
    return replace(log, choices=(*log.choices, choice))


def _lines_of_bag(path: Path, topic: str) -> Sequence[bytes]:
    # logs of a logger are read without the extra with recordings
    from soilmoist_ros.pipeline.bag_lines import logger_topic, text_lines
    from soilmoist_ros.recording import BagReader

    with BagReader(path) as reader:
        return text_lines(reader, logger_topic(reader, topic))


def skipped_text(skipped: Sequence[Mistake]) -> str:
    """Files that were skipped, by reason."""
    reasons: dict[str, list[str]] = {}
    for one in skipped:
        reasons.setdefault(one.message, []).append(one.path.name if one.path else "a file")
    texts = [f"{listing(names)} ({reason})" for reason, names in reasons.items()]
    return f"{len(skipped)} of the files {'is' if len(skipped) == 1 else 'are'} skipped: {'; '.join(texts)}"


def reading_of(logs: Sequence[LogFile]) -> dict[str, str]:
    """Reading of logs, for the user to check: tubes, clock, notation, columns without use."""
    texts: dict[str, dict[str, None]] = {"counts of": {}, "clock": {}, "notation": {}, "not used": {}}
    for log in logs:
        form = log.logger
        left = [name for number, name in log.tubes.items() if number in form.counts.left_out]
        used = [name for number, name in log.tubes.items() if number not in form.counts.left_out]
        unit = "" if form.counts.unit == "counts" else f" ({form.counts.unit.replace('_', ' ')})"
        out = f"; left out: {', '.join(left)}" if left else ""
        note = f". {form.counts.note.strip().rstrip('.')}" if form.counts.note else ""
        texts["counts of"][f"{listing(used)}{unit}{out}{note}"] = None
        texts["clock"][f"{form.time.clock_text}, stamped at the {form.time.marks} of the interval"] = None
        texts["notation"] |= dict.fromkeys(log.choices)
        texts["not used"] |= dict.fromkeys(log.unused)
    return {key: ("; " if key != "not used" else ", ").join(found) for key, found in texts.items() if found}


def log_positions(logs: Sequence[LogFile], track: Track | None, site: Site) -> NDArray[np.float64]:
    """Latitude and longitude of the records of logs, shape (n, 2) [deg]; records without a place are left out.

    They are those of a separate receiver, of the log, or of the location of a stationary probe.
    """
    records = [record for log in logs for record in log.records]
    places = [record.position if track is None else track.at(record.stamp_s, MAX_GAP_S) for record in records]
    known = [(place.latitude_deg, place.longitude_deg) for place in places if place is not None]
    if not known and track is None and site.location is not None:
        known = [(site.location.latitude_deg, site.location.longitude_deg)] * len(records)
    return np.array(known, float).reshape(-1, 2)


def position_source(
    logs: Sequence[LogFile], nmea: Sequence[Path], site: Site, field_file: Path | None
) -> PositionSource:
    """Source of the positions of logs, for advice."""
    if nmea:
        return PositionSource(nmea[0].name, field_file=field_file)
    if not any(record.position for log in logs for record in log.records):
        return PositionSource("'location' in the site file", field_file=field_file)
    unsigned = any(place and not place.longitude_signed for place in (log.logger.position for log in logs))
    return PositionSource(logs[0].path.name, site.longitude if unsigned else "signed", field_file)


def within(logs: Sequence[LogFile], times_s: tuple[float, float]) -> list[LogFile]:
    """Logs with the records that end after a first and by a second time [s since 1970-01-01 UTC]."""
    start_s, end_s = times_s
    if math.isinf(start_s) and math.isinf(end_s):
        return list(logs)
    found = [
        replace(log, records=tuple(one for one in log.records if start_s < one.stamp_s <= end_s)) for log in logs
    ]
    if not any(log.records for log in found) and (span := log_times(logs)) is not None:
        lasts = " to ".join(map(utc_text, span))
        raise InputError("has no record between these times", f"the log lasts from {lasts} UTC", logs[0].path)
    return [log for log in found if log.records]


def log_times(logs: Sequence[LogFile]) -> tuple[float, float] | None:
    """Times of the first and the last record [s since 1970-01-01 UTC], ``None`` without records."""
    stamps = [record.stamp_s for log in logs for record in log.records]
    return (min(stamps), max(stamps)) if stamps else None


def read_track(
    paths: Sequence[Path],
    others: Sequence[Path] = (),
    topic: str = "",
    log_s: tuple[float, float] | None = None,
    shift_s: float = 0.0,
) -> tuple[Track | None, list[Problem]]:
    """The positions of GNSS logs and the faults in them; ``None`` without positions.

    :param paths: GNSS logs, tracks or bags
    :param others: files among which bags may have positions
    :param topic: topic with the positions in bags; see :func:`.fix_topic` if empty
    :param log_s: first and last time of the records [s since 1970-01-01 UTC], for positions without a date
    :param shift_s: time added to those of the positions [s]
    :raises InputError: if the logs hold no position
    """
    fixes, problems, used = list[Fix](), list[Problem](), list[Path]()
    for path in [*paths, *filter(is_bag, dict.fromkeys(others))]:
        found, faults = _fixes_of_bag(path, topic, log_s, shift_s) if is_bag(path) else read_positions(path, log_s)
        problems += faults
        if found is None:
            if path in paths:
                missing = Mistake("has no topic with positions", "name one with --fix-topic", path)
                raise InputError([one.mistake for one in faults] or [missing])
            continue
        _require_one_place(fixes, found, used, path)
        fixes, used = fixes + found, [*used, path]
    if not used:
        return None, problems
    track, noted = shifted_track(fixes, shift_s, used[0])
    problems += noted
    if (why := track.heard.why_none()) is not None:
        chosen = (one.mistake for one in problems if one.kind is Kind.CHOSEN_POSITIONS)
        raise InputError([replace(why, path=used[0]), *chosen])
    return track, problems


def _fixes_of_bag(
    path: Path, topic: str, log_s: tuple[float, float] | None, shift_s: float
) -> tuple[list[Fix] | None, list[Problem]]:
    """Positions of a bag, ``None`` if it has no topic with them."""
    # positions of a receiver are read without the extra with recordings
    from soilmoist_ros.pipeline.bag_lines import fix_topic, read_fixes, unread_positions
    from soilmoist_ros.recording import BagReader

    with BagReader(path) as reader:
        name = fix_topic(reader, topic)
        return read_fixes(reader, name, log_s, shift_s) if name else (None, unread_positions(reader))


def _require_one_place(fixes: Sequence[Fix], found: Sequence[Fix], used: Sequence[Path], path: Path) -> None:
    """Check that positions of several files are of one receiver, where they are of one time."""
    if not fixes:
        return
    track = Track(fixes)
    pairs = [(fix.position, track.at(fix.stamp_s, COMMON_GAP_S)) for fix in found if fix.no_place is None]
    apart_m = [distance_m(one, other) for one, other in pairs if other is not None]
    if len(apart_m) >= MIN_COMMON and (median_m := float(np.median(apart_m))) > MAX_APART_M:
        names = ", ".join(one.name for one in used)
        message = f"its positions are {distance_text(median_m)} from those of {names} at the same times (median)"
        raise InputError(message, "give the positions of one receiver", path)


def shifted_track(fixes: Sequence[Fix], shift_s: float, path: Path) -> tuple[CheckedTrack, list[Problem]]:
    """A track with later times, and a note on that; ``InputError`` for distant positions of one time."""
    known = [fix for fix in fixes if fix.no_place is None and not math.isnan(fix.stamp_s)]
    apart_m = []
    for _, (first, *others) in groupby(sorted(known, key=attrgetter("stamp_s")), attrgetter("stamp_s")):
        apart_m += [distance_m(first.position, fix.position) for fix in others]
    if len(apart_m) >= MIN_COMMON and (median_m := float(np.median(apart_m))) > MAX_APART_AT_ONCE_M:
        message = f"has {len(apart_m)} times with several positions, {distance_text(median_m)} apart (median)"
        remedy = "give the positions of one receiver; or the times have no seconds: export them with seconds"
        raise InputError(message, remedy, path)
    track = CheckedTrack([replace(fix, stamp_s=fix.stamp_s + shift_s) for fix in fixes])
    track.heard.shifted_s = shift_s
    if not shift_s:
        return track, []
    message = f"the times of the positions are shifted by {shift_s:+.0f} s (--gnss-shift)"
    return track, [Problem(Kind.ASSUMED_TIME, Mistake(message, "", path))]


def with_position_doubts(fault: InputError, problems: Sequence[Problem]) -> InputError:
    """An error of records, with the doubts about their positions that may explain it."""
    doubts = (one.mistake for one in problems if one.kind in (Kind.DOUBTFUL_POSITIONS, Kind.ASSUMED_TIME))
    return InputError([*fault.mistakes, *doubts])
