# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options on what is known of the field already: earlier surveys, covariates, a reference sensor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from soilmoist_ros.cli.options.names import InputFile

Command = Callable[..., None]
_RUN = "give the folder that --out of a run named, a recording, or a folder of such"


class _Runs(InputFile):
    """A run or a folder of runs, checked before the command begins."""

    def require(self, value: Path) -> None:
        """Check that there is a run.

        :raises InputError: if there is none
        """
        super().require(value)
        if str(value) not in self.words:
            from soilmoist_ros.pipeline import find_runs

            find_runs(value.expanduser())


class _Covariate(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A file with covariates, checked before the command begins."""

    name = "FILE[:BAND]"

    def require(self, value: str) -> None:
        """Check that the file can be read and has the band.

        :raises InputError: if not, or if an extra is not installed
        """
        if value == "none":
            return
        from soilmoist_ros.mapping import CovariateSource

        source = CovariateSource.parse(value)
        source.require_file()
        from soilmoist_ros.mapping import require_covariates

        require_covariates([source])


def earlier_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--earlier``; the command receives the paths as ``earlier``.

    :param more: text that follows in the help
    """
    text = (
        "Earlier run of the same field, whose counts inform this map: an output folder, a recording, or a folder "
        f"of runs. Repeatable.{more}"
    )
    return click.option(
        "--earlier", "earlier", type=_Runs(_RUN, ("none",)), multiple=True, metavar="RUN", help=text
    )


def covariate_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--covariate``; the command receives the texts as ``covariates``.

    :param more: text that follows in the help
    """
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
    return click.option("--reference", type=InputFile(), metavar="LOG", help=text)(command)
