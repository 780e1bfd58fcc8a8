# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a decision: zones by thresholds, and the probability that each place is in the right one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import OF_DOSE, Thresholds, parse_thresholds, spread_cells
from soilmoist_ros.mapping import SoilMap, common_rate_sd, possible_moisture
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import calibration_of, certainty, class_probability, once_a_run
from soilmoist_ros.reporting.colours import WATER, hex_ramp
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.reporting.page.frame import percent, ranges
from soilmoist_ros.reporting.page.irrigation import IrrigationZone
from soilmoist_ros.reporting.page.statistics import normal_draws
from soilmoist_ros.sensing import UNKNOWN_SENSOR, MoistureCurve

Array = NDArray[np.float64]

BAND_CELLS, BAND_DRAWS = 400, 300  # places and draws of :func:`_band`
BAND = 0.02, 0.98  # held 19 of 24 true shares (real surfaces), 0.1 to 0.9 held 15: draws know the variogram


@dataclass(frozen=True, eq=False)
class DecisionMap:
    """Zones by thresholds.

    :param thresholds: rising, of the moisture [m^3/m^3] or of the rate [counts/s]
    :param number: zone of each cell, from 0 for the lowest values, NaN outside the field, shape (ny, nx)
    :param probability: probability that the true value of a cell lies in its zone, shape (ny, nx)
    :param outside: thresholds that hardly any place is below, or hardly any is above
    """

    thresholds: tuple[float, ...]
    of_moisture: bool
    zones: tuple[IrrigationZone, ...]
    number: Array
    probability: Array
    outside: tuple[float, ...]
    true_wrong: float | None  # share of the field that is in another zone, ``None`` without a truth
    band: tuple[float, float]  # holds that share in four of five missions
    basis: ClassVar[str] = "Zones by the thresholds of the mission."
    water: ClassVar[str] = ""

    @property
    def wrong(self) -> float:
        """Share of the field that can be expected to be in the wrong zone [0..1]."""
        return 1 - float(self.probability[np.isfinite(self.number)].mean())

    @property
    def level(self) -> str:
        """Quality of the decision, as sentences."""
        truly = "" if self.true_wrong is None else f"; by the simulated truth it is {percent(self.true_wrong)}"
        band = f"{percent(self.band[0])} to {percent(self.band[1])} in four of five missions"
        text = f"Expected in the wrong zone: {percent(self.wrong)} ({band}) of the field{truly}."
        if self.outside:
            which = " and ".join(_limit(value, self.of_moisture) for value in self.outside)
            text += f" {which} is outside what the field has: the zone is the same nearly everywhere."
        return text

    @property
    def shares(self) -> str:
        """The zones with their shares of the field, in words."""
        return "; ".join(f"{zone.limits}: {percent(zone.share)}" for zone in self.zones) + " of the field"


@once_a_run
def decision(run: MapRun) -> DecisionMap | None:
    """The map of the decision that the mission was for; ``None`` if it was for none."""
    if run.mission is None or not (text := run.mission.settings.threshold):
        return None
    soil_map = run.soil_map
    edges = run.irrigation.dose_thresholds if text == OF_DOSE else parse_thresholds(text)
    edges = tuple(sorted(set(edges)))
    # Without a level the plan was for rates, and so it was if the soil cannot have such moistures.
    possible = soil_map.limits is not None and edges[-1] < soil_map.limits.saturation
    of_moisture = possible and calibration_of(run) != UNKNOWN_SENSOR
    curve = soil_map.curve if of_moisture else None
    values = np.where(soil_map.grid.mask, soil_map.rate if curve is None else soil_map.vwc, np.nan)
    index = np.searchsorted(edges, np.nan_to_num(values), side="right")
    number = np.where(np.isfinite(values), index, np.nan)
    probability = class_probability(soil_map.rate, soil_map.rate_sd, number, edges, curve, relative=False)
    inside, size_m2 = np.isfinite(number), float(field_polygon(soil_map.grid).area)
    zones, unit = [], "%" if of_moisture else "counts/s"
    texts = ranges([f"{100 * edge if of_moisture else edge:.3g}" for edge in edges], unit)
    for zone, colour in enumerate(hex_ramp(WATER if of_moisture else f"{WATER}_r", len(edges) + 1)):
        share, sure = float((number[inside] == zone).mean()), certainty(probability[number == zone])
        zones.append(IrrigationZone(f"zone {zone + 1}", texts[zone], colour, share * size_m2, share, sure))
    at = soil_map.rate[inside], soil_map.variance[inside]
    limits = Thresholds.of(edges, curve) if curve is not None else Thresholds(edges, edges, (1.0,) * len(edges))
    wrong, truth, true_curve = None, run.truth_rate, run.mission.soil_map and run.mission.soil_map.curve
    if truth is not None and np.isfinite(truth).any():
        true = truth if curve is None else (true_curve or curve).vwc(truth)
        known = inside & np.isfinite(true)
        wrong = float(np.mean(np.searchsorted(edges, true[known], side="right") != number[known]))
    outside, band = limits.outside(*at), _band(soil_map, number, edges, curve)
    return DecisionMap(edges, of_moisture, tuple(zones), number, probability, outside, wrong, band)


def _band(
    soil_map: SoilMap, number: Array, edges: tuple[float, ...], curve: MoistureCurve | None
) -> tuple[float, float]:
    """Band of the share in the wrong zone, by draws from the posterior: errors of neighbours are alike."""
    kriging = soil_map.kriging
    chosen, rng = spread_cells(np.isfinite(number), BAND_CELLS), np.random.default_rng(0)
    xy = soil_map.grid.cells[chosen[soil_map.grid.mask]]
    (rate, variance), covariance = kriging.predict(xy), kriging.covariance(xy)
    drawn = normal_draws(covariance, BAND_DRAWS, rng)
    fixed = np.sqrt(np.maximum(variance - np.diag(covariance), 0.0))
    drawn += rate[:, None] + fixed[:, None] * rng.standard_normal(drawn.shape)
    if curve is not None:
        if (common := common_rate_sd(curve, rate)) is not None:
            drawn += common[:, None] * rng.standard_normal(BAND_DRAWS)
        drawn = possible_moisture(curve, drawn)
    wrong = (np.searchsorted(edges, drawn, side="right") != number[chosen][:, None]).mean(axis=0)
    low, high = np.quantile(wrong, BAND).tolist()
    return low, high


def _limit(value: float, of_moisture: bool) -> str:
    return f"{100 * value:.3g} %" if of_moisture else f"{value:.3g} counts/s"
