# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The meaning of field, site and log files, in words; doubts about them, and contradictions between them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros import sensing
from soilmoist_ros.foundation import (
    InputError,
    LocalFrame,
    Mistake,
    SoilmoistError,
    area,
    coordinates_text,
    distance_text,
    duration,
)
from soilmoist_ros.mapping import Field, PositionSource, read_covariates, require_near
from soilmoist_ros.pipeline.earlier_runs import MAX_AHEAD_S
from soilmoist_ros.pipeline.run import EARLIEST_STAMP_S
from soilmoist_ros.simulation import SurrogateField

MIN_USUAL_M2, MAX_USUAL_M2 = 100.0, 1e8
"""Areas beyond which a field is unusual for a survey with a neutron sensor [m^2]."""
MAX_FROM_SITE_M = 100_000.0
"""Distance of records from the place of their site beyond which one of them is wrong [m]."""
MAX_FROM_REFERENCE_HPA = 40.0
"""Distance of the reference pressure from that of the altitude beyond which it is unusual [hPa]."""
PREVIEW = 3  # number of first records that are shown as they were understood
MAX_FAULTS = 5  # number of kinds of faults that are shown
WEAK_TUBE = 0.2  # share of the mean count of the tubes below which a tube counts too little
_MAX_N0_SD = 0.3  # standard deviation of N0 beyond which it is in another unit, as a share of N0
_DRY, _WET = 0.05, 0.40  # moisture of dry and wet soil, for examples [m^3/m^3]
_NOTED = (
    sensing.Kind.ASSUMED_TIME, sensing.Kind.CHOSEN_POSITIONS, sensing.Kind.DOUBTFUL_POSITIONS,
    sensing.Kind.CHECKSUM,
)  # fmt: skip


class FileFinding(NamedTuple):
    """A statement about a file; its name is the topic, or ``doubt``."""

    name: str
    text: str


def _doubt(text: str) -> FileFinding:
    return FileFinding("doubt", text)


def field_findings(field: Field, robot_radius_m: float = 0.0) -> Iterator[FileFinding]:
    """Area, place, direction, cells and covariates of a field, for a robot of this radius.

    :raises InputError: if a covariate cannot be used
    """
    import shapely

    from soilmoist_ros.exploration import unreachable

    shape = shapely.Polygon(field.polygon)
    left_out = shapely.union_all([shapely.Polygon(ring) for ring in field.no_go])
    value, unit = area(shape.difference(left_out).area)
    width_m, height_m = np.ptp(field.polygon, axis=0)
    sides = np.roll(field.polygon, -1, axis=0) - field.polygon
    east, north = sides[np.argmax(np.hypot(*sides.T))]
    longest_deg = round(math.degrees(math.atan2(east, north))) % 180
    grid = field.grid()
    yield FileFinding("field", f"{field.name}: {value} {unit} at {coordinates_text(*field.centre)}")
    sizes = f"{width_m:.0f} m east-west, {height_m:.0f} m north-south"
    yield FileFinding("extent", f"{sizes}; longest side at {longest_deg} deg")
    no_go = f", {len(field.no_go)} no-go {'area' if len(field.no_go) == 1 else 'areas'}" if field.no_go else ""
    yield FileFinding("map", f"{np.count_nonzero(grid.mask)} cells of {grid.cell_m:g} m{no_go}")
    for note in field.notes:
        yield FileFinding("border", note)
    if doubt := unreachable(field, robot_radius_m):
        yield _doubt(doubt)
    covariates = read_covariates(field.covariates, field.frame, grid)
    if covariates is not None:
        covered = [f"{name} ({share:.0%} of the field)" for name, share in covariates.coverage(grid).items()]
        yield FileFinding("covariates", ", ".join(covered))
        for unused in filter(None, (source.unused_parts() for source in field.covariates)):
            yield FileFinding("covariates", unused)
    if not MIN_USUAL_M2 <= shape.area <= MAX_USUAL_M2:
        small = shape.area < MIN_USUAL_M2
        size = "smaller than the footprint of the sensor" if small else "very large for a survey"
        yield _doubt(f"{value} {unit} is {size}: are the corners in the right unit?")
    distance_m = math.hypot(shape.centroid.x, shape.centroid.y)
    if distance_m > max(5000.0, 5 * field.extent_m):
        away = distance_text(distance_m)
        yield _doubt(f"the boundary lies {away} from its datum: is the datum that of this field?")


def truth_findings(known: SurrogateField) -> Iterator[FileFinding]:
    """Rates of a surrogate field, and the moisture that they stand for."""
    rates = known.rate_at(known.field.grid().cells)
    low, high = float(rates.min()), float(rates.max())
    text, fits = f"a rate of {low:.4g} to {high:.4g} counts/s", True
    if known.curve is not None:
        wet, dry = (float(known.curve.vwc(rate)) for rate in (low, high))
        fits = dry >= 0 and wet <= sensing.soil_limits(known.curve.bulk_density_gcm3).saturation + _DRY
        text += f", a moisture of {dry:.2f} to {wet:.2f} m3/m3 by its calibration"
    yield FileFinding("truth", text)
    if doubt := sensing.unusual_n0(high).replace("N0", "a rate", 1):
        yield _doubt(doubt)
    if not fits:
        yield _doubt("no soil has these rates: check N0, units, and whether the data are rates or moistures")


def graph_findings(field: Field, path: Path, robot_radius_m: float, home: str = "") -> Iterator[FileFinding]:
    """Nodes of a topological map that the planner would use in a field, and its doubts about the map.

    :raises InputError: if the map cannot be read, none of its nodes lies in the field, or the home is not allowed
    """
    from soilmoist_ros import exploration
    from soilmoist_ros.simulation import mission_map

    found = mission_map(field, field.grid(), str(path))
    rules = exploration.AccessRules(robot_radius_m=robot_radius_m)
    access = exploration.FieldAccess(field, exploration.RobotMotion(), found.graph, rules, home=home)
    datum = "none: metres from the field's datum" if found.datum is None else "its own"
    stops = f"{len(access.stops)} of {len(found.graph.names)} nodes are stops in {field.name}"
    frame = found.frame or "not named"
    yield FileFinding("graph", f"{stops}; datum of the map: {datum}; frame of its places: {frame}")
    frames = exploration.RobotFrames(field, exploration.FrameSettings())
    frames.take_map_datum(found.datum, found.frame)
    fault = f"with its default parameters, the planner does not drive: {frames.fault}" if frames.fault else ""
    doubts = (access.warning, fault, found.graph.crowded(), *found.doubts(exploration.KNOWN_ACTIONS))
    yield from map(_doubt, filter(None, doubts))


def site_findings(site: sensing.Site) -> Iterator[FileFinding]:
    """Place, corrections and calibration of a site, and the moisture that its calibration gives.

    :raises InputError: if the neutron-monitor file of the site cannot be used
    """
    side = "" if site.longitude == "signed" else f"; longitudes without a sign are {site.longitude}"
    given = math.isfinite(site.shield_radius_m)
    footprint = f"{site.footprint_radius_m:g} m" if given else "not given, reports state that of a bare probe"
    yield FileFinding("site", f"{site.name}; footprint {footprint}{side}")
    used, settings = site.corrections_parameters, site.corrections
    place = settings.place or site.location
    if place is not None:
        cosmic = settings.cosmic(site.location)
        yield FileFinding("place", coordinates_text(place.latitude_deg, place.longitude_deg))
        if cosmic is not None:
            depth = f"atmospheric depth {cosmic.depth_gcm2:.0f} g/cm2"
            yield FileFinding("cosmic rays", f"cutoff rigidity {cosmic.cutoff_rigidity_gv:.2f} GV, {depth}")
        if settings.pressure is not None and place.altitude_m is not None:
            usual_hpa = sensing.standard_pressure_hpa(place.latitude_deg, place.altitude_m)
            found_with = None if site.calibration is None else site.calibration.reference_hpa
            same = found_with is not None and math.isclose(found_with, used.reference_pressure_hpa, abs_tol=0.01)
            if not same and abs(used.reference_pressure_hpa - usual_hpa) > MAX_FROM_REFERENCE_HPA:
                yield _doubt(
                    f"the pressure factor is 1 at {used.reference_pressure_hpa:g} hPa, but {usual_hpa:.0f} hPa "
                    f"are usual at {place.altitude_m:g} m: right only if N0 was calibrated with this reference "
                    "('reference_hpa: auto' takes that of the altitude)"
                )
    pressure = f"pressure ({used.beta_per_hpa:.5f} 1/hPa, 1 at {used.reference_pressure_hpa:g} hPa)"
    scaling = settings.intensity.scaling if settings.intensity else ""
    applied = [
        pressure if settings.pressure else "no pressure",
        f"humidity ({site.humidity_method})" if settings.humidity else "no humidity",
        f"incoming neutrons (scaling {scaling}, k {used.intensity_scale:.3f})"
        if scaling
        else "no incoming neutrons",
        f"plants (factor {settings.f_biomass:.3f})" if settings.biomass else "",
        f"road (factor {settings.f_road:.3f})" if settings.road else "",
    ]
    yield FileFinding("correction", ", ".join(filter(None, applied)))
    yield from _on_monitor(settings)
    if "irrigation" in site.model_fields_set:
        yield from _on_irrigation(site.irrigation)
    curve, calibration = site.curve, site.calibration
    if curve is None:
        missing = " and ".join(name for name in ("soil", "calibration") if getattr(site, name) is None)
        text = f"not mapped, only the count rate: there is no {missing}"
        if calibration is None and site.sensor_sensitivity and "calibration" not in site.model_fields_set:
            why = sensing.why_no_soil(site)
            text = why or f"by the general calibration, with a sensitivity of {site.sensor_sensitivity}"
        yield FileFinding("moisture", text)
        return
    pores = sensing.soil_limits(curve.bulk_density_gcm3).saturation
    dry, wet = (float(curve.rate_cps(min(vwc, pores))) for vwc in (_DRY, _WET))
    guessed = " (illustrative)" if calibration is not None and calibration.illustrative else ""
    yield FileFinding(
        "moisture",
        f"N0 {curve.n0_cps:g} counts/s{guessed}, {curve.parameters['curve']} curve: {dry:.2f} counts/s on dry "
        f"soil ({_DRY:.2f} m3/m3), {wet:.2f} on wet soil ({min(_WET, pores):.2f}); the pores hold {pores:.2f}",
    )
    if doubt := sensing.unusual_n0(curve.n0_cps):
        yield _doubt(doubt)
    if curve.n0_sd_cps > _MAX_N0_SD * curve.n0_cps:
        yield _doubt(f"n0_sd_cps is {curve.n0_sd_cps / curve.n0_cps:.0%} of N0: is it in counts/s?")
    if calibration is not None and not (calibration.has_origin or calibration.illustrative):
        yield _doubt(
            "the calibration has no date, note or n0_sd_cps: give one, or write 'illustrative: true' if N0 is not "
            "from cores around this probe"
        )


def _on_irrigation(known: sensing.Irrigation) -> Iterator[FileFinding]:
    """Root zone, its water, and the doses, each with its origin."""

    def of(name: str) -> str:
        return "given" if name in known.model_fields_set else "default"

    low, high = known.wilting_point, known.field_capacity
    texts = [f"roots to {known.root_depth_mm:g} mm ({of('root_depth_mm')})"]
    if low is None or high is None:
        texts.append("no wilting point and field capacity, so no dose")
    else:
        origin = "given" if known.texture is None else f"typical of {known.texture}"
        texts.append(f"wilting point {low:g}, field capacity {high:g} ({origin})")
        target = "target given" if known.target is not None else f"target_share {of('target_share')}"
        net_mm, held_mm = ((end - low) * known.root_depth_mm for end in (known.full, high))
        texts.append(f"{held_mm:.0f} mm of available water, filled to {known.full:.2f} ({target})")
        gross_mm, efficiency = net_mm / known.efficiency, f"efficiency {known.efficiency:g} {of('efficiency')}"
        most_mm = min(gross_mm, known.max_dose_mm)
        limit = efficiency if gross_mm <= known.max_dose_mm else f"max_dose_mm {of('max_dose_mm')}"
        texts.append(f"largest dose {most_mm:.0f} mm ({limit})")
    yield FileFinding("irrigation", "; ".join(texts))
    if known.doubt:
        yield _doubt(known.doubt)


def _on_monitor(settings: sensing.CorrectionSettings) -> Iterator[FileFinding]:
    """Neutron monitor of the incoming intensity, with its reference."""
    source, intensity = sensing.intensity_source(settings), settings.intensity
    if source is None or intensity is None:
        return
    reference = f"reference C0 {intensity.reference:g}"
    if isinstance(source, sensing.NeutronMonitor):
        of = source.station or intensity.monitor or "a station without a name"
        first, last = (_date(float(source.stamp_s[index])) for index in (0, -1))
        rates = [float(source.rate.min()), float(source.rate.max())]
        text = f"{of}, {first} to {last} UTC, {rates[0]:g} to {rates[-1]:g}, {reference}"
    else:
        rates, text = [source], f"constant rate {source:g}, {reference}"
    yield FileFinding("monitor", text)
    ratios = [intensity.reference / rate for rate in rates]
    yield from map(_doubt, sensing.unusual_factors({"f_intensity": (min(ratios), max(ratios))}))


def logger_findings(logger: sensing.LoggerFormat) -> Iterator[FileFinding]:
    """Tubes, quantities and times of a logger format."""
    counts, position = logger.counts, logger.position
    columns = " or ".join(counts.columns[:2]) + (" ..." if len(counts.columns) > 2 else "")
    yield FileFinding("logger", f"{logger.title}: {counts.unit.replace('_', ' ')} of {columns}")
    weather = [name for name in ("pressure", "temperature", "humidity") if getattr(logger, name) is not None]
    unsigned = position is not None and not position.longitude_signed
    signs = "; longitudes without a sign: the site file names the side" if unsigned else ""
    place = "no positions" if position is None else f"positions{signs}"
    yield FileFinding("quantities", f"{', '.join(weather) or 'no weather'}, {place}")
    yield FileFinding("clock", f"{logger.time.clock_text}, stamped at the {logger.time.marks} of the interval")
    if counts.left_out or counts.note:
        out = f"tube {', '.join(map(str, counts.left_out))} is left out. " if counts.left_out else ""
        yield FileFinding("tubes", f"{out}{counts.note.strip()}".strip())
    given = counts.model_fields_set | (position.model_fields_set if position else set())
    for key in sorted(given & {"rounding_tolerance", "zero_is_no_fix"}):
        yield _doubt(f"{key!r} is no longer a setting, and will be an unknown key: remove the line")


def log_findings(
    logs: Sequence[sensing.LogFile],
    places: NDArray[np.float64],
    site: sensing.Site | None,
    now_s: float,
    track: sensing.Track | None = None,
    reading: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[FileFinding]:
    """Format, records, dates, tubes and place of the logs of one probe.

    :param logs: the logs, one at least
    :param places: latitude and longitude of the records, shape (n, 2) [deg], see :func:`log_positions`
    :param now_s: the present [s since 1970-01-01 UTC]
    :param track: positions of a separate receiver, if there are any
    :param reading: how the logs were read, see :func:`.reading_of`
    """
    records = [record for log in logs for record in log.records]
    lost = sum(log.records_lost for log in logs)
    repeated = len(records) - len({(one.stamp_s, one.record_number, str(one.tube_counts)) for one in records})
    extra = "".join(f", {number} {what}" for number, what in ((lost, "lost"), (repeated, "repeated")) if number)
    yield FileFinding("log", f"{logs[0].logger.title}: {len(records)} records{extra}")
    for key, text in reading.items():
        yield FileFinding(key, text)
    if not records:
        return
    for record in records[:PREVIEW]:
        yield FileFinding("record", record_text(record))
    stamps_s = np.array([record.stamp_s for record in records])
    first_s, last_s = float(stamps_s.min()), float(stamps_s.max())
    steps_s = np.diff(np.unique(stamps_s))
    period_s = float(np.median(steps_s)) if len(steps_s) else logs[0].period_s
    every = f", a record every {period_s:g} s" if math.isfinite(period_s) else ""
    yield FileFinding("time", f"{_date(first_s)} to {_date(last_s)} UTC ({duration(last_s - first_s)}){every}")
    if first_s < EARLIEST_STAMP_S or last_s > now_s + MAX_AHEAD_S:
        when = "in the future" if last_s > now_s + MAX_AHEAD_S else "before 2000"
        yield _doubt(f"records are dated {when}: check the clock of the logger and the order of day and month")
    for problem in sensing.log_doubts(logs):
        yield _doubt(f"{problem.mistake.message}: {problem.mistake.remedy}")
    yield from _fault_findings(logs)
    yield from _tube_findings(logs)
    for finding in sensing.unlikely_weather(records):
        yield _doubt(f"{finding.message}: {finding.remedy}")
    if len(places):
        latitude, longitude = np.median(places, axis=0).tolist()
        of = f" of {len(records)}" if len(places) < len(records) else ""
        yield FileFinding("place", f"{len(places)}{of} records at {coordinates_text(latitude, longitude)}")
        if of and track is not None:
            missing = len(records) - len(places)
            yield _doubt(f"the receiver has no position at the time of {missing} records: {track.heard.span}")
    elif track is None:
        yield _doubt(
            "no record has a position: give --nmea, or the location of a stationary probe in the site file"
        )
    if site is not None:
        yield from _moisture_findings(logs, site)


def position_findings(
    logs: Sequence[sensing.LogFile],
    track: sensing.Track | None,
    problems: Sequence[sensing.Problem],
    site: sensing.Site,
) -> Iterator[FileFinding]:
    """Doubts about positions of a separate receiver, if there are any, and what was assumed for them."""
    records = [record for log in logs for record in log.records]
    if track is not None and records:
        if (why := sensing.why_unplaced(records, track, site.logger_clock is not None)) is not None:
            yield _doubt(f"{why.message}; {why.remedy}")
        elif track.heard.without:
            yield FileFinding("positions", track.heard.gaps)
    yield from map(_doubt, position_notes(problems, track))


def position_notes(problems: Sequence[sensing.Problem], track: sensing.Track | None) -> list[str]:
    """Choices and assumptions about positions, and positions that are not from satellites, as sentences."""
    said = [str(one) for one in problems if not one.lost and one.kind in _NOTED]
    if track is not None and track.heard.odd:
        said.append(f"Of the positions, {track.heard.odd}")
    return list(dict.fromkeys(said))


def record_text(record: sensing.LoggerRecord) -> str:
    """A record as it was understood, with units."""
    counts = ", ".join("none" if math.isnan(count) else f"{count:.0f}" for count in record.tube_counts)
    live_s = max((live for live in record.tube_live_s if live > 0), default=math.nan)
    parts = [
        f"{datetime.fromtimestamp(record.stamp_s, UTC):%Y-%m-%d %H:%M:%S} UTC", f"{counts} counts in {live_s:g} s",
        *([f"{record.pressure_hpa:.1f} hPa"] if math.isfinite(record.pressure_hpa) else ["no pressure"]),
        *([f"{record.temperature_degc:.1f} degC"] if math.isfinite(record.temperature_degc) else []),
        *([f"{record.relative_humidity:.0%}"] if math.isfinite(record.relative_humidity) else []),
    ]  # fmt: skip
    if record.position is not None:
        parts.append(f"{record.position.latitude_deg:.5f}, {record.position.longitude_deg:.5f}")
    return f"line {record.line}: {'; '.join(parts)}"


def _fault_findings(logs: Sequence[sensing.LogFile]) -> Iterator[FileFinding]:
    """Faults of the lines that need an eye, with the number and the first of each kind."""
    faults = [
        problem
        for log in logs
        for problem in log.problems
        if problem.severity is not sensing.Severity.NOTE
        and problem.kind is not sensing.Kind.CLOCK_OFFSET  # taken off in files
    ]
    counts = Counter(problem.kind for problem in faults)
    rounded = [problem for log in logs for problem in log.problems if problem.kind is sensing.Kind.ROUNDED_COUNT]
    if 2 * len(rounded) > sum(len(log.records) for log in logs):
        counts[sensing.Kind.ROUNDED_COUNT], faults = len(rounded), faults + rounded[:1]
    for kind, count in counts.most_common(MAX_FAULTS):
        first = next(problem for problem in faults if problem.kind is kind)
        yield _doubt(f"{kind.text} ({count}), the first: {replace(first.mistake, path=None)}")


def _tube_findings(logs: Sequence[sensing.LogFile]) -> Iterator[FileFinding]:
    """Mean count rate of each tube."""
    records = [record for log in logs for record in log.records]
    if len({len(record.tube_counts) for record in records}) != 1:
        yield _doubt("the logs have different numbers of tubes: they are of different probes")
        return
    counts = np.nansum([record.tube_counts for record in records], axis=0)
    live_s = np.nansum([record.tube_live_s for record in records], axis=0)
    rates = np.divide(counts, live_s, out=np.full(len(counts), np.nan), where=live_s > 0)
    texts = ", ".join("none" if math.isnan(rate) else f"{rate:.2f}" for rate in rates)
    yield FileFinding("tubes", f"{len(rates)}, counting {texts} counts/s")
    left_out = [number in log.left_out_counts for log in logs[:1] for number in log.tubes] or [False] * len(rates)
    usual = WEAK_TUBE * np.nanmean(rates)
    tubes = enumerate(zip(rates, left_out, strict=True), 1)
    weak = [str(number) for number, (rate, left) in tubes if not left and not rate >= usual]
    if weak:
        yield _doubt(f"tube {', '.join(weak)} counts much less than the others: is it connected?")


def _moisture_findings(logs: Sequence[sensing.LogFile], site: sensing.Site) -> Iterator[FileFinding]:
    """The mean corrected rate, and the moisture that the calibration makes of it."""
    try:
        counted = sensing.calibration_counts(logs, site)
    except SoilmoistError as error:
        yield _doubt(f"the counts cannot be corrected: {error}")
        return
    if counted.left_out:
        yield _doubt(
            f"{counted.left_out} records are quarantined or cannot be corrected: soilmoist map lists them. Most "
            f"often: {counted.reason or 'no reason is known'}"
        )
    yield FileFinding("factors", counted.factors_text)
    yield from map(_doubt, counted.doubts(site))
    rate_cps, curve = counted.rate_cps, site.curve
    if curve is None:
        yield FileFinding("rate", f"mean {rate_cps:.3f} counts/s, corrected")
        return
    vwc, limits = float(curve.vwc(rate_cps)), sensing.soil_limits(curve.bulk_density_gcm3)
    moisture = f"{vwc:.3f} m3/m3" if math.isfinite(vwc) else "no moisture"
    yield FileFinding(
        "rate", f"mean {rate_cps:.3f} counts/s, corrected: {moisture} by the calibration of the site"
    )
    if not limits.dryness <= vwc <= limits.saturation:
        yield _doubt(
            f"no soil with pores of {limits.saturation:.2f} has this rate: check N0 "
            f"({curve.n0_cps:g} counts/s) and whether it is of this probe"
        )
        if doubt := sensing.n0_in_other_time(rate_cps, curve):
            yield _doubt(doubt)


def contradictions(
    field: Field | None, site: sensing.Site | None, places: NDArray[np.float64], source: PositionSource
) -> Iterator[Mistake | FileFinding]:
    """Contradictions between files that are given together: mistakes, and findings for the user.

    :param places: latitude and longitude of the records, shape (n, 2) [deg]; empty without a log
    """
    location = site.location if site else None
    checked, about = places, source
    if not len(places):
        checked = np.array([(location.latitude_deg, location.longitude_deg)] if location else []).reshape(-1, 2)
        about = replace(source, subject="the probe lies")
    if field is not None:
        try:
            reach_m = max(field.extent_m, site.footprint_radius_m if site else 0.0)
            placement = require_near(field, checked, reach_m, about)
        except InputError as error:
            yield from error.mistakes
        else:
            if placement is not None and len(places):
                inside, count = placement.inside, len(placement.latlon)
                yield FileFinding("together", f"{inside} of {count} records lie inside the field {field.name!r}")
                if 2 * inside < count:
                    yield _doubt(f"only {inside} of {count} records lie inside: is it the right field?")
    if site is not None:
        yield from far_from_site(site, places, source)


def far_from_site(site: sensing.Site, places: NDArray[np.float64], source: PositionSource) -> tuple[Mistake, ...]:
    """The contradiction between the place of a site and records that all lie elsewhere; empty if there is none."""
    if site.location is None:
        return ()
    frame = LocalFrame(site.location.latitude_deg, site.location.longitude_deg)
    target = f"the place of the site {site.name!r}"
    about = replace(source, field_file=None, target=target, target_keys="'location' in the site file")
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    try:
        require_near(Field(target, frame, square), places, MAX_FROM_SITE_M, about)
    except InputError as error:
        return error.mistakes
    return ()


def _date(stamp_s: float) -> str:
    try:
        return f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d %H:%M}"
    except (ValueError, OverflowError, OSError):
        return f"{stamp_s:g} s after 1970"
