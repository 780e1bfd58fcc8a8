"""``soilmoist calibrate``: the calibration of a site from soil cores."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from soilmoist_ros.cli.console import FILE, report_errors
from soilmoist_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from soilmoist_ros.sensing.moisture.site import Site


@click.command("calibrate")
@click.argument("cores", type=FILE)
@click.option("--site", type=FILE, required=True, help="Site file to read; N0 is written to it.")
@click.option("--log", "logs", type=FILE, multiple=True, help="Neutron log of the calibration. Repeatable.")
@click.option("--logger", help="Logger format of the logs. Default: detected from the header.")
@click.option("--counts", type=click.IntRange(min=1), help="Instead of --log: raw counts of all tubes.")
@click.option(
    "--exposure",
    "exposure_s",
    type=click.FloatRange(min=0, min_open=True),
    help="Effective exposure of --counts: live time divided by the product of the correction factors [s].",
)
@click.option("--date", help="Date of the calibration; written to the site file.")
@click.option("--dry-run", is_flag=True, help="Print the result; do not write the site file.")
@report_errors
def command(
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

    CORES has one row per core. Its first line names the columns: vwc [m3/m3], or gravimetric_water [g/g] and
    bulk_density_gcm3 [g/cm3]; weight is optional.
    """
    from soilmoist_ros.sensing.moisture.calibration import estimate_n0, read_soil_cores, write_calibration
    from soilmoist_ros.sensing.moisture.site import Calibration, Soil, load_site

    known = load_site(site)
    sampled = read_soil_cores(cores, known.soil.bulk_density_gcm3 if known.soil else None)
    soil = known.soil
    if soil is None:
        if sampled.bulk_density_gcm3 is None:
            remedy = "add 'soil: {bulk_density_gcm3: ...}' to the file, or a column bulk_density_gcm3 to the cores"
            raise InputError("has no soil properties", remedy, site)
        soil = Soil(bulk_density_gcm3=round(sampled.bulk_density_gcm3, 4))
    rate, rate_sd = _calibration_rate(known, logs, logger, counts, exposure_s)
    try:
        estimate = estimate_n0(rate, rate_sd, sampled.vwc, sampled.vwc_sd, soil)
    except ValueError as error:
        raise InputError(
            f"the calibration has no solution: {error}", "check the cores and the soil properties", cores
        ) from None
    click.echo(f"cores      {sampled.count}, mean VWC {sampled.vwc:.4f} m3/m3 +- {sampled.vwc_sd:.4f}")
    click.echo(f"rate       {rate:.4f} +- {rate_sd:.4f} counts/s, corrected")
    click.echo(f"N0         {estimate.n0_cps:.4f} +- {estimate.n0_sd_cps:.4f} counts/s")
    click.echo(
        f"of which   {estimate.from_counting_cps:.4f} from counting, {estimate.from_cores_cps:.4f} from cores"
    )
    if dry_run:
        click.echo(f"dry run: {site} is not changed")
        return
    result = Calibration(
        n0_cps=round(estimate.n0_cps, 5),
        n0_sd_cps=round(estimate.n0_sd_cps, 5),
        date=date,
        note=f"{sampled.count} soil cores, mean VWC {sampled.vwc:.3f} m3/m3",
    )
    write_calibration(site, result, soil if known.soil is None else None)
    click.echo(f"wrote {site}")


def _calibration_rate(
    site: Site, logs: tuple[Path, ...], logger: str | None, counts: int | None, exposure_s: float | None
) -> tuple[float, float]:
    from soilmoist_ros.replay.log_map import read_logs
    from soilmoist_ros.sensing.moisture.calibration import pooled_rate
    from soilmoist_ros.sensing.survey.logs import corrected_counts

    if (counts is None) != (exposure_s is None) or bool(logs) == (counts is not None):
        raise click.UsageError("give the counts of the calibration with --log, or with --counts and --exposure")
    if counts is not None and exposure_s is not None:
        return pooled_rate([counts], [exposure_s])
    raw_counts, effective_s = corrected_counts(read_logs(logs, logger, site), site)
    return pooled_rate(raw_counts, effective_s)
