# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw lines of a logger, and positions, in bags of any recorder: ROS 1 or ROS 2, under any names of topics."""

from __future__ import annotations

from pathlib import Path

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.replay.topics import CLOUD, FIX, TEXT
from soilmoist_ros.sensing.formats.log_values import split_lines
from soilmoist_ros.sensing.gnss import Fix, fix_from_message
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.problems import Problem


def text_lines(reader: BagReader, topic: str) -> list[bytes]:
    """Lines of a topic with texts, without line ends; a message may contain several.

    A message has one character per byte, and a symbol for the byte zero, as the driver writes it.
    """
    found: list[bytes] = []
    for message in reader.messages([topic]):
        try:
            text = str(reader.decode(message).data).replace("\N{SYMBOL FOR NULL}", "\0")
        except InputError:
            text = "\0"  # bytes that are not text: the parser counts them
        found += split_lines(text.encode("latin-1", "replace"))[0]
    return found


def logger_topic(reader: BagReader, named: str = "") -> str:
    """The topic with the lines of the logger.

    :param named: its name; without one it is ``raw/logger``, or the only topic with texts
    :raises InputError: if there is none, or it is not clear which it is
    """
    if named:
        return reader.find_topic(named, TEXT)
    texts = [name for name, kind in reader.topics.items() if kind == TEXT]
    own = [name for name in texts if name.endswith("/raw/logger")]
    if len(own or texts) == 1:
        return (own or texts)[0]
    counts = [name for name, kind in reader.topics.items() if kind == CLOUD and name.endswith("/counts")]
    if texts:
        raise InputError(
            "has several topics that may be the lines of the logger",
            f"name one with --logger-topic: {', '.join(sorted(own or texts))}",
            reader.path,
        )
    remedy = "map its counts: soilmoist replay" if counts else f"record the lines of the logger as {TEXT}"
    raise InputError(f"has no lines of a logger (type {TEXT})", remedy, reader.path)


def read_fixes(reader: BagReader, topic: str) -> tuple[list[Fix], list[Problem]]:
    """Positions of a topic: fixes, or texts with NMEA sentences.

    :param topic: its full name
    :raises InputError: if it has neither
    """
    kind = reader.topics.get(topic)
    if kind == TEXT:
        return parse_nmea(text_lines(reader, topic), Path(topic.lstrip("/")))
    if kind == FIX:
        return [fix_from_message(reader.decode(message)) for message in reader.messages([topic])], []
    raise InputError(f"{topic} has no positions: its type is {kind}", f"name a {FIX} or a {TEXT}", reader.path)


def fix_topic(reader: BagReader, named: str = "") -> str | None:
    """The topic with the positions of the receiver, ``None`` if there is none.

    :param named: its name; without one it is ``raw/gnss``, else ``fix``, else the only one with fixes
    :raises InputError: if there is no topic of this name, or it is not clear which it is
    """
    topics = reader.topics
    if named:
        found = [name for name in topics if named in (name, name.lstrip("/"), name.rpartition("/")[2])]
        if len(found) != 1:
            there = ", ".join(sorted(name for name, kind in topics.items() if kind in (FIX, TEXT)))
            raise InputError(
                f"has no topic {named!r} with positions", f"there are: {there or 'none'}", reader.path
            )
        return found[0]
    for ending, kind in (("/raw/gnss", TEXT), ("/fix", FIX), ("", FIX)):
        found = [name for name, its in topics.items() if its == kind and name.endswith(ending)]
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(
                "has several topics with positions", f"name one with --fix-topic: {', '.join(sorted(found))}",
                reader.path,
            )  # fmt: skip
    return None
