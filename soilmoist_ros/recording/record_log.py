# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records on the disk before anybody receives them, so that a map survives the end of any process."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, NamedTuple

from soilmoist_ros.foundation import nan_as_text
from soilmoist_ros.recording.journal import ENTRIES, Journal
from soilmoist_ros.recording.journal_lines import decode
from soilmoist_ros.sensing import CountRecord

DRIVER: Final = "sensor_driver"
"""Name of the driver's log in the folder of a session."""
RECORD: Final = "record"
"""Kind of the entries that hold a record."""
MAX_WAITING: Final = 100_000
"""Records that may wait for a full disk: eleven days of one each 10 s; the oldest are lost first."""
_MANY: Final = 1000
"""If more records wait for a sync, it is tried every :data:`_AGAIN_S` only: each time writes all of them again."""
_AGAIN_S: Final = 30.0
RESET: Final = "reset"
"""Kind of the entries after which a map starts again."""

_log = logging.getLogger(__name__)


class RecordLog:
    """A log of records that is being written; one disk sync for each call.

    Records that the disk refuses wait in memory, and are written with the next ones. After a sync that failed
    those of the last call are written again, with the same bytes: a reader that has them continues after them.

    :param folder: folder of the log; made if missing
    :param frame: frame of the records
    :raises InputError: if another process writes it, or the folder cannot be written
    """

    def __init__(self, folder: Path, frame: str) -> None:
        self._journal = Journal.open(folder)
        self._frame = frame
        self._waiting: deque[CountRecord] = deque(maxlen=MAX_WAITING)
        self._refused: OSError | None = None  # of the last sync
        self._again_s = 0.0

    def write(self, records: Iterable[CountRecord]) -> None:
        """Write records; they are on the disk afterwards.

        :param records: new records; none to try again those that the disk has refused
        :raises OSError: if the disk refuses them
        """
        self._waiting += records  # first: what is not known here cannot be written later
        if self._refused is not None:
            if len(self._waiting) > _MANY and time.monotonic() < self._again_s:
                raise OSError(self._refused.errno, self._refused.strerror)
            self._journal.undo()  # a record that is in the log twice would count twice
            self._refused = None
        appended = 0
        try:
            for record in self._waiting:
                self._journal.append(RECORD, {"frame": self._frame, **_plain(record)}, durable=False)
                appended += 1
        finally:
            if appended:
                self._sync(appended)

    def _sync(self, appended: int) -> None:
        try:
            self._journal.sync()
        except OSError as error:
            self._refused, self._again_s = error, time.monotonic() + _AGAIN_S
            raise
        for _ in range(appended):
            self._waiting.popleft()

    def reset(self, until_s: float) -> None:
        """Start again: earlier records in this log, and records of other logs up to a stamp [s], are void.

        :raises OSError: as :meth:`write`
        """
        self._waiting.clear()
        self._refused = None
        self._journal.append(RESET, nan_as_text({"until_s": until_s}))

    def close(self) -> None:
        """Write what waits, if the disk takes it now, and release the log."""
        self._again_s = 0.0
        try:
            if self.waits:
                self.write(())
        except OSError as error:
            _log.error("%d records are lost: %s", len(self._waiting), error.strerror or error)
        self._journal.close()

    @property
    def waits(self) -> bool:
        """Whether the disk has refused records that were not written since."""
        return bool(self._waiting)


class LoggedRecords(NamedTuple):
    """New content of a log.

    :param records: records after the last reset
    :param until_s: stamp of the last reset [s], ``None`` without one
    """

    records: list[CountRecord]
    until_s: float | None = None


class RecordTail:
    """Reads a log that may still grow.

    :param folder: folder of the log; it may not exist yet
    :param frame: frame of the records to read; others are skipped
    """

    def __init__(self, folder: Path, frame: str) -> None:
        self.folder = folder
        self._frame = frame
        self._read_bytes = 0

    def read(self) -> LoggedRecords:
        """Records since the last call. A line that is being written is read by a later call.

        :raises OSError: if the log cannot be read
        """
        path = self.folder / ENTRIES
        if not path.exists() or path.stat().st_size <= self._read_bytes:
            return LoggedRecords([])
        with path.open("rb") as file:
            file.seek(self._read_bytes)
            data = file.read()
        lines = decode(data[: data.rfind(b"\n") + 1], str(path))
        self._read_bytes += lines.good_bytes
        for problem in lines.problems:
            _log.warning(problem)
        records: list[CountRecord] = []
        until_s = None
        for entry in lines.entries:
            if entry.kind == RESET:
                records, until_s = [], float(entry.payload["until_s"])
            elif entry.kind == RECORD and entry.payload["frame"] == self._frame:
                records.append(_record(entry.payload))
        return LoggedRecords(records, until_s)


def logs_below(folder: Path) -> list[Path]:
    """Folders of the logs directly below a folder, by name."""
    return sorted(path.parent for path in folder.glob(f"*/{ENTRIES}"))


def _plain(record: CountRecord) -> dict[str, Any]:
    content: dict[str, Any] = nan_as_text(asdict(record))
    return content


def _record(payload: dict[str, Any]) -> CountRecord:
    others = ("raw_counts", "frame", "quarantine")
    values = {name: float(value) for name, value in payload.items() if name not in others}
    return CountRecord(
        raw_counts=int(payload["raw_counts"]), **values, quarantine=str(payload.get("quarantine", ""))
    )
