# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist graph``: build a travel graph for a field."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource

from soilmoist_ros.cli.answer import answering, put, say, warn, wrote
from soilmoist_ros.cli.options import FILE, Parsed, overwrite_option
from soilmoist_ros.foundation import InputError


@click.command("graph")
@click.argument("field", type=Parsed("field"))
@click.option("--spacing", type=click.FloatRange(min=0, min_open=True), default=10.0, show_default=True,
              help="Distance between nodes [m]; with --rows or --swaths, along the row or swath.")  # fmt: skip
@click.option("--rows", type=click.FloatRange(min=0, min_open=True), help="Distance between crop rows [m].")
@click.option("--swaths", type=FILE, help="Swaths of Fields2Cover (GeoJSON) or of opennav_coverage "
              "(PathComponents, YAML or JSON), instead of a lattice or rows.")  # fmt: skip
@click.option(
    "--heading", type=float, default=0.0, show_default=True, help="Direction of the rows from north [deg]."
)
@click.option("--headland", type=click.FloatRange(min=0, min_open=True), default=5.0, show_default=True,
              help="Width of the headlands at the ends of the rows [m].")  # fmt: skip
@click.option("--margin", type=click.FloatRange(min=0), default=0.75, show_default=True,
              help="Distance that the robot keeps from the border and no-go areas: its radius [m].")  # fmt: skip
@click.option("--to", "kind", type=click.Choice(["topological", "nav2-route"]), default="topological",
              show_default=True,
              help="Map of Thorvald's navigation, or graph of Nav2's Route Server (.geojson).")  # fmt: skip
@click.option("--name", help="Name of the map. Default: the name of the field.")
@click.option("--out", type=FILE, required=True, help="File to write, such as field.tmap2.yaml.")
@overwrite_option("Replace the file --out.")
@answering
def command(
    field: str,
    spacing: float,
    rows: float | None,
    swaths: Path | None,
    heading: float,
    headland: float,
    margin: float,
    kind: str,
    name: str | None,
    out: Path,
    overwrite: bool,
) -> None:
    """Build a travel graph for a FIELD: a topological map, or a graph of Nav2.

    The graph is an open lattice. With --rows, it consists of crop rows that are connected at their ends only. With
    --swaths, it has those of a coverage planner, joined by its turns or through the headland.
    """
    source = click.get_current_context().get_parameter_source
    for option in ("heading", "headland"):
        if rows is None and source(option) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{option} is for crop rows: it requires --rows")
    if rows is not None and swaths is not None:
        raise click.UsageError("--rows and --swaths exclude each other")
    if (kind == "nav2-route") != (out.suffix == ".geojson"):
        raise click.UsageError("a graph for --to nav2-route has the ending .geojson, and other maps do not")
    if out.exists() and not overwrite:
        raise InputError("exists already", "choose another file, or give --overwrite to replace it", out)
    from datetime import UTC, datetime

    from soilmoist_ros.exploration import (
        crop_rows,
        make_topological_map,
        open_lattice,
        route_graph_text,
        swath_graph,
        unreachable,
    )
    from soilmoist_ros.simulation import known_field

    known = known_field(field)
    if swaths is not None:
        built, said = swath_graph(known, swaths, spacing, margin)
        say(said)
    elif rows is None:
        built = open_lattice(known, spacing, margin_m=margin)
    else:
        built = crop_rows(known, rows, spacing, heading, headland, margin_m=margin)
    if kind == "nav2-route":
        text = route_graph_text(built.graph)
    else:
        text = make_topological_map(built.graph, name or known.name, datetime.now(UTC)).to_json(indent=1)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another file", out) from None
    say(built.summary)
    if doubt := unreachable(known, margin):
        warn(f"warning: {doubt}")
    put(nodes=len(built.graph.names), out=str(out))
    wrote([out])
