# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share: names, files, times, the output folder, and how a map is made."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import MappingSettings

Command = Callable[..., None]
FILE = click.Path(path_type=Path)
_UNITS_S = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
_RUN = "give the folder that --out of a run named, a recording, or a folder of such"
_SHIPPED = {"field": "fields", "site": "sites", "scenario": "scenarios"}


class Parsed(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A text that a function converts, and a check of the value before the command begins.

    :param name: placeholder in the help
    :param parse: makes the value; a ``ValueError`` of it is wrong use, and says what is expected
    :param require: raises an :class:`InputError`; without it the command checks the value
    """

    def __init__(
        self, name: str, parse: Callable[[str], Any] = str, require: Callable[[Any], object] | None = None
    ) -> None:
        self.name = name
        self.require = require
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value of a text."""
        try:
            return self._parse(value) if isinstance(value, str) else value
        except (ValueError, InputError) as error:
            self.fail(str(error), param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Files that continue the word."""
        return [CompletionItem(incomplete, type="file")]


def named(kind: str) -> Parsed:
    """A shipped name, or the path of a file; what the file says is checked later."""

    def require(value: str) -> None:
        if not value or Path(value).is_file():
            return
        if kind == "logger":
            from soilmoist_ros.sensing import logger_path

            logger_path(value)
        else:
            from soilmoist_ros.foundation import resource

            resource(_SHIPPED[kind], value)

    return Parsed(kind, require=require)


def _require_file(value: Path) -> None:
    if not value.exists():
        raise InputError("there is no such file", "check the path", value)


INPUT = Parsed("path", Path, _require_file)
"""Path of a file or folder that must exist."""


def _model(text: str) -> str:
    from soilmoist_ros.mapping import VARIOGRAM_MODELS  # needs numpy: only where the option is given

    VARIOGRAM_MODELS.get(text)
    return text


MODEL = Parsed("model", _model)
"""Name of a registered variogram model."""


def _moment(text: str) -> datetime:
    """A time in ISO 8601 in UTC; without a time zone it is UTC."""
    try:
        moment = datetime.fromisoformat(re.sub(r"\s*(UTC|GMT|Z)$", "+00:00", text.strip()))
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        forms = "2026-05-02T14:30Z, 2026-05-02T16:30+02:00 or 2026-05-02"
        raise ValueError(f"{text!r} is no time: write {forms}") from None


TIME = Parsed("time", _moment)


def _sensor(text: str) -> str | float:
    """A sensor model with a known sensitivity, or a sensitivity in units of the reference detector [-]."""
    from soilmoist_ros.sensing import SENSITIVITIES

    name = re.sub(r"[\s_-]", "", text.upper())
    if model := next((model for model in SENSITIVITIES if name == model.replace("-", "").upper()), ""):
        return model
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number <= 100:
        known = ", ".join(f"{model} ({of:g})" for model, of in SENSITIVITIES.items())
        raise ValueError(
            f"{text!r} is no sensor: give {known}, or the counts of yours per count of the reference detector, "
            "found next to a station: soilmoist calibrate --beside STATION_LOG"
        )
    return number


sensor_option = click.option(
    "--sensor", type=Parsed("sensor", _sensor), metavar="MODEL|NUMBER",
    help="Sensor of a site without calibration: CRS-1000, CRS-1000B, CRS-2000, CRS-2000B, LiFoil-2, LiFoil-3, or "
    "its counts per count of the reference detector. Gives moisture by the general calibration.",
)  # fmt: skip
"""The sensor, where the site file does not say it."""


def _duration_s(text: str) -> float:
    """A duration with a sign and a unit [s]."""
    found = re.fullmatch(r"([+-]?\d+(?:\.\d+)?)\s*(s|min|h|d|w)", text.strip())
    if found is None:
        raise ValueError(f"{text!r} is no duration: write it with s, min, h, d or w, such as -18s or 1024w")
    return float(found[1]) * _UNITS_S[found[2]]


# The output folder ----------------------------------------------------------------------------------------------


def output_options(text: str = "Folder for the results; made if missing.") -> Callable[[Command], Command]:
    """Add ``--out``, with this help, and ``--overwrite``."""

    def decorate(command: Command) -> Command:
        command = overwrite_option("Replace the results of an earlier run in --out.")(command)
        return click.option("--out", type=FILE, required=True, help=text)(command)

    return decorate


def overwrite_option(text: str) -> Callable[[Command], Command]:
    """Add ``--overwrite``, which ``--force`` means as well, with this help."""
    return click.option("--overwrite", "--force", "overwrite", is_flag=True, help=text)


def prepare_output(out: Path, overwrite: bool) -> None:
    """Check the output folder before the work."""
    from soilmoist_ros.reporting import require_free

    require_free(out, overwrite)


# Positions ------------------------------------------------------------------------------------------------------


def position_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--gnss-shift``, ``--logger-topic`` and ``--fix-topic``."""
    for name, text in (
        ("--fix-topic", "In bags: topic with positions, fixes or NMEA. Default: raw/gnss, or fix."),
        ("--logger-topic", "In bags: topic with the logger's lines. Default: raw/logger, or the only text."),
    ):
        command = click.option(name, default="", metavar="TOPIC", help=text)(command)
    return click.option(
        "--gnss-shift", "gnss_shift_s", type=Parsed("duration", _duration_s), default=0.0, show_default=False,
        help="Time added to that of the positions, such as 1024w, 2h or -18s. Default: none.",
    )(command)  # fmt: skip


# Earlier surveys and covariates ---------------------------------------------------------------------------------


def _require_runs(value: Path) -> None:
    """Refuse what has no run; ``none`` is not one."""
    if str(value) == "none":
        return
    if not value.exists():
        raise InputError("there is no such file", _RUN, value)
    from soilmoist_ros.pipeline import find_runs

    find_runs(value.expanduser())


def _require_covariate(value: str) -> None:
    """Check that a file with covariates can be read and has the band."""
    if value != "none":
        from soilmoist_ros.mapping import CovariateSource, require_covariates

        require_covariates([CovariateSource.parse(value)])


def _require_prior(value: str) -> None:
    """Check that there is a survey of another field, or ``none``."""
    from soilmoist_ros.mapping import FarmPrior

    FarmPrior.named(value)


def earlier_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--earlier``; the command receives the paths as ``earlier``."""
    text = (
        "Earlier run of the same field, whose counts inform this map: an output folder, a recording, or a folder "
        f"of runs. Repeatable.{more}"
    )
    return click.option(
        "--earlier", "earlier", type=Parsed("path", Path, _require_runs), multiple=True, metavar="RUN", help=text
    )


def covariate_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--covariate``; the command receives the texts as ``covariates``."""
    text = (
        "Raster that may explain the map, such as relief or a satellite image. BAND is a number, a name, or "
        "what is derived from elevations: elevation, slope, aspect, curvature. Or polygons of a soil "
        f"map, whose attribute is BAND. Repeatable.{more}"
    )
    kind = Parsed("FILE[:BAND]", require=_require_covariate)
    return click.option("--covariate", "covariates", type=kind, multiple=True, help=text)


# The map --------------------------------------------------------------------------------------------------------

_NAMES = {"keep_nugget": "--nugget", "cell_m": "--cell", "merge_radius_m": "--merge"}
"""Options with other names than their settings."""
_TYPES: Mapping[str, click.ParamType[Any]] = {
    "model": MODEL,
    "prior": Parsed("FOLDER|FILE", require=_require_prior),
    "keep_nugget": click.Choice(["keep", "filter"]),
    "cell_m": click.FloatRange(min=0, min_open=True),
    "merge_radius_m": click.FloatRange(min=0),
}


def map_options(default: str) -> Callable[[Command], Command]:
    """Add an option for each field of :class:`MappingSettings`; see :func:`chosen_settings`.

    :param default: help on the defaults of the variogram, such as ``by --preset``
    """
    defaults = {"cell_m": "", "merge_radius_m": "", "prior": ""}
    if not default.startswith("as "):
        defaults["keep_nugget"] = " Default: keep."

    def decorate(command: Command) -> Command:
        for one in reversed(fields(MappingSettings)):
            kind = _TYPES.get(one.name) or click.Choice(one.metadata["choices"])
            text = one.metadata["help"] + defaults.get(one.name, f" Default: {default}.")
            name = _NAMES.get(one.name, f"--{one.name.replace('_', '-')}")
            command = click.option(name, one.name, type=kind, help=text)(command)
        return command

    return decorate


def chosen_settings(choices: dict[str, Any], presets: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Take the values of :func:`map_options` from the values of all options."""
    found = {one.name: choices.pop(one.name) for one in fields(MappingSettings)}
    if found["keep_nugget"] is not None:
        found["keep_nugget"] = found["keep_nugget"] == "keep"
    return {name: (presets or {}).get(name) if value is None else value for name, value in found.items()}


def crs_option(command: Command) -> Command:
    """Add ``--crs``."""
    text = "CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum."
    return click.option("--crs", metavar="CRS", help=text)(command)
