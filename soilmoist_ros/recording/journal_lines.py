# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines of a journal: JSON with a checksum, so that a cut is detected and a flipped bit is repaired."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

_CHECKSUM: Final = re.compile(rb',"crc":"([0-9a-f]{8})"\}')
_TAIL_LENGTH: Final = len(b',"crc":"00000000"}')
_NEWLINE: Final = 0x0A
_MAX_TRIES: Final = 8
"""Entries of a damaged line that are tried although their checksum is right: one is enough for an accident."""
_MAX_PROBLEMS: Final = 100


@dataclass(frozen=True)
class Entry:
    """An entry of a journal.

    :param seq: its number; consecutive entries have consecutive numbers
    :param kind: kind of the entry
    :param payload: plain data
    """

    seq: int
    kind: str
    payload: dict[str, Any]


@dataclass(frozen=True)
class Lines:
    """The content of a journal's file.

    :param entries: whole entries in the order of the file
    :param problems: problems of the file, in words
    :param good_bytes: bytes up to the end of the last whole line [bytes], where writing may continue
    """

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
    """Read lines back.

    An incomplete last line is dropped: it was never confirmed. A single flipped bit anywhere is found by the
    checksum, and the entry is read as it was written. The time grows with the length of the data, whatever they
    are.

    :param data: content of the file
    :param name: name of the file in the problems
    """
    entries: list[Entry] = []
    problems: list[str] = []
    *lines, rest = data.split(b"\n")
    number, skip = 0, False
    for number, line in enumerate(lines, 1):
        if skip:
            skip = False
            continue
        following = lines[number] if number < len(lines) else rest
        found, problem, skip = _read(line, following)
        entries += found
        if problem:
            problems.append(f"{name}, line {number}: {problem}")
    good_bytes = len(data) - len(rest)
    if rest and not skip:
        found, problem, _ = _read(rest, b"")
        if found:  # only its newline is missing or damaged
            entries += found
            problems += [f"{name}, line {number + 1}: {problem}"] if problem else []
            good_bytes = len(data)
        else:
            problems.append(f"{name}, line {number + 1}: cut off after {len(rest)} bytes; it was never confirmed")
    if len(problems) > _MAX_PROBLEMS:
        problems[_MAX_PROBLEMS:] = [f"{name}: {len(problems) - _MAX_PROBLEMS} further lines are damaged"]
    return Lines(tuple(entries), tuple(problems), good_bytes)


def _read(line: bytes, following: bytes) -> tuple[list[Entry], str, bool]:
    """Entries of a line, what is wrong with it, and whether the following line was needed to repair it."""
    entry = _parse(line)
    if entry is not None:
        return [entry], "", False
    halves = _without_newline(line)
    if halves:
        return halves, "a flipped bit in a newline was repaired", False
    for index, bit, repaired in _one_bit_off(line):
        entry = _parse(repaired)
        if entry is not None:
            return [entry], f"a flipped bit (byte {index + 1}, bit {bit}) was repaired", False
    for bit in range(8):  # a flipped bit turned another character into a newline
        entry = _parse(b"%b%c%b" % (line, _NEWLINE ^ 1 << bit, following))
        if entry is not None:
            return [entry], f"a flipped bit (byte {len(line) + 1}, bit {bit}) was repaired", True
    return [], "is damaged and was skipped", False


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


def _without_newline(line: bytes) -> list[Entry]:
    """Both entries of two lines whose newline was damaged; the second may be missing at the end of the file."""
    crc = read = tries = 0
    for match in _CHECKSUM.finditer(line):
        crc = zlib.crc32(memoryview(line)[read : match.start()], crc)
        read = match.start()
        if crc != int(match[1], 16) or tries == _MAX_TRIES:
            continue
        tries += 1
        first = _parse(line[: match.end()])
        if first is not None:
            second = _parse(line[match.end() + 1 :])
            if second is not None:
                return [first, second]
            if len(line) == match.end() + 1:
                return [first]
    return []


def _one_bit_off(line: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Lines that differ in one bit, and may be whole for it."""
    changed = bytearray(line)
    body = max(0, len(line) - _TAIL_LENGTH)
    match = _CHECKSUM.fullmatch(line, body)
    places = [(index, bit) for index in range(body, len(line)) for bit in range(8)]
    if match is not None:
        places += islice(_flips(zlib.crc32(line[:body]) ^ int(match[1], 16), body), _MAX_TRIES)
    for index, bit in places:
        changed[index] ^= 1 << bit
        yield index, bit, bytes(changed)
        changed[index] ^= 1 << bit


def _flips(difference: int, length: int) -> Iterator[tuple[int, int]]:
    """Places (byte, bit) of data whose flip changes their CRC-32 by a difference.

    A CRC is linear: the difference depends on the place only. It is taken back byte by byte from the end, until it
    is that of a flip in the last byte.
    """
    for index in range(length - 1, -1, -1):
        if difference in _FLIP_OF_LAST:
            yield index, _FLIP_OF_LAST[difference]
        low = _BY_HIGH_BYTE[difference >> 24]
        difference = (difference ^ _CRC_TABLE[low]) << 8 & 0xFFFFFFFF | low


def _crc_of_byte(value: int) -> int:
    return zlib.crc32(bytes([value])) ^ zlib.crc32(b"\0")


_CRC_TABLE: Final = tuple(map(_crc_of_byte, range(256)))
_BY_HIGH_BYTE: Final = {entry >> 24: low for low, entry in enumerate(_CRC_TABLE)}
_FLIP_OF_LAST: Final = {_CRC_TABLE[1 << bit]: bit for bit in range(8)}
