# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Modules that are imported on first use: ``import soilmoist_ros.sensing`` is light, and extras may be missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from soilmoist_ros.foundation.errors import InputError

EXTRAS = {
    **dict.fromkeys(
        ("jinja2", "markupsafe", "matplotlib", "pyogrio", "pyproj", "rasterio", "reverse_geocode"), "reports"
    ),
    **dict.fromkeys(("lz4", "mcap", "rosbags", "zstandard"), "bags"),
    **dict.fromkeys(("distributed", "pyarrow", "pyvrp"), "campaign"),
    **dict.fromkeys(("aiohttp", "segno"), "console"),
    **dict.fromkeys(("geopandas", "pandas", "xarray"), "frames"),
}
"""Extra of this package that installs a module."""


def open_door(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package whose names are imported on first use (PEP 562).

    :param package: ``__name__`` of the package
    :param homes: names, separated by spaces, by the module inside the package that has them
    """
    home_of = {name: f"{package}.{module}" for module, names in homes.items() for name in names.split()}

    def load(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home_of[name]), name)

    return load, lambda: sorted(home_of), sorted(home_of)


def optional_module(name: str, extra: str = "") -> Any:
    """A module of an extra of this package.

    :param name: name of the module
    :param extra: extra to name if the module is missing; default that of :data:`EXTRAS`
    :raises InputError: if it is not installed; states how to install it
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise not_installed(error, extra) from None


def not_installed(error: ModuleNotFoundError, extra: str = "") -> InputError:
    """The error of a user whose installation lacks an extra.

    :param error: of an import
    :param extra: as :func:`optional_module`
    :raises ModuleNotFoundError: ``error``, if the module is in no extra

    >>> not_installed(ModuleNotFoundError("No module named 'rasterio'", name="rasterio"))
    InputError("rasterio is not installed -> pip install 'soilmoist_ros[reports]'")
    """
    name = (error.name or "").partition(".")[0]
    if name not in EXTRAS:
        raise error
    return InputError(f"{name} is not installed", install(extra or EXTRAS[name]))


def is_installed(*modules: str) -> bool:
    """Whether modules can be imported, without importing them."""
    return all(find_spec(module) is not None for module in modules)


def install(extra: str) -> str:
    """The command that installs an extra."""
    return f"pip install 'soilmoist_ros[{extra}]'"
