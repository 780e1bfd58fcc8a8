# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Write a bag in the rosbag2 layout; a crash loses only the messages after the last flush."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import IO, Final, Self, cast

from mcap.writer import CompressionType, Writer

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import Extent, Topic, bag_metadata, to_yaml
from soilmoist_ros.recording.run_folder import sync_folder, write_whole

_WRITE_AT: Final = 1 << 20
_CHUNK_BYTES: Final = 16 << 10  # size at which a chunk is closed [bytes]: one flipped bit costs a chunk


class BagGoneError(OSError):
    """The file of a bag is no longer where it was made."""


class BagWriter:
    """A bag: the folder ``NAME`` with ``NAME_0.mcap``; after it was closed with ``metadata.yaml``.

    A disk error loses nothing: the unwritten data are kept, and the next :meth:`flush` tries again. The lock on
    the open file shows other programs that the recording continues.

    :raises InputError: if the folder exists, or cannot be made or written to
    """

    def __init__(self, folder: Path, distribution: str = "jazzy") -> None:
        self.folder = folder
        self.path = folder / f"{folder.name}_0.mcap"
        self.extent = Extent()
        """All messages."""
        self.counts: dict[Topic, int] = {}
        """Number of messages of each topic."""
        self._distribution = distribution
        self._file = _AppendedFile(_make(folder, self.path), self.path)
        self._mcap = Writer(
            cast("IO[bytes]", self._file), chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._mcap.start(profile="ros2")
        self._schemas: dict[str, int] = {}
        self._channels: dict[Topic, int] = {}
        self._unflushed = False

    @property
    def size_bytes(self) -> int:
        """Bytes in the file and bytes that wait to be written."""
        return self._file.tell()

    def write(self, topic: Topic, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Add a message, see :meth:`.BagRecorder.put`.

        :raises OSError: if the disk refuses the message now; it is kept for the next :meth:`flush`
        """
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._add(topic)
        self._mcap.add_message(channel, log_time=log_ns, publish_time=publish_ns, data=data)
        self.counts[topic] += 1
        self.extent = self.extent.with_message(log_ns)
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

    def close(self, notes: Mapping[str, str] = MappingProxyType({})) -> None:
        """Finish the file and write ``metadata.yaml``, with further notes.

        :raises OSError: if the disk refuses it; :func:`recover_bag` restores what is on the disk
        """
        metadata = bag_metadata(self.path.name, self.extent, self.counts, self._distribution, notes)
        try:
            self._mcap.add_metadata("rosbag2", {"serialized_metadata": to_yaml(metadata).strip()})
            self._mcap.finish()  # type: ignore[no-untyped-call]
            self._file.sync()
            text = to_yaml({"rosbag2_bagfile_information": metadata})
            write_whole(self.folder / "metadata.yaml", text.encode())
        finally:
            self._file.close()

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
        self.counts[topic] = 0
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
        self._waiting = bytearray()
        self._written = 0
        self._synced = 0

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
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            sync_folder(folder)
        except OSError:
            folder.rmdir()
            raise
    except OSError as error:
        raise _refusal(folder, path, error) from None
    sync_folder(folder.parent)
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
