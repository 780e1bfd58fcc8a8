# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records of an earlier run, as the start of a map."""

from __future__ import annotations

from pathlib import Path

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.journal import ENTRIES, load_journal
from soilmoist_ros.recording.record_table import RECORDS, read_records
from soilmoist_ros.sensing import CountRecord


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
