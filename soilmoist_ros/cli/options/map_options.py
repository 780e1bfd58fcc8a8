# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of a map that ``map`` and ``replay`` share, declared once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import click

from soilmoist_ros.cli.options.names import VariogramModel
from soilmoist_ros.mapping import MappingSettings

Command = Callable[..., None]
_NAMES = {"keep_nugget": "--nugget", "cell_m": "--cell", "merge_radius_m": "--merge"}
"""Options with other names than their settings."""
_TYPES: Mapping[str, click.ParamType[Any]] = {
    "model": VariogramModel(),
    "keep_nugget": click.Choice(["keep", "filter"]),
    "cell_m": click.FloatRange(min=0, min_open=True),
    "merge_radius_m": click.FloatRange(min=0),
}


def map_options(default: str) -> Callable[[Command], Command]:
    """Add an option for each field of :class:`MappingSettings`; see :func:`chosen_settings`.

    :param default: help on the defaults of the variogram, such as ``by --preset``
    """
    by_default = f" Default: {default}."

    def decorate(command: Command) -> Command:
        for one in reversed(fields(MappingSettings)):
            kind = _TYPES.get(one.name) or click.Choice(one.metadata["choices"])
            defaults = {"cell_m": "", "merge_radius_m": ""}
            if not default.startswith("as "):
                defaults["keep_nugget"] = " Default: keep."
            text = one.metadata["help"] + defaults.get(one.name, by_default)
            name = _NAMES.get(one.name, f"--{one.name.replace('_', '-')}")
            command = click.option(name, one.name, type=kind, help=text)(command)
        return command

    return decorate


def chosen_settings(choices: dict[str, Any], presets: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Take the values of :func:`map_options` from the values of all options.

    :param choices: values by name; those of the map are removed
    :param presets: values where none are chosen
    """
    found = {one.name: choices.pop(one.name) for one in fields(MappingSettings)}
    if found["keep_nugget"] is not None:
        found["keep_nugget"] = found["keep_nugget"] == "keep"
    return {name: (presets or {}).get(name) if value is None else value for name, value in found.items()}


def crs_option(command: Command) -> Command:
    """Add ``--crs``."""
    text = "CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum."
    return click.option("--crs", metavar="CRS", help=text)(command)
