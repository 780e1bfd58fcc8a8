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
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.kriging.system import Points, cholesky_with_jitter, sample_correlation
from soilmoist_ros.mapping.samples import Samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.soil_map import possible_moisture
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]

PERSISTENCES = (0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.87, 0.92, 0.95, 0.975, 0.99, 0.998)
"""Correlations between patterns that are compared."""
DECAYS = (math.inf, 4.0, 1.0, 0.3)
"""Times in which the correlation falls to 1/e, as multiples of the time from the first to the last survey."""
DECAY_EVIDENCE = 2.0  # increase of the log-likelihood from which the pattern counts as fading
MAX_FITTED = 600  # number of samples from which the correlation is estimated; of more, the last surveys are used
_TILE_ELEMENTS = 400_000
MEAN_PLACES = 500  # about the largest number of places whose mean stands for that of the field
_Z95 = 1.959963984540054
_SLOPE_STEP = 1e-4


@dataclass(frozen=True)
class Persistence:
    """Likeness of the patterns of surveys: ``T(s, t) = share * exp(-days / decay_days)``."""

    share: float  # correlation of the patterns of two surveys on one day, 0..1
    sd: float = 0.0  # standard deviation of the share
    decay_days: float = math.inf  # time in which the correlation falls to 1/e [d]

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
        """
        if len(surveys) < 2:
            return Persistence(1.0)
        chosen: list[int] = []
        for index in np.argsort(stamps_s)[::-1].tolist():
            if len(chosen) > 1 and sum(len(surveys[one]) for one in chosen) + len(surveys[index]) > MAX_FITTED:
                break
            chosen.append(index)
        times = np.array([stamps_s[index] for index in chosen])
        stack = _Stack.of(variogram, [surveys[index] for index in chosen])
        span_days = float(np.ptp(times)) / DAY_S
        decays_days = [decay * span_days for decay in DECAYS] if len(chosen) > 2 and span_days > 0 else [math.inf]
        shares = np.array(PERSISTENCES)
        tried = [[Persistence(share, 0.0, days) for share in PERSISTENCES] for days in decays_days]
        log = np.array([[stack.solved(one.matrix(times)).log_likelihood for one in row] for row in tried])
        best = int(log.max(axis=1).argmax())
        if log[best].max() < log[0].max() + DECAY_EVIDENCE:
            best = 0
        weight = np.gradient(shares) * np.exp(log[best] - log[best].max())  # the shares are not evenly spaced
        weight /= weight.sum()
        mean = float(weight @ shares)
        sd = math.sqrt(max(float(weight @ (shares - mean) ** 2), 0.0))
        return Persistence(mean, sd, decays_days[best])


class _Solved(NamedTuple):
    """Universal kriging of the rates z of all surveys, whose covariance is K = L L' and whose trend is T."""

    factor: Array  # L, lower triangle, shape (n, n)
    trend: Array  # L^-1 T, shape (n, s)
    mean_covariance: Array  # (T' K^-1 T)^-1, shape (s, s)
    means: Array  # generalised least-squares mean of each survey, shape (s,) [counts/s]
    residual: Array  # L^-1 (z - T means), shape (n,)

    @property
    def log_likelihood(self) -> float:
        """Restricted log-likelihood of the rates, but for a constant."""
        determinants = 2 * np.log(np.diag(self.factor)).sum() - np.linalg.slogdet(self.mean_covariance)[1]
        return -0.5 * float(determinants + self.residual @ self.residual)


class _Stack(NamedTuple):
    """The samples of all surveys, one behind the other."""

    variogram: Variogram
    xy: Array  # places, shape (n, 2) [m]
    spread: Array  # their supports, shape (n, 4)
    rate: Array  # rates, shape (n,) [counts/s]
    noise: Array  # their Poisson variances, with the rate of their surroundings, shape (n,) [(counts/s)^2]
    survey: NDArray[np.intp]  # index of the survey of each, shape (n,)
    between: Array  # correlation as if all were of one survey, shape (n, n)

    @classmethod
    def of(cls, variogram: Variogram, surveys: Sequence[Samples]) -> _Stack:
        """The stack of surveys."""
        places = [merge_exactly(one)[0] for one in surveys]
        rates = [
            LocalRate.of(one, variogram)(one.xy) if len(one) > 1 else np.full(1, noise_rate(one)) for one in places
        ]
        xy, spread, rate, exposure_s = (
            np.concatenate([getattr(one, name) for one in places])
            for name in ("xy", "spread", "rate_cps", "exposure_s")
        )
        survey = np.repeat(np.arange(len(places)), list(map(len, places)))
        between = np.ascontiguousarray(sample_correlation(variogram, xy, spread))
        return cls(variogram, xy, spread, rate, np.concatenate(rates) / exposure_s, survey, between)

    def correlation_with(self, xy: Array) -> Array:
        """Correlation of the samples with points, as if all were of one survey, shape (n, g)."""
        points = Points(self.variogram, self.xy, xy, self.spread)
        return np.asarray(points.correlation(slice(0, len(xy))).T)

    def solved(self, correlation: Array) -> _Solved:
        """The kriging system of a correlation T between surveys, shape (s, s)."""
        from scipy.linalg import solve_triangular

        covariance = self.variogram.structured_sill * self.between * correlation[np.ix_(self.survey, self.survey)]
        factor, _ = cholesky_with_jitter(covariance, self.variogram.nugget + self.noise, self.variogram.sill)
        indicators = np.asarray(self.survey[:, None] == np.arange(len(correlation)), float)
        trend = solve_triangular(factor, indicators, lower=True, check_finite=False)
        rate = solve_triangular(factor, self.rate, lower=True, check_finite=False)
        mean_covariance = np.linalg.inv(trend.T @ trend)
        means = mean_covariance @ (trend.T @ rate)
        return _Solved(factor, trend, mean_covariance, means, rate - trend @ means)


class JointKriging:
    """The rates of several surveys, given the counts of all of them.

    :param correlation: T, shape (s, s)
    :raises IllConditionedError: if the matrix cannot be factored
    """

    def __init__(self, variogram: Variogram, surveys: Sequence[Samples], correlation: Array) -> None:
        self.variogram = variogram
        self.correlation = np.asarray(correlation, float)
        self._stack = _Stack.of(self.variogram, surveys)
        self._solved = self._stack.solved(self.correlation)

    @property
    def means(self) -> Array:
        """Mean of the rate of each survey, shape (s,) [counts/s]."""
        return self._solved.means

    def predict(self, xy: Array, survey: int, other: int | None = None) -> tuple[Array, Array]:
        """Rate of a survey, or its difference from that of another, [counts/s] and the variance [(counts/s)^2].

        The variance is that of the smooth rate, without its nugget and without counting noise.
        """
        from scipy.linalg import solve_triangular

        L, trend, mean_covariance, means, residual = self._solved
        weights = np.zeros(len(self.correlation))
        weights[survey] = 1.0
        if other is not None:
            weights[other] -= 1.0
        sill = self.variogram.structured_sill
        prior = sill * float(weights @ self.correlation @ weights)
        of_sample = (self.correlation @ weights)[self._stack.survey]
        rate, variance = np.empty((2, len(xy)))
        step = max(1, _TILE_ELEMENTS // len(of_sample))
        for tile in (slice(start, start + step) for start in range(0, len(xy), step)):
            known = sill * of_sample[:, None] * self._stack.correlation_with(xy[tile])
            W = solve_triangular(L, known, lower=True, overwrite_b=True, check_finite=False)
            lacking = weights[:, None] - trend.T @ W
            rate[tile] = weights @ means + residual @ W
            variance[tile] = prior - np.einsum("ij,ij->j", W, W)
            variance[tile] += np.einsum("ig,ij,jg->g", lacking, mean_covariance, lacking)
        return rate, np.maximum(variance, 0.0)

    def mean(self, xy: Array, weights: dict[int, Array]) -> tuple[float, float]:
        """A mean over some hundred places by weights for the rate of each survey, shape (g,), and its variance."""
        from scipy.linalg import solve_triangular

        L, trend, mean_covariance, means, residual = self._solved
        sill, index, table = self.variogram.structured_sill, np.array(list(weights)), np.array([*weights.values()])
        inner = table @ Points(self.variogram, xy, xy).correlation(slice(0, len(xy))) @ table.T
        prior = sill * float((inner * self.correlation[np.ix_(index, index)]).sum())
        with_samples = self._stack.correlation_with(xy) @ table.T
        known = sill * (with_samples * self.correlation[np.ix_(self._stack.survey, index)]).sum(axis=1)
        W = solve_triangular(L, known, lower=True, check_finite=False)
        total = np.zeros(len(self.correlation))
        total[index] = table.sum(axis=1)
        lacking = total - trend.T @ W
        variance = prior - float(W @ W) + float(lacking @ mean_covariance @ lacking)
        return float(total @ means + residual @ W), max(variance, 0.0)


# -- Change --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SurveysEstimate:
    """A value with its standard deviation."""

    value: float
    sd: float

    @property
    def interval95(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - _Z95 * self.sd, self.value + _Z95 * self.sd


@dataclass(frozen=True, eq=False)
class FieldChange:
    """The change of a field from one survey to another; rasters have shape (ny, nx), NaN outside."""

    rate: Array  # change of the smooth rate [counts/s]
    rate_sd: Array  # its standard deviation [counts/s]
    vwc: Array  # change of the moisture [m^3/m^3]; all NaN without a calibration
    vwc_sd: Array  # its standard deviation [m^3/m^3]
    significant: Array  # 1 where the rate has risen, -1 where it has fallen, 0 where neither is sure
    mean_rate: SurveysEstimate  # change of the mean rate of the field [counts/s]
    mean_vwc: SurveysEstimate | None  # change of its mean moisture [m^3/m^3], ``None`` without a calibration

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
    """The change of a field from one survey to another; that of the moisture to first order.

    The expected share of cells that are wrongly called changed is limited (Benjamini & Hochberg 1995, J. R. Stat.
    Soc. B 57:289-300). Cells of a map are correlated, and positively: the limit holds then, too (Benjamini &
    Yekutieli 2001, Annals of Statistics 29:1165-1188; proved for one-sided tests, and found for two-sided ones).
    Kriging shrinks the change towards its mean, so the p-values are too large rather than too small.

    :param other: index of the earlier one
    :param curve: calibration; that of both, so its error shifts both alike
    :param maps: rates and variances of both surveys in the cells, if they are known already
    :param shared: errors that the samples of the later survey share, such as those of a drift, as errors of the
        rate at places of shape (g, 2): one standard deviation of each, shape (g, k) [counts/s]; none by default
    """
    from scipy.special import ndtr
    from scipy.stats import false_discovery_control

    cells, (places, share) = grid.cells, mean_places(grid)
    errors, mean_errors = (np.zeros((len(xy), 1)) if shared is None else shared(xy) for xy in (cells, places))
    error_variance = (errors**2).sum(axis=1)
    rate, variance = kriging.predict(cells, survey, other)
    variance += error_variance
    sd = np.sqrt(variance)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(sd > 0, rate / sd, np.where(rate == 0, 0.0, np.sign(rate) * np.inf))
    sure = (false_discovery_control(2 * ndtr(-np.abs(z))) <= FieldChange.FALSE_SHARE) * np.sign(rate)

    def mean(value: Array, of_now: Array, of_then: Array) -> SurveysEstimate:
        """Mean of a change, whose weights of the rates of both surveys are these."""
        _, mean_variance = kriging.mean(places, {survey: of_now, other: -of_then})
        mean_variance += float(((of_now @ mean_errors) ** 2).sum())
        return SurveysEstimate(float(value.mean()), math.sqrt(mean_variance))

    vwc, vwc_sd = np.full((2, len(cells)), np.nan)
    mean_vwc = None
    if curve is not None:
        (now, now_variance), (then, then_variance) = (
            kriging.predict(cells, one) if maps is None else maps[one] for one in (survey, other)
        )
        now_variance = now_variance + error_variance
        covariance = (now_variance + then_variance - variance) / 2
        a, b = moisture_slope(curve, now), moisture_slope(curve, then)
        vwc_sd = np.sqrt(np.maximum(a**2 * now_variance + b**2 * then_variance - 2 * a * b * covariance, 0.0))
        vwc = possible_moisture(curve, now) - possible_moisture(curve, then)
        slopes = (share * moisture_slope(curve, kriging.predict(places, one)[0]) for one in (survey, other))
        mean_vwc = mean(vwc, *slopes)
    raster = grid.to_raster
    return FieldChange(
        raster(rate), raster(sd), raster(vwc), raster(vwc_sd), raster(sure), mean(rate, share, share), mean_vwc
    )


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


def moisture_slope(curve: MoistureCurve, rate: Array) -> Array:
    """Change of the moisture with the rate, by differences [m^3/m^3 per count/s]; 0 at the soil's limits."""
    step = _SLOPE_STEP * np.maximum(rate, 1e-9)
    return np.asarray((possible_moisture(curve, rate + step) - possible_moisture(curve, rate - step)) / (2 * step))
