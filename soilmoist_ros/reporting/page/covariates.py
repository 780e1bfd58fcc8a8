# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the covariates of a map explain: their effects and their shares of its variance, with intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from soilmoist_ros.mapping import Effect, coverage
from soilmoist_ros.pipeline import MapRun


class Interval(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    p025: float
    p975: float

    def times(self, factor: float) -> Interval:
        """Estimate and interval in another unit, which may have the other sign."""
        low, high = sorted((self.p025 * factor, self.p975 * factor))
        return Interval(self.value * factor, low, high)


@dataclass(frozen=True)
class Importance:
    """What one covariate says of the map; zeros if it was left out, because the counts do not ask for it.

    :param name: its name
    :param rate_cps: change of the rate where the covariate is one standard deviation higher [counts/s]
    :param vwc: change of the moisture at the mean rate, likewise [m^3/m^3]; ``None`` without a calibration
    :param variance_share: share of the variance of the rate over the field that follows the covariate [0..1];
        shares of covariates that resemble each other may add up to more than 1
    :param covered_share: share of the field where it is known [0..1]
    """

    name: str
    rate_cps: Interval
    vwc: Interval | None
    variance_share: Interval
    covered_share: float


def covariate_importance(run: MapRun) -> list[Importance]:
    """The covariates of a map, the most important first; empty without covariates."""
    soil_map, covariates = run.soil_map, run.covariates
    prior = None if soil_map.fit is None else soil_map.fit.prior
    if covariates is None:
        return []
    effects = [Effect(name, 0.0, 0.0) for name in covariates.names] if prior is None else prior.effects
    covered, mask = coverage(covariates, soil_map.grid), soil_map.grid.mask
    rate, curve = float(soil_map.rate[mask].mean()), soil_map.curve
    # The variance of the rate itself: the map is smoother, by its kriging variance.
    total = float(soil_map.rate[mask].var() + soil_map.variance[mask].mean())
    slope = None if curve is None else float(curve.slope(np.array([rate]))[0])
    found = []
    for effect in effects:
        low, high = effect.interval
        lowest = 0.0 if low <= 0 <= high else min(low**2, high**2)
        share = Interval(effect.mean**2 + effect.sd**2, lowest, max(low**2, high**2)).times(1 / total)
        change = Interval(effect.mean, low, high)
        vwc = None if slope is None or not np.isfinite(slope) else change.times(slope)
        bounded = Interval(*(min(one, 1.0) for one in share))
        found.append(Importance(effect.name, change, vwc, bounded, covered[effect.name]))
    return sorted(found, key=lambda one: -one.variance_share.value)
