# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist calibrate``: the calibration of a site from soil cores."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, time
from functools import partial
from pathlib import Path
from types import SimpleNamespace as Options
from typing import Any, Literal

import click

from soilmoist_ros import mapping, pipeline, reporting, sensing  # their names load on first use
from soilmoist_ros.cli.answer import answering, put, say, warn, wrote
from soilmoist_ros.cli.options import FILE, INPUT, TIME, named
from soilmoist_ros.foundation import InputError, Mistake, listing

DAY_S = 86_400.0
AFTER_MAP_DAYS = 2
"""Days after a survey within which cores are compared with its map; without rain the pattern lasts."""
DENSITY: Literal["bulk density"] = "bulk density"
SAME_DENSITY = 0.02
"""Relative difference up to which the density of the site file is taken as that of the cores."""
USUAL_SENSITIVITIES = 0.05, 30.0
"""Sensitivities of neutron sensors to the reference detector, small tubes to large rovers."""


@click.command("calibrate")
@click.argument("cores", type=INPUT, required=False)
@click.option("--site", type=INPUT, help="Site file to read; N0 or the sensitivity is written to it.")
@click.option("--log", "logs", type=INPUT, multiple=True,
              help="Neutron log of the calibration. Repeatable.")  # fmt: skip
@click.option("--logger", type=named("logger"), help="Logger format of --log. Default: detected from the header.")
@click.option("--counts", type=click.IntRange(min=1), help="Instead of --log: raw counts of all tubes.")
@click.option("--exposure", "exposure_s", type=click.FloatRange(min=0, min_open=True),
              help="Effective exposure of --counts: live time over the product of the factors [s].")  # fmt: skip
@click.option("--run", type=FILE,
              help="Instead of --log: map (output folder) with the rates at the places of the cores.")  # fmt: skip
@click.option("--from", "start", type=TIME, metavar="TIME",
              help="Use records of the log after this time (UTC), such as 2026-05-02T14:30.")  # fmt: skip
@click.option("--to", "end", type=TIME, metavar="TIME", help="Use records of the log up to this time (UTC).")
@click.option("--curve", type=click.Choice(["desilets", "universal"]),
              help="Curve from the rate to the moisture. Default: that of the site file.")  # fmt: skip
@click.option("--weights", "weighting", type=click.Choice(["revised", "equal"]),
              default="revised", show_default=True, help="How distance and depth of the cores weigh.")  # fmt: skip
@click.option("--date", "dates", multiple=True, metavar="DAY", help="Day of the calibration; written to the site "
              "file. Chooses among the days of the cores. Repeatable.")  # fmt: skip
@click.option("--cores-only", is_flag=True, help="Use the cores alone, not the general calibration.")
@click.option("--earlier", type=INPUT, multiple=True,
              help="Site file with an earlier calibration of this sensor, anywhere. Repeatable.")  # fmt: skip
@click.option("--beside", "station_logs", type=INPUT, multiple=True,
              help="Instead of CORES: log of a station next to the sensor of --log. Repeatable.")  # fmt: skip
@click.option("--station-logger", type=named("logger"), help="Logger format of --beside. Default: detected.")
@click.option("--station-site", type=INPUT, help="Site file of the station. Default: that of --site.")
@click.option("--station-sensitivity", type=click.FloatRange(min=0, min_open=True),
              help="Sensitivity of the station to the reference detector. Default: by its site file.")  # fmt: skip
@click.option("--station-sensitivity-sd", type=click.FloatRange(min=0),
              help="Standard deviation of --station-sensitivity. Default: 3 %.")  # fmt: skip
@click.option("--plan", type=FILE, help="Instead of CORES: map (output folder) to plan the places of cores with.")
@click.option("--cores", "places", type=click.IntRange(1, 50), default=5, show_default=True,
              help="Number of places of --plan.")  # fmt: skip
@click.option("--out", type=FILE, help="Folder of the sheet of --plan. Default: RUN/cores.")
@click.option("--dry-run", is_flag=True, help="Print the result; do not write the site file.")
@answering
def command(**given: Any) -> None:
    """Find N0 from soil CORES (a CSV file) and the counts at the calibration.

    CORES has one row per core. Its first line names the columns: vwc [m3/m3], or gravimetric_water [g/g] and
    bulk_density_gcm3 [g/cm3]. Optional are distance_m from the probe, depth_cm (or top_cm and bottom_cm), profile
    (cores of one place) and date. Columns in other units have other names, such as vwc_percent.

    With --beside, find the sensitivity of a sensor from counts next to a station. With --plan, find the places in
    a field where cores lower the uncertainty most, and write a sheet to fill in.
    """
    options = Options(**given)
    if sum((options.cores is not None, bool(options.station_logs), options.plan is not None)) != 1:
        raise click.UsageError("give one of CORES, --beside and --plan")
    if options.plan is not None:
        _plan(options.plan, options.places, options.out)
    elif options.site is None:
        raise click.UsageError("Missing option '--site'.")
    elif options.cores is None:
        _compare(options, options.site)
    else:
        _calibrate(options, options.cores, options.site)


def _calibrate(options: Options, cores: Path, site: Path) -> None:
    """N0 from cores, written to the site file."""
    known, run, weighting, dates = sensing.load_site(site), options.run, options.weighting, options.dates
    table = sensing.read_soil_cores(cores, known.soil.bulk_density_gcm3 if known.soil else None, dates)
    sampled, before = table.cores, known.calibration
    for note in table.notes:
        warn(f"note       {note}")
    soil = _soil(known.soil, sampled, site, run is not None)
    weighed_gcm3 = sensing.mean_of_cores(sampled, "equal").bulk_density_gcm3 or math.nan
    own = math.isclose(weighed_gcm3, soil.bulk_density_gcm3, rel_tol=SAME_DENSITY)
    of_mass = [one.by_mass and (own or math.isnan(one.bulk_density_gcm3)) for one in sampled]
    unit = known.calibration or sensing.Calibration(n0_cps=1.0)
    fresh = {"n0_cps": 1.0, "n0_sd_cps": None, "n0_per_bound_water": 0.0, "n0_per_density": 0.0}
    unit = unit.model_copy(update={**fresh, "curve": options.curve or unit.curve})
    unknown = unit.model_copy(update={"n0_cps": math.nan})  # so that no count is impossible for a former N0
    known = known.model_copy(update={"soil": soil, "calibration": unknown})
    opened = None if run is None else reporting.open_run(run)
    about = {} if opened is None else opened.summary
    counted = _counted(known, options) if opened is None else _no_counts(about, options)
    _require_days_of_counts(table.days or dates, counted, cores)
    if run is not None and not (table.days or dates) and math.isfinite(counted.last_s):
        dates = (f"{datetime.fromtimestamp(counted.last_s, UTC):%Y-%m-%d}",)
        warn(
            f"assumption the cores have no date: taken as the day of the survey ({dates[0]}); --date gives another"
        )
    air, bound_water = _air(known, counted), soil.lattice_water + soil.organic_water
    unit_curve = unit.curve_of(soil, known.reference_humidity_gm3)
    try:
        mean = sensing.mean_of_cores(sampled, weighting, air, bound_water, soil.bulk_density_gcm3)
        if opened is not None:
            source = reporting.open_source(opened)
            level = reporting.n0_at_places(source, sampled, unit_curve, weighting, air)
            estimate, rate = level.estimate, level.rate_cps
            rate_sd = rate * estimate.from_counting_cps / estimate.n0_cps
            at_places = f", the map at {level.places} place{'s' * (level.places > 1)}"
            at_cps = level.mean_rate_cps
            mean = replace(mean, vwc=level.vwc, vwc_sd=level.vwc_sd)
        else:
            rate, rate_sd, at_places, level = counted.rate_cps, counted.rate_sd_cps, "", None
            at_cps = rate
            estimate = sensing.estimate_n0(rate, rate_sd, mean.vwc, mean.vwc_sd, unit_curve)
    except ValueError as error:
        what, remedy = f"the calibration has no solution: {error}", "check the cores and the soil properties"
        raise InputError(what, remedy, cores) from None
    for note in () if level is None else level.notes:
        warn(f"note       {note}")
    if level is not None and level.spread > 1.5:
        what = f"cores and map differ {level.spread:.1f} times more from place to place than both errors explain"
        warn(f"doubt      {what}: was there rain between them? The error of N0 is that much larger")
    put(
        n0_cps=estimate.n0_cps, n0_sd_cps=estimate.n0_sd_cps, curve=unit.curve, days=list(table.days),
        rate_cps=rate, rate_sd_cps=rate_sd, cores=mean.count,
        vwc=mean.vwc, vwc_sd=mean.vwc_sd, weights=mean.weights,
    )  # fmt: skip
    say(f"cores      {_about(mean)}{f', of {listing(table.days)}' if table.days else ''}")
    if mean.weights == "equal weights" and weighting != "equal" and run is None:
        warn(f"note       the {weighting} weights need distance_m, or depths of several cores in a profile")
    assumed = "" if math.isfinite(counted.pressure_hpa) else " (assumed for the weights)"
    say(f"air        {air.pressure_hpa:.1f} hPa, {air.humidity_gm3:.1f} g/m3{assumed}")
    if counted.factors:
        say(f"factors    {counted.factors_text}")
    records = f", {counted.records} records" if counted.records else ""
    records += f", {counted.left_out} left out" if counted.records and counted.left_out else ""
    say(f"rate       {rate:.4f} +- {rate_sd:.4f} counts/s, corrected{records}{at_places}")
    say(f"N0         {estimate.n0_cps:.4f} +- {estimate.n0_sd_cps:.4f} counts/s, curve {unit.curve}")
    of_cores = "an unknown part" if math.isnan(estimate.from_cores_cps) else f"{estimate.from_cores_cps:.4f}"
    say(f"of which   {estimate.from_counting_cps:.4f} from counting, {of_cores} from cores")
    if before is not None and before.curve != unit.curve:
        before = None  # its N0 is of another kind
    for doubt in (*counted.doubts(known), *_doubts(estimate.n0_cps, before, mean.bulk_density_gcm3, soil)):
        warn(f"doubt      {doubt}")
    per_water, per_density = unit_curve.of_cores(mean.vwc, by_volume=1 - sum(of_mass) / len(of_mass))
    result = sensing.Calibration(
        n0_cps=round(estimate.n0_cps, 5), curve=unit.curve, parameter_set=unit.parameter_set,
        n0_sd_cps=round(estimate.n0_sd_cps, 5), date=", ".join(dates or table.days) or None,
        note=f"{mean.count} soil cores, mean VWC {mean.vwc:.3f} m3/m3, {mean.weights}",
        n0_per_bound_water=round(per_water, 5), n0_per_density=round(per_density, 5),
        reference_hpa=_reference_hpa(known, about, options),
    )  # fmt: skip
    if not options.cores_only:
        datum = about.get("datum") or {}
        latitude, longitude = (float(datum.get(name, math.nan)) for name in ("latitude_deg", "longitude_deg"))
        of_air = sensing.SurveyAir(latitude, longitude, counted.pressure_hpa, humidity_gm3=counted.humidity_gm3)
        prior = _general(known, of_air)
        days = tuple(table.days) or dates
        day_sd = sensing.DAY_SD if run is None else 0.0  # a map is of the day of its cores
        result = _combined(
            result, estimate, mean, rate, at_cps, day_sd, unit_curve, known, site, prior, options.earlier, days,
            run is not None,
        )  # fmt: skip
    elif options.earlier:
        raise click.UsageError("--earlier is not used with --cores-only")
    before_soil = sensing.load_site(site).soil
    of_density = [
        part for part in (before.parts if before else ()) if part.name == DENSITY and part.origin == "measured"
    ]
    if soil != before_soil and soil.bulk_density_sd_gcm3:
        weighed = sensing.UncertaintyPart(
            name=DENSITY, value=soil.bulk_density_gcm3, unit="g/cm3", sd=soil.bulk_density_sd_gcm3,
            origin="measured", sd_origin="assumed",
        )  # fmt: skip
        of_density = [weighed]
    if of_density:
        others = [part for part in result.parts if part.name != DENSITY]
        result = result.model_copy(update={"parts": [*others, *of_density]})
    level_sd = mapping.level_of(result.curve_of(soil, known.reference_humidity_gm3), at_cps)[0]
    put(level_vwc_sd=level_sd)
    say(f"level      +- {100 * level_sd:.1f} % by volume, of N0 and soil")
    if options.dry_run:
        say(f"dry run: {site} is not changed")
        return
    sensing.write_calibration(site, result, None if soil == before_soil else soil)
    wrote([site])


def _soil(known: sensing.Soil | None, cores: Sequence[sensing.SoilCore], site: Path, of_run: bool) -> sensing.Soil:
    """Soil of a site; the density is that of weighed cores where it has none, or, of a run, a less sure one."""
    density = sensing.mean_of_cores(cores, "equal").bulk_density_gcm3
    if density is None:
        if known is None:
            remedy = "add 'soil: {bulk_density_gcm3: ...}' to the file, or a column bulk_density_gcm3 to the cores"
            raise InputError("has no soil properties", remedy, site)
        return known
    if known is None:
        return sensing.Soil(bulk_density_gcm3=round(density, 4))
    weighed = [group for group in sensing.profiles_of(cores) if any(one.bulk_density_gcm3 > 0 for one in group)]
    sd, had = sensing.PROFILE_DENSITY_SD_GCM3 / math.sqrt(len(weighed)), known.bulk_density_gcm3
    had_sd = sensing.DENSITY_ERROR * had if known.bulk_density_sd_gcm3 is None else known.bulk_density_sd_gcm3
    profiles = f"{len(weighed)} weighed profile{'s' * (len(weighed) > 1)}, {density:.2f} +- {sd:.2f} g/cm3"
    of_site = f"{had:.2f} +- {had_sd:.2f} of the site file"
    if not of_run or sd >= had_sd:
        if of_run:
            say(f"density    {of_site}, which is surer than {profiles}")
        return known
    say(f"density    {profiles}, instead of {of_site}")
    return known.model_copy(update={"bulk_density_gcm3": round(density, 4), "bulk_density_sd_gcm3": round(sd, 4)})


def _combined(
    alone: sensing.Calibration, cores: sensing.N0Estimate, mean: sensing.CoreMean, rate_cps: float,
    at_cps: float, day_sd: float, unit_curve: sensing.MoistureCurve, known: sensing.Site, site: Path,
    general: tuple[sensing.Calibration | None, str], earlier: tuple[Path, ...], days: Sequence[str],
    of_map: bool,
) -> sensing.Calibration:  # fmt: skip
    """The calibration by the cores together with the general and earlier ones; as it was where there is none."""
    prior, why = general
    if prior is None:
        say(f"general    not used: {why}")
        if not earlier:
            return alone
    assumed = math.isnan(mean.vwc_sd)
    if assumed:
        warn(f"assumption the profile is within {sensing.PROFILE_SD:g} m3/m3 (1 sd) of its footprint's mean")
        rate_sd = cores.from_counting_cps / cores.n0_cps * rate_cps
        cores = sensing.estimate_n0(rate_cps, rate_sd, mean.vwc, sensing.PROFILE_SD, unit_curve)
    sources = [sensing.N0Source("cores", cores.n0_cps, math.hypot(cores.n0_sd_cps / cores.n0_cps, day_sd))]
    if prior is not None:
        sd = (prior.n0_sd_cps or 0.0) / prior.n0_cps
        sources.append(sensing.N0Source("general", prior.n0_cps, sd, min(sensing.GENERAL_SD, sd)))
    for one in earlier:
        before = sensing.load_site(one)
        scale = partial(_scale, known, site, before, one)
        sources.append(sensing.earlier_source(before, one, known, days, scale))
    result, both = sensing.combined_calibration(alone, cores, sources, prior, assumed or of_map)
    without, n0_cps = sensing.combine_n0(sources[1:]), result.n0_cps
    before_sd = mapping.level_of(replace(unit_curve, n0_cps=n0_cps, n0_sd_cps=without.sd * n0_cps), at_cps)[0]
    differ = sensing.difference_sd(sources[0], sensing.N0Source("", without.n0_cps, without.sd))
    names = listing([one.name for one in sources[1:]])
    for source in sources:
        say(f"{source.name:<10} N0 {source.n0_cps:.4f} +- {source.n0_cps * source.sd:.4f} counts/s")
    say(f"together   N0 {result.n0_cps:.4f} +- {result.n0_sd_cps:.4f} counts/s")
    worth = f"{names} alone +- {100 * before_sd:.1f} % by volume"
    say(f"worth      {worth}; the cores weigh {100 * both.weights[0]:.0f} %; both agree within {differ:.1f} sd")
    put(
        method="combined", n0_cps=result.n0_cps, n0_sd_cps=result.n0_sd_cps, n0_of_cores_cps=cores.n0_cps,
        weight_of_cores=both.weights[0], disagreement_sd=differ, level_vwc_sd_before=before_sd,
    )  # fmt: skip
    if differ > sensing.DISAGREEMENT_SD:
        what, check = f"the cores and {names} contradict each other by {differ:.1f} sd", "density and sensitivity"
        warn(f"doubt      {what}: check cores, {check}; --cores-only uses the cores alone")
    return result


def _about(mean: sensing.CoreMean) -> str:
    depth = "" if math.isnan(mean.depth_cm) else f", seen to {mean.depth_cm:.0f} cm"
    error = ", of unknown error (one profile)" if math.isnan(mean.vwc_sd) else f" +- {mean.vwc_sd:.4f}"
    return f"{mean.count} in {mean.profiles} profiles, mean VWC {mean.vwc:.4f} m3/m3{error}, {mean.weights}{depth}"


def _require_days_of_counts(days: Sequence[str], counted: sensing.CalibrationCounts, cores: Path) -> None:
    """Refuse counts of other days than the cores; of a date whose month is not clear, both days are compared."""
    if math.isnan(counted.first_s):
        return
    # Clocks of loggers and of people differ by up to half a day from UTC.
    earliest_s, latest_s = counted.first_s - 1.5 * DAY_S, counted.last_s + 0.5 * DAY_S
    if not counted.records:  # cores are taken where the map says, often later
        latest_s += AFTER_MAP_DAYS * DAY_S
    for day in days:
        begins_s = [datetime.combine(of, time(), UTC).timestamp() for of in sensing.possible_days(day)]
        if begins_s and not any(earliest_s < at < latest_s for at in begins_s):
            first, last = (datetime.fromtimestamp(at, UTC) for at in (counted.first_s, counted.last_s))
            of_counts = f"the counts of {first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"
            source = "log" if counted.records else "run"
            remedy = f"give the {source} of that day, or correct the date of the cores"
            raise InputError(f"the cores are of {day}, and {of_counts}", remedy, cores)
        if not counted.records and all(at > counted.last_s for at in begins_s):
            warn(f"doubt      the cores are of {day}, after the survey: was there rain between them?")
    long_days = (counted.last_s - counted.first_s) / DAY_S
    if counted.records and days and long_days > len(days) + 2:
        warn(f"doubt      {long_days:.0f} days are counted for cores of {listing(days)}: choose --from and --to")


def _doubts(
    n0_cps: float, before: sensing.Calibration | None, density: float | None, soil: sensing.Soil
) -> Iterator[str]:
    """Doubts about the result of a calibration."""
    if doubt := sensing.unusual_n0(n0_cps):
        yield f"{doubt}: check counts, exposure and their units"
    if before is not None and not before.illustrative and not 0.8 < n0_cps / before.n0_cps < 1.25:
        yield f"N0 was {before.n0_cps:g} counts/s in the site file: are probe, tubes and corrections as before?"
    if density is not None and not 0.85 < density / soil.bulk_density_gcm3 < 1.18:
        used = f"the site file {soil.bulk_density_gcm3:g}: the curve uses that of the site file"
        yield f"the cores have a bulk density of {density:.2f} g/cm3, {used}"


def _air(site: sensing.Site, counted: sensing.CalibrationCounts) -> sensing.Footprint:
    """Conditions of the weights; without a measured pressure that of the altitude, else the reference value."""
    place = site.corrections.place or site.location
    reference_hpa = site.corrections_parameters.reference_pressure_hpa
    if place is not None and place.altitude_m is not None:
        reference_hpa = sensing.standard_pressure_hpa(place.latitude_deg, place.altitude_m)
    humidity_gm3 = site.reference_humidity_gm3 if math.isnan(counted.humidity_gm3) else counted.humidity_gm3
    pressure_hpa = reference_hpa if math.isnan(counted.pressure_hpa) else counted.pressure_hpa
    probe = site.vegetation_height_m, site.shield_radius_m
    return sensing.Footprint(math.nan, humidity_gm3, pressure_hpa, *probe)


def _counted(site: sensing.Site, given: Options) -> sensing.CalibrationCounts:
    counts, exposure_s, start, end = given.counts, given.exposure_s, given.start, given.end
    if (counts is None) != (exposure_s is None) or bool(given.logs) == (counts is not None):
        raise click.UsageError("give the counts of the calibration with --log, or with --counts and --exposure")
    if counts is not None and exposure_s is not None:
        if start or end:
            raise click.UsageError("--from and --to select records of a log; they require --log")
        return sensing.CalibrationCounts(counts, exposure_s, 0, 0, math.nan, math.nan)
    first_s, last_s = start.timestamp() if start else -math.inf, end.timestamp() if end else math.inf
    return sensing.calibration_counts(_read(site, given.logs, given.logger), site, first_s, last_s)


def _no_counts(about: Mapping[str, Any], given: Options) -> sensing.CalibrationCounts:
    """Stand-in for counts where the rates are those of a map: its time and mean weather."""
    if given.logs or given.counts is not None or given.exposure_s is not None or given.start or given.end:
        raise click.UsageError("--run has the counts: leave out --log, --counts, --exposure, --from and --to")
    first_s, last_s = (about.get(name) or math.nan for name in ("first_stamp_s", "last_stamp_s"))
    if about.get("simulated"):
        first_s = last_s = math.nan  # the date of a simulation is not one of cores
    return sensing.CalibrationCounts(0, 1.0, 0, 0, *_weather_of(about), first_s, last_s)


def _reference_hpa(site: sensing.Site, about: Mapping[str, Any], given: Options) -> float | None:
    """Air pressure to which the counts of the calibration are corrected [hPa]; ``None`` if to none, or unknown."""
    own = site.corrections_parameters.reference_pressure_hpa if site.corrections.pressure is not None else None
    if given.run is None:
        return None if own is None or not given.logs else round(own, 2)
    rows = about.get("corrections") or []
    found = next((row["parameters"]["P0 [hPa]"] for row in rows if "P0 [hPa]" in row["parameters"]), None)
    if rows and found != (own and round(own, 2)):
        texts = ["no pressure" if one is None else f"{one:.2f} hPa" for one in (found, own)]
        what = f"the counts of the run are corrected to {texts[0]}, those of the site file to {texts[1]}"
        warn(f"doubt      {what}: N0 fits maps with the corrections of the run only")
    return None if found is None else float(found)


def _weather_of(summary: Mapping[str, Any]) -> tuple[float, float]:
    """Mean air pressure [hPa] and absolute humidity [g/m^3] of a run by its mean factors; NaN for the unknown."""
    pressure_hpa = humidity_gm3 = math.nan
    for row in summary.get("corrections") or []:
        known, factor = row["parameters"], row["mean_factor"]
        if known.get("beta [1/hPa]") and "P0 [hPa]" in known:
            pressure_hpa = known["P0 [hPa]"] + math.log(factor) / known["beta [1/hPa]"]
        elif known.get("c [m3/g]") and "Q0 [g/m3]" in known:
            humidity_gm3 = known["Q0 [g/m3]"] + (factor - 1) / known["c [m3/g]"]
    return pressure_hpa, humidity_gm3


def _plan(run: Path, count: int, out: Path | None) -> None:
    """Print where cores lower the uncertainty most, and write the sheet and the waypoints."""
    source = reporting.open_source(reporting.open_run(run))
    plan = reporting.plan_cores(source, count)
    for note in (*source.notes, *plan.notes):
        warn(f"note       {note}")
    level = f"N0 +- {100 * plan.prior_sd:.1f} %, the mean moisture +- {100 * plan.prior_vwc_sd:.1f} % by volume"
    say(f"before     {level}")
    say("place  latitude    longitude    expected        cores [cm]                     after it")
    for one in plan.places:
        layers = ", ".join(f"{top}-{bottom}" for top, bottom in one.layers_cm)
        expected = f"{100 * one.vwc:.0f} +- {100 * one.vwc_sd:.0f} %"
        say(
            f"{one.number:<5}  {one.latitude_deg:10.6f}  {one.longitude_deg:11.6f}  {expected:<14}  {layers:<29}  "
            f"N0 +- {100 * one.level_sd:.1f} %, moisture +- {100 * one.level_vwc_sd:.1f} %"
        )
    say(f"distances  {plan.spacing_m:.0f} m to the next place, {plan.edge_m:.0f} m to the edge at least")
    put(
        places=[one._asdict() for one in plan.places], prior_sd=plan.prior_sd, prior_vwc_sd=plan.prior_vwc_sd,
        spacing_m=plan.spacing_m, edge_m=plan.edge_m,
    )  # fmt: skip
    wrote(reporting.write_plan(plan, out or run / "cores", source.title))
    say("then       fill in the sheet, and: soilmoist calibrate cores.csv --site SITE --run RUN")


def _compare(options: Options, site: Path) -> None:
    """The sensitivity of a sensor from counts next to a station, written to the site file."""
    if not options.logs:
        raise click.UsageError("--beside requires --log, the log of your own sensor")
    known = sensing.load_site(site)
    of_station = sensing.load_site(options.station_site) if options.station_site else known
    sensitivity, sensitivity_sd, origin = _sensitivity_of(of_station, options)
    own = _read(known, options.logs, options.logger)
    other = _read(of_station, options.station_logs, options.station_logger)
    found = sensing.compare_side_by_side(own, known, other, of_station)
    value, sd = found.sensitivity(sensitivity, sensitivity_sd)
    alike = f"both logs have the serial number {own[0].serial}" if own[0].serial == other[0].serial != "" else ""
    for doubt in filter(None, (*found.doubts(value, sd, sensing.sensitivity_of(known)), alike)):
        warn(f"doubt      {doubt}")
    _require_usual(f"a ratio of counts of {found.ratio:.3g} makes a sensitivity", value, options.logs[0])
    put(
        ratio=found.ratio, ratio_sd=found.ratio_sd, sensor_sensitivity=value, sensor_sensitivity_sd=sd,
        own_counts=found.own_counts, station_counts=found.other_counts, counted_s=found.counted_s,
    )  # fmt: skip
    first, last = sensing.utc_text(found.first_s), sensing.utc_text(found.last_s)
    say(f"together   {found.counted_s / 3600:.1f} h of {first} to {last} UTC")
    say(f"counts     {found.own_counts} here, {found.other_counts} of the station")
    say(f"ratio      {found.ratio:.4f} +- {found.ratio_sd:.4f}, from counting")
    say(f"station    sensitivity {sensitivity:.3f} +- {sensitivity_sd:.3f}, {origin}")
    say(f"sensor     sensitivity {value:.3f} +- {sd:.3f}")
    if options.dry_run:
        say(f"dry run: {site} is not changed")
        return
    sensing.write_site_values(site, {"sensor_sensitivity": round(value, 4), "sensor_sensitivity_sd": round(sd, 4)})
    wrote([site])


def _read(site: sensing.Site, logs: tuple[Path, ...], logger: str | None) -> list[sensing.LogFile]:
    """Logs of one sensor, with what the user should know of them."""
    skipped: list[Mistake] = []
    found = pipeline.read_logs(logs, logger, site, skipped=skipped)
    for key, text in pipeline.reading_of(found).items():
        say(f"{key:<10} {text}")
    lost = [pipeline.skipped_text(skipped)] * bool(skipped)
    for problem in (*lost, *sensing.log_doubts(found)):
        warn(f"warning    {problem}")
    return found


def _general(site: sensing.Site, air: sensing.SurveyAir) -> tuple[sensing.Calibration | None, str]:
    """General calibration of a site, or ``None`` and the reason."""
    if sensing.sensitivity_of(site) is None:
        return None, "the site file has no sensor_sensitivity; --beside finds it"
    if site.calibration is not None and site.calibration.curve != "desilets":
        return None, f"it is of the curve desilets, the site's is {site.calibration.curve}"
    if why := sensing.why_no_soil(site):
        return None, why
    found = sensing.general_calibration(site, air)
    if found is None:
        return None, "the site file needs a location, with altitude_m where the log has no pressure"
    return found[0], ""


def _reference_n0_cps(site: sensing.Site, path: Path) -> float:
    """N0 of the reference detector at the site of a file by the general calibration."""
    alike = site.model_copy(update={"sensor_sensitivity": 1.0, "soil": None})
    if (found := sensing.general_calibration(alike, sensing.SurveyAir())) is None:
        what = "has no location with altitude_m, so its N0 cannot be compared with that of another site"
        raise InputError(what, "add it", path)
    return found[0].n0_cps


def _scale(here: sensing.Site, path: Path, there: sensing.Site, other: Path) -> float:
    """N0 of one sensor at the site of a file relative to that at another one, by the general calibration."""
    return _reference_n0_cps(here, path) / _reference_n0_cps(there, other)


def _require_usual(name: str, sensitivity: float, path: Path | None = None) -> None:
    low, high = USUAL_SENSITIVITIES
    if not low <= sensitivity <= high:
        remedy = "check that both sensors stood side by side, the units of their counts, and the station's values"
        usual = f"neutron sensors have {low:g} to {high:g} of the reference detector"
        raise InputError(f"{name} of {sensitivity:.3g}: {usual}", remedy, path)


def _sensitivity_of(station: sensing.Site, options: Options) -> tuple[float, float, str]:
    """Sensitivity of a station, its standard deviation, and where it is from: as given, from its site file, or by
    its N0, whose site then differs from others by as much as sites do.
    """
    given, path = options.station_sensitivity, options.station_site
    if given is not None:
        _require_usual("--station-sensitivity", given)
        sd = options.station_sensitivity_sd
        return given, sensing.GIVEN_SD * given if sd is None else sd, "as given"
    if path is None:
        raise InputError("nothing is known of the station", "give --station-sensitivity or --station-site")
    if (known := sensing.sensitivity_of(station)) is not None:
        return known.value, known.sd, f"of {path.name}"
    own = station.calibration
    if own is None or own.illustrative or own.curve != "desilets" or own.method != "cores":
        remedy = "give --station-sensitivity, or a site file with sensor_sensitivity or an N0 from cores"
        raise InputError("has no sensitivity and no N0 from cores of the curve desilets", remedy, path)
    value = own.n0_cps / _reference_n0_cps(station, path)
    sd = math.hypot((own.n0_sd_cps or 0.0) / own.n0_cps, sensing.GENERAL_SD)
    return value, value * sd, f"by N0 of {path.name}"
