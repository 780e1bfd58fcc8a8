# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Objects chosen by name, with those of plug-ins; names and extras that are imported on first use."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from soilmoist_ros.foundation.errors import InputError, SoilmoistError, did_you_mean, listing

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

EXTRAS = {
    **dict.fromkeys(("jinja2", "markupsafe", "matplotlib", "pyogrio", "pyproj", "rasterio"), "reports"),
    **dict.fromkeys(("lz4", "mcap", "rosbags", "zstandard"), "bags"),
    **dict.fromkeys(("pandas", "pyvrp"), "campaign"),
    **dict.fromkeys(("aiohttp", "segno"), "console"),
}
"""Extra of this package that installs a module."""

T = TypeVar("T")
_log = logging.getLogger(__name__)


class Registry(Generic[T]):
    """Named objects of one kind.

    Another package adds an object with an entry point of the group in its metadata, for example
    ``[project.entry-points."soilmoist_ros.strategies"]`` with ``spiral = "my_package:Spiral"``.
    Entry points are read only when a name is not built in, or when all names are listed.
    A plug-in that cannot be loaded is skipped with a warning.

    :param check: converts the object of a plug-in to the form in use;
        raises ``ValueError``, ``TypeError`` or :class:`InputError` if it cannot be used
    :param advice: text for an unknown name, before "one of:" and the names

    >>> shapes = Registry("example.shapes", "shape", {"circle": 0, "square": 4})
    >>> shapes.names()
    ['circle', 'square']
    >>> shapes.get("square")
    4
    >>> shapes.get("sqare")
    Traceback (most recent call last):
    ...
    soilmoist_ros.foundation.errors.InputError: there is no shape 'sqare' -> use one of: circle, square (did you mean 'square'?)
    """  # noqa: E501 - the last line of an exception must be one line

    def __init__(
        self,
        group: str,
        noun: str,
        built_in: Mapping[str, T] | Callable[[], Mapping[str, T]],
        check: Callable[[Any], T] = lambda plug_in: plug_in,
        advice: str = "use",
    ) -> None:
        self._group = group
        self._noun = noun
        self._built_in = built_in
        self._check = check
        self._advice = advice
        self._own: dict[str, T] | None = None
        self._plug_ins: dict[str, list[EntryPoint]] | None = None
        self._loaded: dict[str, T] = {}
        self._broken: set[str] = set()

    def names(self) -> list[str]:
        """Names of all usable objects: built-in names in their order, then all others, sorted."""
        own, found = self._objects(), self._found()
        names = list(own)
        for name in sorted(found.keys() - self._broken):
            try:
                if name in own:
                    raise InputError(f"the name is built in, and {_providers(found[name])} adds it too")
                self.get(name)
                names.append(name)
            except InputError as error:
                self._broken.add(name)
                why = error.mistakes[0].message
                _log.warning("skipped the %s %r of another package: %s", self._noun, name, why)
        return names

    def get(self, name: str) -> T:
        """The object of a name.

        :raises InputError: if the name is unknown, if two packages add it, or if the object cannot be loaded
        """
        own = self._objects()
        if name in own:
            return own[name]
        if name in self._found():
            if name not in self._loaded:
                self._loaded[name] = self._load(name)
            return self._loaded[name]
        names = self.names()
        there_is_none = f"there is no {self._noun} {name!r}" if name else f"no {self._noun} is given"
        raise InputError(there_is_none, f"{self._advice} one of: {listing(names)}{did_you_mean(name, names)}")

    def add(self, name: str, item: T) -> None:
        """Add an object at run time, for instance in a notebook; ``InputError`` if the name is in use."""
        if name in self._objects():
            raise InputError(f"there is a {self._noun} {name!r} already", "choose another name")
        if name in self._found():
            raise InputError(
                f"{_providers(self._found()[name])} adds a {self._noun} {name!r} already", "rename it"
            )
        self._objects()[name] = item

    def refresh(self) -> None:
        """Read the entry points again, after a package was installed or removed."""
        self._plug_ins = None
        self._loaded.clear()
        self._broken.clear()

    def _objects(self) -> dict[str, T]:
        if self._own is None:
            self._own = dict(self._built_in() if callable(self._built_in) else self._built_in)
        return self._own

    def _found(self) -> dict[str, list[EntryPoint]]:
        """Entry points by name; several for a name that several packages add."""
        if self._plug_ins is None:
            from importlib.metadata import entry_points  # slow to import, and needed for other names only

            self._plug_ins = {}
            for point in entry_points(group=self._group):
                alike = self._plug_ins.setdefault(point.name, [])
                if all((point.value, _provider(point)) != (other.value, _provider(other)) for other in alike):
                    alike.append(point)
        return self._plug_ins

    def _load(self, name: str) -> T:
        points = self._found()[name]
        if len(points) > 1:
            raise InputError(
                f"the {self._noun} {name!r} is added by {_providers(points)}",
                "uninstall one of the packages, or rename the entry point in one",
            )
        (point,) = points
        try:
            return self._check(point.load())
        except Exception as error:  # the code of another package may raise anything
            reason = str(error) if isinstance(error, SoilmoistError) else f"{type(error).__name__}: {error}"
            message = f"the {self._noun} {name!r} ({point.value}) of {_provider(point)} cannot be loaded: {reason}"
            raise InputError(message, f"repair or uninstall {_provider(point)}") from error


def _provider(point: EntryPoint) -> str:
    """Name of the package that declares an entry point."""
    return point.dist.name if point.dist is not None else "an unknown package"


def _providers(points: list[EntryPoint]) -> str:
    return " and ".join(f"{_provider(point)} ({point.value})" for point in points)


# Imports on first use --------------------------------------------------------------------------------------------


def open_door(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package whose names are imported on first use (PEP 562).

    :param homes: names, separated by spaces, by the module inside the package that has them
    """
    home_of = {name: f"{package}.{module}" for module, names in homes.items() for name in names.split()}

    def load(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home_of[name]), name)

    return load, lambda: sorted(home_of), sorted(home_of)


def optional_module(name: str) -> Any:
    """A module of an extra of this package, see :data:`EXTRAS`.

    :raises InputError: if it is not installed; states how to install it
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise not_installed(error) from None


def not_installed(error: ModuleNotFoundError) -> InputError:
    """The error of a user whose installation lacks an extra.

    :raises ModuleNotFoundError: ``error``, if the module is in no extra

    >>> not_installed(ModuleNotFoundError("No module named 'rasterio'", name="rasterio"))
    InputError("rasterio is not installed -> pip install 'soilmoist_ros[reports]'")
    """
    name = (error.name or "").partition(".")[0]
    if name not in EXTRAS:
        raise error
    return InputError(f"{name} is not installed", install(EXTRAS[name]))


def is_installed(*modules: str) -> bool:
    """True if modules can be imported, without importing them."""
    return all(find_spec(module) is not None for module in modules)


def install(extra: str) -> str:
    """The command that installs an extra."""
    return f"pip install 'soilmoist_ros[{extra}]'"
