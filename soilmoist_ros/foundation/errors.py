# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the core: each states the mistake, its place and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Mistake:
    """One mistake in the input.

    :param message: what is wrong
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
    """The input of the user cannot be used; contains every mistake found.

    :param mistakes: one or more mistakes; a plain string is the only message
    :param remedy: what to do, when ``mistakes`` is a plain string
    :param path: file concerned, when ``mistakes`` is a plain string
    """

    def __init__(self, mistakes: str | Sequence[Mistake], remedy: str = "", path: Path | None = None) -> None:
        if isinstance(mistakes, str):
            mistakes = [Mistake(mistakes, remedy, path)]
        self.mistakes: tuple[Mistake, ...] = tuple(mistakes)
        super().__init__("\n".join(str(mistake) for mistake in self.mistakes))


class IllConditionedError(SoilmoistError):
    """A covariance matrix is not positive definite, even with jitter: the model is numerically inconsistent."""
