# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission's journal: each event is on the disk before the robot acts on it."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.run_folder import sync_folder, write_whole

_CHECKSUM: Final = re.compile(rb',"crc":"([0-9a-f]{8})"\}')
_TAIL_LENGTH: Final = len(b',"crc":"00000000"}')
_MAX_PROBLEMS: Final = 100
ENTRIES: Final = "journal.jsonl"  # name of the file with the entries; it identifies the folder of a journal
_SNAPSHOT: Final = "snapshot.json"
_COMPLETE: Final = "complete"
"""Name of an empty file next to a snapshot while no later entry was refused: a full disk lets it be deleted."""


@dataclass(frozen=True)
class Entry:
    """An entry of a journal: its number, kind, and plain data. Consecutive entries have consecutive numbers."""

    seq: int
    kind: str
    payload: dict[str, Any]


@dataclass(frozen=True)
class Lines:
    """Whole entries of a journal's file, its problems, and the end of the last whole line [bytes]."""

    entries: tuple[Entry, ...]
    problems: tuple[str, ...]
    good_bytes: int


def encode(entry: Entry) -> bytes:
    r"""The line of an entry.

    >>> encode(Entry(1, "event", {"verb": "start"}))
    b'{"seq":1,"kind":"event","data":{"verb":"start"},"crc":"6a3a3378"}\n'

    :raises TypeError: if the payload is not plain data
    """
    content = {"seq": entry.seq, "kind": entry.kind, "data": entry.payload}
    body = json.dumps(content, separators=(",", ":")).encode()[:-1]
    return b'%b,"crc":"%08x"}\n' % (body, zlib.crc32(body))


def decode(data: bytes, name: str = "journal") -> Lines:
    """Read lines back. A damaged line is skipped; so is an incomplete last one, which was never confirmed."""
    entries: list[Entry] = []
    problems: list[str] = []
    *lines, rest = data.split(b"\n")
    for number, line in enumerate(lines, 1):
        entry = _parse(line)
        if entry is None:
            problems.append(f"{name}, line {number}: is damaged and was skipped")
        else:
            entries.append(entry)
    good_bytes = len(data) - len(rest)
    entry = _parse(rest)
    if entry is not None:  # only its newline is missing
        entries.append(entry)
        good_bytes = len(data)
    elif rest:
        number = len(lines) + 1
        problems.append(f"{name}, line {number}: cut off after {len(rest)} bytes; it was never confirmed")
    if len(problems) > _MAX_PROBLEMS:
        problems[_MAX_PROBLEMS:] = [f"{name}: {len(problems) - _MAX_PROBLEMS} further lines are damaged"]
    return Lines(tuple(entries), tuple(problems), good_bytes)


def _parse(line: bytes) -> Entry | None:
    """The entry of a whole and undamaged line."""
    match = _CHECKSUM.fullmatch(line, max(0, len(line) - _TAIL_LENGTH))
    if match is None or zlib.crc32(line[: match.start()]) != int(match[1], 16):
        return None
    try:
        content = json.loads(line)
        return Entry(int(content["seq"]), str(content["kind"]), dict(content["data"]))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None


class LoadedJournal(NamedTuple):
    """The content of a journal.

    :param entries: entries after the snapshot, by number; all entries without a snapshot
    """

    snapshot: str | None  # text given to the last Journal.snapshot, None if there is none
    entries: tuple[Entry, ...]
    problems: tuple[str, ...]
    complete: bool = True  # whether no entry is known to be missing since the snapshot, see Journal.doubt


class Journal:
    """A journal that is being written, by one process at a time. Use :meth:`open`.

    Entries are numbered from 1, and a restart continues the numbers. The numbers distinguish an entry that is
    read twice from two entries.
    """

    def __init__(self, folder: Path, descriptor: int, size_bytes: int, seq: int) -> None:
        self.folder = folder
        self._descriptor = descriptor
        self._size_bytes = size_bytes
        self._seq = seq
        self._synced = (size_bytes, seq)
        self._complete = (folder / _COMPLETE).exists()

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Continue the journal of a folder, or start one. An incomplete last entry is removed.

        :raises InputError: if another process is writing it, or the folder cannot be written
        """
        path = folder / ENTRIES
        descriptor = -1
        try:
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            sync_folder(folder)
            data = path.read_bytes()
            lines, _, snapshot_seq, _ = _read(folder, data)
            size_bytes = lines.good_bytes
            if size_bytes != len(data):
                os.ftruncate(descriptor, size_bytes)
            if size_bytes and data[size_bytes - 1 : size_bytes] != b"\n":
                _write(descriptor, b"\n")
                size_bytes += 1
        except BlockingIOError:
            os.close(descriptor)
            message = "another mission is writing the journal of this folder"
            raise InputError(message, "stop it, or choose another folder", folder) from None
        except OSError as error:
            if descriptor >= 0:
                os.close(descriptor)
            message = f"the mission's journal cannot be written here: {error.strerror}"
            raise InputError(message, "choose a folder on a disk that is writable and has space", folder) from None
        seq = max((entry.seq for entry in lines.entries), default=0)
        return cls(folder, descriptor, size_bytes, max(seq, snapshot_seq))

    @property
    def seq(self) -> int:
        """Number of the last entry, 0 before the first."""
        return self._seq

    def append(self, kind: str, payload: Mapping[str, Any], *, durable: bool = True) -> int:
        """Write an entry, such as an ``event`` with plain data, and return its number.

        :param durable: whether to return only when it is on the disk; otherwise it gets there with the next one
        :raises OSError: if the disk refuses it; the journal stays as it was, and the next entry may be tried
        """
        entry = Entry(self._seq + 1, kind, dict(payload))
        line = encode(entry)
        try:
            _write(self._descriptor, line)
            if durable:
                os.fdatasync(self._descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self._size_bytes)
            raise
        self._size_bytes += len(line)
        self._seq = entry.seq
        if durable:
            self._synced = (self._size_bytes, self._seq)
        return entry.seq

    def sync(self) -> None:
        """Make sure that all entries are on the disk; ``OSError`` if it refuses them."""
        os.fdatasync(self._descriptor)
        self._synced = (self._size_bytes, self._seq)

    def undo(self) -> None:
        """Remove the entries since the last sync: after one that failed, only writing them again is safe.

        The system takes them for written then, and a later sync succeeds without them.
        """
        os.ftruncate(self._descriptor, self._synced[0])
        self._size_bytes, self._seq = self._synced

    def snapshot(self, state_json: str) -> None:
        """Write the state after all entries so far, so that only later ones are replayed; the entries stay.

        :raises OSError: if the disk refuses it; the previous snapshot stays
        """
        self.sync()
        write_whole(self.folder / _SNAPSHOT, encode(Entry(self._seq, "snapshot", {"state": state_json})))
        if not self._complete:
            write_whole(self.folder / _COMPLETE, b"")
            self._complete = True

    def turn_over(self, state_json: str) -> None:
        """Write the state, and begin anew without the entries before, as a journal would grow for ever.

        :raises OSError: if the disk refuses it; the journal stays as it was
        """
        self.snapshot(state_json)
        os.ftruncate(self._descriptor, 0)
        self._size_bytes = 0
        self._synced = (0, self._seq)

    def doubt(self) -> None:
        """An entry is missing: what is on the disk is not the state, until the next snapshot."""
        self._complete = False
        with contextlib.suppress(OSError):
            (self.folder / _COMPLETE).unlink(missing_ok=True)

    def close(self) -> None:
        """Write everything to the disk, and release the journal."""
        if self._descriptor >= 0:
            try:
                os.fdatasync(self._descriptor)
            finally:
                os.close(self._descriptor)
                self._descriptor = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def load_journal(folder: Path) -> LoadedJournal:
    """Read the journal of a folder, if there is one, without changing it.

    A cut loses only the entry that was being written. A damaged snapshot loses nothing of what came after the last
    :meth:`Journal.turn_over`: these entries are returned.

    :raises InputError: if it cannot be read
    """
    try:
        path = folder / ENTRIES
        lines, snapshot, snapshot_seq, problems = _read(folder, path.read_bytes() if path.exists() else b"")
    except OSError as error:
        message = f"the mission's journal cannot be read: {error.strerror}"
        raise InputError(message, "check the disk and permissions", folder) from None
    entries: list[Entry] = []
    refused = snapshot is not None and not (folder / _COMPLETE).exists()
    complete, seq = not refused, snapshot_seq
    for entry in lines.entries:
        if entry.seq <= snapshot_seq:  # the snapshot includes it
            continue
        if entry.seq <= seq:
            problems.append(f"{ENTRIES}: entry {entry.seq} occurs twice; the first one is used")
            continue
        if entry.seq > seq + 1:
            problems.append(f"{ENTRIES}: {_span(seq + 1, entry.seq - 1)} missing")
            complete = False
        seq = entry.seq
        entries.append(entry)
    if refused:
        problems.append(f"{ENTRIES}: the disk has refused entries since the snapshot")
    return LoadedJournal(snapshot, tuple(entries), tuple(problems), complete)


def _read(folder: Path, data: bytes) -> tuple[Lines, str | None, int, list[str]]:
    """Lines of the journal, the snapshot's text and last entry, and all problems of both files."""
    lines = decode(data, ENTRIES)
    problems = list(lines.problems)
    path = folder / _SNAPSHOT
    if path.exists():
        found = decode(path.read_bytes(), _SNAPSHOT)
        problems += found.problems
        if len(found.entries) == 1 and isinstance(state := found.entries[0].payload.get("state"), str):
            return lines, state, found.entries[0].seq, problems
        problems.append(f"{_SNAPSHOT} cannot be used; all entries are replayed instead")
    return lines, None, 0, problems


def _span(first: int, last: int) -> str:
    return f"entry {first} is" if first == last else f"entries {first} to {last} are"


def _write(descriptor: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]
