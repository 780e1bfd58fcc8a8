"""Option ``--covariate`` of commands that make a map."""

from __future__ import annotations

from collections.abc import Callable

import click

Command = Callable[..., None]


def covariate_option(more: str = "") -> Callable[[Command], Command]:
    """Add ``--covariate``; the command receives the texts as ``covariates``.

    :param more: text that follows in the help
    """
    text = (
        "Raster that may explain the map, such as relief or a satellite image: a band, its number, or what is "
        "derived from elevations (slope, aspect, curvature, wetness); or polygons and their attribute. "
        f"Repeatable.{more}"
    )
    return click.option("--covariate", "covariates", multiple=True, metavar="FILE[:BAND]", help=text)
