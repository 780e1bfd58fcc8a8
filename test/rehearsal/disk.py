# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a rehearsal, written by the real journal and the real logs."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from soilmoist_ros.exploration.mission.journal import EVENT
from soilmoist_ros.recording import journal as journal_files
from soilmoist_ros.recording.journal import Journal, load_journal
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.recording.map_sources import DRIVER, MapSources, RecordLog, RecordTail, open_session
from soilmoist_ros.sensing import CountRecord

FRAME = "map"
_FILES = {name: getattr(journal_files, name) for name in ("_write", "write_whole")}


def _refuse(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


class Disk:
    """The files of a rehearsal: journal of the mission, logs of driver and mapper."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._session = open_session(folder / "records", folder / "journal", fresh=True)
        self._driver = RecordLog(self._session / DRIVER, FRAME)
        self._journal: Journal | None = None

    def open_journal(self) -> tuple[Journal, str | None, Iterable[Mapping[str, Any]], bool]:
        found = load_journal(self._folder / "journal")
        self._journal = Journal.open(self._folder / "journal")
        events = [entry.payload for entry in found.entries if entry.kind == EVENT]
        return self._journal, found.snapshot, events, found.complete

    def close_journal(self) -> None:
        if self._journal is not None:
            self._journal.close()

    def publish(self, records: Sequence[CountRecord]) -> None:
        with contextlib.suppress(OSError):  # the driver publishes them nevertheless
            self._driver.write(records)

    def full(self, is_full: bool) -> None:
        """No space is left for journal and logs, or there is space again."""
        for name in ("_write", "write_whole"):
            setattr(journal_files, name, _refuse if is_full else _FILES[name])
        if not is_full and self._driver.waits:
            self._driver.write([])

    def stored(self) -> Sequence[CountRecord]:
        """Records in the driver's log."""
        return RecordTail(self._session / DRIVER, FRAME).read().records

    def close(self) -> None:
        """Release the driver's log."""
        self.full(False)
        self._driver.close()

    def open_map(self, records: MapRecords) -> MapSources:
        """The sources of a mapper's records."""
        return MapSources(records, self._session, FRAME)
