# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Write a bag in the rosbag2 layout; a crash loses only the messages after the last flush."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import IO, Final, Self, cast

from mcap.writer import CompressionType, Writer

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagFile, Extent, Topic, bag_metadata, joined, to_yaml
from soilmoist_ros.recording.run_folder import sync_folder, write_whole

_WRITE_AT: Final = 1 << 20
_CHUNK_BYTES: Final = 16 << 10  # size at which a chunk is closed [bytes]: one flipped bit costs a chunk


CHECKSUMS: Final = "SHA256SUMS"
"""File with the checksums of a bag's files, for ``soilmoist bag verify`` and ``sha256sum --check``."""


class BagGoneError(OSError):
    """The file of a bag is no longer where it was made."""


@dataclass(frozen=True)
class _Part:
    """A finished file, its messages by topic, and its size [bytes]."""

    file: BagFile
    counts: Mapping[Topic, int]
    size: int


class BagWriter:
    """A bag: the folder ``NAME`` with ``NAME_0.mcap``; after it was closed with ``metadata.yaml`` and checksums.

    A disk error loses nothing: the unwritten data are kept, and the next :meth:`flush` tries again. The lock on
    the open file shows other programs that the recording continues. ``notes`` go to the metadata.

    :raises InputError: if the folder exists, or cannot be made or written to
    """

    def __init__(
        self, folder: Path, distribution: str = "jazzy", notes: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self.folder = folder
        self._distribution = distribution
        self._notes = notes
        self._done: list[_Part] = []
        self._number = 0
        self._sums: dict[str, str] = {}
        self._counts: dict[Topic, int] = {}
        self._done_bytes = 0
        self.path = folder / f"{folder.name}_0.mcap"
        self._begin(_make(folder, self.path))

    def _begin(self, descriptor: int) -> None:
        """Begin a file; topics are described in each."""
        self._file = _AppendedFile(descriptor, self.path)
        self._mcap = Writer(
            cast("IO[bytes]", self._file), chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._mcap.start(profile="ros2")
        self._schemas: dict[str, int] = {}
        self._channels: dict[Topic, int] = {}
        self._in_file: dict[Topic, int] = {}
        self._extent = Extent()
        self._began_s = time.monotonic()
        self._finished = False
        self._unflushed = False

    @property
    def extent(self) -> Extent:
        """All messages."""
        return joined([part.file.extent for part in self._done] + [self._extent])

    @property
    def file_age_s(self) -> float:
        """Time since the current file was begun [s]."""
        return time.monotonic() - self._began_s

    @property
    def file_bytes(self) -> int:
        """Size of the current file, with what waits to be written [bytes]."""
        return self._file.tell()

    @property
    def size_bytes(self) -> int:
        """Bytes in the files and bytes that wait to be written."""
        return self._done_bytes + (0 if self._file.closed else self._file.tell())

    @property
    def counts(self) -> dict[Topic, int]:
        """Number of messages of each topic."""
        return dict(self._counts)

    def write(self, topic: Topic, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Add a message, see :meth:`.BagRecorder.put`.

        :raises OSError: if the disk refuses the message now; it is kept for the next :meth:`flush`
        """
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._add(topic)
        self._mcap.add_message(channel, log_time=log_ns, publish_time=publish_ns, data=data)
        self._counts[topic] += 1
        self._in_file[topic] += 1
        self._extent = self._extent.with_message(log_ns)
        self._unflushed = True
        if self._file.waiting >= _WRITE_AT:
            self._file.write_out()

    def flush(self) -> None:
        """Write everything so far to the disk. After an ``OSError`` nothing is lost, call it again.

        :raises BagGoneError: if the file was deleted or moved
        """
        if self._unflushed:
            self._mcap.flush()  # type: ignore[no-untyped-call]
            self._unflushed = False
        self._file.sync()
        if self._finished:  # the rest of a split
            self._sums[self.path.name] = self._file.checksum
            self._write_sums()
            path = self.folder / f"{self.folder.name}_{self._number + 1}.mcap"
            descriptor = _create(path)
            self._file_done()
            self._number += 1
            self.path = path
            self._begin(descriptor)

    def split(self) -> None:
        """Finish the file, and continue in the next one; after an ``OSError``, :meth:`flush` before a message."""
        self._finish({})
        self.flush()

    def drop_oldest(self, size_bytes: float) -> list[str]:
        """Delete finished files, the oldest first, until their sizes reach this size; returns their names."""
        names = []
        while size_bytes > 0 and self._done:
            part = self._done[0]
            (self.folder / part.file.name).unlink(missing_ok=True)
            del self._done[0], self._sums[part.file.name]
            for topic, count in part.counts.items():
                self._counts[topic] -= count
            self._done_bytes -= part.size
            size_bytes -= part.size
            names.append(part.file.name)
        if names:
            self._write_sums()
        return names

    def close(self, notes: Mapping[str, str] = MappingProxyType({})) -> None:
        """Finish the file and write ``metadata.yaml``, with further notes, and the checksums.

        :raises OSError: if the disk refuses it; :func:`recover_bag` restores what is on the disk
        """
        notes = {**self._notes, **notes}
        try:
            self._finish(notes)
            self._file.sync()
            self._file_done()
            files = [part.file for part in self._done]
            metadata = bag_metadata(files, self._counts, self._distribution, notes)
            text = to_yaml({"rosbag2_bagfile_information": metadata}).encode()
            self._sums[self.path.name] = self._file.checksum
            self._sums["metadata.yaml"] = hashlib.sha256(text).hexdigest()
            self._write_sums()
            write_whole(self.folder / "metadata.yaml", text)
        finally:
            self._file.close()

    def _finish(self, notes: Mapping[str, str]) -> None:
        """Complete the file in memory."""
        if self._finished:
            return
        metadata = bag_metadata([BagFile(self.path.name, self._extent)], self._in_file, self._distribution, notes)
        self._mcap.add_metadata("rosbag2", {"serialized_metadata": to_yaml(metadata).strip()})
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._unflushed, self._finished = False, True

    def _file_done(self) -> None:
        size = self._file.tell()
        self._done.append(_Part(BagFile(self.path.name, self._extent), self._in_file, size))
        self._done_bytes += size
        self._extent = Extent()
        self._file.close()

    def _write_sums(self) -> None:
        lines = [f"{checksum}  {name}\n" for name, checksum in self._sums.items()]
        write_whole(self.folder / CHECKSUMS, "".join(lines).encode())

    def abandon(self) -> None:
        """Close the file without finishing it."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is None:
            self.close()
        else:
            self.abandon()

    def _add(self, topic: Topic) -> int:
        definition = topic.definition
        if definition.type_name not in self._schemas:
            text = definition.text.encode()
            number = self._mcap.register_schema(definition.type_name, definition.encoding, text)
            self._schemas[definition.type_name] = number
        metadata = {
            "offered_qos_profiles": to_yaml([qos.to_dict() for qos in topic.offered]).strip(),
            "topic_type_hash": definition.type_hash,
        }
        schema = self._schemas[definition.type_name]
        channel = self._mcap.register_channel(topic.name, "cdr", schema, metadata)
        self._channels[topic] = channel
        self._counts.setdefault(topic, 0)
        self._in_file[topic] = 0
        return channel


def is_being_written(path: Path) -> bool:
    """True if a recorder on this machine has an MCAP file open."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return isinstance(error, BlockingIOError)
    return False


class _AppendedFile:
    """The file of the MCAP writer. It keeps what the disk refuses, and never writes it twice.

    With a buffered file of Python it is unknown how much of a failed write is in the file.
    """

    def __init__(self, descriptor: int, path: Path) -> None:
        self._descriptor = descriptor
        self._path = path
        self._hash = hashlib.sha256()
        self._waiting = bytearray()
        self._written = 0
        self._synced = 0

    @property
    def checksum(self) -> str:
        """SHA-256 of what was written."""
        return self._hash.hexdigest()

    @property
    def closed(self) -> bool:
        return self._descriptor < 0

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    def write(self, data: bytes) -> int:
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Called by the MCAP writer at the end of each chunk; :meth:`sync` writes to the disk."""

    def write_out(self) -> None:
        while self._waiting:
            count = os.write(self._descriptor, self._waiting)
            self._hash.update(memoryview(self._waiting)[:count])
            del self._waiting[:count]
            self._written += count

    def sync(self) -> None:
        self.write_out()
        self._check()
        if self._synced < self._written:
            os.fdatasync(self._descriptor)
            self._synced = self._written

    def _check(self) -> None:
        """Writing to a file that was deleted or moved succeeds: nobody would notice."""
        try:
            there = os.path.samestat(os.stat(self._path), os.fstat(self._descriptor))
        except FileNotFoundError:
            there = False
        if not there:
            raise BagGoneError(errno.ENOENT, "it was deleted or moved")

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _make(folder: Path, path: Path) -> int:
    """Make a bag's folder and file, and return the descriptor of the locked file."""
    try:
        folder.mkdir(parents=True)
        try:
            descriptor = _create(path)
        except OSError:
            folder.rmdir()
            raise
    except OSError as error:
        raise _refusal(folder, path, error) from None
    sync_folder(folder.parent)
    return descriptor


def _create(path: Path) -> int:
    """Make a file, and return the descriptor of it, locked."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    sync_folder(path.parent)
    return descriptor


def _refusal(folder: Path, path: Path, error: OSError) -> InputError:
    if not (isinstance(error, FileExistsError) and folder.is_dir()):
        message = f"no recording can be made here: {error.strerror}"
        return InputError(message, "choose a folder on a disk that is writable and has space", folder)
    if is_being_written(path):
        return InputError("another recorder is writing to this folder", "stop it, or choose another name", folder)
    return InputError(
        "this folder exists; a recording never overwrites", "choose another name or remove it", folder
    )
