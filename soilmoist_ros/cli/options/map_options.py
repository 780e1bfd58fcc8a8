# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of a map that ``map`` and ``replay`` share, declared once."""

from __future__ import annotations

from collections.abc import Callable

import click

from soilmoist_ros.cli.options.names import VariogramModel

Command = Callable[..., None]
MODEL = "Variogram model: gaussian, exponential, spherical, matern32, matern52, or that of a plug-in."
FIT = "Variogram fit: restricted maximum likelihood, or the published robust least squares."
NOISE = "Rate in the Poisson noise of a sample: local to its place or the mean rate."
LOCAL = "Whether the variance may differ from place to place."
DRIFT = "Whether the mean rate may change during the survey."
NUGGET = "Map the rate with its micro-scale variation (keep), or its smooth part only (filter)."
MERGE = "Records within this radius become one sample [m]. Default: a quarter of the footprint."


def map_options(default: str) -> Callable[[Command], Command]:
    """Add the options of variogram, drift, cells and samples.

    :param default: help on the defaults of the variogram, such as ``by --preset``
    """
    by_default = f" Default: {default}."
    nugget = by_default if default.startswith("as ") else " Default: keep."
    options = (
        click.option("--model", type=VariogramModel(), help=MODEL + by_default),
        click.option("--fit", type=click.Choice(["reml", "soft_l1"]), help=FIT + by_default),
        click.option("--noise", type=click.Choice(["local", "mean"]), help=NOISE + by_default),
        click.option("--local", type=click.Choice(["auto", "off"]), help=LOCAL + by_default),
        click.option("--drift-model", type=click.Choice(["auto", "off"]), help=DRIFT + by_default),
        click.option("--nugget", type=click.Choice(["keep", "filter"]), help=NUGGET + nugget),
        click.option("--cell", "cell_m", type=click.FloatRange(min=0, min_open=True), help="Cell size [m]."),
        click.option("--merge", "merge_radius_m", type=click.FloatRange(min=0), help=MERGE),
    )

    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def crs_option(command: Command) -> Command:
    """Add ``--crs``."""
    text = "CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum."
    return click.option("--crs", metavar="CRS", help=text)(command)
