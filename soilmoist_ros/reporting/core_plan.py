# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil cores after a survey: the places where they lower the uncertainty of the level most, and N0 from them.

The map knows the pattern, the level (log N0) is common to all places. A core at a place compares the moisture
there with the rate of the map there::

    log rate = log N0 + log f(moisture, density) + error of the map + error of the core

The error of the map is that of kriging, correlated between places. The error of the core is that of one profile as
a mean of its surroundings, :data:`PROFILE_SD`, through the slope of the curve.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros import sensing
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import PoissonKriging, Variogram, level_of
from soilmoist_ros.pipeline import is_illustrative
from soilmoist_ros.reporting.exports.source import RunSource
from soilmoist_ros.reporting.page.statistics import MAX_UNUSABLE

Array = NDArray[np.float64]
N0_SD = math.hypot(sensing.GENERAL_SD, sensing.SCALING_SD, sensing.GIVEN_SD)
"""Standard deviation of log N0 where the run knows none: that of the general calibration of a given sensor."""
MAX_CANDIDATES, MAX_SAMPLES = 600, 2000
"""Number of cells, about, among which places are chosen, every second or third ... of larger maps; and of samples
up to which errors of the map are correlated between places."""
SHIELDED_M = 10.0
"""Radius of the footprint where the run does not know it, as in :class:`soilmoist_ros.sensing.Site` [m]."""
DRIEST = 0.01
"""Moisture below which no place is expected to be, for the slope of the curve [m^3/m^3]."""
LAYERS_CM = (0, 5, 10, 20, 30, 40, 50)
"""Ends of the cores of a profile; an auger rarely gets deeper, and what is deeper weighs little."""
SHEET_COLUMNS = (
    *("profile", "latitude_deg", "longitude_deg", "date"),
    *("top_cm", "bottom_cm", "gravimetric_water", "bulk_density_gcm3"),
)
"""Columns of the sheet, all read by :func:`soilmoist_ros.sensing.read_soil_cores`."""


class CorePlace(NamedTuple):
    """A place for cores.

    :param xy_m: east and north of the field's datum [m]
    :param vwc: expected moisture [m^3/m^3]
    :param vwc_sd: standard deviation of the map there, without the level [m^3/m^3]
    :param layers_cm: upper and lower end of each core
    :param level_sd: standard deviation of log N0 after this place and those before it; ``level_vwc_sd`` its effect
    """

    number: int
    xy_m: tuple[float, float]
    latitude_deg: float
    longitude_deg: float
    vwc: float
    vwc_sd: float
    layers_cm: tuple[tuple[int, int], ...]
    level_sd: float
    level_vwc_sd: float


@dataclass(frozen=True)
class CorePlan:
    """Places for cores, most useful first.

    :param prior_sd: standard deviation of log N0 before the cores; ``prior_vwc_sd`` its effect [m^3/m^3]
    :param spacing_m: least distance between two places; ``edge_m`` from the edge of the field and no-go areas
    """

    places: tuple[CorePlace, ...]
    prior_sd: float
    prior_vwc_sd: float
    spacing_m: float
    edge_m: float
    notes: tuple[str, ...] = ()


class LevelModel(NamedTuple):
    """Evidence about the level in one core at each of n candidates; all errors are normal.

    :param map_covariance: covariance of the errors of the logarithm of the map's rate, shape (n, n)
    :param core_variance: variance of log N0 from the core alone, shape (n,)
    :param prior_sd: standard deviation of log N0 before the cores
    """

    map_covariance: Array
    core_variance: Array
    prior_sd: float


def choose_places(
    model: LevelModel, xy_m: Array, vwc: Array, count: int, spacing_m: float, free: NDArray[np.bool_] | None = None
) -> tuple[list[int], list[float]]:
    """Places that lower the variance of the level most, one after the other: a greedy design.

    Of two and more places, one is of the driest and one of the moistest third of the candidates: cores in one
    moisture only do not show a wrong curve.

    :param xy_m: candidates, shape (n, 2) [m]; ``vwc`` their expected moisture, shape (n,) [m^3/m^3]
    :param spacing_m: least distance between two places
    :param free: candidates that may be chosen, at least one, shape (n,); all by default
    :returns: indices, fewer than ``count`` where no more places are far enough apart; and the standard deviation
        of the level after each
    """
    free = np.ones(len(vwc), bool) if free is None else free
    low, high = np.quantile(vwc[free], [1 / 3, 2 / 3])
    missing = [vwc <= low, vwc >= high] if count > 1 else []
    # Of log N0, and of log N0 as the map shows it at each candidate.
    covariance = np.pad(model.map_covariance, (1, 0)) + model.prior_sd**2
    chosen, level_sd = list[int](), list[float]()
    while len(chosen) < count and free.any():
        wanted = free & np.logical_or.reduce(missing) if len(missing) >= count - len(chosen) else free
        allowed = wanted if wanted.any() else free
        gain = covariance[0, 1:] ** 2 / (np.diag(covariance)[1:] + model.core_variance)
        best = int(np.argmax(np.where(allowed, gain, -1.0)))
        row = covariance[best + 1]
        covariance = covariance - np.multiply.outer(row, row) / (row[best + 1] + model.core_variance[best])
        chosen.append(best)
        level_sd.append(math.sqrt(covariance[0, 0]))
        missing = [mask for mask in missing if not mask[best]]
        free = free & (np.hypot(*(xy_m - xy_m[best]).T) >= max(spacing_m, 1e-6))
    return chosen, level_sd


def plan_cores(source: RunSource, count: int) -> CorePlan:
    """Places where cores lower the uncertainty of the level of a map most.

    :param source: the run; its first property is used
    :raises InputError: if the map has no calibration curve, an impossible moisture on much of the area, or no cell
        where cores could be taken
    """
    one, about, notes = source.properties[0], source.run.summary, list[str]()
    curve, (inside, xy) = one.curve, one.cells
    if curve is None:
        remedy = "make it with a site file that has soil and a calibration, if only a general one"
        what = "the run has no calibration, so the moisture of no place is known"
        raise InputError(what, remedy, source.run.folder)
    limits, everywhere = sensing.soil_limits(curve.bulk_density_gcm3), curve.vwc(one.bands["rate"][inside])
    impossible = float(np.mean(~((everywhere >= limits.dryness) & (everywhere <= limits.saturation))))
    if impossible > MAX_UNUSABLE:
        what = f"the map has no possible moisture on {100 * impossible:.0f} % of its area, so no place is best"
        remedy = "check sensor_sensitivity or n0_cps and the soil in the site file, and make the map again"
        raise InputError(what, remedy, source.run.folder)
    stride = math.ceil(math.sqrt(len(xy) / MAX_CANDIDATES))
    kept = (np.array(np.nonzero(inside)) % stride == stride // 2).all(axis=0) & (one.bands["rate"][inside] > 0)
    rate, covariance = _rates_at(source, np.flatnonzero(kept), notes)
    vwc = np.nan_to_num(curve.vwc(rate), nan=limits.saturation)  # below the curve, as on the map
    xy, vwc = xy[kept], np.clip(vwc, DRIEST, limits.saturation)
    per_level = _per_level(curve, curve.rate_cps(vwc))
    known = curve.n0_sd_cps / curve.n0_cps
    if is_illustrative(about):
        notes.append("the calibration is a guess: so are the moistures, and any level that the pores allow may be")
        known = sensing.unknown_share(curve)
    if not known:
        notes.append(f"the error of N0 is not known: {100 * N0_SD:.1f} % is assumed, as between sites")
    model = LevelModel(covariance, (sensing.PROFILE_SD / per_level) ** 2, known or N0_SD)
    reach = ((about.get("map") or {}).get("sensed") or {}).get("radius_r86_m") or {}
    radius = float(reach.get("mean") or SHIELDED_M)
    if not reach.get("mean"):
        notes.append(f"the run has no reach of the probe: {radius:g} m are assumed, as of a shielded one")
    edge = float(sensing.Footprint.shielded(radius).rings(1)[0])  # half of the counts come from within
    spacing = max(radius, float((about.get("variogram") or {}).get("range_m") or 0))
    (chosen, level_sd), edge_m, spacing_m = _fit(model, source, xy, vwc, count, edge, spacing)
    for name, asked, found in (("edge of the field", edge, edge_m), ("next place", spacing, spacing_m)):
        if found < asked:
            what = f"too small to keep {asked:.0f} m from the {name}, by the probe's reach and the variogram"
            notes.append(f"the field is {what}: {found:.0f} m are kept")
    if len(chosen) < count:
        notes.append(f"the field has room for {len(chosen)} of {count} places")
    if count > 1 and np.ptp(vwc[chosen]) < 0.02:
        notes.append("the map hardly differs from place to place: the cores will not show an error of the curve")
    vwc_sd = np.minimum(per_level * np.sqrt(np.diag(covariance)), limits.saturation / 2)  # of any in the pores
    mean_rate = float(np.nanmean(one.bands["rate"]))

    def level_vwc_sd(sd: float, cores: int) -> float:
        """Error of the level with this one of log N0, and the density and bound water as after cores by mass."""
        weight, density = 1 - (sd / model.prior_sd) ** 2, curve.bulk_density_sd_gcm3
        known = replace(curve, n0_sd_cps=sd * curve.n0_cps)
        if cores:
            vwc = min(max(float(curve.vwc(mean_rate)), DRIEST), limits.saturation)
            per_water, per_density = curve.of_cores(vwc, weight, by_volume=0.0)
            known = replace(known, n0_per_bound_water=per_water, n0_per_density=per_density)
        if cores and density > 0:
            density = (density**-2 + cores * sensing.PROFILE_DENSITY_SD_GCM3**-2) ** -0.5
            known = replace(known, bulk_density_sd_gcm3=density)
        return level_of(known, mean_rate)[0]

    at = np.round(source.frame.to_geographic(xy[chosen]), 7).tolist()
    rows = zip(xy[chosen].tolist(), at, vwc[chosen].tolist(), vwc_sd[chosen].tolist(), level_sd, strict=True)
    places = tuple(
        CorePlace(number, (x, y), north, east, wet, sd, core_layers_cm(wet, curve), of, level_vwc_sd(of, number))
        for number, ((x, y), (north, east), wet, sd, of) in enumerate(rows, 1)
    )
    return CorePlan(places, model.prior_sd, level_vwc_sd(model.prior_sd, 0), spacing_m, edge_m, tuple(notes))


def core_layers_cm(vwc: float, curve: sensing.MoistureCurve) -> tuple[tuple[int, int], ...]:
    """Ends of the cores of a profile down to D86, above which 86 % of the counts come from at a moisture."""
    water = vwc + curve.bulk_density_gcm3 * (curve.lattice_water + curve.organic_water)
    reach = float(sensing.Footprint(water).depth_at_cm(0.0, curve.bulk_density_gcm3))
    return tuple(pair for pair in itertools.pairwise(LAYERS_CM) if pair[0] < reach)


def write_plan(plan: CorePlan, folder: Path, name: str) -> list[Path]:
    """Write ``cores.csv``, a sheet with a row for each core, and the places as waypoints, ``cores.gpx`` (GPX 1.1).

    :raises InputError: if one of the files is there: it may be filled in
    """
    rows = [",".join(SHEET_COLUMNS)]
    gpx = [
        "<?xml version='1.0' encoding='UTF-8'?>",
        '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="soilmoist_ros">',
        f"  <metadata><name>Soil cores of {escape(name)}</name></metadata>",
    ]
    for one in plan.places:
        place, (north, east) = f"core place {one.number}", (f"{at:.7f}" for at in one[2:4])
        rows += [f"{place},{north},{east},,{top},{bottom},," for top, bottom in one.layers_cm]
        layers = ", ".join(f"{top}-{bottom}" for top, bottom in one.layers_cm)
        about = f"<name>{place}</name><desc>cores of {layers} cm, {100 * one.vwc:.0f} % expected</desc>"
        gpx.append(f'  <wpt lat="{north}" lon="{east}">{about}</wpt>')
    contents = {folder / "cores.csv": rows, folder / "cores.gpx": [*gpx, "</gpx>"]}
    for file in contents:
        if file.exists():
            raise InputError("is there already, and may be filled in", "choose another --out", file)
    folder.mkdir(parents=True, exist_ok=True)
    for file, lines in contents.items():
        file.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return list(contents)


@dataclass(frozen=True)
class LevelOfPlaces:
    """N0 from cores at places of a map.

    :param estimate: N0; its part from counting is that of the map's errors at the places
    :param vwc: mean moisture of the cores, weighed as in the estimate [m^3/m^3]; ``rate_cps`` that of the map
    :param mean_rate_cps: mean rate of the whole map [counts/s], at which its level is
    :param spread: standard deviation of cores minus map relative to the expected one; above 1 it is in the error
    """

    estimate: sensing.N0Estimate
    vwc: float
    vwc_sd: float
    rate_cps: float
    mean_rate_cps: float
    places: int
    spread: float
    notes: tuple[str, ...] = ()


def n0_at_places(
    source: RunSource,
    cores: Sequence[sensing.SoilCore],
    unit_curve: sensing.MoistureCurve,
    weighting: sensing.Weighting,
    air: sensing.Footprint,
) -> LevelOfPlaces:
    """N0 from cores and the rates of a map at their places, by generalised least squares.

    The moisture is fitted, not the rate: the error of a core is in the moisture, where it has no bias.

    :param unit_curve: curve of the site with an N0 of 1 count/s
    :param air: conditions of the depth weights; its water is not used
    :raises InputError: if a core has no place, or lies outside the map; a ValueError if no N0 fits
    """
    from scipy.spatial import cKDTree

    groups = sensing.profiles_of(cores)
    lost = [group[0].profile or "without a name" for group in groups if math.isnan(group[0].latitude_deg)]
    if lost:
        remedy = "fill in latitude_deg and longitude_deg, or calibrate with --log instead of --run"
        raise InputError(f"cores have no place: profile {', '.join(lost[:5])}", remedy)
    places: dict[tuple[float, float], list[sensing.SoilCore]] = {}
    for group in groups:
        places.setdefault((round(group[0].latitude_deg, 6), round(group[0].longitude_deg, 6)), []).extend(group)
    counts = {at: len(sensing.profiles_of(found)) for at, found in places.items()}
    alike = [f"{count} profiles have the same coordinates {at}" for at, count in counts.items() if count > 1]
    notes = tuple(f"{text}: they count as one place" for text in alike)
    one = source.properties[0]
    distance, nearest = cKDTree(one.cells[1]).query(source.frame.to_local(*np.array(list(places)).T))
    for group, away in zip(places.values(), distance.tolist(), strict=True):
        if not away <= 1.5 * one.cell_m:
            what = f"the cores of profile {group[0].profile} lie {away:.0f} m outside the map"
            raise InputError(what, "check latitude_deg and longitude_deg, or give the run of this field")
    rate, covariance = _rates_at(source, nearest, [])
    bound, density = unit_curve.lattice_water + unit_curve.organic_water, unit_curve.bulk_density_gcm3
    vwc = np.array([sensing.mean_of_cores(group, weighting, air, bound, density).vwc for group in places.values()])
    level, variance, weights, excess = fit_level(vwc, rate, covariance, unit_curve)
    of_map = math.sqrt(max(float(weights @ covariance @ weights), 0.0))
    n0, total = math.exp(level), math.sqrt(variance) * max(1.0, excess)
    of_cores = math.sqrt(max(total**2 - of_map**2, 0.0))
    mean, mean_rate = np.average([vwc, rate], axis=1, weights=weights).tolist()
    vwc_sd = of_cores * float(_per_level(unit_curve, unit_curve.rate_cps(mean)))
    estimate = sensing.N0Estimate(n0, n0 * total, n0 * of_map, n0 * of_cores)
    everywhere = float(np.nanmean(one.bands["rate"]))
    return LevelOfPlaces(estimate, mean, vwc_sd, mean_rate, everywhere, len(places), excess, notes)


def fit_level(
    vwc: Array, rate: Array, covariance: Array, unit_curve: sensing.MoistureCurve
) -> tuple[float, float, Array, float]:
    """Log N0 of moistures and rates at places, by Gauss-Newton steps.

    :param covariance: covariance of the errors of log rate, shape (n, n)
    :returns: log N0, its variance, the weights of the places, and the standard deviation of the residuals relative
        to the expected one (1 for one place, where nothing shows it)
    :raises ValueError: if no N0 fits
    """
    level = float(np.median(np.log(rate) - np.log(unit_curve.rate_cps(np.maximum(vwc, DRIEST)))))
    for _ in range(50):
        curve = replace(unit_curve, n0_cps=math.exp(level))
        slope, residual = _per_level(curve, rate), vwc - curve.vwc(rate)
        if not np.isfinite(residual).all():
            raise ValueError("a rate of the map is below the curve: the cores and the map contradict each other")
        expected = np.eye(len(vwc)) * sensing.PROFILE_SD**2 + np.multiply.outer(slope, slope) * covariance
        of_moisture = np.linalg.solve(expected, slope)
        variance = 1 / float(slope @ of_moisture)
        step = variance * float(of_moisture @ residual)
        level += max(-0.1, min(step, 0.1))
        if abs(step) < 1e-10:
            break
    chi2 = float(residual @ np.linalg.solve(expected, residual))
    excess = math.sqrt(chi2 / (len(vwc) - 1)) if len(vwc) > 1 else 1.0
    return level, variance, variance * of_moisture * slope, excess


def _per_level(curve: sensing.MoistureCurve, rate: Array) -> Array:
    """d(vwc)/d(log N0) at a rate [m^3/m^3]: rate and N0 act by their ratio."""
    return np.asarray(-curve.slope(rate) * rate)


def _rates_at(source: RunSource, cells: NDArray[np.intp], notes: list[str]) -> tuple[Array, Array]:
    """Rates of the map at cells, and the covariance of their relative errors: the standard deviations are those of
    the map, their correlation is that of kriging by its samples and its variogram.
    """
    one, about = source.properties[0], source.run.summary.get("variogram")
    inside, xy = one.cells
    rate, sd = (np.asarray(one.bands[band][inside][cells], float) for band in ("rate", "rate_sd"))
    correlation = np.eye(len(cells))
    counts = one.samples.get("raw_counts", np.empty(0))
    if about and 0 < len(counts) <= MAX_SAMPLES:
        names = {"model", "range_m", "anisotropy", "angle_deg"} & about.keys()
        known = {name: about[name] for name in names if about[name] is not None}
        kriging = PoissonKriging(Variogram(nugget=about["nugget_cps2"], sill=about["sill_cps2"], **known))
        places = source.frame.to_local(one.samples["latitude_deg"], one.samples["longitude_deg"])
        kriging.fit(places, counts, one.samples["effective_exposure_s"])
        errors = kriging.covariance(xy[cells])
        own = np.sqrt(np.diag(errors) + about["nugget_cps2"])
        correlation = errors / np.multiply.outer(own, own)
        np.fill_diagonal(correlation, 1.0)
    else:
        notes.append("the errors of the map are taken as independent between places")
    return rate, np.multiply.outer(sd / rate, sd / rate) * correlation


def _fit(
    model: LevelModel, source: RunSource, xy: Array, vwc: Array, count: int, edge_m: float, spacing_m: float
) -> tuple[tuple[list[int], list[float]], float, float]:
    """Places with the wanted distances, or the largest share of them for which the field has room."""
    from shapely import boundary, distance, intersects_xy, points, union_all

    area = source.boundary.difference(union_all(list(source.no_go)))
    to_edge = np.where(intersects_xy(area, *xy.T), distance(points(xy), boundary(area)), -1.0)
    for share in (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.0):
        free = to_edge >= share * edge_m
        found = choose_places(model, xy, vwc, count, share * spacing_m, free) if free.any() else ([], [])
        if len(found[0]) == count or (share == 0 and found[0]):
            return found, share * edge_m, share * spacing_m
    raise InputError("has no cell where cores could be taken", "check field and no-go areas", source.run.folder)
