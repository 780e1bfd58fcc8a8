# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Why bytes of a logger become no record, and what to do about it."""

from __future__ import annotations

from collections import Counter

from soilmoist_ros.sensing.formats.log_file import matching_formats
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.problems import Kind, Problem

MAX_LINES = 50
"""Number of lines kept for the search of their format."""
MAX_EXAMPLE = 80
"""Number of characters shown of a line."""

_DAMAGED = frozenset((Kind.UNREADABLE, Kind.TOO_LONG))
_OTHER_FORMAT = frozenset((Kind.NO_HEADER, Kind.BAD_HEADER, Kind.WRONG_FIELDS, Kind.BAD_TIME, Kind.NOT_A_NUMBER))
_BAUD = "compare the baud rate in logger_uri with the logger's, and check the cable"


class FaultyLines:
    """Lines of a logger since its last record, by what is wrong with them.

    Attributes
    ----------
    lines : int
        number of lines
    lost : Counter[Kind]
        number of lines and records that were dropped, by kind of problem
    """

    def __init__(self) -> None:
        self.lines = 0
        self.lost: Counter[Kind] = Counter()
        self._line = b""
        self._first: list[bytes] = []
        self._remedies: dict[Kind, str] = {}
        self._examples: dict[Kind, bytes] = {}

    def take_line(self, line: bytes) -> None:
        """A line has come."""
        self.lines += 1
        self._line = line
        if len(self._first) < MAX_LINES:
            self._first.append(line)

    def take_problem(self, problem: Problem) -> None:
        """Something is wrong with the last line, or with its record."""
        if problem.lost and problem.kind is not Kind.DUPLICATE:
            self.lost[problem.kind] += 1
            self._remedies[problem.kind] = problem.mistake.remedy
            self._examples[problem.kind] = self._line

    @property
    def reasons(self) -> str:
        """What is wrong and how often, the most frequent first; empty if nothing is."""
        return ", ".join(f"{kind.text} ({count})" for kind, count in self.lost.most_common(3))

    @property
    def examples(self) -> dict[str, str]:
        """The last line of each kind of problem, as printable text."""
        return {f"last line with: {kind.text}": _printable(line) for kind, line in sorted(self._examples.items())}

    def remedy(self, logger: LoggerFormat) -> str:
        """What the operator can do.

        :param logger: format with which the lines are read
        """
        if not self.lines:
            return f"no line has an end: {_BAUD}"
        if sum(line.startswith(b"$G") for line in self._first) > len(self._first) / 2:
            return "these are sentences of a GNSS receiver: exchange logger_uri and gnss_uri"
        fitting = matching_formats(self._first)
        if fitting and logger not in map(load_logger_format, fitting):
            return f"the lines look like {fitting[0]}: set logger_format to it"
        kind = next((kind for kind, _ in self.lost.most_common(1)), None)
        if kind is None:
            return "check that the logger counts: it sends only lines of a header"
        if kind in _DAMAGED or (kind is Kind.CHECKSUM and _is_noise(self._examples[kind])):
            return f"{_BAUD}; binary protocols cannot be read"
        if kind is Kind.CHECKSUM and b"*" not in self._examples[kind]:
            return f"the lines have no checksum, unlike those of {logger.title}: check logger_format"
        if kind in (Kind.BAD_TIME, Kind.NOT_A_NUMBER) and self._remedies[kind]:
            return self._remedies[kind]
        if kind in _OTHER_FORMAT:
            return f"check logger_format (now {logger.title}), or restart the logger, which then sends its header"
        return self._remedies[kind] or "check the logger"


def _is_noise(line: bytes) -> bool:
    """Whether more than a tenth of a line is not ASCII text."""
    return 10 * sum(not (32 <= byte < 127 or byte == 9) for byte in line) > len(line)


def _printable(line: bytes) -> str:
    text = "".join(chr(byte) if 32 <= byte < 127 else f"\\x{byte:02x}" for byte in line[:MAX_EXAMPLE])
    return text if len(text) <= MAX_EXAMPLE else f"{text[:MAX_EXAMPLE]}..."
