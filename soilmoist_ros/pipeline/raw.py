# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw lines of logger and receiver from a bag, corrected and placed like their log files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.pipeline.bag_lines import fix_topic, logger_topic, read_fixes, text_lines, unread_positions
from soilmoist_ros.pipeline.log_map import log_times, shifted_track
from soilmoist_ros.pipeline.topics import FIX, TEXT, RunTopics
from soilmoist_ros.recording import BagReader
from soilmoist_ros.sensing import (
    FORMAT_NAME,
    NO_ARMS,
    CountRecord,
    Kind,
    LeverArms,
    Problem,
    Site,
    load_logger_format,
    matching_formats,
    parse_log,
    process_logs,
)


@dataclass(frozen=True)
class RawSurvey:
    """Raw lines, processed.

    :param records: corrected records at their places, in order of time, quarantined ones included
    :param problems: problems of the lines
    :param format_title: title of the logger's format
    :param position_problems: those of them that concern the positions
    """

    records: Sequence[CountRecord]
    problems: Sequence[Problem]
    format_title: str
    position_problems: Sequence[Problem] = ()


def read_raw(
    topics: RunTopics,
    site: Site,
    frame: LocalFrame,
    logger: str | None = None,
    arms: LeverArms = NO_ARMS,
    logger_name: str = "",
    fix_name: str = "",
    gnss_shift_s: float = 0.0,
) -> RawSurvey:
    """Process the raw lines of a robot.

    :param topics: its topics
    :param site: corrections and tubes
    :param frame: plane of the field
    :param logger: logger format, a shipped name or a file; detected from the header if ``None``
    :param arms: where antenna and sensor sat on the robot
    :param logger_name: topic with the lines of the logger; ``raw/logger`` if empty
    :param fix_name: topic with positions; ``raw/gnss``, or ``fix``, if empty
    :param gnss_shift_s: time added to those of the positions [s]
    :raises InputError: if the lines contain no usable record
    """
    reader = topics.reader
    name = logger_topic(reader, logger_name) if logger_name else topics.find("raw/logger", TEXT)
    if name is None:
        raise InputError("has no topic raw/logger", "map its counts instead", reader.path)
    lines = text_lines(reader, name)
    form = load_logger_format(logger or next(iter(matching_formats(lines)), FORMAT_NAME))
    form = form.on_clock(site.logger_clock)
    log = parse_log(lines, form, site.longitude, _place(name))
    gnss = topics.find("raw/gnss", TEXT) or topics.find("fix", FIX)
    if logger_name or fix_name or (gnss is None and topics.alone):
        gnss = fix_topic(reader, fix_name)
    track = None
    problems: list[Problem] = []
    if gnss is None:
        problems = unread_positions(reader)
    else:
        fixes, problems = read_fixes(reader, gnss, log_times([log]), gnss_shift_s)
        track, noted = shifted_track(fixes, gnss_shift_s, _place(gnss))
        problems += noted
        if (why := track.heard.why_none()) is not None:
            raise InputError(f"{gnss} {why.message}", f"{why.remedy}; or map its counts instead", reader.path)
    try:
        survey = process_logs([log], site, frame, track, arms)
    except InputError as fault:
        doubts = (one.mistake for one in problems if one.kind in (Kind.DOUBTFUL_POSITIONS, Kind.ASSUMED_TIME))
        raise InputError([*fault.mistakes, *doubts]) from None
    return RawSurvey(survey.all_records, [*survey.problems, *problems], log.format_title, problems)


def says_simulated(reader: BagReader, logger: str) -> bool:
    """Whether the logger's lines declare simulated counts.

    :param logger: full name of the topic with the lines
    """
    return any(line.startswith(b"#simulated=yes") for line in text_lines(reader, logger))


def _place(topic: str) -> Path:
    """Source of a line in messages, in place of a file name."""
    return Path(topic.lstrip("/"))
