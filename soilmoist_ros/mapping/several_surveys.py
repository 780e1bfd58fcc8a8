# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several surveys of a field kriged together: maps of each, their differences, and where a change is significant.

The rate of survey s is ``m_s + Z_s(x)``, with unknown means m_s and
``cov(Z_s(x), Z_t(x')) = structured sill * R(x - x') * T(s, t)``; samples have a nugget and their Poisson noise in
addition. This is universal kriging with one indicator per survey as trend (Chiles & Delfiner 2012, Geostatistics,
chapters 3 and 5). It is exact, and for some thousand samples at most; maps on line use :mod:`.joint_fit`.

The change is a posterior of both surveys together: its variance is ``v1 + v2 - 2 cov``, and the covariance between
the surveys is large where the pattern persists. The difference of two separate maps would not know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.kriging.system import Points, cholesky_with_jitter, sample_correlation
from soilmoist_ros.mapping.samples import Samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.soil_map import possible_moisture
from soilmoist_ros.mapping.variogram.local import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]

PERSISTENCES = (0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.975, 0.99, 0.998)
"""Correlations between patterns that are compared."""
DECAYS = (math.inf, 4.0, 1.0, 0.3)
"""Times in which the correlation falls to 1/e, as multiples of the time from the first to the last survey."""
DECAY_EVIDENCE = 2.0
"""Increase of the log-likelihood from which the pattern counts as fading."""
MAX_FITTED = 600
"""Number of samples from which the correlation is estimated; of more, the last surveys are used."""
_TILE_ELEMENTS = 400_000
MEAN_PLACES = 500
"""About the largest number of places whose mean stands for that of the field."""
_Z95 = 1.959963984540054
_SLOPE_STEP = 1e-4


@dataclass(frozen=True)
class Persistence:
    """Likeness of the patterns of surveys: ``T(s, t) = share * exp(-days / decay_days)``.

    :param share: correlation of the patterns of two surveys on one day, 0..1
    :param sd: its standard deviation
    :param decay_days: time in which it falls to 1/e [d]; infinite if it does not
    """

    share: float
    sd: float = 0.0
    decay_days: float = math.inf

    def matrix(self, stamps_s: ArrayLike) -> Array:
        """T for surveys at these times [s], shape (s, s)."""
        days = np.abs(np.subtract.outer(stamps_s, stamps_s)) / DAY_S
        between = self.share * np.exp(-days / self.decay_days)
        np.fill_diagonal(between, 1.0)
        return np.asarray(between)

    @classmethod
    def estimate(cls, variogram: Variogram, surveys: Sequence[Samples], stamps_s: Sequence[float]) -> Persistence:
        """Persistence of the patterns of surveys, by restricted maximum likelihood.

        The mean over :data:`PERSISTENCES`, each weighted by its likelihood. The decay is searched with three
        surveys or more that have different times.

        :param variogram: variogram of the rate of each survey
        :param surveys: samples of each survey
        :param stamps_s: times of the surveys [s]
        """
        if len(surveys) < 2:
            return Persistence(1.0)
        chosen: list[int] = []
        for index in np.argsort(stamps_s)[::-1].tolist():
            if len(chosen) > 1 and sum(len(surveys[one]) for one in chosen) + len(surveys[index]) > MAX_FITTED:
                break
            chosen.append(index)
        times = np.array([stamps_s[index] for index in chosen])
        stack = _Stack.of(variogram.stationary, [surveys[index] for index in chosen])
        span_days = float(np.ptp(times)) / DAY_S
        decays = DECAYS if len(chosen) > 2 and span_days > 0 else DECAYS[:1]
        shares = np.array(PERSISTENCES)
        decays_days = [decay * span_days if span_days else math.inf for decay in decays]
        tried = [[Persistence(share, 0.0, days) for share in PERSISTENCES] for days in decays_days]
        log = np.array([[stack.log_likelihood(one.matrix(times)) for one in row] for row in tried])
        best = int(log.max(axis=1).argmax())
        if log[best].max() < log[0].max() + DECAY_EVIDENCE:
            best = 0
        widths = np.gradient(shares)  # the shares are not evenly spaced
        weight = widths * np.exp(log[best] - log[best].max())
        weight /= weight.sum()
        mean = float(weight @ shares)
        sd = math.sqrt(max(float(weight @ (shares - mean) ** 2), 0.0))
        return Persistence(mean, sd, decays_days[best])


class JointKriging:
    """The rates of several surveys, given the counts of all of them.

    :param variogram: variogram of the rate of each survey; an amplitude that differs by place is left out
    :param surveys: samples of each survey, at least one survey
    :param correlation: T, shape (s, s)
    :raises IllConditionedError: if the matrix cannot be factored
    """

    def __init__(self, variogram: Variogram, surveys: Sequence[Samples], correlation: Array) -> None:
        self.variogram = variogram.stationary
        self.correlation = np.asarray(correlation, float)
        self._stack = _Stack.of(self.variogram, surveys)
        self._solve()

    def __repr__(self) -> str:
        return f"JointKriging({len(self.correlation)} surveys, {len(self._stack.rate)} places)"

    def _solve(self) -> None:
        from scipy.linalg import solve_triangular

        stack = self._stack
        self._factor = stack.factor(self.correlation)
        self._trend = solve_triangular(self._factor, stack.trend, lower=True, check_finite=False)
        rate = solve_triangular(self._factor, stack.rate, lower=True, check_finite=False)
        self._mean_covariance = np.linalg.inv(self._trend.T @ self._trend)
        self.means = self._mean_covariance @ (self._trend.T @ rate)
        self._residual = rate - self._trend @ self.means

    def predict(self, xy: Array, survey: int, other: int | None = None) -> tuple[Array, Array]:
        """Rate of a survey, or its difference from that of another survey, and the variance.

        The variance is that of the smooth rate, without its nugget and without counting noise.

        :param xy: places, shape (g, 2) [m]
        :param survey: index of the survey
        :param other: index of the survey that is subtracted
        :returns: rate [counts/s] and variance [(counts/s)^2], each of shape (g,)
        """
        from scipy.linalg import solve_triangular

        weights = np.zeros(len(self.correlation))
        weights[survey] = 1.0
        if other is not None:
            weights[other] -= 1.0
        sill = self.variogram.structured_sill
        prior = sill * float(weights @ self.correlation @ weights)
        rate, variance = np.empty((2, len(xy)))
        of_sample = (self.correlation @ weights)[self._stack.survey]
        step = max(1, _TILE_ELEMENTS // len(of_sample))
        for start in range(0, len(xy), step):
            tile = slice(start, start + step)
            known = sill * of_sample[:, None] * self._stack.correlation_with(xy[tile])
            solved = solve_triangular(self._factor, known, lower=True, overwrite_b=True, check_finite=False)
            lacking = weights[:, None] - self._trend.T @ solved
            rate[tile] = weights @ self.means + self._residual @ solved
            explained = np.einsum("ij,ij->j", solved, solved)
            variance[tile] = prior - explained + np.einsum("ig,ij,jg->g", lacking, self._mean_covariance, lacking)
        return rate, np.maximum(variance, 0.0)

    def mean(self, xy: Array, weights: dict[int, Array]) -> tuple[float, float]:
        """A weighted mean over places, and its variance.

        :param xy: places, shape (g, 2) [m]; some hundred
        :param weights: weight of the rate of each survey at the places, shape (g,) each
        :returns: sum of the weighted rates, and its variance
        """
        from scipy.linalg import solve_triangular

        sill, surveys = self.variogram.structured_sill, list(weights)
        index = np.array(surveys)
        table = np.array([weights[number] for number in surveys])
        between = Points(self.variogram, xy, xy).correlation(slice(0, len(xy)))
        inner = table @ between @ table.T
        prior = sill * float((inner * self.correlation[np.ix_(index, index)]).sum())
        with_samples = self._stack.correlation_with(xy) @ table.T
        known = sill * (with_samples * self.correlation[np.ix_(self._stack.survey, index)]).sum(axis=1)
        solved = solve_triangular(self._factor, known, lower=True, check_finite=False)
        trend = np.zeros(len(self.correlation))
        trend[surveys] = table.sum(axis=1)
        lacking = trend - self._trend.T @ solved
        value = float(trend @ self.means + self._residual @ solved)
        return value, max(prior - float(solved @ solved) + float(lacking @ self._mean_covariance @ lacking), 0.0)


@dataclass(frozen=True, eq=False)
class _Stack:
    """The samples of all surveys, one behind the other."""

    variogram: Variogram  # variogram of the rate
    xy: Array  # places, shape (n, 2) [m]
    spread: Array  # their supports, shape (n, 4)
    rate: Array  # rates, shape (n,) [counts/s]
    noise: Array  # their Poisson variances, shape (n,) [(counts/s)^2]
    survey: NDArray[np.intp]  # index of the survey of each, shape (n,)

    @classmethod
    def of(cls, variogram: Variogram, surveys: Sequence[Samples]) -> _Stack:
        """The stack of surveys."""
        places = [merge_exactly(one)[0] for one in surveys]
        noise = [_noise(one, variogram) for one in places]
        number = [np.full(len(one), index) for index, one in enumerate(places)]
        xy, spread, rate = (
            np.concatenate([getattr(one, name) for one in places]) for name in ("xy", "spread", "rate_cps")
        )
        return cls(variogram, xy, spread, rate, np.concatenate(noise), np.concatenate(number))

    @cached_property
    def trend(self) -> Array:
        """Indicators of the surveys, shape (n, s)."""
        return np.asarray(self.survey[:, None] == np.arange(self.survey.max() + 1), float)

    @cached_property
    def _between(self) -> Array:
        """Correlation of the samples as if all were of one survey, shape (n, n)."""
        return np.ascontiguousarray(sample_correlation(self.variogram, self.xy, self.spread))

    def correlation_with(self, xy: Array) -> Array:
        """Correlation of the samples with points, as if all were of one survey, shape (n, g)."""
        points = Points(self.variogram, self.xy, xy, self.spread)
        return np.asarray(points.correlation(slice(0, len(xy))).T)

    def factor(self, correlation: Array) -> Array:
        """Cholesky factor of the covariance of the samples.

        :raises IllConditionedError: if there is none
        """
        covariance = self.variogram.structured_sill * self._between * correlation[np.ix_(self.survey, self.survey)]
        return cholesky_with_jitter(covariance, self.variogram.nugget + self.noise, self.variogram.sill)[0]

    def log_likelihood(self, correlation: Array) -> float:
        """Restricted log-likelihood of the rates, but for a constant."""
        from scipy.linalg import solve_triangular

        factor = self.factor(correlation)
        solved = solve_triangular(factor, np.column_stack([self.trend, self.rate]), lower=True, check_finite=False)
        trend, rate = solved[:, :-1], solved[:, -1]
        inner = trend.T @ trend
        mean = np.linalg.solve(inner, trend.T @ rate)
        residual = rate - trend @ mean
        determinants = 2 * float(np.log(np.diag(factor)).sum()) + float(np.linalg.slogdet(inner)[1])
        return -0.5 * (determinants + float(residual @ residual))


def _noise(places: Samples, variogram: Variogram) -> Array:
    """Poisson variance of the rate of each place, with the rate of its surroundings [(counts/s)^2]."""
    rate = LocalRate.of(places, variogram)(places.xy) if len(places) > 1 else noise_rate(places)
    return np.asarray(rate / places.exposure_s)


# -- Change --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SurveysEstimate:
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
    mean_rate: SurveysEstimate
    mean_vwc: SurveysEstimate | None

    FALSE_SHARE: ClassVar[float] = 0.05
    """Expected share of the cells that are called changed, but are not."""

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
    sure = discoveries(two_sided(z), FieldChange.FALSE_SHARE) * np.sign(rate)
    mean_variance = kriging.mean(places, {survey: share, other: -share})[1]
    mean_variance += _variance_of(mean_errors, share)
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
        SurveysEstimate(float(rate.mean()), math.sqrt(mean_variance)), mean_vwc,
    )  # fmt: skip


def discoveries(p_values: ArrayLike, false_share: float) -> NDArray[np.bool_]:
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
    from scipy.stats import false_discovery_control

    return np.asarray(false_discovery_control(np.asarray(p_values, float)) <= false_share)


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


def _variance_of(errors: Array, weights: Array) -> float:
    """Variance of a weighted mean over places by errors that the places share [(counts/s)^2]."""
    return float(((weights @ errors) ** 2).sum())


def moisture_slope(curve: MoistureCurve, rate: Array) -> Array:
    """Change of the moisture with the rate, by differences [m^3/m^3 per count/s]; 0 at the soil's limits."""
    step = _SLOPE_STEP * np.maximum(rate, 1e-9)
    return np.asarray((possible_moisture(curve, rate + step) - possible_moisture(curve, rate - step)) / (2 * step))


def _moisture_change(
    now: tuple[Array, Array], then: tuple[Array, Array], difference_variance: Array, curve: MoistureCurve
) -> tuple[Array, Array]:
    """Change of the moisture and its standard deviation, to first order, shape (g,) each."""
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
) -> SurveysEstimate:
    """Change of the mean moisture; its error to first order."""
    slopes = {one: share * moisture_slope(curve, kriging.predict(places, one)[0]) for one in (survey, other)}
    _, variance = kriging.mean(places, {survey: slopes[survey], other: -slopes[other]})
    return SurveysEstimate(value, math.sqrt(variance + _variance_of(errors, slopes[survey])))
