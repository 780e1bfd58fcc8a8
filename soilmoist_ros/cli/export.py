"""``soilmoist export``: files for GIS, phones and farm terminals."""

from __future__ import annotations

from pathlib import Path

import click

from soilmoist_ros.cli.console import FILE, report_errors


@click.command("export")
@click.argument("run", type=FILE, required=False)
@click.option("--to", "names", multiple=True, metavar="FORMAT", help="Format, repeatable. --formats lists them.")
@click.option("--formats", is_flag=True, help="List the formats and exit.")
@click.option("--out", type=FILE, help="Folder for the files; made if missing. Default: RUN/export.")
@click.option("--zones", type=click.IntRange(1, 20), default=3, show_default=True,
              help="Management zones of equal area, where the site file has no limits.")  # fmt: skip
@click.option("--min-zone", "min_zone_ha", type=click.FloatRange(min=0),
              help="Area from which a part of the field is a zone [ha]. Default: 5 % of the field.")  # fmt: skip
@click.option("--step", type=click.FloatRange(min=0, min_open=True),
              help="Distance of contour lines [% by volume, or counts/s]. Default: a round one.")  # fmt: skip
@click.option("--root-depth", "root_depth_mm", type=click.FloatRange(min=0, min_open=True),
              help="Depth of the root zone for the water of zones [mm]. Default: the run's, or 300.")  # fmt: skip
@report_errors
def command(
    run: Path | None,
    names: tuple[str, ...],
    formats: bool,
    out: Path | None,
    zones: int,
    min_zone_ha: float | None,
    step: float | None,
    root_depth_mm: float | None,
) -> None:
    """Export a RUN for GIS, phones and farm terminals.

    RUN is the output folder of map, simulate, replay or demo. Files of each property have its name.
    """
    from soilmoist_ros.foundation.errors import InputError
    from soilmoist_ros.reporting.exports.registry import EXPORTS, export_kind, export_run
    from soilmoist_ros.reporting.exports.source import ExportSettings

    if formats:
        for name in EXPORTS.names():
            kind = export_kind(name)
            click.echo(f"{name:10} {kind.label} ({kind.suffix}): {kind.description}")
        return
    if run is None:
        raise InputError("export needs the folder of a run", "give the folder that --out of a run named")
    settings = ExportSettings(zones, min_zone_ha, step, root_depth_mm)
    for path in export_run(run, names, out, settings, lambda text: click.echo(f"note: {text}", err=True)):
        click.echo(f"wrote {path}")
