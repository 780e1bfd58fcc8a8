# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counted records that are stored: tables with all digits, bags in any condition, and what a map starts from.

The modules of bags are imported when they are needed: a robot starts without them.
"""

from __future__ import annotations

import csv
import logging
import math
import os
import struct
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from soilmoist_ros.foundation import InputError, Mistake, csv_text, text_of_csv
from soilmoist_ros.recording.journal import ENTRIES, load_journal
from soilmoist_ros.sensing import FIRST_STAMP_S, LAST_STAMP_S, CountRecord

if TYPE_CHECKING:
    from soilmoist_ros.recording.bag.verify import BagInfo

RECORDS: Final = "records.csv"
"""Name of the table of records in an output folder, from which a later map can start."""

COLUMNS: Final = tuple(field.name for field in fields(CountRecord))
_NUMBERS: Final = tuple(name for name in COLUMNS if name != "quarantine")
"""Columns that every table has; tables of earlier releases have no quarantine."""

_MAX_COUNTS: Final = 2**63

_log = logging.getLogger(__name__)


def write_records(path: Path, records: Sequence[CountRecord]) -> None:
    """Write records. After an error the file is unchanged.

    :raises InputError: if it cannot be written
    """
    part = path.with_name(f".{path.name}.writing")
    try:
        with part.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(COLUMNS)
            table.writerows([csv_text(getattr(record, name)) for name in COLUMNS] for record in records)
        os.replace(part, path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another folder", path) from None


def read_records(path: Path) -> list[CountRecord]:
    """Records of a table, exactly as they were written.

    :raises InputError: if the file cannot be read, a column is missing, or a row is not a record that a sensor can
        have made; names the line
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the path", path) from None
    except UnicodeDecodeError:
        raise InputError("is not text", "give a table of records as soilmoist writes it", path) from None
    rows = csv.DictReader(text.splitlines())
    try:
        missing = [name for name in _NUMBERS if name not in (rows.fieldnames or ())]
        if missing:
            raise InputError(f"has no column {', '.join(missing)}", "give a table as soilmoist writes it", path)
        return [_row_record(row, path, rows.line_num) for row in rows]
    except csv.Error as error:  # a cell of very many characters
        raise _no_record(error, path, rows.reader.line_num) from None


def _row_record(row: dict[str, str], path: Path, line: int) -> CountRecord:
    try:
        values = {name: float(row[name]) for name in _NUMBERS if name != "raw_counts"}
        for name, value in values.items():
            if math.isinf(value) or (name == "stamp_s" and not FIRST_STAMP_S <= value <= LAST_STAMP_S):
                raise ValueError(f"{name} is {value}")
        counts = int(row["raw_counts"])
        if not 0 <= counts <= _MAX_COUNTS:
            raise ValueError(f"raw_counts is {row['raw_counts']:.30}")
        quarantine = text_of_csv(row.get("quarantine") or "")
        return CountRecord(raw_counts=counts, **values, quarantine=quarantine)
    except (TypeError, ValueError) as error:
        raise _no_record(error, path, line) from None


def _no_record(error: Exception, path: Path, line: int) -> InputError:
    return InputError([Mistake(f"is not a record: {error}", "delete the line, or restore the file", path, line)])


def stored_counts(bag: Path, topics: Collection[str], frame: str = "") -> list[CountRecord]:
    """Records of some topics of a bag in any condition, and the quarantined ones next to them.

    What cannot be read, or has another frame than a given one, is skipped.
    """
    from soilmoist_ros.recording.bag.messages import CLOUD, count_records, quarantined_topic
    from soilmoist_ros.recording.bag.verify import files_of, stored_messages

    records: list[CountRecord] = []
    wanted = {*topics, *map(quarantined_topic, topics)}
    for path in files_of(bag):
        try:
            for message in stored_messages(path, [], wanted):
                if message.type_name != CLOUD:
                    continue
                try:
                    cloud = _store().deserialize_cdr(message.data, CLOUD)
                    if frame in ("", cloud.header.frame_id):
                        records += count_records(cloud)
                except (ValueError, LookupError, TypeError, struct.error) as error:
                    _log.warning("%s: a message of %s is skipped: %s", path, message.topic, error)
        except Exception as error:  # rosbags does not check everything; bag_info names the damage
            _log.warning("%s: the rest is skipped: %s", path, error)
    return records


def quarantine_reasons(info: BagInfo) -> dict[str, dict[str, int]]:
    """Number of quarantined records of a bag, by topic and code of the reason, the most frequent first."""
    from soilmoist_ros.recording.bag.messages import CLOUD, QUARANTINED

    names = [topic.name for topic in info.topics if topic.type_name == CLOUD]
    return {
        name: dict(Counter(record.quarantine for record in stored_counts(info.path, [name])).most_common())
        for name in names
        if name.rpartition("/")[2] == QUARANTINED
    }


@cache
def _store() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def read_earlier(path: Path, name: str = "") -> list[CountRecord]:
    """Records to start from.

    :param path: an output folder with a table of records, a bag with ``counts``, or the journal of a mission. A
        journal returns the records of an interrupted mission, and none of a mission that ended
    :param name: the planner's name of the property in a journal or bag; empty for the robot's own
    :raises InputError: if the path is none of these
    """
    if (path / ENTRIES).is_file():
        from soilmoist_ros.exploration import interrupted_records

        found = load_journal(path, whole=True)
        return interrupted_records(found.snapshot, (entry.payload for entry in found.entries), name)
    for table in (path / f"records_{name.strip('/')}.csv", path / RECORDS):
        if table.is_file():
            return read_records(table)
    if path.is_dir() and not any(path.glob("*.mcap")) and not (path / "metadata.yaml").is_file():
        raise InputError(
            f"holds neither {RECORDS} nor a bag nor a journal",
            "give a folder that the mapper has saved, a bag, or the journal of a mission",
            path,
        )
    from soilmoist_ros.recording.bag.reader import BagReader

    with BagReader(path) as bag:
        if not name:
            return bag.read_counts()
        ending = f"/{name.strip('/')}/counts"
        return bag.read_counts(next((topic for topic in sorted(bag.topics) if topic.endswith(ending)), ending))
