# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counted records that are stored: tables with all digits, bags in any condition, and what a map starts from.

The modules of bags are imported when they are needed: a robot starts without them.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Final

from soilmoist_ros.foundation import InputError, Mistake, csv_text, text_of_csv
from soilmoist_ros.sensing import FIRST_STAMP_S, LAST_STAMP_S, CountRecord

RECORDS: Final = "records.csv"
"""Name of the table of records in an output folder, from which a later map can start."""

COLUMNS: Final = tuple(field.name for field in fields(CountRecord))
_NUMBERS: Final = tuple(name for name in COLUMNS if name != "quarantine")
"""Columns that every table has; tables of earlier releases have no quarantine."""

_MAX_COUNTS: Final = 2**63


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


def read_earlier(path: Path, name: str = "") -> list[CountRecord]:
    """Records to start from.

    :param path: an output folder with a table of records, or a bag with ``counts``
    :param name: the planner's name of the property; empty for the robot's own
    :raises InputError: if the path is neither
    """
    for table in (path / f"records_{name.strip('/')}.csv", path / RECORDS):
        if table.is_file():
            return read_records(table)
    if path.is_dir() and not any(path.glob("*.mcap")) and not (path / "metadata.yaml").is_file():
        raise InputError(
            f"holds neither {RECORDS} nor a bag",
            "give a folder that the mapper has saved, or a bag; record_dir continues the map of a mission",
            path,
        )
    from soilmoist_ros.recording.bag.reader import BagReader

    with BagReader(path) as bag:
        if not name:
            return bag.read_counts()
        ending = f"/{name.strip('/')}/counts"
        return bag.read_counts(next((topic for topic in sorted(bag.topics) if topic.endswith(ending)), ending))
