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

import csv
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.pipeline import is_illustrative
from soilmoist_ros.reporting.exports.source import ExportedProperty, RunSource
from soilmoist_ros.reporting.page.statistics import MAX_UNUSABLE
from soilmoist_ros.sensing import (
    GENERAL_SD,
    PROFILE_SD,
    Footprint,
    MoistureCurve,
    N0Estimate,
    SoilCore,
    Weighting,
    mean_of_cores,
    profiles_of,
    soil_limits,
)

Array = NDArray[np.float64]
DENSITY_SD_GCM3 = 0.12
"""Standard deviation of the bulk density, prior and of one profile, where the run knows none [g/cm^3]."""
SHAPE_SHARE = 0.25
"""Worth of a share of the density's variance relative to that of the level's: the level comes first."""
MAX_CANDIDATES = 600
"""Number of cells among which places are chosen; of larger maps every second, third ... cell is a candidate."""
MAX_SAMPLES = 2000
"""Number of samples up to which errors of the map are correlated between places; beyond, they are independent."""
SHIELDED_M = 10.0
"""Radius of the footprint where the run does not know it, as in :class:`soilmoist_ros.sensing.Site` [m]."""
_ANY_AIR = Footprint(0.2)
DRIEST = 0.01
"""Moisture below which no place is expected to be, for the slope of the curve [m^3/m^3]."""
SHEET_COLUMNS = (
    "profile", "latitude_deg", "longitude_deg", "date", "top_cm", "bottom_cm", "gravimetric_water",
    "bulk_density_gcm3",
)  # fmt: skip
"""Columns of the sheet, all read by :func:`soilmoist_ros.sensing.read_soil_cores`."""


class CorePlace(NamedTuple):
    """A place for cores.

    :param xy_m: east and north of the field's datum [m]
    :param vwc: expected moisture [m^3/m^3]
    :param vwc_sd: standard deviation of the map there, without the level [m^3/m^3]
    :param layers_cm: upper and lower end of each core
    :param level_sd: standard deviation of log N0 after this place and those before it
    :param level_vwc_sd: its effect on the mean moisture of the field [m^3/m^3]
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
    :param spacing_m: least distance between two places
    :param edge_m: least distance from the edge of the field and of no-go areas
    """

    places: tuple[CorePlace, ...]
    prior_sd: float
    prior_vwc_sd: float
    spacing_m: float
    edge_m: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LevelModel:
    """Linear Gaussian model of the evidence about the level in one core at each of n candidates.

    :param map_covariance: covariance of the errors of the logarithm of the map's rate, shape (n, n)
    :param core_variance: variance of log N0 from the core alone, shape (n,)
    :param density_effect: d(log N0)/d(bulk density) at the moisture of each candidate, shape (n,) [1/(g/cm^3)]
    :param prior_sd: standard deviation of log N0 before the cores
    :param density_sd: standard deviation of the bulk density before the cores [g/cm^3]
    """

    map_covariance: Array
    core_variance: Array
    density_effect: Array
    prior_sd: float
    density_sd: float = DENSITY_SD_GCM3

    def start(self) -> Array:
        """Prior covariance of log N0, the bulk density, and log N0 as the map shows it at each candidate."""
        effect, level, density = self.density_effect, self.prior_sd**2, self.density_sd**2
        seen = level + density * np.multiply.outer(effect, effect) + self.map_covariance
        common = np.array([[level, 0.0], [0.0, density]])
        across = np.vstack([np.full(len(effect), level), density * effect])
        return np.block([[common, across], [across.T, seen]])

    def gain(self, covariance: Array) -> Array:
        """Expected drop of the variance of the level and, by :data:`SHAPE_SHARE`, of the density, relative to both
        priors; shape (n,).
        """
        variance = np.diag(covariance)[2:] + self.core_variance
        level, density = covariance[0, 2:] ** 2 / self.prior_sd**2, covariance[1, 2:] ** 2 / self.density_sd**2
        return np.asarray((level + SHAPE_SHARE * density) / variance)

    def after(self, covariance: Array, candidate: int) -> Array:
        """Covariance after cores at a candidate; their density is weighed, too."""
        for row, noise in ((candidate + 2, self.core_variance[candidate]), (1, DENSITY_SD_GCM3**2)):
            gained = covariance[row]
            covariance = covariance - np.multiply.outer(gained, gained) / (gained[row] + noise)
        return covariance


def choose_places(
    model: LevelModel, xy_m: Array, vwc: Array, count: int, spacing_m: float
) -> tuple[list[int], list[float]]:
    """Places of the largest gain, one after the other: a greedy design.

    Of two and more places, one is of the driest and one of the moistest third of the candidates: cores in one
    moisture only do not show a wrong curve.

    :param xy_m: candidates, shape (n, 2) [m]
    :param vwc: expected moisture of the candidates, shape (n,) [m^3/m^3]
    :param spacing_m: least distance between two places
    :returns: indices, fewer than ``count`` where no more places are far enough apart; and the standard deviation
        of the level after each
    """
    low, high = np.quantile(vwc, [1 / 3, 2 / 3])
    missing = [vwc <= low, vwc >= high] if count > 1 else []
    covariance, free = model.start(), np.ones(len(vwc), bool)
    chosen: list[int] = []
    level_sd: list[float] = []
    while len(chosen) < count and free.any():
        allowed = free
        if len(missing) >= count - len(chosen):
            wanted = free & np.logical_or.reduce(missing)
            allowed = wanted if wanted.any() else free
        best = int(np.argmax(np.where(allowed, model.gain(covariance), -1.0)))
        covariance = model.after(covariance, best)
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
    one = source.properties[0]
    curve = _curve_of(one, source)
    limits = soil_limits(curve.bulk_density_gcm3)
    everywhere = curve.vwc(one.bands["rate"][one.cells[0]])
    impossible = float(np.mean(~((everywhere >= limits.dryness) & (everywhere <= limits.saturation))))
    if impossible > MAX_UNUSABLE:
        raise InputError(
            f"the map has no possible moisture on {100 * impossible:.0f} % of its area: it cannot tell where "
            "cores tell most",
            "check sensor_sensitivity or n0_cps and the soil in the site file, and make the map again",
            source.run.folder,
        )
    notes: list[str] = []
    _, xy, rate, covariance = _candidates(one, source, notes)
    vwc = np.clip(curve.vwc(rate), DRIEST, limits.saturation)
    vwc = np.where(np.isfinite(vwc), vwc, limits.saturation)  # below the curve, as on the map
    per_level = _per_level(curve, vwc)
    step = 1e-3
    effect = np.log(replace(curve, bulk_density_gcm3=curve.bulk_density_gcm3 + step).rate_cps(vwc))
    effect = (np.log(curve.rate_cps(vwc)) - effect) / step
    if is_illustrative(source.run.summary):
        notes.append(
            "the calibration is a guess: the moistures here are, too, and the level is less sure than said"
        )
    known = curve.n0_sd_cps / curve.n0_cps
    if not known:
        notes.append(f"the error of N0 is not known: {100 * GENERAL_SD:.1f} % is assumed, as between sites")
    model = LevelModel(
        covariance, (PROFILE_SD / per_level) ** 2, effect, known or GENERAL_SD,
        curve.bulk_density_sd_gcm3 or DENSITY_SD_GCM3,
    )  # fmt: skip
    radius = _radius(source)
    if radius is None:
        radius = SHIELDED_M
        notes.append(
            f"the run does not say how far the probe sees: {radius:g} m are assumed, as of a shielded probe"
        )
    edge, spacing = _core_radius(radius), max(radius, _range_of(source))
    places, edge_m, spacing_m = _fit(model, source, xy, vwc, count, edge, spacing)
    chosen, level_sd = places
    for name, wanted, found in (("edge of the field", edge, edge_m), ("next place", spacing, spacing_m)):
        if found < wanted:
            notes.append(
                f"the field is too small to keep {wanted:.0f} m from the {name}, as far as the probe sees and the "
                f"map is alike: {found:.0f} m are kept"
            )
    if len(chosen) < count:
        notes.append(f"the field has room for {len(chosen)} of {count} places")
    if count > 1 and np.ptp(vwc[chosen]) < 0.02:
        notes.append("the map hardly differs from place to place: the cores will not show an error of the curve")
    mean, widest = float(_per_level(curve, vwc).mean()), limits.saturation / 2  # of any distribution in the pores
    geographic = source.frame.to_geographic(xy[chosen])
    listed: list[CorePlace] = []
    for number, (index, sd, (latitude, longitude)) in enumerate(zip(chosen, level_sd, geographic, strict=True), 1):
        listed.append(
            CorePlace(
                number, (float(xy[index, 0]), float(xy[index, 1])), round(float(latitude), 7),
                round(float(longitude), 7), float(vwc[index]),
                min(float(per_level[index] * math.sqrt(covariance[index, index])), widest),
                core_layers_cm(float(vwc[index]), curve), sd, min(sd * mean, widest),
            )
        )  # fmt: skip
    return CorePlan(
        tuple(listed), model.prior_sd, min(model.prior_sd * mean, widest), spacing_m, edge_m, tuple(notes)
    )


def core_layers_cm(vwc: float, curve: MoistureCurve) -> tuple[tuple[int, int], ...]:
    """Ends of the cores of a profile [cm], down to the depth D86 above which 86 % of the counts come from.

    The layers are 5 cm thick to 10 cm, where most counts come from, and 10 cm thick below, to 50 cm at most:
    drier soil is seen deeper, but an auger rarely gets there, and what is deeper weighs little.

    :param vwc: moisture of the place [m^3/m^3]
    """
    water = vwc + curve.bulk_density_gcm3 * (curve.lattice_water + curve.organic_water)
    reach = float(Footprint(water).depth_at_cm(0.0, curve.bulk_density_gcm3))
    ends = [0, 5, 10, 20, 30, 40, 50]
    last = next((index for index, end in enumerate(ends) if end >= reach), len(ends) - 1)
    return tuple(itertools.pairwise(ends[: last + 1]))


# -- N0 from the filled sheet --------------------------------------------------------------------------------


@dataclass(frozen=True)
class LevelOfPlaces:
    """N0 from cores at places of a map.

    :param estimate: N0; its part from counting is that of the map's errors at the places
    :param vwc: mean moisture of the cores, weighed as in the estimate [m^3/m^3]; ``rate_cps`` that of the map
    :param spread: standard deviation of the differences between cores and map relative to the expected one [-];
        above 1 the estimate's error is larger by it; NaN for one place
    """

    estimate: N0Estimate
    vwc: float
    vwc_sd: float
    rate_cps: float
    places: int
    spread: float
    notes: tuple[str, ...] = field(default=())


def n0_at_places(
    source: RunSource,
    cores: Sequence[SoilCore],
    unit_curve: MoistureCurve,
    weighting: Weighting = "revised",
    air: Footprint = _ANY_AIR,
) -> LevelOfPlaces:
    """N0 from cores and the rates of a map at their places, by generalised least squares.

    The moisture is fitted, not the rate: the error of a core is in the moisture, where it has no bias.

    :param unit_curve: curve of the site with an N0 of 1 count/s
    :param air: conditions of the depth weights; its water is not used
    :raises InputError: if a core has no place, or lies outside the map
    :raises ValueError: if no N0 fits
    """
    groups = profiles_of(cores)
    lost = [group[0].profile or "without a name" for group in groups if math.isnan(group[0].latitude_deg)]
    if lost:
        remedy = "fill in latitude_deg and longitude_deg, or calibrate with --log instead of --run"
        raise InputError(f"cores have no place: profile {', '.join(lost[:5])}", remedy)
    places: dict[tuple[float, float], list[list[SoilCore]]] = {}
    for group in groups:
        places.setdefault((round(group[0].latitude_deg, 6), round(group[0].longitude_deg, 6)), []).append(group)
    notes = [
        f"{len(found)} profiles have the same coordinates ({at[0]}, {at[1]}): they count as one place"
        for at, found in places.items()
        if len(found) > 1
    ]
    one, groups = source.properties[0], [list(itertools.chain(*found)) for found in places.values()]
    xy = source.frame.to_local(*np.array([(g[0].latitude_deg, g[0].longitude_deg) for g in groups]).T)
    _, cells = one.cells
    distance = np.hypot(*np.moveaxis(xy[:, None] - cells[None], -1, 0))
    nearest = distance.argmin(axis=1)
    for group, index, row in zip(groups, nearest, distance, strict=True):
        if not row[index] <= 1.5 * one.cell_m:
            about = f"the cores of profile {group[0].profile} lie {row[index]:.0f} m outside the map"
            raise InputError(about, "check latitude_deg and longitude_deg, or give the run of this field")
    rate, covariance = _rates_at(one, source, nearest, [])
    bound, density = unit_curve.lattice_water + unit_curve.organic_water, unit_curve.bulk_density_gcm3
    vwc = np.array([mean_of_cores(group, weighting, air, bound, density).vwc for group in groups])
    level, variance, weights, excess = fit_level(vwc, rate, covariance, unit_curve)
    n0 = math.exp(level)
    share = weights / weights.sum()
    of_map = math.sqrt(max(float(weights @ covariance @ weights), 0.0))
    total = math.sqrt(variance) * max(1.0, excess)
    of_cores = math.sqrt(max(total**2 - of_map**2, 0.0))
    mean_vwc = float(share @ vwc)
    return LevelOfPlaces(
        N0Estimate(n0, n0 * total, n0 * of_map, n0 * of_cores), mean_vwc,
        of_cores * float(_per_level(unit_curve, np.array(mean_vwc))), float(share @ rate), len(groups), excess,
        tuple(notes),
    )  # fmt: skip


def fit_level(
    vwc: Array, rate: Array, covariance: Array, unit_curve: MoistureCurve
) -> tuple[float, float, Array, float]:
    """Log N0 of moistures and rates at places, by Gauss-Newton steps.

    :param covariance: covariance of the errors of log rate, shape (n, n)
    :returns: log N0, its variance, the weights of the places (their log N0 times these is the estimate), and the
        standard deviation of the residuals relative to the expected one (1 for one place, where nothing shows it)
    :raises ValueError: if no N0 fits
    """
    level = float(np.median(np.log(rate) - np.log(unit_curve.rate_cps(np.maximum(vwc, DRIEST)))))
    for _ in range(50):
        curve = replace(unit_curve, n0_cps=math.exp(level))
        slope = -curve.slope(rate) * rate  # d(vwc)/d(log N0): rate and N0 act by their ratio
        residual = vwc - curve.vwc(rate)
        if not np.isfinite(residual).all():
            raise ValueError("a rate of the map is below the curve: the cores and the map contradict each other")
        expected = np.eye(len(vwc)) * PROFILE_SD**2 + np.multiply.outer(slope, slope) * covariance
        of_moisture = np.linalg.solve(expected, slope)
        variance = 1 / float(slope @ of_moisture)
        step = variance * float(of_moisture @ residual)
        level += max(-0.1, min(step, 0.1))
        if abs(step) < 1e-10:
            break
    chi2 = float(residual @ np.linalg.solve(expected, residual))
    excess = math.sqrt(chi2 / (len(vwc) - 1)) if len(vwc) > 1 else 1.0
    return level, variance, np.asarray(variance * of_moisture * slope), excess


# -- Files -------------------------------------------------------------------------------------------------------


def sheet_csv(plan: CorePlan) -> str:
    """Sheet to fill in: one row for each core, in the columns :data:`SHEET_COLUMNS`."""
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(SHEET_COLUMNS)
    for place in plan.places:
        for top, bottom in place.layers_cm:
            at = f"{place.latitude_deg:.7f}", f"{place.longitude_deg:.7f}"
            table.writerow((f"core place {place.number}", *at, "", top, bottom, "", ""))
    return text.getvalue()


def waypoints_gpx(plan: CorePlan, name: str) -> str:
    """Places as waypoints in GPX 1.1."""
    root = ElementTree.Element(
        "gpx", {"xmlns": "http://www.topografix.com/GPX/1/1", "version": "1.1", "creator": "soilmoist_ros"}
    )
    ElementTree.SubElement(ElementTree.SubElement(root, "metadata"), "name").text = f"Soil cores of {name}"
    for place in plan.places:
        at = {"lat": f"{place.latitude_deg:.7f}", "lon": f"{place.longitude_deg:.7f}"}
        point = ElementTree.SubElement(root, "wpt", at)
        ElementTree.SubElement(point, "name").text = f"core place {place.number}"
        layers = ", ".join(f"{top}-{bottom}" for top, bottom in place.layers_cm)
        ElementTree.SubElement(point, "desc").text = f"cores of {layers} cm, {100 * place.vwc:.0f} % expected"
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def write_plan(plan: CorePlan, folder: Path, name: str) -> list[Path]:
    """Write ``cores.csv`` and ``cores.gpx`` into a folder.

    :returns: the files
    :raises InputError: if one is there: it may be filled in
    """
    contents = {"cores.csv": sheet_csv(plan), "cores.gpx": waypoints_gpx(plan, name)}
    for file in contents:
        if (folder / file).exists():
            raise InputError("is there already, and may be filled in", "choose another --out", folder / file)
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in contents.items():
        (folder / file).write_text(text, encoding="utf-8")
    return [folder / file for file in contents]


# -- The map -----------------------------------------------------------------------------------------------------


def _curve_of(one: ExportedProperty, source: RunSource) -> MoistureCurve:
    if one.curve is None:
        remedy = "make it with a site file that has soil and a calibration, if only a general one"
        raise InputError(
            "the run has no calibration, so the moisture of no place is known", remedy, source.run.folder
        )
    return one.curve


def _per_level(curve: MoistureCurve, vwc: Array) -> Array:
    """d(vwc)/d(log N0) at a moisture [m^3/m^3]."""
    rate = curve.rate_cps(vwc)
    return np.asarray(-curve.slope(rate) * rate)


def _candidates(
    one: ExportedProperty, source: RunSource, notes: list[str]
) -> tuple[NDArray[np.intp], Array, Array, Array]:
    """Cells that may get cores: their indices, places, rates, and the covariance of the errors of log rate."""
    inside, xy = one.cells
    rate = one.bands["rate"][inside]
    row, column = np.nonzero(inside)
    stride = 1
    while True:
        kept = np.flatnonzero((row % stride == stride // 2) & (column % stride == stride // 2) & (rate > 0))
        if len(kept) <= MAX_CANDIDATES:
            break
        stride += 1
    rates, covariance = _rates_at(one, source, kept, notes)
    return kept, xy[kept], rates, covariance


def _rates_at(
    one: ExportedProperty, source: RunSource, cells: NDArray[np.intp], notes: list[str]
) -> tuple[Array, Array]:
    """Rates of the map at cells, and the covariance of their relative errors: the standard deviations are those of
    the map, their correlation is that of kriging by its samples and its variogram.
    """
    inside, xy = one.cells
    rate, sd = (np.asarray(one.bands[band][inside][cells], float) for band in ("rate", "rate_sd"))
    correlation = np.eye(len(cells))
    about = source.run.summary.get("variogram")
    counts = one.samples.get("raw_counts", np.empty(0))
    if about and 0 < len(counts) <= MAX_SAMPLES:
        names = ("model", "range_m", "anisotropy", "angle_deg")
        known = {name: about[name] for name in names if about.get(name) is not None}
        variogram = Variogram(nugget=about["nugget_cps2"], sill=about["sill_cps2"], **known)
        places = source.frame.to_local(one.samples["latitude_deg"], one.samples["longitude_deg"])
        kriging = PoissonKriging(variogram)
        kriging.fit(places, counts, one.samples["effective_exposure_s"])
        errors = kriging.covariance(xy[cells])
        own = np.diag(errors) + variogram.nugget
        correlation = errors / np.sqrt(np.multiply.outer(own, own))
        np.fill_diagonal(correlation, 1.0)
    else:
        notes.append("the errors of the map are taken as independent between places")
    relative = sd / rate
    return rate, np.multiply.outer(relative, relative) * correlation


def _radius(source: RunSource) -> float | None:
    """Radius from within which 86 % of the counts come [m], mean over the map; ``None`` if it is unknown."""
    sensed = (source.run.summary.get("map") or {}).get("sensed") or {}
    mean = (sensed.get("radius_r86_m") or {}).get("mean")
    return float(mean) if mean else None


def _core_radius(radius_m: float) -> float:
    """Radius from within which half of the counts come [m]."""
    footprint = Footprint.shielded(radius_m)
    low, high = 0.0, radius_m
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (middle, high) if footprint.share(middle) < 0.5 else (low, middle)
    return high


def _range_of(source: RunSource) -> float:
    return float((source.run.summary.get("variogram") or {}).get("range_m") or 0.0)


def _fit(
    model: LevelModel, source: RunSource, xy: Array, vwc: Array, count: int, edge_m: float, spacing_m: float
) -> tuple[tuple[list[int], list[float]], float, float]:
    """Places with the wanted distances, or the largest share of them for which the field has room."""
    from shapely import boundary, distance, intersects_xy, points, union_all

    area = source.boundary.difference(union_all(list(source.no_go))) if source.no_go else source.boundary
    within = intersects_xy(area, xy[:, 0], xy[:, 1])
    to_edge = np.where(within, distance(points(xy), boundary(area)), -1.0)
    best: tuple[tuple[list[int], list[float]], float, float] = ([], []), 0.0, 0.0
    for edge, spacing in itertools.product((1.0, 0.5, 0.25, 0.0), (1.0, 0.8, 0.6, 0.45, 0.3, 0.2)):
        kept = np.flatnonzero(to_edge >= edge * edge_m)
        if not kept.size or len(best[0][0]) == count:
            continue
        part = replace(
            model, map_covariance=model.map_covariance[np.ix_(kept, kept)],
            core_variance=model.core_variance[kept], density_effect=model.density_effect[kept],
        )  # fmt: skip
        indices, level_sd = choose_places(part, xy[kept], vwc[kept], count, spacing * spacing_m)
        if len(indices) > len(best[0][0]):
            best = ([int(kept[index]) for index in indices], level_sd), edge * edge_m, spacing * spacing_m
    if not best[0][0]:
        raise InputError(
            "has no cell where cores could be taken", "check field and no-go areas", source.run.folder
        )
    return best
