# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share: names, files, times, the output folder, and how a map is made."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from soilmoist_ros.cli.answer import wrote
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import MappingSettings

Command = Callable[..., None]
FILE = click.Path(path_type=Path)
_UNITS_S = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
_RUN = "give the folder that --out of a run named, a recording, or a folder of such"
_SHIPPED = {"field": "fields", "site": "sites", "scenario": "scenarios"}


class Name(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A name, or the path of a file. The command that uses it checks it.

    :param early: whether it is checked before the command begins; otherwise the command does it
    """

    def __init__(self, kind: str, early: bool = True) -> None:
        self.name = self._kind = kind
        self._early = early

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Files that continue the word."""
        return [CompletionItem(incomplete, type="file")]

    def require(self, value: str) -> None:
        """Check a given name or path before the work; what the file says is checked later."""
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


class InputFileType(click.Path):
    """Path of a file or folder that must exist when the command begins."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def require(self, value: Path) -> None:
        """Refuse the path of nothing."""
        if not value.exists():
            raise InputError("there is no such file", "check the path", value)


class VariogramModel(Name):
    """Name of a registered variogram model, checked. Only a given option loads the registry: it needs numpy."""

    def __init__(self) -> None:
        super().__init__("model")

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the name if a model has it; fail otherwise."""
        from soilmoist_ros.mapping import VARIOGRAM_MODELS

        try:
            VARIOGRAM_MODELS.get(value)
        except InputError as error:
            self.fail(str(error), param, ctx)
        return value


# Times ----------------------------------------------------------------------------------------------------------


class MomentType(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A time in ISO 8601 with or without a time zone, converted to UTC; without a zone it is UTC."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> datetime:
        """The time in UTC."""
        if isinstance(value, datetime):
            return value
        try:
            moment = datetime.fromisoformat(re.sub(r"\s*(UTC|GMT|Z)$", "+00:00", str(value).strip()))
            return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
        except (ValueError, OverflowError):
            self.fail(
                f"{value!r} is no time: write 2026-05-02T14:30Z, 2026-05-02T16:30+02:00 or 2026-05-02", param
            )


class SensorType(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A sensor model with a known sensitivity, or a sensitivity in units of the reference detector."""

    name = "sensor"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str | float:
        """The name of the model, or the sensitivity [-]."""
        from soilmoist_ros.sensing import SENSITIVITIES

        if isinstance(value, float):
            return value
        name = re.sub(r"[\s_-]", "", str(value).upper())
        for model in SENSITIVITIES:
            if name == model.replace("-", "").upper():
                return model
        try:
            number = float(value)
        except ValueError:
            number = 0.0
        if not 0 < number <= 100:
            known = ", ".join(f"{model} ({of:g})" for model, of in SENSITIVITIES.items())
            self.fail(
                f"{value!r} is no sensor: give {known}, or the counts of yours per count of the reference "
                "detector, found next to a station: soilmoist calibrate --beside STATION_LOG",
                param,
            )
        return number


sensor_option = click.option(
    "--sensor", type=SensorType(), metavar="MODEL|NUMBER",
    help="Sensor of a site without calibration: CRS-1000, CRS-1000B, CRS-2000, CRS-2000B, LiFoil-2, LiFoil-3, or "
    "its counts per count of the reference detector. Gives moisture by the general calibration.",
)  # fmt: skip
"""The sensor, where the site file does not say it."""


class ShiftType(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A duration with a sign and a unit, as seconds."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The duration [s]."""
        if isinstance(value, float):
            return value
        found = re.fullmatch(r"([+-]?\d+(?:\.\d+)?)\s*(s|min|h|d|w)", str(value).strip())
        if found is None:
            self.fail(f"{value!r} is no duration: write it with s, min, h, d or w, such as -18s or 1024w", param)
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
    """Check the output folder before the work; ask on a terminal before earlier results are replaced."""
    from soilmoist_ros.reporting import require_free, require_writable, results_in

    if not overwrite:
        require_writable(out)
        overwrite = confirmed(out, results_in(out))
    require_free(out, overwrite)


def confirmed(out: Path, held: str) -> bool:
    """True if the user agrees, on a terminal, that results are replaced; false without a terminal.

    :param held: the results, in words; empty if there is nothing to ask
    """
    if not held or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    if click.confirm(f"{out} has {held}. Replace them?", err=True):
        return True
    raise InputError("nothing was changed", "choose another output folder", out)


@contextmanager
def reported_failure(out: Path) -> Iterator[None]:
    """Write the report of a run without a map."""
    from soilmoist_ros.pipeline import NoMapError

    try:
        yield
    except NoMapError as error:
        from soilmoist_ros.reporting import write_failed

        wrote(write_failed(out, error.failed), out)
        raise


# Positions ------------------------------------------------------------------------------------------------------

gnss_shift_option = click.option(
    "--gnss-shift", "gnss_shift_s", type=ShiftType(), metavar="DURATION", default=0.0, show_default=False,
    help="Time added to that of the positions, such as 1024w, 2h or -18s. Default: none.",
)  # fmt: skip


def position_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--gnss-shift``, ``--logger-topic`` and ``--fix-topic``."""
    for name, text in (
        ("--fix-topic", "In bags: topic with positions, fixes or NMEA. Default: raw/gnss, or fix."),
        ("--logger-topic", "In bags: topic with the logger's lines. Default: raw/logger, or the only text."),
    ):
        command = click.option(name, default="", metavar="TOPIC", help=text)(command)
    return gnss_shift_option(command)


# Earlier surveys, covariates, a reference sensor ----------------------------------------------------------------


class _Runs(InputFileType):
    """A run, a folder of runs, or ``none``, checked before the command begins."""

    def require(self, value: Path) -> None:
        """Refuse what has no run."""
        if str(value) == "none":
            return
        if not value.exists():
            raise InputError("there is no such file", _RUN, value)
        from soilmoist_ros.pipeline import find_runs

        find_runs(value.expanduser())


class _Covariate(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A file with covariates, checked before the command begins."""

    name = "FILE[:BAND]"

    def require(self, value: str) -> None:
        """Check that the file can be read and has the band."""
        if value == "none":
            return
        from soilmoist_ros.mapping import CovariateSource, require_covariates

        require_covariates([CovariateSource.parse(value)])


def earlier_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--earlier``; the command receives the paths as ``earlier``."""
    text = (
        "Earlier run of the same field, whose counts inform this map: an output folder, a recording, or a folder "
        f"of runs. Repeatable.{more}"
    )
    return click.option("--earlier", "earlier", type=_Runs(), multiple=True, metavar="RUN", help=text)


def covariate_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--covariate``; the command receives the texts as ``covariates``."""
    text = (
        "Raster that may explain the map, such as relief or a satellite image. BAND is a number, a name, or "
        "what is derived from elevations: elevation, slope, aspect, curvature, wetness. Or polygons of a soil "
        f"map, whose attribute is BAND. Repeatable.{more}"
    )
    return click.option(
        "--covariate", "covariates", type=_Covariate(), multiple=True, metavar="FILE[:BAND]", help=text
    )


def reference_option(command: Command) -> Command:
    """Add ``--reference``; the command receives the path as ``reference``."""
    text = (
        "Log of a stationary neutron sensor at the field, which counted during the survey. Its changes correct "
        "the counts to the end of the survey. The site file is used for both."
    )
    return click.option("--reference", type=InputFileType(), metavar="LOG", help=text)(command)


# The map --------------------------------------------------------------------------------------------------------


class _FarmPrior(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Surveys of other fields, or ``none``, read when the command begins."""

    name = "FOLDER|FILE"

    def require(self, value: str) -> None:
        """Check that there is a survey."""
        from soilmoist_ros.mapping import FarmPrior

        FarmPrior.named(value)


_NAMES = {"keep_nugget": "--nugget", "cell_m": "--cell", "merge_radius_m": "--merge"}
"""Options with other names than their settings."""
_TYPES: Mapping[str, click.ParamType[Any]] = {
    "model": VariogramModel(),
    "prior": _FarmPrior(),
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
