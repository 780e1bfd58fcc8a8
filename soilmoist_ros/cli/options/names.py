# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values of options that have names: fields, sites, loggers, strategies ... The shell completes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

FILE = click.Path(path_type=Path)
_SHIPPED = {"field": "fields", "site": "sites", "scenario": "scenarios"}


def _shipped(kind: str) -> Callable[[], Iterable[str]]:
    def names() -> Iterable[str]:
        from soilmoist_ros.foundation import resource_names

        return resource_names(kind)

    return names


def _surrogates() -> Iterable[str]:
    from soilmoist_ros.simulation import surrogate_field_names

    return surrogate_field_names()


def _strategies() -> Iterable[str]:
    from soilmoist_ros.exploration import STRATEGIES

    return STRATEGIES.names()


def _dwells() -> Iterable[str]:
    from soilmoist_ros.exploration import DWELL_RULES

    return [name + ":" * DWELL_RULES.get(name).needs_value for name in DWELL_RULES.names()]


def _models() -> Iterable[str]:
    from soilmoist_ros.mapping import VARIOGRAM_MODELS

    return VARIOGRAM_MODELS.names()


def _loggers() -> Iterable[str]:
    from soilmoist_ros.sensing import logger_names

    return logger_names()


def _exports() -> Iterable[str]:
    from soilmoist_ros.reporting import EXPORTS

    return EXPORTS.names()


NAMES: dict[str, Callable[[], Iterable[str]]] = {
    "field": _shipped("fields"),
    "surrogate": _surrogates,
    "site": _shipped("sites"),
    "logger": _loggers,
    "scenario": _shipped("scenarios"),
    "campaign": _shipped("campaigns"),
    "strategy": _strategies,
    "dwell": _dwells,
    "model": _models,
    "export": _exports,
}
"""What can be named -> its names, read on use."""
_NO_FILES = ("strategy", "dwell", "model", "export")


def completions(kind: str, incomplete: str) -> list[CompletionItem]:
    """Names that continue a word, and files where the path of one will do.

    :param kind: a key of :data:`NAMES`
    """
    files = (
        [] if kind in _NO_FILES else [CompletionItem(incomplete, type="file")]
    )  # first: bash clears what is before
    return files + [CompletionItem(name) for name in NAMES[kind]() if name.startswith(incomplete)]


class Name(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A name, or the path of a file. The command that uses it checks it.

    :param kind: a key of :data:`NAMES`
    :param early: whether it is checked before the command begins; otherwise the command does it
    """

    def __init__(self, kind: str, early: bool = True) -> None:
        self.name = self._kind = kind
        self._early = early

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Names and files that continue the word."""
        return completions(self._kind, incomplete)

    def require(self, value: str) -> None:
        """Check a given name or path before the work; what the file says is checked later.

        :raises InputError: if there is no such name and no such file
        """
        if not self._early or not value or Path(value).is_file():
            return
        if self._kind in _SHIPPED:
            from soilmoist_ros.foundation import resource

            resource(_SHIPPED[self._kind], value)
        elif self._kind == "logger":
            from soilmoist_ros.sensing import logger_path

            logger_path(value)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """A placeholder: reading the names would make the help slow."""
        return {"surrogate": "field", "export": "format"}.get(self._kind, self._kind).upper()


class InputFile(click.Path):
    """Path of a file or folder that must exist when the command begins.

    :param remedy: what to do if it does not
    :param words: values that are no paths
    """

    def __init__(self, remedy: str = "check the path", words: tuple[str, ...] = ()) -> None:
        super().__init__(path_type=Path)
        self._remedy, self.words = remedy, words

    def require(self, value: Path) -> None:
        """Check a given path.

        :raises InputError: if there is nothing
        """
        if str(value) in self.words or value.exists():
            return
        from soilmoist_ros.foundation import InputError

        raise InputError("there is no such file", self._remedy, value)


class VariogramModel(Name):
    """Name of a registered variogram model, checked. Only a given option loads the registry: it needs numpy."""

    def __init__(self) -> None:
        super().__init__("model")

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the name if a model has it; fail otherwise."""
        from soilmoist_ros.foundation import InputError
        from soilmoist_ros.mapping import VARIOGRAM_MODELS

        try:
            VARIOGRAM_MODELS.get(value)
        except InputError as error:
            self.fail(str(error), param, ctx)
        return value
