# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist calibrate``: the calibration of a site from soil cores."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from soilmoist_ros.cli.answer import answering, put, say, warn, wrote
from soilmoist_ros.cli.options import InputFileType, MomentType, Name
from soilmoist_ros.foundation import InputError, Mistake, listing

if TYPE_CHECKING:
    from soilmoist_ros.sensing import Calibration, CalibrationCounts, CoreMean, Footprint, Site, Soil, Weighting

DAY_S = 86_400.0
TIME = MomentType()


@click.command("calibrate")
@click.argument("cores", type=InputFileType())
@click.option("--site", type=InputFileType(), required=True, help="Site file to read; N0 is written to it.")
@click.option(
    "--log", "logs", type=InputFileType(), multiple=True, help="Neutron log of the calibration. Repeatable."
)
@click.option(
    "--logger", type=Name("logger"), help="Logger format of the logs. Default: detected from the header."
)
@click.option("--counts", type=click.IntRange(min=1), help="Instead of --log: raw counts of all tubes.")
@click.option(
    "--exposure",
    "exposure_s",
    type=click.FloatRange(min=0, min_open=True),
    help="Effective exposure of --counts: live time divided by the product of the correction factors [s].",
)
@click.option("--from", "start", type=TIME, metavar="TIME",
              help="Use records of the log after this time (UTC), such as 2026-05-02T14:30.")  # fmt: skip
@click.option("--to", "end", type=TIME, metavar="TIME", help="Use records of the log up to this time (UTC).")
@click.option("--curve", type=click.Choice(["desilets", "universal"]),
              help="Curve from the rate to the moisture. Default: that of the site file.")  # fmt: skip
@click.option("--weights", "weighting", type=click.Choice(["revised", "conventional", "equal"]),
              default="revised", show_default=True, help="How distance and depth of the cores weigh.")  # fmt: skip
@click.option(
    "--date",
    "dates",
    multiple=True,
    metavar="DAY",
    help="Day of the calibration; written to the site file. Chooses among the days of the cores. Repeatable.",
)
@click.option("--dry-run", is_flag=True, help="Print the result; do not write the site file.")
@answering
def command(
    cores: Path,
    site: Path,
    logs: tuple[Path, ...],
    logger: str | None,
    counts: int | None,
    exposure_s: float | None,
    start: datetime | None,
    end: datetime | None,
    curve: Literal["desilets", "universal"] | None,
    weighting: Weighting,
    dates: tuple[str, ...],
    dry_run: bool,
) -> None:
    """Find N0 from soil CORES (a CSV file) and the counts at the calibration.

    CORES has one row per core. Its first line names the columns: vwc [m3/m3], or gravimetric_water [g/g] and
    bulk_density_gcm3 [g/cm3]. Optional are distance_m from the probe, depth_cm (or top_cm and bottom_cm), profile
    (cores of one place), date and weight. Columns in other units have other names, such as vwc_percent.
    """
    from soilmoist_ros.sensing import (
        Calibration,
        Soil,
        estimate_n0,
        load_site,
        mean_of_cores,
        read_soil_cores,
        write_calibration,
    )

    known = load_site(site)
    table = read_soil_cores(cores, known.soil.bulk_density_gcm3 if known.soil else None, dates)
    sampled, before = table.cores, known.calibration
    for note in table.notes:
        warn(f"note       {note}")
    soil = known.soil
    if soil is None:
        density = mean_of_cores(sampled, "equal").bulk_density_gcm3
        if density is None:
            remedy = "add 'soil: {bulk_density_gcm3: ...}' to the file, or a column bulk_density_gcm3 to the cores"
            raise InputError("has no soil properties", remedy, site)
        soil = Soil(bulk_density_gcm3=round(density, 4))
    unit = known.calibration or Calibration(n0_cps=1.0)
    unit = unit.model_copy(update={"n0_cps": 1.0, "n0_sd_cps": None, "curve": curve or unit.curve})
    unknown = unit.model_copy(update={"n0_cps": math.nan})  # so that no count is impossible for a former N0
    known = known.model_copy(update={"soil": soil, "calibration": unknown})
    counted = _counted(known, logs, logger, counts, exposure_s, (start, end))
    _require_days_of_counts(table.days or dates, counted, cores)
    rate, rate_sd = counted.rate_cps, counted.rate_sd_cps
    air, bound_water = _air(known, counted), soil.lattice_water + soil.organic_water
    try:
        mean = mean_of_cores(sampled, weighting, air, bound_water, soil.bulk_density_gcm3)
        unit_curve = unit.curve_of(soil, known.reference_humidity_gm3)
        estimate = estimate_n0(rate, rate_sd, mean.vwc, mean.vwc_sd, unit_curve)
    except ValueError as error:
        raise InputError(
            f"the calibration has no solution: {error}", "check the cores and the soil properties", cores
        ) from None
    put(
        n0_cps=estimate.n0_cps, n0_sd_cps=estimate.n0_sd_cps, curve=unit.curve, days=list(table.days),
        rate_cps=rate, rate_sd_cps=rate_sd, cores=mean.count,
        vwc=mean.vwc, vwc_sd=mean.vwc_sd, weights=mean.weights,
    )  # fmt: skip
    say(f"cores      {_about(mean)}{f', of {listing(table.days)}' if table.days else ''}")
    if mean.weights == "equal weights" and weighting != "equal":
        warn(f"note       the {weighting} weights need distance_m, or depths of several cores in a profile")
    assumed = "" if counted.records and math.isfinite(counted.pressure_hpa) else " (assumed for the weights)"
    say(f"air        {air.pressure_hpa:.1f} hPa, {air.humidity_gm3:.1f} g/m3{assumed}")
    if counted.factors:
        say(f"factors    {counted.factors_text}")
    records = f", {counted.records} records" if counted.records else ""
    records += f", {counted.left_out} left out" if counted.records and counted.left_out else ""
    say(f"rate       {rate:.4f} +- {rate_sd:.4f} counts/s, corrected{records}")
    say(f"N0         {estimate.n0_cps:.4f} +- {estimate.n0_sd_cps:.4f} counts/s, curve {unit.curve}")
    of_cores = "an unknown part" if math.isnan(estimate.from_cores_cps) else f"{estimate.from_cores_cps:.4f}"
    say(f"of which   {estimate.from_counting_cps:.4f} from counting, {of_cores} from cores")
    if before is not None and before.curve != unit.curve:
        before = None  # its N0 is of another kind
    for doubt in (*counted.doubts(known), *_doubts(estimate.n0_cps, before, mean.bulk_density_gcm3, soil)):
        warn(f"doubt      {doubt}")
    if dry_run:
        say(f"dry run: {site} is not changed")
        return
    result = Calibration(
        n0_cps=round(estimate.n0_cps, 5),
        curve=unit.curve,
        parameter_set=unit.parameter_set,
        n0_sd_cps=round(estimate.n0_sd_cps, 5),
        date=", ".join(dates or table.days) or None,
        note=f"{mean.count} soil cores, mean VWC {mean.vwc:.3f} m3/m3, {mean.weights}",
    )
    write_calibration(site, result, soil if load_site(site).soil is None else None)
    wrote([site])


def _about(mean: CoreMean) -> str:
    depth = "" if math.isnan(mean.depth_cm) else f", seen to {mean.depth_cm:.0f} cm"
    error = ", of unknown error (one profile)" if math.isnan(mean.vwc_sd) else f" +- {mean.vwc_sd:.4f}"
    return f"{mean.count} in {mean.profiles} profiles, mean VWC {mean.vwc:.4f} m3/m3{error}, {mean.weights}{depth}"


def _require_days_of_counts(days: Sequence[str], counted: CalibrationCounts, cores: Path) -> None:
    """Refuse counts of other days than the cores; of a date whose month is not clear, both days are compared."""
    from soilmoist_ros.sensing import possible_days

    if not counted.records:
        return
    # Clocks of loggers and of people differ by up to half a day from UTC.
    earliest_s, latest_s = counted.first_s - 1.5 * DAY_S, counted.last_s + 0.5 * DAY_S
    for day in days:
        begins_s = [datetime.combine(of, time(), UTC).timestamp() for of in possible_days(day)]
        if begins_s and not any(earliest_s < at < latest_s for at in begins_s):
            first, last = (datetime.fromtimestamp(at, UTC) for at in (counted.first_s, counted.last_s))
            message = (
                f"the cores are of {day}, and the counts of {first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"
            )
            raise InputError(message, "give the log of that day, or correct the date of the cores", cores)
    long_days = (counted.last_s - counted.first_s) / DAY_S
    if days and long_days > len(days) + 2:
        warn(f"doubt      {long_days:.0f} days are counted for cores of {listing(days)}: choose --from and --to")


def _doubts(n0_cps: float, before: Calibration | None, density: float | None, soil: Soil) -> Iterator[str]:
    """Doubts about the result of a calibration."""
    from soilmoist_ros.sensing import unusual_n0

    if doubt := unusual_n0(n0_cps):
        yield f"{doubt}: check counts, exposure and their units"
    if before is not None and not before.illustrative and not 0.8 < n0_cps / before.n0_cps < 1.25:
        yield f"N0 was {before.n0_cps:g} counts/s in the site file: are probe, tubes and corrections as before?"
    if density is not None and not 0.85 < density / soil.bulk_density_gcm3 < 1.18:
        yield (
            f"the cores have a bulk density of {density:.2f} g/cm3, the site file {soil.bulk_density_gcm3:g}: the "
            "curve uses that of the site file"
        )


def _air(site: Site, counted: CalibrationCounts) -> Footprint:
    """Conditions of the weights; without a measured pressure that of the altitude, else the reference value."""
    from soilmoist_ros.sensing import Footprint, standard_pressure_hpa

    place = site.corrections.place or site.location
    reference_hpa = site.corrections_parameters.reference_pressure_hpa
    if place is not None and place.altitude_m is not None:
        reference_hpa = standard_pressure_hpa(place.latitude_deg, place.altitude_m)
    return Footprint(
        math.nan,
        site.reference_humidity_gm3 if math.isnan(counted.humidity_gm3) else counted.humidity_gm3,
        reference_hpa if math.isnan(counted.pressure_hpa) else counted.pressure_hpa,
        site.vegetation_height_m,
        site.footprint_radius_m,
    )


def _counted(
    site: Site,
    logs: tuple[Path, ...],
    logger: str | None,
    counts: int | None,
    exposure_s: float | None,
    window: tuple[datetime | None, datetime | None],
) -> CalibrationCounts:
    from soilmoist_ros.pipeline import read_logs, reading_of, skipped_text
    from soilmoist_ros.sensing import CalibrationCounts, calibration_counts, log_doubts

    if (counts is None) != (exposure_s is None) or bool(logs) == (counts is not None):
        raise click.UsageError("give the counts of the calibration with --log, or with --counts and --exposure")
    start, end = window
    if counts is not None and exposure_s is not None:
        if start or end:
            raise click.UsageError("--from and --to select records of a log; they require --log")
        return CalibrationCounts(counts, exposure_s, 0, 0, math.nan, math.nan, math.nan, math.nan)
    first_s, last_s = start.timestamp() if start else -math.inf, end.timestamp() if end else math.inf
    skipped: list[Mistake] = []
    found = read_logs(logs, logger, site, skipped=skipped)
    for key, text in reading_of(found).items():
        say(f"{key:<10} {text}")
    for text in [skipped_text(skipped)] * bool(skipped) + [str(problem) for problem in log_doubts(found)]:
        warn(f"warning    {text}")
    return calibration_counts(found, site, first_s, last_s)
