# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Poisson kriging: the count rate and its variance at unsampled places, from neutron counts.

Monestiez, Dubroca, Bonnin, Durbec & Guinet (2006), Ecological Modelling 193:615-628. For samples i with
counts Z_i and exposures t_i, and a target 0::

    sum_j w_j C_ij + w_i m*/t_i + mu = C_i0   (i = 1..n),     sum_j w_j = 1
    rate = sum_i w_i Z_i/t_i,                 variance = C_00 - sum_i w_i C_i0 - mu

With the Cholesky factor L of the matrix, W = L^-1 C_.0, b = L^-1 1 and a = L^-1 (Z/t - c), where c is the
generalised least-squares mean, this becomes ``rate = c + a.W`` and
``variance = C_00 - |W|^2 + (b.W - 1)^2 / b.b``: one triangular solve per target, no inverse. On a
large raster most of this work is not needed (:mod:`.raster`).
"""

from __future__ import annotations

import logging
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.kriging.raster import check_raster, krige_raster
from soilmoist_ros.mapping.kriging.system import (
    KrigingSystem,
    Points,
    Progress,
    cholesky_with_jitter,
    coincident,
    sample_correlation,
    target_variance,
)
from soilmoist_ros.mapping.samples import NO_SAMPLES, Samples, as_samples, check_xy, merge_exactly, noise_rate
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)


class PoissonKriging:
    """Kriging of Poisson counts with unknown constant mean (the ordinary form).

    Records at one place are merged, which is exact.

    :param keep_nugget: whether the target is the rate with its micro-scale variation (C_00 = sill, also the
        covariance with a sample at the target), or only its smooth part (sill - nugget in both cases)
    :param prior: what is known of the field besides
    :param mean_rate: mean rate m* in the noise variances m*/t [counts/s], by default sum of counts / sum of
        exposures; or a :class:`LocalRate` for noise variances with the rate at the place of each sample. The mean
        of the *map* is always estimated

    >>> kriging = PoissonKriging(Variogram("matern32", nugget=0.0, range_m=15.0, sill=0.5))
    >>> kriging.fit([(0, 0), (20, 0)], counts=[300, 500], exposure_s=[100.0, 100.0])
    PoissonKriging(matern32, 2 places)
    >>> rate, variance = kriging.predict([(5, 0), (1000, 0)])
    >>> rate.round(2), variance.round(2)
    (array([3.46, 4.  ]), array([0.11, 0.85]))
    """

    def __init__(
        self,
        variogram: Variogram,
        keep_nugget: bool = True,
        mean_rate: float | LocalRate | None = None,
        prior: FieldPrior | None = None,
    ) -> None:
        if isinstance(mean_rate, (int, float)) and not (np.isfinite(mean_rate) and mean_rate > 0):
            raise ValueError(f"mean_rate must be positive and finite, got {mean_rate}")
        self.variogram = variogram
        self.keep_nugget = keep_nugget
        self.mean_rate = mean_rate
        self.prior = prior
        self.noise_mean_rate = float("nan")  # the m* in use; with a local rate, that of the data [counts/s]
        self.jitter = 0.0  # added to the diagonal to make the matrix positive definite [(counts/s)^2]
        self.clipped_variances = 0  # variances of the last prediction that were negative and set to 0
        self._records: Samples | None = None
        self._record_place: NDArray[np.intp] = np.empty(0, int)
        self._uncertain = np.empty((0, 0))
        none = np.empty(0)
        self._system = KrigingSystem(variogram, NO_SAMPLES, np.empty((0, 0)), none, none, float("nan"))

    def __repr__(self) -> str:
        return f"PoissonKriging({self.variogram.model}, {len(self.places)} places)"

    @property
    def places(self) -> Samples:
        """The merged samples: one per distinct place, in the order of first appearance."""
        return self._system.places

    @property
    def map_mean(self) -> float:
        """Generalised least-squares mean of the rate [counts/s].

        It is the limit of the map far from all samples, or the difference of the map from the prior mean there.
        """
        return self._system.mean

    @property
    def system(self) -> KrigingSystem:
        """The factored system of the merged samples."""
        return self._system

    def fit(
        self,
        xy: ArrayLike,
        counts: ArrayLike,
        exposure_s: ArrayLike,
        spread: ArrayLike | None = None,
        uncertain: Array | None = None,
    ) -> PoissonKriging:
        """Replace the samples and factor the kriging matrix.

        :param xy: places, shape (n, 2), n >= 1 [m]
        :param counts: raw counts, shape (n,)
        :param spread: second moments of the areas over which the samples were counted, shape (n, 4), see
            :mod:`support`; all points by default
        :param uncertain: independent errors that the rates share and the targets have not, one standard deviation
            of each, shape (n, k) [counts/s], such as those of a drift; none by default. They add to the variance,
            but leave the weights as they are
        :raises ValueError: if there is no sample, or as :class:`Samples`
        :raises IllConditionedError: if the matrix cannot be factored
        """
        records = as_samples(xy, counts, exposure_s, spread)
        if not len(records):
            raise ValueError("kriging needs at least one sample; wait for the first record")
        self._factor(records, np.empty((len(records), 0)) if uncertain is None else uncertain)
        return self

    def add(
        self, xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike, spread: ArrayLike | None = None
    ) -> PoissonKriging:
        """Add samples, or one place (x, y) and two numbers, as if all had been given to :meth:`fit`.

        :returns: itself; errors that earlier samples share are not in these
        :raises ValueError: as :meth:`fit`; earlier samples stay as they were
        """
        new = as_samples(xy, counts, exposure_s, spread)
        if self._records is None:
            return self.fit(new.xy, new.counts, new.exposure_s, new.spread)
        if len(new):
            self._factor(self._records.joined(new), np.pad(self._uncertain, ((0, len(new)), (0, 0))))
        return self

    def predict(self, xy: ArrayLike, progress: Progress | None = None) -> tuple[Array, Array]:
        """Rate and kriging variance at points.

        :returns: rate [counts/s] and variance without counting noise [(counts/s)^2], each of shape (g,)
        """
        targets = self._targets(check_xy(xy))
        rate, variance = self._system.surfaces(targets, self.keep_nugget, progress)
        variance += target_variance(self.variogram, self.keep_nugget)
        self.clipped_variances = clip_negative(variance, self.variogram.sill)
        return rate, variance

    def predict_grid(
        self,
        x_m: ArrayLike,
        y_m: ArrayLike,
        mask: NDArray[np.bool_] | None = None,
        progress: Progress | None = None,
    ) -> tuple[Array, Array]:
        """Rate and kriging variance on a raster; equal to :meth:`predict`, but faster.

        :param mask: cells wanted, shape (ny, nx), by default all; other cells are NaN
        """
        x, y, wanted = check_raster(x_m, y_m, mask)
        self._fitted()
        rate, variance = krige_raster(self._system, x, y, wanted, self.keep_nugget, progress)
        self.clipped_variances = clip_negative(variance, self.variogram.sill)
        return rate, variance

    def weights(self, xy: ArrayLike) -> tuple[Array, Array]:
        """Kriging weights and Lagrange multipliers.

        :returns: weights, shape (n, g), of the n records *as given* (those at one place share the weight of
            the place in proportion to exposure), and Lagrange multipliers mu, shape (g,) [(counts/s)^2]
        """
        from scipy.linalg import solve_triangular

        targets = self._targets(check_xy(xy))
        factor, ones = self._system.factor, self._system.ones
        solved = np.concatenate(
            [tile for _, tile in self._system.solved_tiles(targets, self.keep_nugget)]
            or [np.empty((0, len(ones)))]
        )
        lagrange = (solved @ ones - 1) / (ones @ ones)
        right = (solved - lagrange[:, None] * ones).T
        of_places = solve_triangular(factor, right, lower=True, trans="T", check_finite=False)
        assert self._records is not None
        share = self._records.exposure_s / self.places.exposure_s[self._record_place]
        return of_places[self._record_place] * share[:, None], lagrange

    def counting_variance(self, xy: ArrayLike) -> Array:
        """Part of the variance of :meth:`predict` that the counting noise of the samples makes, shape (g,)
        [(counts/s)^2].

        The error at a place is ``sum_i w_i e_i + (sum_i w_i R_i - R_0)`` with the counting errors e of the samples
        and the true rates R. The two are uncorrelated, so the variance is the sum of ``sum_i w_i^2 m*/t_i`` and of
        the error of interpolation with these weights. Longer counting changes the weights as well, which lowers
        the variance further: it is concave in the noise.
        """
        weights = self.weights(xy)[0]
        records = self._records
        assert records is not None
        rate = self.mean_rate if isinstance(self.mean_rate, LocalRate) else self.noise_mean_rate
        return np.asarray(weights.T**2 @ (noise_rates(rate, records.xy) / records.exposure_s))

    def covariance(self, xy: ArrayLike) -> Array:
        """Covariance of the kriging errors of the *smooth* rate between places, shape (m, m) [(counts/s)^2].

        Its diagonal is the variance that :meth:`predict` gives without nugget and without what the prior knows of
        no two places.
        """
        return self.rate_and_covariance(xy)[1]

    def rate_and_covariance(self, xy: ArrayLike) -> tuple[Array, Array]:
        """The rate of :meth:`predict`, shape (m,) [counts/s], and :meth:`covariance`, together."""
        from scipy.linalg import solve_triangular

        targets, variogram, system, prior = check_xy(xy), self.variogram, self._system, self.prior
        ones = system.ones
        known = self._targets(targets).correlation(slice(0, len(targets))) * variogram.structured_sill
        at = None if prior is None else prior.at(targets)
        if prior is not None and at is not None:
            known += prior.covariance(at, system.features)
        solved = solve_triangular(system.factor, known.T, lower=True, check_finite=False)
        weights = solve_triangular(system.factor, system.residual, lower=True, trans="T", check_finite=False)
        rate = known @ weights
        if self.keep_nugget:
            target, place = coincident(targets, self.places.xy)
            rate[target] += variogram.nugget * weights[place]
        rate += system.mean
        mean = (ones @ solved - 1) / np.sqrt(ones @ ones)
        between = solved.T @ solved
        np.subtract(_prior_covariance(variogram, targets.tobytes()), between, out=between)
        between += np.multiply.outer(mean, mean)
        if prior is not None and at is not None:
            between += prior.covariance(at, at)
            rate += prior.mean(at)
        if self._uncertain.size:
            shared = system.shared(solved.T)
            between += shared @ shared.T
        return rate, np.asarray(between)

    def shared(self, xy: ArrayLike) -> Array:
        """Errors that the rates at places have by those that the samples share (``uncertain`` of :meth:`fit`).

        :returns: one standard deviation of each independent error, shape (m, k) [counts/s]
        """
        targets = self._targets(check_xy(xy))
        if not self._uncertain.size:
            return np.empty((len(targets.xy), 0))
        tiles = self._system.solved_tiles(targets, self.keep_nugget)
        return np.concatenate([self._system.shared(solved) for _, solved in tiles])

    def _fitted(self) -> Samples:
        if self._records is None:
            raise RuntimeError("the kriging has no samples yet; call fit() first")
        return self.places

    def _targets(self, xy: Array) -> Points:
        places = self._fitted()
        return Points(self.variogram, places.xy, xy, places.spread)

    def _factor(self, records: Samples, uncertain: Array) -> None:
        """Factor the matrix of the merged records, with as little jitter as makes it positive definite."""
        variogram, prior, rate = self.variogram, self.prior, self.mean_rate
        self._records, self._uncertain = records, uncertain
        places, self._record_place = merge_exactly(records)
        self.noise_mean_rate = noise_rate(places) if rate is None or isinstance(rate, LocalRate) else rate
        rate = rate if isinstance(rate, LocalRate) else self.noise_mean_rate
        noise = noise_rates(rate, places.xy) / places.exposure_s
        matrix = sample_correlation(variogram, places.xy, places.spread).T
        matrix *= variogram.structured_sill
        features = np.empty((0, 0))
        if prior is not None:
            features = prior.at(places.xy, places.spread)
            matrix += prior.covariance(features, features)
            matrix[np.diag_indices(len(places))] += prior.own_variance(places.xy)
        scale = variogram.sill + float(np.mean(noise))
        factor, self.jitter = cholesky_with_jitter(matrix, variogram.nugget + noise, scale)
        totals = [
            np.bincount(self._record_place, one, len(places))
            for one in (records.exposure_s[:, None] * uncertain).T
        ]
        errors = np.array(totals).reshape(len(totals), len(places)).T / places.exposure_s[:, None]
        self._system = KrigingSystem.of_factor(variogram, places, factor, prior, features, errors)


@lru_cache(maxsize=2)
def _prior_covariance(variogram: Variogram, xy: bytes) -> Array:
    """Covariance of the smooth rate between places of shape (m, 2), given as bytes.

    Plans of a mission have the same places, and mostly the same variogram as the one before.
    """
    from scipy.spatial.distance import pdist, squareform

    places = np.frombuffer(xy).reshape(-1, 2)
    between = squareform(variogram.correlation_of_square(pdist(variogram.scaled(places), "sqeuclidean")))
    np.fill_diagonal(between, 1.0)
    between *= variogram.structured_sill
    between.setflags(write=False)
    return np.asarray(between)


def clip_negative(variance: Array, sill: float) -> int:
    """Set negative variances, which come from rounding, to 0; warn if they are more than that."""
    negative = variance < 0
    count = int(np.count_nonzero(negative))
    if count:
        lowest = variance[negative].min()
        level = logging.DEBUG if lowest >= -1e-10 * max(sill, 1e-300) else logging.WARNING
        _log.log(level, "%d negative variances (down to %.3g) set to 0", count, lowest)
        variance[negative] = 0.0
    return count
