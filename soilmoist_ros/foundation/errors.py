# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages to users: mistakes with place and remedy, states of health, and suggestions for names."""

from __future__ import annotations

import difflib
import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

MAX_NAMES = 12  # maximum number of names in a message


@dataclass(frozen=True)
class Mistake:
    """One mistake in the input.

    :param remedy: what the user can do; may be empty
    :param path: file with the mistake, ``None`` without a file
    :param line: line in the file, counted from 1; 0 if unknown
    :param column: name of the column or key; empty if the mistake concerns the whole line or file
    """

    message: str
    remedy: str = ""
    path: Path | None = None
    line: int = 0
    column: str = ""

    def __str__(self) -> str:
        where = str(self.path) if self.path is not None else ""
        if self.line:
            where += f"{':' if where else 'line '}{self.line}"
        if self.column:
            where += f" [{self.column}]" if where else self.column
        text = f"{where}: {self.message}" if where else self.message
        return f"{text} -> {self.remedy}" if self.remedy else text


class SoilmoistError(Exception):
    """Base class of every exception that this package raises on purpose."""


class InputError(SoilmoistError):
    """The input of the user cannot be used; contains every mistake found."""

    def __init__(self, mistakes: str | Sequence[Mistake], remedy: str = "", path: Path | None = None) -> None:
        if isinstance(mistakes, str):
            mistakes = [Mistake(mistakes, remedy, path)]
        self.mistakes: tuple[Mistake, ...] = tuple(mistakes)
        super().__init__("\n".join(str(mistake) for mistake in self.mistakes))


class IllConditionedError(SoilmoistError):
    """A covariance matrix is not positive definite, even with jitter: the model is numerically inconsistent."""


# Names -----------------------------------------------------------------------------------------------------------


def listing(names: Iterable[str]) -> str:
    """The names, separated by commas; a long list is cut, with the number of names left out."""
    every = list(names)
    shown = ", ".join(every[:MAX_NAMES])
    return f"{shown} and {len(every) - MAX_NAMES} more" if len(every) > MAX_NAMES else shown


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` for a similar known word or the only one with this begin, else an empty text."""
    names = list(map(str, known))  # members of enumerations, too, as people write them
    begin = [name for name in names if word and name.startswith(word)]
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6) or (begin if len(begin) == 1 else [])
    return f" (did you mean {close[0]!r}?)" if close else ""


# Health ----------------------------------------------------------------------------------------------------------


class Level(enum.IntEnum):
    """Severity, numbered as in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    """Works, but needs attention."""
    ERROR = 2
    """Does not work."""
    STALE = 3
    """State unknown or out of date."""


@dataclass(frozen=True)
class Health:
    """State of one part."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
