# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist export``: files for GIS, paper and farm terminals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli.answer import answering, warn, wrote
from soilmoist_ros.cli.options import FILE, Parsed, overwrite_option
from soilmoist_ros.foundation import InputError, SoilmoistError


@click.command("export")
@click.argument("run", type=FILE)
@click.option("--to", "names", type=Parsed("format"), multiple=True,
              help="Format, repeatable. soilmoist list exports shows them.")  # fmt: skip
@click.option("--out", type=FILE, help="Folder for the files; made if missing. Default: RUN/export.")
@click.option("--min-zone", "min_zone_ha", type=click.FloatRange(min=0),
              help="Area from which a part of the field is a zone [ha]. Default: 5 % of the field.")  # fmt: skip
@click.option("--rate-column", default="RATE", show_default=True,
              help="Column of the irrigation rate in dose, at most ten characters.")  # fmt: skip
@click.option("--rate-unit", type=click.Choice(["mm", "l/m2", "m3/ha", "in", "gal/ac"]), default="mm",
              show_default=True, help="Unit of the rate.")  # fmt: skip
@click.option("--isoxml-version", type=click.IntRange(3, 4), default=3, show_default=True,
              help="Version of ISOXML. Terminals for version 4 read version 3 too.")  # fmt: skip
@click.option("--isoxml-form", type=click.Choice(["grid1", "grid2", "polygons"]), default="grid1",
              show_default=True, help="Zones as a grid of their codes, a grid of rates, or polygons.")  # fmt: skip
@click.option("--isoxml-passes", "passes", type=click.IntRange(1), default=1, show_default=True,
              help="Passes that share a dose: ISOXML holds at most 21.47 mm in one.")  # fmt: skip
@click.option("--max-cells", type=click.IntRange(1), default=40_000, show_default=True,
              help="Cells that the terminal takes; a larger grid gets larger cells.")  # fmt: skip
@click.option("--max-zones", type=click.IntRange(1, 254), default=254, show_default=True,
              help="Zones that the terminal takes.")  # fmt: skip
@overwrite_option("Replace the files of an earlier export.")
@answering
def command(run: Path, names: tuple[str, ...], out: Path | None, overwrite: bool, **choices: Any) -> None:
    """Export a RUN for GIS, paper and farm terminals.

    RUN is the output folder of map, simulate, replay or demo. Files of each property have its name.
    """
    if not names:
        raise InputError("no export is given", "name formats with --to; soilmoist list exports shows them")
    from soilmoist_ros.reporting import ExportSettings, export_run

    refused: list[str] = []
    settings = ExportSettings(**choices)
    wrote(export_run(run, names, out, settings, lambda text: warn(f"note: {text}"), overwrite, refused))
    if refused:
        raise SoilmoistError(f"not written: {'; '.join(refused)}")
