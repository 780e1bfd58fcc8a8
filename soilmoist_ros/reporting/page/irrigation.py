# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The farmer's page: zones of the field by soil moisture, water in the root zone, and what to do next."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.moisture_bands import common_rate_sd
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.reporting.moisture_series import at_one_place, moisture_series
from soilmoist_ros.reporting.page.numbers import area, percent, volume
from soilmoist_ros.reporting.page.statistics import mean_moisture
from soilmoist_ros.reporting.run import IrrigationLimits, MapRun

Array = NDArray[np.float64]

COLOURS = ("#d8b365", "#a6d5cf", "#2166ac")
"""Colours of dry, medium and moist; readers with colour-blindness can distinguish them."""
RELATIVE = ("driest third", "middle third", "wettest third")
BY_USER = ("dry", "medium", "moist")
BY_PLANT = ("too dry", "enough water", "wet")
FEW_PLACES = 10
CERTAIN = 0.8
"""Probability from which the zone of a place counts as certain."""
SURE_ENOUGH = 0.5
"""Share of the area with a certain zone from which the map supports decisions zone by zone."""


@dataclass(frozen=True)
class Zone:
    """A class of the field's area.

    :param name: name for readers
    :param limits: its range in words, with the unit
    :param colour: colour on the map
    :param area_m2: its area [m^2]
    :param share: share of the field's area [0..1]
    :param sure: share of its area that belongs to it with a probability of 80 % or more [0..1], NaN if it is empty
    :param water_mm: mean water in the root zone [mm], NaN without a calibration
    :param missing_mm: mean water missing to field capacity [mm], NaN if that is unknown
    """

    name: str
    limits: str
    colour: str
    area_m2: float
    share: float
    sure: float
    water_mm: float
    missing_mm: float

    @property
    def area(self) -> str:
        """The area with its unit."""
        return " ".join(area(self.area_m2)) if self.area_m2 > 0 else "0"


@dataclass(frozen=True, eq=False)
class Irrigation:
    """What the map means for irrigation.

    :param zones: from dry to moist
    :param number: number of the zone of each cell, NaN outside the field, shape (ny, nx)
    :param sure: whether a cell belongs to its zone with a probability of 80 % or more, shape (ny, nx)
    :param relative: whether the zones only compare places of this field
    :param basis: where the limits of the zones come from, as a sentence
    :param water: water in the root zone of the mean of the field, as a sentence; empty without a real calibration
    :param level: what is known of the absolute moisture, as a sentence
    :param advice: what to do next, as a sentence
    """

    zones: tuple[Zone, ...]
    number: Array
    sure: NDArray[np.bool_]
    relative: bool
    basis: str
    water: str
    level: str
    advice: str

    @property
    def sure_share(self) -> float:
        """Share of the field whose zone is certain [0..1]."""
        inside = np.isfinite(self.number)
        return float(self.sure[inside].mean()) if inside.any() else math.nan


def irrigation(run: MapRun) -> Irrigation:
    """Zones, water and advice of a map; of its count rate if there is no calibration."""
    values = _values(run)
    names, edges, basis = _edges(run, values)
    number = np.where(np.isfinite(values), np.searchsorted(edges, np.nan_to_num(values), side="right"), np.nan)
    sure = _probability(run, number, edges) >= CERTAIN
    zones = tuple(_zone(run, i, names[i], edges, values, number, sure) for i in range(3))
    found = Irrigation(zones, number, sure, names == RELATIVE, basis, _water(run), _level(run), "")
    return Irrigation(**{**vars(found), "advice": _advice(run, found)})


def absolute_limits(run: MapRun) -> tuple[float, ...] | None:
    """Limits between dry, medium and moist [m^3/m^3]; ``None`` where zones only compare places of the field."""
    names, edges, _ = _edges(run, _values(run))
    return None if names == RELATIVE else tuple(edges.tolist())


def stress_point(limits: IrrigationLimits) -> float | None:
    """Moisture below which plants lack water [m^3/m^3]; ``None`` without wilting point and field capacity.

    Readily available water is the share ``depletion`` of the water between wilting point and field capacity
    (Allen et al. 1998, FAO Irrigation and drainage paper 56, equations 82 and 83).
    """
    if limits.wilting_point is None or limits.field_capacity is None:
        return None
    return limits.field_capacity - limits.depletion * (limits.field_capacity - limits.wilting_point)


def absolute(run: MapRun) -> bool:
    """Whether the map has moistures that limits can be compared with."""
    return run.calibrated and not (run.calibration is not None and run.calibration.illustrative)


def _values(run: MapRun) -> Array:
    """Moisture, or minus the rate without a calibration: more is moister. NaN outside the field."""
    soil_map = run.soil_map
    return np.where(soil_map.grid.mask, soil_map.vwc if run.calibrated else -soil_map.rate, np.nan)


def _probability(run: MapRun, number: Array, edges: Array) -> Array:
    """Probability that the true value lies in the zone of the estimate, 0 outside the field; rates are normal."""
    from scipy.special import ndtr

    soil_map, curve = run.soil_map, run.soil_map.curve
    sd, limits = soil_map.rate_sd, -edges
    if curve is not None:
        common = common_rate_sd(curve, soil_map.rate)
        sd = sd if common is None else np.hypot(sd, common)
        limits = np.asarray(curve.rate_cps(np.maximum(edges, 0.0)), float)
    highest = np.concatenate([[np.inf], limits])
    lowest = np.concatenate([limits, [-np.inf]])
    own = np.nan_to_num(number).astype(int)
    with np.errstate(invalid="ignore"):
        inside = ndtr((highest[own] - soil_map.rate) / sd) - ndtr((lowest[own] - soil_map.rate) / sd)
    return np.where(np.isfinite(number), np.nan_to_num(inside), 0.0)


def _edges(run: MapRun, values: Array) -> tuple[tuple[str, ...], Array, str]:
    """Names of the zones, the two limits between them, and their origin."""
    limits, stress = run.irrigation, stress_point(run.irrigation)
    if absolute(run) and limits.dry_below is not None and limits.moist_above is not None:
        return BY_USER, np.array([limits.dry_below, limits.moist_above]), "The limits are those of the site file."
    if absolute(run) and stress is not None and limits.field_capacity is not None:
        basis = (
            f"Plants lack water below {volume(stress)} %: there, {percent(limits.depletion)} of the water between "
            f"field capacity ({volume(limits.field_capacity)} %) and wilting point "
            f"({volume(limits.wilting_point)} %) is used up. Above field capacity the soil drains."
        )
        return BY_PLANT, np.array([stress, limits.field_capacity]), basis
    finite = values[np.isfinite(values)]
    edges = np.quantile(finite, (1 / 3, 2 / 3)) if finite.size else np.zeros(2)
    basis = (
        "The zones only compare places of this field: each is about a third of the area, however dry or wet it is."
    )
    given = stress is not None or limits.dry_below is not None
    if given and not absolute(run):
        basis += " The limits of the site file need a calibrated sensor."
    elif not given:
        basis += (
            " For absolute zones, give wilting point and field capacity, or your own limits, in the site file."
        )
    return RELATIVE, edges, basis


def _zone(
    run: MapRun, index: int, name: str, edges: Array, values: Array, number: Array, sure: NDArray[np.bool_]
) -> Zone:
    chosen = number == index
    total = np.count_nonzero(run.soil_map.grid.mask)
    share = np.count_nonzero(chosen) / total
    depth, full = run.irrigation.root_depth_mm, run.irrigation.field_capacity
    water = missing = math.nan
    if absolute(run) and chosen.any():
        water = float(values[chosen].mean()) * depth
        if full is not None:
            missing = float(np.maximum(full - values[chosen], 0).mean()) * depth
    size_m2 = share * float(field_polygon(run.soil_map).area)
    return Zone(
        name, _range_text(run, index, edges), COLOURS[index], size_m2, share,
        float(sure[chosen].mean()) if chosen.any() else math.nan, water, missing,
    )  # fmt: skip


def _range_text(run: MapRun, index: int, edges: Array) -> str:
    """Range of a zone: moisture, or rates, which fall towards moist soil."""
    if run.calibrated:
        first, second = (volume(edge) for edge in edges.tolist())
        return (f"below {first} %", f"{first} to {second} %", f"above {second} %")[index]
    first, second = (f"{-edge:.2f}" for edge in edges.tolist())
    return (f"above {first} counts/s", f"{second} to {first} counts/s", f"below {second} counts/s")[index]


def _water(run: MapRun) -> str:
    """Water in the root zone with its 90 % interval."""
    if absolute(run) and at_one_place(run):
        return _water_at_the_end(run)
    mean = mean_moisture(run.soil_map) if absolute(run) else None
    if mean is None or not math.isfinite(mean.value):
        return ""
    depth = run.irrigation.root_depth_mm
    text = (
        f"On average the upper {depth:g} mm of the soil hold {mean.value * depth:.0f} mm of water "
        f"(90 % interval {mean.p05 * depth:.0f} to {mean.p95 * depth:.0f} mm), if the soil below the reach of the "
        "sensor is as moist as above"
    )
    return f"{text}." if mean.common_sd > 0 else f"{text}. An error of the calibration is not included."


def _water_at_the_end(run: MapRun) -> str:
    """Water in the root zone in the last step of a series at one place."""
    bands, depth = moisture_series(run.track, run.soil_map.curve).bands, run.irrigation.root_depth_mm
    low, middle, high = (float(band[-1]) * depth for band in (bands.vwc_p05, bands.vwc, bands.vwc_p95))
    return (
        f"At the end the upper {depth:g} mm of the soil held {middle:.0f} mm of water (90 % interval {low:.0f} to "
        f"{high:.0f} mm), if the soil below the reach of the sensor was as moist as above."
    )


def _level(run: MapRun) -> str:
    if not run.calibrated:
        return "Not calibrated: the map shows where it is drier and wetter, but not how much water there is."
    if not absolute(run):
        return (
            "Illustrative: the calibration is a guess. Trust where it is drier and wetter, but not the "
            "percentages and millimetres."
        )
    if run.simulated:
        return "Simulated: no real field was measured."
    source = f" ({run.calibration.source})" if run.calibration and run.calibration.source else ""
    return f"Calibrated{source}: the percentages and millimetres are meant as they stand, with their intervals."


def _advice(run: MapRun, found: Irrigation) -> str:
    """The next step that helps most, as a sentence."""
    if not run.calibrated:
        return "Next: take soil cores and calibrate the sensor, so that the map shows water."
    if not absolute(run):
        return "Next: take soil cores and calibrate the sensor, so that the amounts of water can be used."
    if at_one_place(run):
        return (
            "Next: for a map of the surroundings, drive the sensor over the field or move it from place to place."
        )
    samples = len(run.soil_map.samples)
    if samples < FEW_PLACES:
        return f"Next: measure at more places; {samples} are too few to know how sure the map is."
    if found.sure_share < SURE_ENOUGH:
        return (
            f"Next: count longer or at more places {_least_sure(run)}; now the zone is certain on only "
            f"{percent(found.sure_share)} of the area."
        )
    dry = found.zones[0]
    if not found.relative and dry.share > 0 and math.isfinite(dry.missing_mm):
        return (
            f"Next: look at the {dry.area} that are too dry; about {dry.missing_mm:.0f} mm would fill their root "
            "zone to field capacity."
        )
    return "Next: compare the zones with what you see in the field, and measure again after rain or irrigation."


def _least_sure(run: MapRun) -> str:
    """Part of the field where the interval is widest, in words."""
    soil_map = run.soil_map
    width = np.where(soil_map.grid.mask, soil_map.vwc_p95 - soil_map.vwc_p05, np.nan)
    rows, columns = np.nonzero(width >= np.nanquantile(width, 0.8))
    every_row, every_column = np.nonzero(soil_map.grid.mask)
    x, y = soil_map.grid.x_m, soil_map.grid.y_m
    east = float(x[columns].mean() - x[every_column].mean()) / max(float(np.ptp(x[every_column])), 1e-9)
    north = float(y[rows].mean() - y[every_row].mean()) / max(float(np.ptp(y[every_row])), 1e-9)
    if math.hypot(east, north) < 0.12:
        return "all over the field"
    points = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
    return f"in the {points[round(math.degrees(math.atan2(north, east)) / 45) % 8]}"
