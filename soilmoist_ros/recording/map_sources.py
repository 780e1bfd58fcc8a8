# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stores of the records of a map on this computer, and the choice of records that belong to the map."""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from soilmoist_ros.foundation import InputError, nan_as_text, read_json
from soilmoist_ros.recording.journal import ENTRIES, Journal, LoadedJournal, decode, load_journal
from soilmoist_ros.recording.map_records import RECEIVED, MapRecords
from soilmoist_ros.recording.run_folder import write_whole
from soilmoist_ros.sensing import CountRecord

DRIVER: Final = "sensor_driver"
"""Name of the driver's log in the folder of a session."""
RECORD: Final = "record"  # kind of the entries that hold a record
MAX_WAITING: Final = 100_000
"""Records that may wait for a full disk: eleven days of one each 10 s; the oldest are lost first."""
RESET: Final = "reset"  # kind of the entries after which a map starts again
SESSION: Final = "session.json"
"""File that marks the folder of a session: one map, from the first launch to the end of its mission."""
OWN: Final = "mapper"  # name of the mapper's log in the folder of a session

_log = logging.getLogger(__name__)


class RecordLog:
    """A log of records that is being written; one disk sync for each call.

    Records that the disk refuses wait in memory, and are written with the next ones. After a sync that failed
    the records of the last call are written again, byte by byte: a reader that has them continues after them.

    :param folder: folder of the log; made if missing
    :param frame: frame of the records
    :raises InputError: if another process writes it, or the folder cannot be written
    """

    def __init__(self, folder: Path, frame: str) -> None:
        self._journal = Journal.open(folder)
        self._frame = frame
        self._waiting: deque[CountRecord] = deque(maxlen=MAX_WAITING)
        self._refused = False  # by the last sync

    def write(self, records: Iterable[CountRecord]) -> None:
        """Write records, and those that the disk has refused before; ``OSError`` if it refuses them again."""
        self._waiting += records  # first: what is not known here cannot be written later
        if self._refused:
            self._journal.undo()  # a record that is in the log twice would count twice
            self._refused = False
        appended = 0
        try:
            for record in self._waiting:
                self._journal.append(RECORD, {"frame": self._frame, **nan_as_text(asdict(record))}, durable=False)
                appended += 1
        finally:
            if appended:
                self._refused = True
                self._journal.sync()
                self._refused = False
                for _ in range(appended):
                    self._waiting.popleft()

    def reset(self, until_s: float) -> None:
        """Start again: earlier records in this log, and records of other logs up to a stamp [s], are void."""
        self._waiting.clear()
        self._refused = False
        self._journal.append(RESET, nan_as_text({"until_s": until_s}))

    def close(self) -> None:
        """Write what waits, if the disk takes it now, and release the log."""
        try:
            if self.waits:
                self.write(())
        except OSError as error:
            _log.error("%d records are lost: %s", len(self._waiting), error.strerror or error)
        self._journal.close()

    @property
    def waits(self) -> bool:
        """True if the disk has refused records that were not written since."""
        return bool(self._waiting)


class LoggedRecords(NamedTuple):
    """New content of a log: records after the last reset, and its stamp [s], ``None`` without one."""

    records: list[CountRecord]
    until_s: float | None = None


class RecordTail:
    """Reads the log in a folder, which may not exist yet and still grow; records of other frames are skipped."""

    def __init__(self, folder: Path, frame: str) -> None:
        self.folder = folder
        self._frame = frame
        self._read_bytes = 0

    def read(self) -> LoggedRecords:
        """Records since the last call; ``OSError`` if they cannot be read. An unfinished line comes later."""
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
                records.append(_log_record(entry.payload))
        return LoggedRecords(records, until_s)


def _log_record(payload: dict[str, Any]) -> CountRecord:
    others = ("raw_counts", "frame", "quarantine")
    values = {name: float(value) for name, value in payload.items() if name not in others}
    quarantine = str(payload.get("quarantine", ""))
    return CountRecord(raw_counts=int(payload["raw_counts"]), **values, quarantine=quarantine)


def open_session(root: Path, journal: Path | None, fresh: bool) -> Path:
    """Folder of the session: the last one while the mission of a planner's journal is interrupted, else a new one.

    :raises InputError: if the journal cannot be read, or the folder cannot be made
    """
    from soilmoist_ros.exploration import is_under_way

    found = load_journal(journal) if journal is not None else LoadedJournal(None, (), ())
    # By number: names are times of day, and the clock may have been set back.
    earlier = sorted((_number(path), path.parent) for path in root.glob(f"*/{SESSION}"))
    if earlier and not fresh and is_under_way(found.snapshot, (entry.payload for entry in found.entries)):
        return earlier[-1][1]
    folder = root / f"{datetime.now():%Y%m%d_%H%M%S_%f}"
    number = 1 + max((number for number, _ in earlier), default=0)
    try:
        folder.mkdir(parents=True)
        write_whole(folder / SESSION, json.dumps({"number": number}).encode())
    except OSError as error:
        remedy = "choose a folder on a disk that is writable and has space"
        raise InputError(f"no records can be written here: {error.strerror}", remedy, folder) from None
    return folder


class MapSources:
    """Reads the records of a map from the logs of a session, and writes those that no driver's log has.

    The driver's log has every record that was published, so the map is complete whichever process was down.
    Records of other drivers are in the mapper's own log.

    :param folder: folder of the session; ``None`` to store nothing and read nothing
    :param fault: why a record is left out, empty for none; called with whether it was stored before the start
    :raises InputError: if the folder cannot be written, or another process maps the session
    """

    def __init__(
        self,
        records: MapRecords,
        folder: Path | None,
        frame: str = "map",
        fault: Callable[[CountRecord, bool], str] = lambda record, stored: "",
    ) -> None:
        self.problem = ""
        """Reason why records are not on the disk, or not read; empty without a problem."""
        self._records = records
        self._folder = folder
        self._frame = frame
        self._fault = fault
        self._tails: dict[Path, RecordTail] = {}
        self._own: RecordLog | None = None
        if folder is None:
            return
        self._own = RecordLog(folder / OWN, frame)
        found, until_s = RecordTail(folder / OWN, frame).read()
        if until_s is not None:
            records.reset(until_s)
        records.take(RECEIVED, found)
        self.poll()

    def received(self, records: Sequence[CountRecord]) -> None:
        """Add records of messages; those that no log of a driver has are written to the disk."""
        self.poll()
        self._write(self._records.take(RECEIVED, records))

    def _write(self, new: Sequence[CountRecord]) -> None:
        """Write records to the mapper's log, and those that the disk has refused before."""
        try:
            if self._own is not None and (new or self._own.waits):
                self._own.write(new)
                self.problem = ""
        except OSError as error:
            self._fail(f"records are in the map, but not on the disk: {error.strerror or error}")

    def poll(self) -> None:
        """Add what the drivers have written since the last call."""
        self._write(())
        logs = self._folder.glob(f"*/{ENTRIES}") if self._folder is not None else ()
        for folder in sorted(path.parent for path in logs if path.parent.name != OWN):
            new = folder not in self._tails
            tail = self._tails.setdefault(folder, RecordTail(folder, self._frame))
            try:
                found = tail.read().records
            except OSError as error:
                self._fail(f"the log {folder} cannot be read: {error.strerror}")
                continue
            self._records.take(str(folder), self._usable(found, stored=new))

    def reset(self) -> None:
        """Remove all records, for later processes too."""
        until_s = self._records.reset()
        try:
            if self._own is not None:
                self._own.reset(until_s)
        except OSError as error:
            self._fail(f"a restart would bring the removed records back: {error.strerror or error}")

    def close(self) -> None:
        """Release the mapper's log."""
        if self._own is not None:
            self._own.close()

    def _usable(self, records: Iterable[CountRecord], stored: bool) -> list[CountRecord]:
        return [record for record in records if not self._fault(record, stored)]

    def _fail(self, problem: str) -> None:
        if not self.problem:
            _log.error(problem)
        self.problem = problem


def _number(path: Path) -> int:
    """Number of a session, from its file: 0 if that is damaged, or of an older version."""
    try:
        return int(read_json(path.read_bytes())["number"])
    except (OSError, ValueError, LookupError, TypeError):
        return 0
