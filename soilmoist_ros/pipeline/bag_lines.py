# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw lines of a logger, and positions, in bags of any recorder: ROS 1 or ROS 2, under any names of topics."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Final, Self

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.recording import BagReader, line_bytes
from soilmoist_ros.sensing import (
    FIX_TYPE,
    Fix,
    Kind,
    Problem,
    clock_words,
    fix_from_message,
    parse_nmea,
    split_lines,
    stamp_of,
)

CLOUD: Final = "sensor_msgs/msg/PointCloud2"
TEXT: Final = "std_msgs/msg/String"
FIX: Final = FIX_TYPE
SENTENCE: Final = "nmea_msgs/msg/Sentence"
GPS_FIX: Final = ("gps_msgs/msg/GPSFix", "gps_common/msg/GPSFix")
STATUS: Final = "diagnostic_msgs/msg/DiagnosticStatus"
MAX_DIFFERENCE_S = 5.0  # reported difference of stamps and times of receipt [s]
_SNIFFED = 20  # number of messages that show whether texts are NMEA
_COORDINATES = re.compile(r'^\s*(float|double|u?int)\w*\s+(lat|latitude\w*)\b|"latitude"', re.MULTILINE)
_GNSS_TYPE = re.compile(
    r"gnss|gps|nav_?sat|navpvt|pvt|geo(point|pose)|location_?fix|bestpos|inspva", re.IGNORECASE
)


@dataclass(frozen=True)
class RunTopics:
    """The topics of one robot in a bag, by the full name of the one with its records."""

    reader: BagReader
    counts: str
    alone: bool  # whether the bag has no other robot

    @classmethod
    def of_counts(cls, reader: BagReader, counts: str) -> Self:
        """The topics of the robot whose records have this full name."""
        clouds = _of_kinds(reader.topics, (CLOUD,), f"/{counts.rpartition('/')[2]}")
        return cls(reader, counts, not set(clouds) - {counts})

    @classmethod
    def of_team(cls, reader: BagReader, counts: str, namespaces: Sequence[str]) -> list[Self]:
        """The topics of each robot of a team with a mapper in the outermost namespace; empty for another bag."""
        names = [f"/{namespace.strip('/')}/{counts}" for namespace in namespaces]
        found = [name for name in names if reader.topics.get(name) == CLOUD]
        shared = reader.topics.get("/soil_map") == CLOUD and f"/{counts}" not in reader.topics
        return [cls(reader, name, False) for name in found] if len(found) > 1 and shared else []

    @property
    def namespace(self) -> str:
        """Namespace of the robot with a slash at its end, for the names of its nodes; empty for none."""
        return f"{self.counts.rpartition('/')[0].strip('/')}/".lstrip("/")

    def find(self, name: str, kind: str) -> str | None:
        """Full name of a topic of this robot, ``None`` if it is not in the bag."""
        topics = self.reader.topics
        own = f"{self.counts.rpartition('/')[0]}/{name}"
        if topics.get(own) == kind:
            return own
        named = _of_kinds(topics, (kind,), f"/{name}")
        return named[0] if self.alone and len(named) == 1 else None


def text_lines(reader: BagReader, topic: str) -> list[bytes]:
    """Lines of a topic with texts or NMEA sentences, without line ends; a message may contain several.

    A message has one character per byte, and a symbol for the byte zero, as the driver writes it.
    """
    found: list[bytes] = []
    for message in reader.messages([topic]):
        try:
            decoded = reader.decode(message)
            text = str(getattr(decoded, "data", None) or getattr(decoded, "sentence", ""))
        except InputError:
            text = "\0"  # bytes that are not text: the parser counts them
        found += split_lines(line_bytes(text))[0]
    return found


def logger_topic(reader: BagReader, named: str = "") -> str:
    """The topic with the lines of the logger.

    :param named: its name; without one it is ``raw/logger``, or the only topic with texts that are not NMEA
    :raises InputError: if there is none, or it is not clear which it is
    """
    if named:
        return reader.find_topic(named, TEXT)
    texts = _of_kinds(reader.topics, (TEXT,))
    texts = [name for name in texts if reader.counts.get(name)] or texts
    own = [name for name in texts if name.endswith("/raw/logger")]
    if not own and len(texts) > 1:
        texts = [name for name in texts if not _is_nmea(reader, name)] or texts
    if len(own or texts) == 1:
        return (own or texts)[0]
    if texts:
        raise InputError(
            "has several topics that may be the lines of the logger",
            f"name one with --logger-topic: {', '.join(sorted(own or texts))}",
            reader.path,
        )
    clouds = _of_kinds(reader.topics, (CLOUD,), "/counts")
    remedy = "map its counts: soilmoist replay" if clouds else f"record the lines of the logger as {TEXT}"
    raise InputError(f"has no lines of a logger (type {TEXT})", remedy, reader.path)


def read_fixes(
    reader: BagReader, topic: str, log_s: tuple[float, float] | None = None, shift_s: float = 0.0
) -> tuple[list[Fix], list[Problem]]:
    """Positions of a topic: fixes, or texts with NMEA sentences; ``InputError`` if it has neither.

    :param log_s: first and last time of the log for which the positions are [s since 1970 UTC], if known
    :param shift_s: time by which the stamps will be shifted [s]
    """
    kind, path = reader.topics.get(topic, ""), Path(topic.lstrip("/"))
    chosen = _choice_notes(reader, topic)
    if kind in (TEXT, SENTENCE):
        extent = reader.extent
        recorded_s = (extent.start_ns * 1e-9, extent.end_ns * 1e-9) if extent.messages else None
        fixes, problems = parse_nmea(text_lines(reader, topic), path, log_s or recorded_s)
        return fixes, [*problems, *chosen]
    if kind not in (FIX, *GPS_FIX):
        readable = f"name one of type {FIX}, {GPS_FIX[0]}, {SENTENCE}, or {TEXT} with NMEA; {_OTHER_DRIVER}"
        raise InputError(f"{topic} cannot be read as positions: its type is {kind}", readable, reader.path)
    fixes, received = [], []
    for message in reader.messages([topic]):
        decoded = reader.decode(message)
        received.append(message.log_ns * 1e-9)
        fixes.append(replace(fix_from_message(decoded), stamp_s=stamp_of(decoded)))
    stamps = {fix.stamp_s for fix in fixes}
    if stamps == {0.0} or len(stamps) == 1 < len(fixes):
        have = "all have the same stamp" if any(stamps) else "have no stamp"
        said = f"the {len(fixes)} positions {have}: the time of their receipt is used"
        note = Problem(Kind.ASSUMED_TIME, Mistake(said, "", path))
        return [replace(fix, stamp_s=s) for fix, s in zip(fixes, received, strict=True)], [*chosen, note]
    stamped = [(fix, s) for fix, s in zip(fixes, received, strict=True) if fix.stamp_s]
    ahead_s = median(fix.stamp_s - s for fix, s in stamped) if stamped else 0.0
    if abs(ahead_s + shift_s) > MAX_DIFFERENCE_S:
        words = clock_words(ahead_s)
        said = f"the stamps are {ahead_s:+.0f} s from the times of receipt{f', {words}' if words else ''}"
        remedy = f"if the times of receipt are right: --gnss-shift {-ahead_s:.0f}s"
        chosen.append(Problem(Kind.DOUBTFUL_POSITIONS, Mistake(said, remedy, path)))
    return [fix if fix.stamp_s else replace(fix, stamp_s=math.nan) for fix in fixes], chosen


_OTHER_DRIVER = "most drivers of receivers publish sensor_msgs/NavSatFix, too: record it"


def fix_topic(reader: BagReader, named: str = "") -> str | None:
    """The topic with the positions of the receiver, ``None`` if there is none.

    :param named: its name; without one it is ``raw/gnss``, else the only one of the first type that the bag has:
        fixes under the name ``fix``, fixes, GPSFix, NMEA sentences, texts with NMEA
    :raises InputError: if there is no topic of this name, or it is not clear which it is
    """
    topics = reader.topics
    if named:
        found = [name for name in topics if named in (name, name.lstrip("/"), name.rpartition("/")[2])]
        if len(found) == 1:
            return found[0]
        there = ", ".join(sorted(name for name, kind in topics.items() if kind in (*_READABLE, TEXT)))
        raise InputError(f"has no topic {named!r} with positions", f"there are: {there or 'none'}", reader.path)
    for found in _candidates(reader):
        if len(found) == 1:
            return found[0]
        if found:
            remedy = f"name one with --fix-topic: {', '.join(sorted(found))}"
            raise InputError("has several topics with positions", remedy, reader.path)
    return None


_READABLE = (FIX, *GPS_FIX, SENTENCE)


def _candidates(reader: BagReader) -> list[list[str]]:
    """Topics that may be the positions, the likeliest group first; those without messages if no other may."""
    heard = {name: kind for name, kind in reader.topics.items() if reader.counts.get(name)}
    for topics in (heard, reader.topics):
        kinds = (((TEXT,), "/raw/gnss"), ((FIX,), "/fix"), ((FIX,), ""), (GPS_FIX, ""), ((SENTENCE,), ""))
        found = [_of_kinds(topics, *one) for one in kinds]
        found = found if any(found) else [[name for name in _of_kinds(topics, (TEXT,)) if _is_nmea(reader, name)]]
        if any(found):
            return found
    return []


def _of_kinds(topics: Mapping[str, str], kinds: Sequence[str], ending: str = "") -> list[str]:
    return [name for name, kind in topics.items() if kind in kinds and name.endswith(ending)]


def _is_nmea(reader: BagReader, topic: str) -> bool:
    """True if texts are the sentences of a receiver."""
    for message in islice(reader.messages([topic]), _SNIFFED):
        with suppress(InputError):
            if re.search(r"\$(G[A-Z]|BD|QZ)[A-Z]{3},", str(reader.decode(message).data)):
                return True
    return False


def unread_positions(reader: BagReader) -> list[Problem]:
    """Topics with positions of types that cannot be read, if there are any."""
    texts = reader.definition_texts
    found = [
        f"{name} ({kind})"
        for name, kind in sorted(reader.topics.items())
        if kind not in (*_READABLE, TEXT)
        and not kind.startswith("soilmoist_msgs/")
        and (_GNSS_TYPE.search(kind.rpartition("/")[2]) or _COORDINATES.search(texts.get(kind, "")))
    ]
    if not found:
        return []
    message = f"has positions of types that cannot be read: {', '.join(found)}"
    remedy = f"give them as {FIX}, {GPS_FIX[0]}, {SENTENCE}, or NMEA as {TEXT}, or with --nmea; {_OTHER_DRIVER}"
    return [Problem(Kind.DOUBTFUL_POSITIONS, Mistake(message, remedy, reader.path))]


def _choice_notes(reader: BagReader, topic: str) -> list[Problem]:
    """Note on the topic chosen for positions, if other topics have positions, too."""
    others = sorted({name for found in _candidates(reader) for name in found if name != topic})
    if not others:
        return []
    message = f"the positions are those of {topic}; not used: {', '.join(others)}"
    return [Problem(Kind.CHOSEN_POSITIONS, Mistake(message, "choose with --fix-topic"))]
