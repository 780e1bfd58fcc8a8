# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Uncertainty budget of a map: the parts of its stated uncertainty, and what is not in it.

In the manner of the Guide to the Expression of Uncertainty in Measurement (GUM, JCGM 100:2008). Parts add up as
variances of the *rate*, where they are independent: errors of the calibration shift all places together (the
level), counting and interpolation those of a place. The sum of the level goes through the moisture curve, as JCGM
101:2008 asks where a model bends: its 90 % interval over twice 1.645. A part contributes the total times the root
of its share of the variance of the rate, so the squares of the contributions add up (GUM 5.1.2, 5.1.3).

A source that is not among the parts of the calibration is never added in silence: :attr:`Budget.beyond` says
whether it is corrected, and what may remain. N0 of soil cores was found with the same corrections, so their
constant errors cancel; only their change since the calibration remains. So do errors of bulk density and bound
water at the moisture of the cores, and what remains elsewhere is in the sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import duration
from soilmoist_ros.mapping import PoissonKriging, SoilMap, common_rate_sd, level_of, possible_moisture
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import absolute, calibration_of, once_a_run
from soilmoist_ros.reporting.one_place import at_one_place, moisture_of_all
from soilmoist_ros.sensing import UNKNOWN_SENSOR, MoistureCurve, UncertaintyPart, soil_limits

Array = NDArray[np.float64]

_ROUNDED = 1e-3
COUNTING, MAPPING, CHANGE, OTHER = "counting", "mapping", "change during the survey", "other parts of N0"
CORES, N0 = "calibration by soil cores", "N0"
DENSITY, WATER = "bulk density", "lattice and organic water"


class Influence(NamedTuple):
    """An influence on the rate, and the relative standard deviations that it has with and without correction."""

    name: str
    correction: str  # its row among the corrections of a run
    corrected: float
    open: float
    remains: str  # origin of ``corrected``
    missing: str  # origin of ``open``


SOURCES = (
    Influence("pressure", "air pressure", 0.008, 0.08, "barometer ±1 hPa", "weather of ±10 hPa"),
    Influence("humidity", "air humidity", 0.003, 0.016, "sensor ±0.5 g/m³", "weather of ±3 g/m³"),
    Influence(
        "intensity", "incoming neutrons", 0.005, 0.03, "a monitor of another place, within a day",
        "2010 to 2019 at Jungfraujoch; ±0.5 % within a day",
    ),
    Influence("biomass", "plants", 0.0045, 0.009, "±0.5 kg/m² of dry plants", "±1 kg/m² of dry plants"),
)  # fmt: skip
"""Assumed remainders, no measurements: usual accuracies and weather, times the coefficients of the corrections
(0.0077 per hPa, 0.0054 m^3/g, 0.009 m^2/kg). Intensity: standard deviation of the neutron monitor JUNG (NMDB,
six-hourly, January 2010 to February 2019), 3.0 % in all and 0.5 % within a day."""
_CORES_DAY, _MORE_CORES = "one day of soil cores (soilmoist calibrate)", "more soil cores, on another day"
REMEDIES = {
    MAPPING: "stops between those measured, above all where the map is least sure",
    CHANGE: "visits to some of the first stops at the end",
    **dict.fromkeys(("general N0", "site scaling", OTHER, N0), _CORES_DAY),
    **dict.fromkeys(("cores", CORES), _MORE_CORES),
    "sensitivity": "counting next to a calibrated station (soilmoist calibrate)",
    UNKNOWN_SENSOR: "the model of the sensor (--sensor MODEL, or sensor_sensitivity in the site file)",
    "intensity": "the file of a neutron monitor", "pressure": "a checked barometer",
    "humidity": "a checked sensor of the air humidity", "biomass": "weighed plants of a square metre",
    "road": "a way farther from the road, or its width and moisture", "snow": "a survey without snow",
    DENSITY: "weighed cores of known volume", WATER: "clay and organic carbon from a soil laboratory",
    "counting of the calibration": "longer counting during the calibration",
}  # fmt: skip
"""Remedies by the names of parts of the uncertainty; that of counting follows from the map."""


@dataclass(frozen=True)
class Part:
    """A part of the stated uncertainty.

    :param sd: standard uncertainty of the value, in its unit; NaN if it has none of its own
    :param distribution: ``Poisson``, ``normal``, or ``uniform`` for a range of ±1.73 ``sd`` (GUM 4.3.7)
    :param level_rate_cps: standard deviation of the rate that it makes at all places together [counts/s], and
        ``place_rate_cps`` at a place
    :param level: its contribution to the level, in the unit of the budget, and ``place`` to a place
    """

    name: str
    value: float
    unit: str
    sd: float
    distribution: str
    origin: str
    level_rate_cps: float = 0.0
    place_rate_cps: float = 0.0
    level: float = 0.0
    place: float = 0.0


class Beyond(NamedTuple):
    """A source of error that is not in the stated uncertainty, and whether a correction is applied.

    :param remainder: assumed standard deviation of the level that remains, in the unit of the budget, or NaN
    """

    name: str
    corrected: bool
    remainder: float
    remark: str


@dataclass(frozen=True)
class Budget:
    """Uncertainty budget of a map.

    :param unit: ``m3/m3``; of a map of rates ``share of the rate``
    :param rate_cps: mean rate of the map, at which the level is [counts/s]
    :param vwc: its moisture [m^3/m^3], NaN without a calibration
    :param level_sd: standard uncertainty that all places share; NaN without one
    :param level_p05: quantile 0.05 of this moisture by the calibration alone; ``level_p95`` quantile 0.95
    :param place_sd: standard uncertainty of a place against the level: the median of the map
    :param place_rate_cps: rate of the place that stands for it, and its kriging standard deviation [counts/s]
    :param largest: name of the largest part, and what would lower it; empty if there is none
    """

    unit: str
    rate_cps: float
    vwc: float
    level_sd: float
    level_p05: float
    level_p95: float
    place_sd: float
    place_rate_cps: float
    place_rate_sd_cps: float
    parts: tuple[Part, ...]
    beyond: tuple[Beyond, ...]
    largest: str
    remedy: str
    text: str


@once_a_run
def make_budget(run: MapRun) -> Budget | None:
    """Uncertainty budget of the map of a run; ``None`` if no cell has a value."""
    soil_map, curve = run.soil_map, run.soil_map.curve
    if at_one_place(run):
        mean, place, here, parts = _at_one_place(run)
    else:
        spread = soil_map.rate_sd if curve is None else soil_map.vwc_sd
        known = np.argwhere(np.isfinite(spread) & np.isfinite(soil_map.rate))
        if not len(known):
            return None
        values = spread[tuple(known.T)]
        mean, place = float(np.nanmean(soil_map.rate)), float(np.median(values))
        row, column = known[np.argmin(np.abs(values - place))]
        xy = np.array([[soil_map.grid.x_m[column], soil_map.grid.y_m[row]]])
        here = float(soil_map.rate[row, column]), float(soil_map.variance[row, column])
        place /= mean if curve is None else 1
        parts = _of_place(soil_map, xy, here[1], place)
    remedies = {COUNTING: _counting_remedy(soil_map, parts, place), **REMEDIES}
    level, low, high, vwc = (math.nan,) * 4
    if curve is not None:
        vwc = float(possible_moisture(curve, mean))
    bounded = absolute(run) or calibration_of(run) == UNKNOWN_SENSOR
    known_level = bounded and 0 < vwc < soil_limits(curve.bulk_density_gcm3).saturation if curve else False
    if curve is not None and known_level:
        level, low, high, of_level = level_parts(run, curve, mean)
        parts = [*parts, *of_level]
    size, largest = max(((max(part.level, part.place), part.name) for part in parts), default=(0.0, ""))
    largest = N0 if curve is not None and not known_level else largest if size > 0 else ""  # a guess beats all
    return Budget(
        "share of the rate" if curve is None else "m3/m3", mean, vwc, level, low, high, place, here[0],
        math.sqrt(here[1]), tuple(parts), tuple(_beyond(run, mean)), largest, remedies.get(largest, ""),
        _text(run, known_level, level, place),
    )  # fmt: skip


def level_remedy(run: MapRun) -> str:
    """Remedy for the largest part of the level of a map."""
    found = make_budget(run)
    parts = [part for part in found.parts if part.level > 0] if found else []
    return REMEDIES[max(parts, key=lambda part: part.level).name] if parts else _CORES_DAY


def place_remedy(run: MapRun) -> str:
    """Remedy for the largest part of the uncertainty of a place, as an order."""
    found = make_budget(run)
    parts = {part.name: part.place for part in found.parts} if found else {}
    return "count longer" if parts.get(COUNTING, 0.0) >= parts.get(MAPPING, 0.0) else "count at more places"


def _at_one_place(run: MapRun) -> tuple[float, float, tuple[float, float], list[Part]]:
    """Rate, uncertainty, rate and variance, and the only part of all counts at one place."""
    bands = moisture_of_all(run.track, run.soil_map.curve)
    rate, sd, counts = float(bands.rate), float(bands.rate_sd), float(sum(one.raw_counts for one in run.track))
    place = sd / max(rate, sd) if run.soil_map.curve is None else float(bands.vwc_sd)
    part = Part(COUNTING, counts, "counts", math.sqrt(counts), "Poisson", "measured", 0.0, sd, 0.0, place)
    return rate, place, (rate, sd**2), [part]


def _of_place(soil_map: SoilMap, xy: Array, variance: float, total: float) -> list[Part]:
    """Parts of the kriging variance at a place, scaled to its total."""
    samples, kriging = soil_map.samples, _kriging(soil_map)
    split = {COUNTING: 0.0, CHANGE: 0.0}
    if kriging is not None:
        own = float(kriging.predict(xy)[1][0])
        scale = variance / own if own > 0 else 0.0
        split[COUNTING] = min(scale * float(kriging.counting_variance(xy)[0]), variance)
        split[CHANGE] = min(scale * float((kriging.shared(xy) ** 2).sum()), variance - split[COUNTING])
    split[MAPPING] = variance - sum(split.values())
    counts = float(np.median(samples.counts)) if len(samples) else 0.0
    about: dict[str, tuple[float, str, float, str, str]] = {
        COUNTING: (counts, "counts", math.sqrt(counts), "Poisson", "measured"),
        MAPPING: (float(len(samples)), "places", math.nan, "normal", "measured"),
        CHANGE: (math.nan, "", math.nan, "normal", "measured"),
    }
    sds = {name: math.sqrt(split[name]) for name in about if split[name] > 0 or (name != CHANGE and variance > 0)}
    return [Part(name, *about[name], 0.0, sd, 0.0, total * sd / math.sqrt(variance)) for name, sd in sds.items()]


def _kriging(soil_map: SoilMap) -> PoissonKriging | None:
    """The kriging of a map, that knows its weights; ``None`` if it is singular."""
    try:
        return soil_map.kriging
    except np.linalg.LinAlgError:
        return None


def level_parts(run: MapRun, curve: MoistureCurve, rate: float) -> tuple[float, float, float, list[Part]]:
    """Standard uncertainty and 90 % interval of the level at a rate, and its parts."""
    at, known = np.array([rate]), run.calibration
    level, low, high = level_of(curve, rate)
    common = common_rate_sd(curve, at)
    if common is None or math.isnan(level):
        return math.nan, math.nan, math.nan, []
    total = float(common[0])

    def alone(name: str) -> float:
        """Effect of one standard deviation of the curve alone [counts/s]."""
        none = dict.fromkeys(("n0_sd_cps", "bulk_density_sd_gcm3", "bound_water_sd"), 0.0)
        found = common_rate_sd(replace(curve, **{**none, name: getattr(curve, name)}), at)
        return 0.0 if found is None else float(found[0])

    of_n0, told = alone("n0_sd_cps"), known.parts if known else ()
    shares = [part for part in told if part.share > 0]
    summed = math.sqrt(sum(part.share**2 for part in shares)) * rate
    # A calibration states its total rounded; of a combined one the parts are those before the combination.
    scale = 0.0 if not shares else of_n0 / summed if summed > (1 - _ROUNDED) * of_n0 else 1.0
    parts = [_told(part, scale * part.share * rate) for part in shares]
    rest = math.sqrt(max(of_n0**2 - (scale * summed) ** 2, 0.0))
    if rest > 1e-6 * total:
        cores = known is not None and known.method == "cores"
        name = OTHER if shares else CORES if cores else N0
        parts.append(Part(name, curve.n0_cps, "counts/s", curve.n0_cps * rest / rate, "normal", "given", rest))
    water = curve.lattice_water + curve.organic_water
    for name, value, unit, sd, made in (
        (DENSITY, curve.bulk_density_gcm3, "g/cm3", curve.bulk_density_sd_gcm3, alone("bulk_density_sd_gcm3")),
        (WATER, water, "g/g", curve.bound_water_sd, alone("bound_water_sd")),
    ):
        of_soil = [_told(part, made) for part in told if part.name == name]
        if made > 0:
            parts += of_soil[:1] or [Part(name, value, unit, sd, "normal", "given", made)]
    return level, low, high, [replace(part, level=level * part.level_rate_cps / total) for part in parts]


def _told(part: UncertaintyPart, rate_cps: float) -> Part:
    """A part of the calibration, with the standard deviation of the rate that it makes [counts/s]."""
    distribution = "uniform" if part.origin == "default range" else "normal"
    return Part(part.name, part.value, part.unit, part.sd, distribution, part.source, rate_cps)


def _counting_remedy(soil_map: SoilMap, parts: list[Part], place: float) -> str:
    """Effect of counting as long again; at least this much, because better counts get better weights."""
    seconds = float(soil_map.samples.exposure_s.sum())
    counting = sum(part.place**2 for part in parts if part.name == COUNTING)
    left = math.sqrt(max(place**2 - counting / 2, 0.0))
    of = "of the rate" if soil_map.curve is None else "by volume"
    return f"{duration(seconds)} more of counting at the same places: ± {100 * left:.1f} % {of} or less at a place"


def _beyond(run: MapRun, rate: float) -> Iterator[Beyond]:
    """Sources that are not in the stated uncertainty."""
    curve, known = run.soil_map.curve, run.calibration
    applied = {row.name for row in run.corrections if row.remark != "not applied"}
    inside = {part.name for part in (known.parts if known else ())}
    of_cores = curve is not None and known is not None and known.method != "general" and not known.illustrative
    for source in SOURCES if run.corrections and not run.simulated else ():
        corrected = source.correction in applied
        share = source.corrected if corrected else source.open
        if curve is not None:
            dry, wet = possible_moisture(curve, np.array([rate * (1 + share), rate * (1 - share)])).tolist()
            share = (wet - dry) / 2
        remark = f"{source.remains if corrected else source.missing} (assumed)"
        if source.name not in inside:
            cancels = "; what was so during the calibration too cancels" if of_cores else ""
            yield Beyond(source.name, corrected, share, remark + cancels)
    if not (run.corrections or run.simulated):
        yield Beyond("corrections", False, math.nan, "the run does not say which were applied")
    for part in known.parts if known else ():
        if not part.share > 0 and part.name not in (DENSITY, WATER):
            yield Beyond(part.name, False, math.nan, "possible in this survey, and nothing is known of it")
    for name, key in ((DENSITY, "bulk_density_sd_gcm3"), (WATER, "bound_water_sd")):
        if curve is not None and not (run.simulated or getattr(curve, key) > 0):  # simulated soil is exact
            yield Beyond(name, False, math.nan, f"no ± is given: {key}")
    if run.soil_map.deconvolved_m and not at_one_place(run):
        yield Beyond("footprint", True, math.nan, "de-convolved; its radius counts as known")
    elif run.support_text.startswith("mean") and not at_one_place(run):
        yield Beyond("footprint", False, math.nan, f"each value is a {run.support_text}")


def _text(run: MapRun, known_level: bool, level: float, place: float) -> str:
    """The two uncertainties in a sentence."""
    if not run.calibrated:
        text = f"the rate of a place is known to ± {100 * place:.1f} % of the rate; moisture needs a calibration."
    elif math.isnan(level):
        wrong = "the mean rate means an impossible moisture"
        why = "N0 is a guess" if not absolute(run) else "the calibration has no ±" if known_level else wrong
        text = f"places are known to ± {100 * place:.1f} % by volume against the level; the level is not: {why}."
    elif at_one_place(run):
        text = (
            f"the moisture is known to ± {100 * level:.1f} % by volume, and counting adds ± {100 * place:.1f} %."
        )
    else:
        text = (
            f"the level of the whole map is known to ± {100 * level:.1f} % by volume, a place against this level "
            f"to ± {100 * place:.1f} % (one standard deviation)."
        )
    return f"In this simulation, {text}" if run.simulated else text[0].upper() + text[1:]
