# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Statistics of a map, cross-validation of its model, and comparison with a truth."""

from __future__ import annotations

import math
import sys
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping import (
    Effect,
    PoissonKriging,
    SoilMap,
    common_rate_sd,
    estimate_variogram,
    level_of,
    moisture_terms,
    possible_moisture,
)
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.page.frame import volume
from soilmoist_ros.sensing import SoilLimits

Array = NDArray[np.float64]

MAX_UNUSABLE = 0.25
"""Largest share of impossible or undefined moisture in the area at which zones and advice rest on the moisture."""
MAX_SAMPLES = 1000
MAX_CELLS, MAX_PAIRED_CELLS = 1500, 500
UNCERTAIN_VWC_SD = 0.03  # standard deviation of VWC from which a place counts as uncertain [m^3/m^3]
UNCERTAIN_RATE_SHARE = 0.05  # the same of the rate, as a share of it [-]
INTERVAL_SD = 1.96  # half width of a 95 % interval


def normal_draws(covariance: Array, count: int, rng: np.random.Generator) -> Array:
    """Draws of normal errors with a covariance of shape (n, n), shape (n, count)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ rng.standard_normal((len(values), count)))


class BandStatistics(NamedTuple):
    """Distribution of one band over the cells of the field; all NaN if no cell has a value."""

    mean: float
    sd: float
    minimum: float
    maximum: float
    p05: float
    p50: float
    p95: float


def band_statistics(values: ArrayLike) -> BandStatistics:
    """Statistics of the cells that have a value."""
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return BandStatistics(*[math.nan] * 7)
    found = (finite.mean(), finite.std(), finite.min(), finite.max(), *np.percentile(finite, (5, 50, 95)))
    return BandStatistics(*map(float, found))


def undefined_share(soil_map: SoilMap) -> float:
    """Share of the field's cells whose rate lies below the calibration curve, shown as saturated [0..1].

    1 without a calibration.
    """
    if soil_map.curve is None:
        return 1.0
    return soil_map.undefined_vwc_cells / int(np.count_nonzero(soil_map.grid.mask))


def beyond_limits_share(soil_map: SoilMap) -> float:
    """Share of the field's cells whose interval of moisture reaches a limit of the soil [0..1]."""
    return float(np.mean(soil_map.beyond_limits[soil_map.grid.mask]))


def explained_share(soil_map: SoilMap) -> float:
    """Share of the variance of the rate within the field that the map explains, as far as its model knows [0..1].

    The rest is the mean squared error to be expected, as a share of the variance of the field.
    """
    mask = soil_map.grid.mask
    between, error = float(np.var(soil_map.rate[mask])), float(np.mean(soil_map.variance[mask]))
    return between / (between + error) if between + error > 0 else math.nan


def resolution_m(soil_map: SoilMap, footprint_radius_m: float) -> float:
    """Size of the smallest structures that a map can show [m].

    It is the largest of: the cell, the distance between samples, the side of the area in which the counting noise
    is as small as the differences within the field, and the radius of a footprint that is not de-convolved.

    :param footprint_radius_m: radius of the sensor's footprint, 0 if unknown [m]
    """
    samples, area_m2 = soil_map.samples, np.count_nonzero(soil_map.grid.mask) * soil_map.grid.cell_m**2
    sill = max(soil_map.variogram.structured_sill, 1e-300)
    noise = soil_map.mean_rate / float(samples.exposure_s.sum()) / sill
    seen_m = 0.0 if soil_map.deconvolved_m else footprint_radius_m
    resolved_m = math.sqrt(area_m2 * max(1 / len(samples), noise))
    return max(soil_map.grid.cell_m, min(resolved_m, soil_map.grid.extent_m), seen_m)


def uncertain_share(soil_map: SoilMap) -> float:
    """Share of the field's cells whose standard deviation is above its limit or undefined [0..1]."""
    mask = soil_map.grid.mask
    if soil_map.curve is not None:
        return float(np.mean(~(soil_map.vwc_sd[mask] <= UNCERTAIN_VWC_SD)))
    return float(np.mean(~(soil_map.rate_sd[mask] <= UNCERTAIN_RATE_SHARE * soil_map.rate[mask])))


def implausible_shares(soil_map: SoilMap) -> tuple[float, float]:
    """Shares of the field's cells whose rate means more water than pore volume, and less than none [0..1].

    The map shows the limit there. Rates below the curve are counted by :func:`undefined_share`.
    """
    if soil_map.curve is None or soil_map.limits is None:
        return 0.0, 0.0
    vwc = soil_map.curve.vwc(soil_map.rate[soil_map.grid.mask])
    return float(np.mean(vwc > soil_map.limits.saturation)), float(np.mean(vwc < soil_map.limits.dryness))


def unusable_share(soil_map: SoilMap) -> float:
    """Share of the field's cells whose moisture is impossible or not defined [0..1]; 1 without a calibration."""
    return undefined_share(soil_map) + sum(implausible_shares(soil_map))


def is_usable(soil_map: SoilMap) -> bool:
    """True if zones, water and advice may rest on the moisture: most of the area has a possible one."""
    return not unusable_share(soil_map) > MAX_UNUSABLE


class LeaveOneOut(NamedTuple):
    """Leave-one-out cross-validation: observed rates, rates predicted without the sample, and the standard
    deviation of their difference, counting noise included [counts/s].
    """

    observed: Array
    predicted: Array
    sd: Array

    @property
    def rmse(self) -> float:
        """Root mean squared error [counts/s]."""
        return float(np.sqrt(np.mean((self.observed - self.predicted) ** 2)))

    @property
    def standardised_sd(self) -> float:
        """Root mean square of error / sd; 1 if sd is right, above 1 if sd is too small."""
        return float(np.sqrt(np.mean(((self.observed - self.predicted) / self.sd) ** 2)))

    @property
    def coverage95(self) -> float:
        """Share of samples inside their 95 % interval [0..1]; should be 0.95."""
        return float(np.mean(np.abs(self.observed - self.predicted) <= INTERVAL_SD * self.sd))


def _kriging(soil_map: SoilMap) -> PoissonKriging | None:
    """Exact kriging of a map; ``None`` if it is too large for a report or numerically singular."""
    if not 1 <= len(soil_map.samples.xy) <= MAX_SAMPLES or not soil_map.variogram.sill > 0:
        return None
    try:
        return soil_map.kriging
    except np.linalg.LinAlgError:
        return None


def leave_one_out(soil_map: SoilMap) -> LeaveOneOut | None:
    """Leave-one-out cross-validation in closed form (Dubrule 1983, Mathematical Geology 15:687-699).

    With the projected inverse ``Q = K^-1 - K^-1 1 1' K^-1 / (1' K^-1 1)`` the error of sample i is
    ``(Q y)_i / Q_ii`` and its variance ``1 / Q_ii``.

    :returns: ``None`` for fewer than 5 or more than ``MAX_SAMPLES`` samples
    """
    from scipy.linalg import solve_triangular

    kriging = _kriging(soil_map) if len(soil_map.samples.xy) >= 5 else None
    if kriging is None:
        return None
    system, observed = kriging.system, kriging.places.rate_cps
    of_ones, of_data = solve_triangular(
        system.factor, np.column_stack([system.ones, system.residual]), lower=True, trans="T"
    ).T
    inverse = solve_triangular(system.factor, np.eye(len(observed)), lower=True)
    precision = (inverse**2).sum(axis=0) - of_ones**2 / (system.ones @ system.ones)
    return LeaveOneOut(observed, observed - of_data / precision, 1 / np.sqrt(precision))


def mean_sd(soil_map: SoilMap, moisture: bool) -> float | None:
    """Standard deviation of the *field mean* of the rate [counts/s] or of VWC [m^3/m^3].

    Block kriging over at most ``MAX_CELLS`` cells, since errors of neighbouring cells are correlated; for VWC over
    at most ``MAX_PAIRED_CELLS``, with the whole curve (:func:`moisture_terms`). What is not known of a drift is
    included, the error of N0 is not.

    :returns: ``None`` if there are too many samples, or nothing to average
    """
    if moisture:
        return _expected_moisture(soil_map)[1]
    kriging, cells = _kriging(soil_map), _some_cells(soil_map, MAX_CELLS)[0]
    if kriging is None:
        return None
    variance = float(kriging.covariance(cells).mean()) + soil_map.variogram.nugget / len(cells)
    return math.sqrt(max(variance, 0.0))


@lru_cache(maxsize=8)  # page and summary ask several times
def _expected_moisture(soil_map: SoilMap) -> tuple[float, float | None]:
    """Expected mean moisture and its standard deviation, by the covariances of the moistures of pairs of cells.

    The expected moisture differs from the curve at the rate in proportion to the variance of the rate. With a
    footprint most of it lies within the footprint, where no count shows it: the difference is then as uncertain as
    it is large. In simulated surveys of other people's surfaces the interval was too narrow without this.
    """
    if (curve := soil_map.curve) is None:
        return math.nan, None
    of_places = _of_places(soil_map)
    kriging = of_places or soil_map.kriging
    cells, rate, variance = _some_cells(soil_map, MAX_CELLS if of_places else sys.maxsize)
    if of_places:
        rate, variance = of_places.predict(cells)
    value = float(np.mean(moisture_terms(curve, rate, np.sqrt(variance))[0]))
    above = value - float(np.mean(possible_moisture(curve, rate)))
    if len(soil_map.samples) > MAX_SAMPLES:
        return value, None
    some = _evenly(len(cells), MAX_PAIRED_CELLS)
    cells, rate, variance = cells[some], rate[some], variance[some]
    covariance = kriging.covariance(cells)
    np.fill_diagonal(covariance, variance)
    sd = np.sqrt(np.maximum(variance, 1e-300))
    correlation = covariance / np.outer(sd, sd)
    total, power = 0.0, np.ones_like(correlation)
    for terms in moisture_terms(curve, rate, sd)[1:]:
        power *= correlation
        total += float(terms @ power @ terms)
    within = above if of_places or soil_map.deconvolved_m else 0.0
    return value, math.hypot(math.sqrt(max(total, 0.0)) / len(cells), within)


def _of_places(soil_map: SoilMap) -> PoissonKriging | None:
    """Kriging of the rate at each place, for a map of means over a known footprint; ``None`` for any other map.

    The curve of a mean is not the mean of the curve: within the footprint it is wetter than the mean rate says.
    """
    fit, samples, radius_m = soil_map.fit, soil_map.samples, soil_map.footprint_radius_m
    means = radius_m > 0 and not soil_map.deconvolved_m and len(samples) <= MAX_SAMPLES
    if fit is None or fit.method != "reml" or not means:
        return None
    columns = samples.xy, samples.counts, samples.exposure_s
    spread = samples.spread + np.array([0.0, 0.0, 0.0, radius_m])
    model, extent_m, local = soil_map.variogram.model, soil_map.grid.extent_m, fit.local_rate is not None
    found = estimate_variogram(*columns, model, extent_m=extent_m, spread=spread, local_noise=local)
    kriging = PoissonKriging(found.variogram, soil_map.keep_nugget, found.noise_rate, fit.prior)
    return kriging.fit(*columns, spread)


def calibration_sd(soil_map: SoilMap) -> float | None:
    """Standard deviation of VWC that an uncertain calibration adds to all cells together, at the mean rate of the
    map [m^3/m^3].

    :returns: ``None`` without a calibration, or if its standard deviations are unknown
    """
    if soil_map.curve is None:
        return None
    sd = level_of(soil_map.curve, float(np.nanmean(soil_map.rate)))[0]
    return None if math.isnan(sd) else sd


class MeanMoisture(NamedTuple):
    """Mean moisture of the field with its uncertainty [m^3/m^3].

    :param value: mean of the expected moisture of each cell, above the mean of the band ``vwc``: the curve is
        steep in wet soil, so what is uncertain may be much wetter, but not much drier
    :param between_sd: standard deviation by counting and kriging (block kriging)
    :param common_sd: standard deviation by the calibration, 0 if unknown
    :param p05: quantile 0.05, both included; ``p95`` the quantile 0.95
    """

    value: float
    between_sd: float
    common_sd: float
    p05: float
    p95: float


def mean_moisture(soil_map: SoilMap) -> MeanMoisture | None:
    """Mean moisture of the field; ``None`` without a calibration, or where :func:`mean_sd` is ``None``."""
    limits, (value, between) = soil_map.limits, _expected_moisture(soil_map)
    if limits is None or between is None:
        return None
    common, away = calibration_sd(soil_map) or 0.0, SoilMap.QUANTILE_SD * between
    drier, wetter = _reach_of_calibration(soil_map)
    low, high = value - math.hypot(away, drier), value + math.hypot(away, wetter)
    return MeanMoisture(value, between, common, max(low, limits.dryness), min(high, limits.saturation))


def moisture_text(value: float, low: float, high: float, limits: SoilLimits | None) -> tuple[str, str, str]:
    """A moisture, its 90 % interval [% by volume] and a remark where a limit of the soil cuts it: an interval that
    is short for this reason looks sure and is not. Without a width the interval is empty.
    """
    text, interval, cut = volume(value), f"{volume(low)} to {volume(high)}", list[str]()
    ends = (("pores", limits.saturation, high), ("dry soil", limits.dryness, low)) if limits else ()
    for name, limit, end in ends:
        if abs(value - limit) < 5e-4:
            return text, "", f"at the limit of the {name}: hardly possible, and no interval is known"
        cut += [f"cut at the limit of the {name}"] if abs(end - limit) < 5e-4 else []
    return text, interval, " and ".join(cut)


def _reach_of_calibration(soil_map: SoilMap) -> tuple[float, float]:
    """Distances of the quantiles 0.05 and 0.95 of the mean moisture by the calibration alone [m^3/m^3].

    Through the curve of each cell: its bend makes the interval longer towards wet.
    """
    curve, rate = soil_map.curve, soil_map.rate[soil_map.grid.mask]
    sd = None if curve is None else common_rate_sd(curve, rate)
    if curve is None or sd is None:
        return 0.0, 0.0
    away = SoilMap.QUANTILE_SD * sd
    dry, mid, wet = (float(np.mean(possible_moisture(curve, one))) for one in (rate + away, rate, rate - away))
    return mid - dry, wet - mid


def _some_cells(soil_map: SoilMap, most: int) -> tuple[Array, ...]:
    """Centres (n, 2), rates and their variances of an even subset of the field's cells."""
    mask, cells = soil_map.grid.mask, soil_map.grid.cells
    pick = _evenly(len(cells), most)
    return cells[pick], soil_map.rate[mask][pick], soil_map.variance[mask][pick]


def _evenly(count: int, most: int) -> NDArray[np.intp]:
    """Numbers below ``count``, evenly apart and at most ``most``."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


class TruthScore(NamedTuple):
    """Errors of the rate against a known truth over the cells of the field [counts/s]: root mean squared error,
    mean of estimate minus truth, and share of cells whose 95 % interval contains the truth [0..1].
    """

    rmse: float
    bias: float
    coverage95: float


def truth_score(soil_map: SoilMap, truth_rate: ArrayLike) -> TruthScore:
    """Compare the rate map with the truth on the same grid.

    :raises ValueError: if the shapes differ
    """
    truth = np.asarray(truth_rate, float)
    if truth.shape != soil_map.rate.shape:
        raise ValueError(f"the truth has shape {truth.shape}, the map {soil_map.rate.shape}")
    known = soil_map.grid.mask & np.isfinite(truth) & np.isfinite(soil_map.rate)
    error = (soil_map.rate - truth)[known]
    inside = np.abs(error) <= INTERVAL_SD * soil_map.rate_sd[known]
    return TruthScore(float(np.sqrt(np.mean(error**2))), float(error.mean()), float(inside.mean()))


# What the covariates of a map explain: their effects and their shares of its variance, with intervals -----------


class Interval(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    p025: float
    p975: float

    def times(self, factor: float) -> Interval:
        """Estimate and interval in another unit, which may have the other sign."""
        low, high = sorted((self.p025 * factor, self.p975 * factor))
        return Interval(self.value * factor, low, high)


class Importance(NamedTuple):
    """Importance of one covariate for the map; zeros if it was left out, because the counts do not need it.

    :param rate_cps: change of the rate where the covariate is one standard deviation higher [counts/s]
    :param vwc: change of the moisture at the mean rate for this change of the rate [m^3/m^3], or ``None``
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
    """The covariates of a map, the most important first."""
    soil_map, covariates = run.soil_map, run.covariates
    if covariates is None:
        return []
    prior = None if soil_map.fit is None else soil_map.fit.prior
    effects = [Effect(name, 0.0, 0.0) for name in covariates.names] if prior is None else prior.effects
    covered, mask = covariates.coverage(soil_map.grid), soil_map.grid.mask
    rate, curve = float(soil_map.rate[mask].mean()), soil_map.curve
    # The variance of the rate itself: the map is smoother, by its kriging variance.
    total = float(soil_map.rate[mask].var() + soil_map.variance[mask].mean())
    slope = None if curve is None else float(curve.slope(np.array([rate]))[0])
    found = []
    for effect in effects:
        low, high = effect.interval
        lowest = 0.0 if low <= 0 <= high else min(low**2, high**2)
        shares = (effect.mean**2 + effect.sd**2, lowest, max(low**2, high**2))
        share = Interval(*(min(one / total, 1.0) for one in shares))
        change = Interval(effect.mean, low, high)
        vwc = None if slope is None or not np.isfinite(slope) else change.times(slope)
        found.append(Importance(effect.name, change, vwc, share, covered[effect.name]))
    return sorted(found, key=lambda one: -one.variance_share.value)
