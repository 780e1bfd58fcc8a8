"""Exceptions of the core: each says what is wrong, where, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Mistake:
    """One fault found in an input file.

    :param message: what is wrong
    :param remedy: what the user can do about it (may be empty)
    :param path: file in which it was found, ``None`` if it is not about a file
    :param line: line in that file, counted from 1, 0 if unknown
    :param column: name of the column or key, empty if it is about the whole line or file
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
    """Base of every exception this package raises on purpose."""


class InputError(SoilmoistError):
    """The user's input cannot be used; carries every mistake that was found, not only the first.

    :param mistakes: one or more mistakes; a plain string is taken as the only message
    :param remedy: what to do, when ``mistakes`` is a plain string
    :param path: file concerned, when ``mistakes`` is a plain string
    """

    def __init__(self, mistakes: str | Sequence[Mistake], remedy: str = "", path: Path | None = None) -> None:
        if isinstance(mistakes, str):
            mistakes = [Mistake(mistakes, remedy, path)]
        self.mistakes: tuple[Mistake, ...] = tuple(mistakes)
        super().__init__("\n".join(str(mistake) for mistake in self.mistakes))


class IllConditionedError(SoilmoistError):
    """A covariance matrix is not positive definite, even with jitter: the model contradicts itself numerically."""
