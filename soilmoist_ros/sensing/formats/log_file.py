# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finds and reads logger files, and explains unreadable files."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.sensing.formats.log_layout import (
    MissingColumnsError,
    build_layout,
    is_header,
    plain_name,
    split_fields,
)
from soilmoist_ros.sensing.formats.log_values import decode_line, split_lines, utf16
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format, logger_names

HEADER_LINES = 200
_GNSS_SENTENCE = re.compile(rb"\s*\$G[A-Z](GGA|RMC|GST|GLL|GSA|GSV|VTG|ZDA),")
_MAGIC = {
    b"PK\x03\x04": "a ZIP archive or a spreadsheet (.xlsx)",
    b"\x1f\x8b": "a gzip archive",
    b"%PDF": "a PDF document",
    b"\x89PNG": "an image",
    b"\xd0\xcf\x11\xe0": "an old Office document (.xls)",
    b"\x89MCAP": "a ROS bag (MCAP)",
    b"SQLite": "a database",
}


def read_lines(path: Path, binary: bool = False) -> tuple[list[bytes], bool]:
    """Lines of a text file without line ends, and whether the last line had an end.

    :param path: the file; the path of an archive, followed by the name of a file in it, is one as well
    :param binary: whether other bytes may stand between the lines
    :raises InputError: if the file is missing, a folder, not readable, empty or not text
    """
    if path.is_dir():
        raise InputError("is a folder, not a file", "give the path of a log file in it", path)
    try:
        data = read_data(path)
    except FileNotFoundError:
        raise InputError("there is no such file", "check the path", path) from None
    except (OSError, ValueError, KeyError, RuntimeError, zipfile.BadZipFile) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", "check the path and its permissions", path) from None
    if not data.strip(b"\x00 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise EmptyFileError("is empty", "check that the logger wrote it, and that it was copied as a whole", path)
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise InputError(f"is {what}, not a text file", "unpack it or export it as text first", path)
    if not binary and _is_binary(data[:4096]):
        raise InputError("is not a text file", "give the text file that the logger wrote", path)
    return split_lines(data)


class EmptyFileError(InputError):
    """A file without content, as loggers leave them when the power fails."""


def read_data(path: Path) -> bytes:
    """Content of a file, or of a file in a ZIP archive."""
    archive = next((parent for parent in path.parents if parent.is_file()), None)
    if archive is None:
        return path.read_bytes()
    with zipfile.ZipFile(archive) as content:
        return content.read(path.relative_to(archive).as_posix())


def log_files(paths: Iterable[Path]) -> list[Path]:
    """Files to read: those that are given, and those in folders and ZIP archives, without hidden ones.

    :raises InputError: if a folder or archive has no file
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            runs = {one.parent for one in path.rglob("summary.json")}
            names = sorted(one for one in path.rglob("*") if one.is_file() and not runs.intersection(one.parents))
        elif path.suffix.lower() == ".zip" and zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as content:
                names = sorted(path / one.filename for one in content.infolist() if not one.is_dir())
        else:
            found.append(path)
            continue
        files = [one for one in names if not any(part[0] in "._" for part in one.relative_to(path).parts)]
        if not files:
            raise InputError("has no file", "give a log file, or a folder or archive with log files", path)
        found += files
    return found


def _is_binary(start: bytes) -> bool:
    if utf16(start):
        return False
    start = start.replace(b"\x00", b"")  # a power cut leaves blocks of zeros
    control = sum(byte < 32 and byte not in b"\t\r\n\x0c\x1a" for byte in start)
    return control > 0.05 * len(start)


def separated_as(logger: LoggerFormat, lines: Sequence[bytes]) -> LoggerFormat:
    """The format with the separator by which the first lines have its columns; unchanged if none does."""
    for delimiter in (
        logger.delimiter,
        *(one for one in ("semicolon", "comma", "tab") if one != logger.delimiter),
    ):
        form = logger if delimiter == logger.delimiter else logger.model_copy(update={"delimiter": delimiter})
        if any(_number_of_sources(form, names) for names in header_candidates(form, lines)):
            return form
    return logger


def header_candidates(logger: LoggerFormat, lines: Sequence[bytes]) -> list[list[str]]:
    """Lists of column names in the first lines of a file, if it has this format."""
    found: list[list[str]] = []
    comment = logger.header.comment
    continued = {plain_name(name) for name in logger.header.continued_by}
    for line in lines[:HEADER_LINES]:
        text = decode_line(line).strip()
        if logger.checksum == "nmea":
            text = text.partition("*")[0]
        if comment:
            text = text.removeprefix(comment)
        names = [name for name in split_fields(logger, text) if name]
        if is_header(logger, names):
            found.append(names)
        elif found and names and plain_name(names[0]) in continued:
            found[-1] = found[-1] + names
    return found


def matching_formats(lines: Sequence[bytes]) -> list[str]:
    """Names of the formats whose columns are in the first lines, best match first."""
    matches = []
    for name in logger_names():
        logger = separated_as(_known_format(name), lines)
        best = max((_number_of_sources(logger, names) for names in header_candidates(logger, lines)), default=0)
        if best:
            matches.append((-best, name))
    return [name for _, name in sorted(matches)]


@cache
def _known_format(name: str) -> LoggerFormat:
    return load_logger_format(name)


def _number_of_sources(logger: LoggerFormat, names: Sequence[str]) -> int:
    try:
        return build_layout(logger, names).number_of_sources
    except MissingColumnsError:
        return 0


def unreadable_header(path: Path, lines: Sequence[bytes], logger: LoggerFormat, missing: Sequence[str]) -> Mistake:
    """Reason why a file does not have a format, and the format that may fit.

    :param logger: the format with which the file was read
    :param missing: columns missing in the header; empty if there is no header
    """
    remedy = other_format(lines)
    if not missing:
        wanted = " or ".join(repr(name) for name in logger.time.columns)
        return Mistake(f"{logger.title}: no header line, which would name a column {wanted}", remedy, path)
    number, names = _first_header(logger, lines)
    have = f"; it has {', '.join(name.lstrip('/# ') for name in names[:40])}" if names else ""
    lacks = "; no column ".join(missing)
    return Mistake(f"{logger.title}: the header has no column {lacks}{have}", remedy, path, number)


def nothing_usable(
    path: Path, lines: Sequence[bytes], logger: LoggerFormat, mistakes: Sequence[Mistake]
) -> Mistake:
    """Reason why no record of a file is usable; its columns were found.

    :param logger: the format with which the file was read
    :param mistakes: the fault of each record, at least one
    """
    first = mistakes[0]
    fitting = [_known_format(name) for name in matching_formats(lines)[:1]]
    other = [one for one in fitting if one.title != logger.title and one.header.columns == ()]
    remedy = first.remedy or (other_format(lines) if other else "correct the logger format or the file")
    message = f"{logger.title}: none of the {len(mistakes)} records is usable; the first: {first.message}"
    return Mistake(message, remedy, path, first.line, first.column)


def other_format(lines: Sequence[bytes]) -> str:
    """Advice on the format that a file may have."""
    fitting = matching_formats(lines)
    if fitting:
        return f"this looks like {fitting[0]}: pass --logger {fitting[0]}"
    if any(_GNSS_SENTENCE.match(line) for line in lines[:HEADER_LINES]):
        return "this looks like the log of a GNSS receiver: pass it with --nmea, together with the neutron log"
    return (
        f"the known formats are {', '.join(logger_names())}; for another logger, soilmoist logger FILE drafts a "
        "format from the file: pass its path with --logger"
    )


def _first_header(logger: LoggerFormat, lines: Sequence[bytes]) -> tuple[int, list[str]]:
    for number, line in enumerate(lines[:HEADER_LINES], start=1):
        names = header_candidates(logger, [line])
        if names:
            return number, names[0]
    return 0, []
