# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What has changed in a field from one survey to another, with its uncertainty and where it is significant.

The change is a posterior of both surveys together: its variance is ``v1 + v2 - 2 cov``, and the covariance between
the surveys is large where the pattern persists. The difference of two separate maps would not know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.joint_kriging import JointKriging
from soilmoist_ros.mapping.moisture_bands import possible_moisture
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]

FALSE_SHARE = 0.05
"""Expected share of the cells that are called changed, but are not."""
MEAN_PLACES = 500
"""About the largest number of places whose mean stands for that of the field."""
_Z95 = 1.959963984540054
_SLOPE_STEP = 1e-4


@dataclass(frozen=True)
class Estimate:
    """A value with its standard deviation.

    :param value: the value
    :param sd: its standard deviation
    """

    value: float
    sd: float

    @property
    def interval95(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - _Z95 * self.sd, self.value + _Z95 * self.sd


@dataclass(frozen=True, eq=False)
class FieldChange:
    """The change of a field from one survey to another; rasters have shape (ny, nx), NaN outside.

    :param rate: change of the smooth rate [counts/s]
    :param rate_sd: its standard deviation [counts/s]
    :param vwc: change of the moisture [m^3/m^3]; all NaN without a calibration
    :param vwc_sd: its standard deviation [m^3/m^3]
    :param significant: 1 where the rate has risen, -1 where it has fallen, 0 where neither is sure
    :param mean_rate: change of the mean rate of the field [counts/s]
    :param mean_vwc: change of the mean moisture of the field [m^3/m^3], ``None`` without a calibration
    """

    rate: Array
    rate_sd: Array
    vwc: Array
    vwc_sd: Array
    significant: Array
    mean_rate: Estimate
    mean_vwc: Estimate | None

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of the field whose rate has risen (drier) and fallen (wetter) significantly."""
        inside = self.significant[np.isfinite(self.significant)]
        return float((inside > 0).mean()), float((inside < 0).mean())


def field_change(
    kriging: JointKriging,
    grid: FieldGrid,
    survey: int,
    other: int,
    curve: MoistureCurve | None = None,
    maps: Mapping[int, tuple[Array, Array]] | None = None,
    shared: Callable[[Array], Array] | None = None,
) -> FieldChange:
    """The change of a field from one survey to another.

    :param kriging: of all surveys
    :param grid: the field
    :param survey: index of the later survey
    :param other: index of the earlier one
    :param curve: calibration; that of both, so its error shifts both alike
    :param maps: rates and variances of both surveys in the cells, if they are known already
    :param shared: errors that the samples of the later survey share, such as those of a drift, as errors of the
        rate at places of shape (g, 2): one standard deviation of each, shape (g, k) [counts/s]; none by default
    """
    cells, (places, share) = grid.cells, mean_places(grid)
    errors, mean_errors = (np.zeros((len(xy), 1)) if shared is None else shared(xy) for xy in (cells, places))
    error_variance = (errors**2).sum(axis=1)
    rate, variance = kriging.predict(cells, survey, other)
    variance += error_variance
    sd = np.sqrt(variance)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(sd > 0, rate / sd, np.where(rate == 0, 0.0, np.sign(rate) * np.inf))
    sure = discoveries(two_sided(z), FALSE_SHARE) * np.sign(rate)
    mean_variance = kriging.mean(places, {survey: share, other: -share})[1]
    mean_variance += mean_variance_of(mean_errors, share)
    vwc, vwc_sd = np.full((2, len(cells)), np.nan)
    mean_vwc = None
    if curve is not None:
        now, then = (kriging.predict(cells, one) if maps is None else maps[one] for one in (survey, other))
        vwc, vwc_sd = _moisture_change((now[0], now[1] + error_variance), then, variance, curve)
        mean_vwc = _mean_moisture_change(
            kriging, places, share, survey, other, curve, float(vwc.mean()), mean_errors
        )
    raster = grid.to_raster
    return FieldChange(
        raster(rate), raster(sd), raster(vwc), raster(vwc_sd), raster(sure),
        Estimate(float(rate.mean()), math.sqrt(mean_variance)), mean_vwc,
    )  # fmt: skip


def discoveries(p_values: ArrayLike, false_share: float = FALSE_SHARE) -> NDArray[np.bool_]:
    """Which of many hypotheses to reject, so that the expected share of wrong rejections is limited.

    Benjamini & Hochberg (1995), J. R. Stat. Soc. B 57:289-300: with the p-values in order, reject up to the last
    one for which ``p_(k) <= false_share * k / m``. Cells of a map are correlated, and positively. The limit holds
    then, too (Benjamini & Yekutieli 2001, Annals of Statistics 29:1165-1188: positive regression dependence, which
    normal variables with positive correlations have; proved for one-sided tests, and found for two-sided ones).
    In addition, kriging shrinks the change towards its mean, so the p-values are too large rather than too small.

    :param p_values: shape (m,)
    :param false_share: limit of the expected share
    :returns: shape (m,)
    """
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    good = np.flatnonzero(p[order] <= false_share * np.arange(1, len(p) + 1) / max(len(p), 1))
    found = np.zeros(len(p), bool)
    if len(good):
        found[order[: good[-1] + 1]] = True
    return found


def two_sided(z: ArrayLike) -> Array:
    """Probability of a standard normal variable at least as far from 0 as z."""
    from scipy.special import ndtr

    return np.asarray(2 * ndtr(-np.abs(np.asarray(z, float))))


def mean_places(grid: FieldGrid) -> tuple[Array, Array]:
    """Places whose weighted mean stands for that of the field: the centres of square blocks of its cells.

    A small field has a place in each cell. The mean of a value that rises evenly over the field is exact.

    :returns: places, shape (g, 2) [m], and weights, shape (g,), sum 1
    """
    row, column = np.nonzero(grid.mask)
    side = math.ceil(math.sqrt(len(row) / MEAN_PLACES))
    block = row // side * grid.shape[1] + column // side
    _, index, count = np.unique(block, return_inverse=True, return_counts=True)
    centres = [np.bincount(index, axis) / count for axis in grid.cells.T]
    return np.column_stack(centres), count / len(row)


def mean_variance_of(errors: Array, weights: Array) -> float:
    """Variance of a weighted mean over places by errors that the places share [(counts/s)^2].

    :param errors: one standard deviation of each error at the places, shape (g, k) [counts/s]
    :param weights: shape (g,)
    """
    return float(((weights @ errors) ** 2).sum())


def moisture_slope(curve: MoistureCurve, rate: Array) -> Array:
    """Change of the moisture with the rate, by differences [m^3/m^3 per count/s]; 0 at the soil's limits."""
    step = _SLOPE_STEP * np.maximum(rate, 1e-9)
    return np.asarray((possible_moisture(curve, rate + step) - possible_moisture(curve, rate - step)) / (2 * step))


def _moisture_change(
    now: tuple[Array, Array], then: tuple[Array, Array], difference_variance: Array, curve: MoistureCurve
) -> tuple[Array, Array]:
    """Change of the moisture and its standard deviation, to first order, shape (g,) each.

    :param now: rate of the later survey and its variance
    :param then: likewise of the earlier one
    :param difference_variance: variance of the change of the rate
    """
    covariance = (now[1] + then[1] - difference_variance) / 2
    slope_now, slope_then = moisture_slope(curve, now[0]), moisture_slope(curve, then[0])
    variance = slope_now**2 * now[1] + slope_then**2 * then[1] - 2 * slope_now * slope_then * covariance
    change = possible_moisture(curve, now[0]) - possible_moisture(curve, then[0])
    return change, np.sqrt(np.maximum(variance, 0.0))


def _mean_moisture_change(
    kriging: JointKriging,
    places: Array,
    share: Array,
    survey: int,
    other: int,
    curve: MoistureCurve,
    value: float,
    errors: Array,
) -> Estimate:
    """Change of the mean moisture; its error to first order."""
    slopes = {one: share * moisture_slope(curve, kriging.predict(places, one)[0]) for one in (survey, other)}
    _, variance = kriging.mean(places, {survey: slopes[survey], other: -slopes[other]})
    return Estimate(value, math.sqrt(variance + mean_variance_of(errors, slopes[survey])))
