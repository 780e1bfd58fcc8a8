# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The soil map: rate and soil moisture with their uncertainty over a field, and what they came from.

The moisture curve is monotone, so quantiles of the rate become quantiles of the moisture: an interval that is
symmetric in the rate is long towards wet soil. The rate is taken as normal with the mean and variance of kriging.
A gamma or log-normal rate of the same mean and variance missed more truths on one side in simulated surveys,
also with five counts a stop (``test/mapping/test_soil_map.py``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.drift import NO_CHANGE, Change, Changing
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples, noise_rate, pooled
from soilmoist_ros.mapping.variogram.fit import VariogramFit
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.sensing import MoistureCurve, SoilLimits, soil_limits

Array = NDArray[np.float64]

ORDERS, _NODES = 5, 24  # orders of the expansion of the moisture; nodes of the quadrature over the rate
UNITS = {
    "rate": "counts/s", "rate_sd": "counts/s",
    "vwc": "m3/m3", "vwc_sd": "m3/m3", "vwc_p05": "m3/m3", "vwc_p95": "m3/m3",
}  # fmt: skip
"""Unit of each band."""
MAX_EXACT_SAMPLES = 2000
"""Number of samples up to which a map is exact; of more, neighbours are pooled. With the usual radius of merging,
hardly any survey has so many. Of 10,000 samples 6 m apart the pooled map had an error of 1.04 to 1.07 of that of a
kriging from 300 to 1200 neighbours of each tile, in a quarter of its time."""
CELL: Final = np.dtype([(name, "<f4") for name in ("x", "y", "z", *UNITS)])
"""A cell: centre in the plane z = 0 [m], and the bands."""


class Bands(NamedTuple):
    """The bands of a map, of one shape. Bands of moisture are NaN without a curve.

    Each band of moisture lies within the limits of the soil (:func:`soil_limits`). A rate below the pole of the
    curve means saturated soil.

    :param rate: corrected count rate [counts/s]
    :param rate_sd: its kriging standard deviation [counts/s]
    :param vwc: volumetric water content of the rate [m^3/m^3]: near the median of its distribution, since the
        curve keeps medians; the mean would be larger
    :param vwc_sd: its standard deviation, third order (Jakobi et al. 2020), of the part that differs between
        places [m^3/m^3]; at most half of the distance of the limits (Popoviciu 1935)
    :param vwc_p05: quantile 0.05 of the moisture, the uncertainty of the calibration included where it is known
        [m^3/m^3]
    :param vwc_p95: quantile 0.95 of the moisture, with the uncertainty included in ``vwc_p05`` [m^3/m^3]
    """

    rate: Array
    rate_sd: Array
    vwc: Array
    vwc_sd: Array
    vwc_p05: Array
    vwc_p95: Array


def make_bands(rate: Array, variance: Array, curve: MoistureCurve | None) -> Bands:
    """All bands of a kriged rate."""
    rate_sd = np.sqrt(variance)
    if curve is None:
        none = np.full(rate.shape, np.nan)
        return Bands(rate, rate_sd, none, none, none, none)
    limits = soil_limits(curve.bulk_density_gcm3)
    vwc = possible_moisture(curve, rate)
    # fmin: the expansion has no value below the pole, where nothing is known but the limits.
    half = (limits.saturation - limits.dryness) / 2
    vwc_sd = np.where(np.isnan(rate), np.nan, np.fmin(curve.vwc_and_sd(rate, rate_sd)[1], half))
    common = common_rate_sd(curve, rate)
    away = SoilMap.QUANTILE_SD * (rate_sd if common is None else np.hypot(rate_sd, common))
    return Bands(
        rate, rate_sd, vwc, vwc_sd, possible_moisture(curve, rate + away), possible_moisture(curve, rate - away)
    )


def possible_moisture(curve: MoistureCurve, rate_cps: ArrayLike) -> Array:
    """Moisture of rates, limited to what the soil can hold [m^3/m^3].

    The curve has a pole: without limits, one cell with a slightly low estimate would dominate a mean of the map.
    A rate too low for any moisture counts as saturated soil.
    """
    rate = np.asarray(rate_cps, float)
    limits = soil_limits(curve.bulk_density_gcm3)
    vwc = np.fmin(curve.vwc(rate), limits.saturation)  # fmin takes the limit where the curve has no value
    return np.where(np.isnan(rate), np.nan, np.maximum(vwc, limits.dryness))


def moisture_terms(curve: MoistureCurve, rate_cps: ArrayLike, rate_sd_cps: ArrayLike) -> Array:
    """Hermite coefficients of the moisture of normal rates; the first one is the expected moisture [m^3/m^3].

    With the coefficients c and d of two rates of correlation r, the covariance of their moistures is the sum over
    k >= 1 of ``c[k] d[k] r^k`` (Mehler's formula): exact for any curve but for the orders left out.

    :returns: shape (:data:`ORDERS`, n)
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    polynomials = np.polynomial.hermite_e.hermevander(nodes, ORDERS - 1) * (weights / weights.sum())[:, None]
    polynomials /= np.sqrt([math.factorial(order) for order in range(ORDERS)])
    rate, sd = np.asarray(rate_cps, float), np.asarray(rate_sd_cps, float)
    terms = np.zeros((ORDERS, len(rate)))
    for node, factors in zip(nodes.tolist(), polynomials, strict=True):
        terms += np.outer(factors, possible_moisture(curve, rate + node * sd))
    return terms


def common_rate_sd(curve: MoistureCurve, rate: Array) -> Array | None:
    """Standard deviation of the rate that has the effect of an uncertain calibration [counts/s].

    The errors of N0, bulk density and bound water shift all places together. A curve depends on the rate in units
    of N0, so the relative error of N0 acts like that of the rate. Moisture is proportional to the bulk density;
    lattice and organic water take ``rho_b`` times their own from it. The three errors are taken as independent; an
    N0 from cores goes with the soil properties that it was found with, so it takes most of their effect away.

    :returns: same shape; ``None`` for a calibration whose standard deviations are unknown
    """
    n0 = curve.n0_sd_cps / curve.n0_cps
    density = curve.bulk_density_sd_gcm3
    if density == 0 and curve.bound_water_sd == 0:
        return rate * n0 if n0 > 0 else None
    slope = np.where(curve.valid(rate), curve.slope(rate), -np.inf)
    of_density = possible_moisture(curve, rate) / slope / curve.bulk_density_gcm3 - rate * curve.n0_per_density
    of_water = curve.bulk_density_gcm3 / slope + rate * curve.n0_per_bound_water
    of_soil = np.hypot(of_density * curve.bulk_density_sd_gcm3, of_water * curve.bound_water_sd)
    return np.hypot(rate * n0, of_soil)


def level_of(curve: MoistureCurve, rate_cps: float) -> tuple[float, float, float]:
    """Moisture at a rate by the calibration alone: half the distance of its quantiles 0.05 and 0.95 over 1.645,
    which is its standard deviation, and the two [m^3/m^3]; NaN if no error is known.
    """
    at = np.array([rate_cps])
    common = common_rate_sd(curve, at)
    if common is None or not common[0] > 0:
        return math.nan, math.nan, math.nan
    bands = make_bands(at, np.zeros(1), curve)
    low, high = float(bands.vwc_p05[0]), float(bands.vwc_p95[0])
    return (high - low) / (2 * SoilMap.QUANTILE_SD), low, high


# -- Map -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class SoilMap:
    """A map of one field; rasters have shape (ny, nx) and are NaN outside the field.

    :param rate: corrected count rate [counts/s]
    :param variance: its kriging variance [(counts/s)^2]
    :param samples: the samples behind the map, as given; with a drift those by place and time, merged at each
        place, and their exposures make the rates those at the time of the map
    :param variogram: the variogram used
    :param mean_rate: mean rate m* of the samples [counts/s]; their noise has it unless the fit has a local rate
    :param keep_nugget: whether the map has the rate with its micro-scale variation, or the smooth part only
    :param made_by: the fitted kriging that made the map; ``None`` for a map that was made elsewhere
    :param clipped_variances: inside cells whose variance came out negative (rounding) and was set to 0
    """

    grid: FieldGrid
    rate: Array
    variance: Array
    samples: Samples
    variogram: Variogram
    fit: VariogramFit | None
    mean_rate: float
    curve: MoistureCurve | None
    keep_nugget: bool
    made_by: PoissonKriging | None
    clipped_variances: int
    change: Change = NO_CHANGE
    footprint_radius_m: float = 0.0

    QUANTILE_SD: ClassVar[float] = 1.6448536269514722
    """Quantile 0.95 of the standard normal distribution."""

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        size = f"{rows} x {columns} cells of {self.grid.cell_m:g} m"
        return f"SoilMap({size}, {len(self.samples)} samples, {self.variogram.model})"

    @property
    def deconvolved_m(self) -> float:
        """Radius of the footprint that was de-convolved, for a map of each place [m]; 0 for one of means."""
        return round(float(self.samples.spread[:, 3].max(initial=0.0)), 6)

    @cached_property
    def bands(self) -> Bands:
        """All rasters together."""
        return make_bands(self.rate, self.variance, self.curve)

    @property
    def rate_sd(self) -> Array:
        """Kriging standard deviation of the rate [counts/s]."""
        return self.bands.rate_sd

    @property
    def vwc(self) -> Array:
        """Volumetric water content [m^3/m^3]; all NaN without a curve."""
        return self.bands.vwc

    @property
    def vwc_sd(self) -> Array:
        """Standard deviation of the water content [m^3/m^3]; all NaN without a curve."""
        return self.bands.vwc_sd

    @property
    def vwc_p05(self) -> Array:
        """Quantile 0.05 of the water content, the known uncertainty of the calibration included [m^3/m^3]."""
        return self.bands.vwc_p05

    @property
    def vwc_p95(self) -> Array:
        """Quantile 0.95 of the water content, the known uncertainty of the calibration included [m^3/m^3]."""
        return self.bands.vwc_p95

    @property
    def limits(self) -> SoilLimits | None:
        """Lower and upper limit of the water that the soil can hold [m^3/m^3]; ``None`` without a curve."""
        return None if self.curve is None else soil_limits(self.curve.bulk_density_gcm3)

    @cached_property
    def beyond_limits(self) -> NDArray[np.bool_]:
        """Cells whose interval p05 to p95 reaches a limit of the soil, where it is cut; none without a curve."""
        if self.limits is None:
            return np.zeros(self.rate.shape, bool)
        return (self.vwc_p05 <= self.limits.dryness) | (self.vwc_p95 >= self.limits.saturation)

    @property
    def undefined_vwc_cells(self) -> int:
        """Inside cells whose rate is too low for any soil moisture, shown as saturated; 0 without a curve."""
        if self.curve is None:
            return 0
        return int(np.count_nonzero(~self.curve.valid(self.rate) & self.grid.mask))

    @cached_property
    def kriging(self) -> PoissonKriging:
        """The fitted kriging, for estimates at other places."""
        if self.made_by is not None:
            return self.made_by
        samples = self.samples
        prior = None if self.fit is None else self.fit.prior
        kriging = PoissonKriging(self.variogram, self.keep_nugget, self._noise_rate, prior)
        return kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)

    @property
    def noise_variance(self) -> Array:
        """Poisson variance of the rate of each sample, shape (n,) [(counts/s)^2]."""
        return noise_rates(self._noise_rate, self.samples.xy) / self.samples.exposure_s

    @property
    def _noise_rate(self) -> float | LocalRate:
        return (self.fit.local_rate if self.fit is not None else None) or self.mean_rate

    @property
    def unknown_rate_sd(self) -> float:
        """Standard deviation that the model gives the rate far from all samples, about its mean [counts/s]."""
        return math.sqrt(self.variogram.sill if self.keep_nugget else self.variogram.structured_sill)

    @property
    def pooling(self) -> str:
        """Numbers of samples and of their pools, in words; empty if the map is made of all samples."""
        count = len(self.samples)
        return f"of {count} samples in {len(self.kriging.places)} pools" if count > MAX_EXACT_SAMPLES else ""

    def evaluate(self, xy: ArrayLike) -> Bands:
        """The bands at any points, inside the field or not."""
        return make_bands(*self.kriging.predict(xy), self.curve)


def make_soil_map(
    samples: Samples,
    grid: FieldGrid,
    variogram: Variogram | VariogramFit,
    curve: MoistureCurve | None = None,
    keep_nugget: bool = True,
    progress: Callable[[float], None] | None = None,
    changing: Changing | None = None,
    footprint_radius_m: float = 0.0,
) -> SoilMap:
    """Krige the samples onto the cells of a field; of more than :data:`MAX_EXACT_SAMPLES`, neighbours are pooled.

    With a fit, the rate in the noise is the fit's, mean or local: noise changes only at the next fit. What the fit
    knows besides the samples is used.

    :param curve: calibration that turns the rate into soil moisture
    :param changing: the samples by place and time, how their mean changed, and the time of the map [s]; a drift
        needs at most :data:`MAX_EXACT_SAMPLES`, and the samples by time at the places of the samples
    """
    fit = variogram if isinstance(variogram, VariogramFit) else None
    model = variogram.variogram if isinstance(variogram, VariogramFit) else variogram
    known_rate = None if fit is None else fit.noise_rate
    prior = None if fit is None else fit.prior
    kriging = PoissonKriging(model, keep_nugget, known_rate, prior)
    samples = _fit(kriging, samples, changing)
    rate, variance = kriging.predict_grid(grid.x_m, grid.y_m, grid.mask, progress)
    return SoilMap(
        grid,
        rate,
        variance,
        samples=samples,
        variogram=model,
        fit=fit,
        mean_rate=(fit.mean_rate if fit else 0.0) or kriging.noise_mean_rate,
        curve=curve,
        keep_nugget=keep_nugget,
        made_by=kriging,
        clipped_variances=kriging.clipped_variances,
        change=NO_CHANGE if changing is None else changing.change,
        footprint_radius_m=footprint_radius_m,
    )


def _fit(kriging: PoissonKriging, samples: Samples, changing: Changing | None) -> Samples:
    """Fit a kriging to samples, or to those by place and time, as they would be counted at the time of the map.

    :returns: the samples behind the map, as they are before pooling
    """
    if changing is None or changing.change.drift is None:
        some = pooled(samples, MAX_EXACT_SAMPLES)
        kriging.fit(some.xy, some.counts, some.exposure_s, some.spread)
        return samples
    samples, time_s = changing.timed.samples, changing.timed.time_s
    exposure_s = samples.exposure_s * changing.change.drift.factor(time_s)
    known = kriging.mean_rate  # not that of a local rate: it was kriged from these counts
    mean_rate = known.mean if isinstance(known, LocalRate) else known or noise_rate(samples)
    uncertain = changing.change.drift.uncertain(time_s) * mean_rate
    return kriging.fit(samples.xy, samples.counts, exposure_s, samples.spread, uncertain).places


# -- Cells for viewers ---------------------------------------------------------------------------------------


def map_cells(grid: FieldGrid, soil_map: SoilMap | None) -> NDArray[Any]:
    """Cells of a map, rounded to 32 bits.

    :param soil_map: the map on this grid; without a map all bands are NaN
    :returns: array of :data:`CELL`, shape (rows, columns); a cell outside the field is all NaN
    """
    cells = np.full(grid.shape, np.nan, CELL)
    row, column = np.nonzero(grid.mask)
    cells["x"][row, column] = grid.x_m[column]
    cells["y"][row, column] = grid.y_m[row]
    cells["z"][row, column] = 0.0
    if soil_map is not None:
        for name in Bands._fields:
            cells[name] = getattr(soil_map, name)
    return cells
