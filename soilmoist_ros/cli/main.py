"""The ``soilmoist`` command. Exit code 0: all was done; 1: not all of it; 2: bad input; 130: interrupted.

Each subcommand imports what it needs when it runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli.console import FILE, VariogramModel, progress_bar, report_errors
from soilmoist_ros.cli.recordings import bag_group, demo_command, replay_command
from soilmoist_ros.cli.simulate import campaign_command, simulate_command
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.version import __version__

if TYPE_CHECKING:
    from soilmoist_ros.reporting.run import MapRun
    from soilmoist_ros.sensing.moisture.site import Site


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="soilmoist")
def main() -> None:
    """Soil-moisture mapping with a cosmic-ray neutron sensor."""


@main.command("map")
@click.argument("logs", type=FILE, nargs=-1, required=True)
@click.option("--logger", help="Logger format: a shipped name or a YAML file. Default: told from the header.")
@click.option("--site", help="Site file: corrections, soil, calibration. Default: standard corrections.")
@click.option("--field", help="Field file: boundary, cell size. Default: the surroundings of the track.")
@click.option(
    "--nmea", type=FILE, multiple=True, help="GNSS log (NMEA), for loggers without positions. Repeatable."
)
@click.option(
    "--model",
    type=VariogramModel(),
    default="matern32",
    show_default=True,
    help="Variogram model: gaussian, exponential, spherical, matern32, matern52, or that of a plug-in.",
)
@click.option(
    "--fit", type=click.Choice(["reml", "soft_l1"]), default="reml", show_default=True, help="Variogram fit."
)
@click.option(
    "--nugget",
    type=click.Choice(["keep", "filter"]),
    default="keep",
    show_default=True,
    help="Map the rate with its micro-scale variation, or its smooth part only.",
)
@click.option("--cell", "cell_m", type=click.FloatRange(min=0, min_open=True), help="Cell size [m].")
@click.option(
    "--merge",
    "merge_radius_m",
    type=click.FloatRange(min=0),
    help="Records within this radius become one sample [m]. Default: a quarter of the footprint.",
)
@click.option("--exact", "max_exact_samples", type=click.IntRange(min=1), default=2000, show_default=True,
              help="Samples up to which the map is exact; beyond, it is made tile by tile.")  # fmt: skip
@click.option("--workers", type=click.IntRange(min=0), help="Local processes for tiles. Default: one per core.")
@click.option("--scheduler", help="Address of a Dask scheduler for the tiles instead, such as tcp://host:8786.")
@click.option("--crs", help="CRS of the GeoTIFF, such as EPSG:32614. Default: the UTM zone of the datum.")
@click.option("--title", help="Title of the report.")
@click.option("--out", type=FILE, required=True, help="Folder for the results; made if missing.")
@report_errors
def map_command(
    logs: tuple[Path, ...],
    site: str | None,
    field: str | None,
    nugget: str,
    workers: int | None,
    scheduler: str | None,
    crs: str | None,
    out: Path,
    **choices: Any,
) -> None:
    """Map soil moisture from neutron LOGS.

    Writes summary.json, map.tif, samples.geojson and report.html to the folder --out.
    """
    from soilmoist_ros.cli.map_workers import tile_workers
    from soilmoist_ros.foundation.configuration import resource
    from soilmoist_ros.replay.log_map import MapSettings, map_logs
    from soilmoist_ros.reporting import write_outputs

    settings = MapSettings(
        site=resource("sites", site) if site else None,
        field=resource("fields", field) if field else None,
        keep_nugget=nugget == "keep",
        **choices,
    )
    with progress_bar() as progress, tile_workers(workers, scheduler) as compute:
        run = map_logs(logs, settings, progress, compute)
        progress("writing the results", 0.0)
        written = write_outputs(out, run, crs)
    _print_summary(run)
    for path in written:
        click.echo(f"wrote {path}")


@main.command("calibrate")
@click.argument("cores", type=FILE)
@click.option("--site", type=FILE, required=True, help="Site file to read and to write N0 into.")
@click.option("--log", "logs", type=FILE, multiple=True, help="Neutron log of the calibration. Repeatable.")
@click.option("--logger", help="Logger format of the logs. Default: told from the header.")
@click.option("--counts", type=click.IntRange(min=1), help="Instead of logs: raw counts of all tubes ...")
@click.option(
    "--exposure",
    "exposure_s",
    type=click.FloatRange(min=0, min_open=True),
    help="... and their effective exposure (live time over the product of the factors) [s].",
)
@click.option("--date", help="Day of the calibration, for the site file.")
@click.option("--dry-run", is_flag=True, help="Print the result, but leave the site file as it is.")
@report_errors
def calibrate_command(
    cores: Path,
    site: Path,
    logs: tuple[Path, ...],
    logger: str | None,
    counts: int | None,
    exposure_s: float | None,
    date: str | None,
    dry_run: bool,
) -> None:
    """Find N0 from soil CORES (a CSV file) and the counts at the calibration.

    CORES has one row per core and names its columns in the first line: vwc [m3/m3], or gravimetric_water
    [g/g] and bulk_density_gcm3 [g/cm3]; optionally weight.
    """
    from soilmoist_ros.sensing.moisture.calibration import estimate_n0, read_soil_cores, write_calibration
    from soilmoist_ros.sensing.moisture.site import Calibration, Soil, load_site

    known = load_site(site)
    sampled = read_soil_cores(cores, known.soil.bulk_density_gcm3 if known.soil else None)
    soil = known.soil
    if soil is None:
        if sampled.bulk_density_gcm3 is None:
            remedy = "add 'soil: {bulk_density_gcm3: ...}' to it, or a column bulk_density_gcm3 to the cores"
            raise InputError("has no soil properties", remedy, site)
        soil = Soil(bulk_density_gcm3=round(sampled.bulk_density_gcm3, 4))
    rate, rate_sd = _calibration_rate(known, logs, logger, counts, exposure_s)
    try:
        estimate = estimate_n0(rate, rate_sd, sampled.vwc, sampled.vwc_sd, soil)
    except ValueError as error:
        raise InputError(
            f"the calibration has no solution: {error}", "check the cores and the soil", cores
        ) from None
    click.echo(f"cores      {sampled.count}, mean VWC {sampled.vwc:.4f} m3/m3 +- {sampled.vwc_sd:.4f}")
    click.echo(f"rate       {rate:.4f} +- {rate_sd:.4f} counts/s, corrected")
    click.echo(f"N0         {estimate.n0_cps:.4f} +- {estimate.n0_sd_cps:.4f} counts/s")
    click.echo(
        f"of which   {estimate.from_counting_cps:.4f} from counting, {estimate.from_cores_cps:.4f} from cores"
    )
    if dry_run:
        click.echo(f"dry run: {site} is left as it is")
        return
    result = Calibration(
        n0_cps=round(estimate.n0_cps, 5),
        n0_sd_cps=round(estimate.n0_sd_cps, 5),
        date=date,
        note=f"{sampled.count} soil cores, mean VWC {sampled.vwc:.3f} m3/m3",
    )
    write_calibration(site, result, soil if known.soil is None else None)
    click.echo(f"wrote {site}")


@main.command("graph")
@click.argument("field")
@click.option("--spacing", type=click.FloatRange(min=0, min_open=True), default=10.0, show_default=True,
              help="Distance of the nodes [m]; in crop rows, along the row.")  # fmt: skip
@click.option("--rows", type=click.FloatRange(min=0, min_open=True), help="Crop rows at this distance [m].")
@click.option(
    "--heading", type=float, default=0.0, show_default=True, help="Direction of the rows from north [deg]."
)
@click.option("--headland", type=click.FloatRange(min=0, min_open=True), default=5.0, show_default=True,
              help="Width of the headlands at the ends of the rows [m].")  # fmt: skip
@click.option("--margin", type=click.FloatRange(min=0), default=0.0, show_default=True,
              help="Distance to keep from the border and from no-go areas [m].")  # fmt: skip
@click.option("--name", help="Name of the map. Default: the field's.")
@click.option("--out", type=FILE, required=True, help="File to write: .yaml, or .json as on /topological_map_2.")
@report_errors
def graph_command(
    field: str,
    spacing: float,
    rows: float | None,
    heading: float,
    headland: float,
    margin: float,
    name: str | None,
    out: Path,
) -> None:
    """Lay a travel graph over a FIELD and write it as a topological map.

    An open lattice, or with --rows crop rows that can be left at their ends only.
    """
    from datetime import UTC, datetime

    from soilmoist_ros.exploration.travel.graph_builders import crop_rows, open_lattice
    from soilmoist_ros.exploration.travel.topological_map import make_topological_map
    from soilmoist_ros.simulation.fields.catalogue import known_field

    known = known_field(field)
    if rows is None:
        built = open_lattice(known, spacing, margin_m=margin)
    else:
        built = crop_rows(known, rows, spacing, heading, headland, margin_m=margin)
    topological = make_topological_map(built.graph, name or known.name, datetime.now(UTC))
    text = topological.to_json() if out.suffix == ".json" else topological.to_yaml()
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another file", out) from None
    click.echo(built.summary)
    click.echo(f"wrote {out}")


@main.command("check")
@click.option("--logger", multiple=True, help="Logger format: a shipped name or a YAML file. Repeatable.")
@click.option("--site", multiple=True, help="Site file: a shipped name or a YAML file. Repeatable.")
@click.option("--field", multiple=True, help="Field file: a shipped name or a YAML file. Repeatable.")
@report_errors
def check_command(logger: tuple[str, ...], site: tuple[str, ...], field: tuple[str, ...]) -> None:
    """Check configuration files; name every mistake in all of them."""
    from soilmoist_ros.foundation.configuration import read_yaml, resource
    from soilmoist_ros.mapping.field import load_field
    from soilmoist_ros.sensing.corrections.neutron_monitor import read_neutron_monitor
    from soilmoist_ros.sensing.formats.logger_format import load_logger_format
    from soilmoist_ros.sensing.moisture.site import load_site
    from soilmoist_ros.simulation.fields.truth_file import load_surrogate

    def check_site(name: str) -> None:
        intensity = load_site(name).corrections.intensity
        if intensity is not None and intensity.file is not None:
            read_neutron_monitor(intensity.file)

    def check_field(path: Path) -> None:
        load_field(path)
        if "truth" in read_yaml(path):
            load_surrogate(path)

    checks: list[tuple[str, Callable[[], object]]] = [
        *((name, lambda name=name: load_logger_format(name)) for name in logger),
        *((name, lambda name=name: check_site(name)) for name in site),
        *((name, lambda name=name: check_field(resource("fields", name))) for name in field),
    ]
    if not checks:
        raise click.UsageError("give at least one of --logger, --site, --field")
    mistakes: list[Mistake] = []
    for name, check in checks:
        try:
            check()
            click.echo(f"ok: {name}")
        except InputError as error:
            mistakes += error.mistakes
    if mistakes:
        raise InputError(mistakes)


def _calibration_rate(
    site: Site, logs: tuple[Path, ...], logger: str | None, counts: int | None, exposure_s: float | None
) -> tuple[float, float]:
    from soilmoist_ros.replay.log_map import read_logs
    from soilmoist_ros.sensing.moisture.calibration import pooled_rate
    from soilmoist_ros.sensing.survey.logs import corrected_counts

    if (counts is None) != (exposure_s is None) or bool(logs) == (counts is not None):
        raise click.UsageError("give the counts of the calibration either by --log or by --counts and --exposure")
    if counts is not None and exposure_s is not None:
        return pooled_rate([counts], [exposure_s])
    raw_counts, effective_s = corrected_counts(read_logs(logs, logger, site), site)
    return pooled_rate(raw_counts, effective_s)


def _print_summary(run: MapRun) -> None:
    import numpy as np

    soil_map = run.soil_map
    lost = sum(row.count for row in run.losses if row.consequence == "lost")
    click.echo(f"records    {len(run.track)} used, {lost} lost; {len(soil_map.samples)} samples after merging")
    rate, sd = np.nanmean(soil_map.rate), np.nanmean(soil_map.rate_sd)
    click.echo(f"rate       mean {rate:.3f} counts/s, standard deviation of a cell {sd:.3f}")
    if soil_map.curve is None:
        click.echo("moisture   not mapped: the site file has no soil properties or calibration")
    else:
        low, high = np.nanquantile(soil_map.vwc, [0.05, 0.95])
        click.echo(
            f"moisture   mean {np.nanmean(soil_map.vwc):.3f} m3/m3, 5 to 95 % of the area {low:.3f} to {high:.3f}"
        )
    if soil_map.accuracy is not None:
        click.echo(f"kriging    {soil_map.accuracy}")
    from soilmoist_ros.reporting.page.notes import notes

    for note in notes(run):
        click.echo(f"warning    {note}")


for command in (simulate_command, campaign_command, demo_command, replay_command, bag_group):
    main.add_command(command)

if __name__ == "__main__":
    main()
