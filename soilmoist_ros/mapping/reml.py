"""Restricted maximum likelihood (REML) of a variogram, with the known Poisson noise and weak priors.

Patterson & Thompson (1971), Biometrika 58:545-554; blocks as in Eidsvik et al. (2014), Journal of
Computational and Graphical Statistics 23:295-315 (their composite likelihood, with one block at a time).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples import Samples, noise_rate
from soilmoist_ros.mapping.variogram import MODELS, ModelName, Variogram

Array = NDArray[np.float64]

ONE_BLOCK_PLACES = 1000
"""Up to so many places the likelihood is the full one."""
BLOCK_PLACES = 500
"""Beyond that, the largest number of places in a block."""

_FEWEST_POOLS = 8
_LARGEST_STEP = 5.0
"""Parameters are sought within so many prior standard deviations."""


@dataclass(frozen=True)
class Prior:
    """Independent log-normal priors of (structured variance, range, nugget).

    They are weak (a factor of three to five either way is one standard deviation) and fixed, so what they
    say fades as the likelihood grows with the number of samples:

    * **structured variance**: median the noise-corrected sample variance ``S^2 - mean(m*/t)`` (of pooled
      neighbours where counts are short), averaged
      with a guess that is worth five samples: a coefficient of variation of the rate of 15 % (half of a
      field dry and half wet gives 5 to 35 %). Standard deviation of the logarithm 1. The sample variance
      alone is useless from three samples, and a guess on the low side claims a map that is not there
    * **range**: median such that the practical range is a third of the extent, standard deviation 1: what
      is much shorter cannot be told from the nugget, what is much longer not from a trend
    * **nugget**: median 5 % of the prior's structured variance, standard deviation 1.5; a count integrates
      over a footprint of some hundred square metres, so little variance is left below it

    The mode is used as if it were the truth, so few samples promise a little too much: over six kinds of
    simulated fields the 95 % intervals of a Matern 3/2 map covered 93 to 97 % with 72 samples, 91 to 97 %
    with 20 and 90 to 99 % with 8.

    :param log_median: logarithms of the medians, (structured, range, nugget)
    :param log_sd: standard deviations of the logarithms
    """

    log_median: Array
    log_sd: Array

    GUESSED_VARIATION = 0.15
    GUESS_WORTH = 5.0

    @classmethod
    def of(cls, places: Samples, model: ModelName, extent_m: float) -> Prior:
        """The prior for these merged samples.

        :param extent_m: extent of the field [m], > 0
        """
        m = noise_rate(places)
        n = len(places)
        corrected = _variance_without_noise(places, m)
        guess = cls.GUESS_WORTH * (cls.GUESSED_VARIATION * m) ** 2
        structured = (guess + (n - 1) * corrected) / (cls.GUESS_WORTH + n - 1)
        medians = [structured, extent_m / 3 / MODELS[model].practical, 0.05 * structured]
        return cls(np.log(medians), np.array([1.0, 1.0, 1.5]))


def _variance_without_noise(places: Samples, mean_rate: float) -> float:
    """Sample variance of the rates less that of the counting [(counts/s)^2], >= 0.

    Of many short counts the difference of the two is mostly chance, so neighbours are pooled until what is left is
    more than the noise, or few pools are left.
    """
    size = 1
    while True:
        pools = spatial_blocks(places.xy, 0, size) if size > 1 else [np.array([i]) for i in range(len(places))]
        exposure_s = np.array([places.exposure_s[pool].sum() for pool in pools])
        rate = np.array([places.counts[pool].sum() for pool in pools]) / exposure_s
        noise = float(np.mean(mean_rate / exposure_s))
        corrected = max(float(rate.var(ddof=1)) - noise, 0.0) if len(pools) > 1 else 0.0
        if corrected > noise or len(pools) < 2 * _FEWEST_POOLS:
            return corrected
        size *= 2


@dataclass(frozen=True)
class RemlEstimate:
    """Result of :func:`maximise_reml`.

    :param variogram: the posterior mode
    :param log_likelihood: restricted log-likelihood there, without the prior
    :param log_sd: standard errors of log (structured variance, range, nugget): Laplace's approximation
    :param prior_share: share of the prior in the knowledge of each of them; near 0 the data decided,
        near 1 the prior did
    :param converged: whether the optimiser says so
    :param message: what it says
    """

    variogram: Variogram
    log_likelihood: float
    log_sd: tuple[float, float, float]
    prior_share: tuple[float, float, float]
    converged: bool
    message: str


class RestrictedLikelihood:
    """Log restricted likelihood of rates ``Z/t`` with covariance ``s R(range) + nugget I + diag(m*/t)``.

    The unknown constant mean is integrated out. With several blocks it is the sum over the blocks
    (a composite likelihood), each with a mean of its own.

    :param places: merged samples
    :param model: name of the variogram model
    :param blocks: numbers of the places of each block; one block of all by default
    """

    def __init__(self, places: Samples, model: ModelName, blocks: list[NDArray[np.intp]] | None = None) -> None:
        m = noise_rate(places)
        self._model = MODELS[model]
        self._blocks = [
            (_squared_distances(places.xy[b]), places.rate_cps[b], m / places.exposure_s[b])
            for b in (blocks if blocks is not None else [np.arange(len(places))])
        ]

    def value(self, log_parameters: Array) -> float:
        """Log-likelihood at log (structured variance, range, nugget)."""
        return sum(self._block(block, np.exp(log_parameters), False)[0] for block in self._blocks)

    def value_and_gradient(self, log_parameters: Array) -> tuple[float, Array]:
        """Log-likelihood and its exact gradient with respect to the log-parameters."""
        total, gradient = 0.0, np.zeros(3)
        for block in self._blocks:
            value, slopes = self._block(block, np.exp(log_parameters), True)
            total += value
            gradient += slopes
        return total, gradient

    def _block(self, block: tuple[Array, Array, Array], parameters: Array, slope: bool) -> tuple[float, Array]:
        from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

        squares, rate, noise = block
        structured, range_m, nugget = parameters
        n = len(rate)
        R = self._model.correlation(squares / range_m**2)
        K = structured * R
        K[np.diag_indices(n)] += nugget + noise
        factor, info = dpotrf(K, lower=1, clean=1)
        if info:  # cannot happen within the bounds unless the noise is absurdly small
            return -1e300, np.zeros(3)
        b = dpotrs(factor, np.ones(n), lower=1)[0]
        mean = b @ rate / b.sum()
        q = dpotrs(factor, rate - mean, lower=1)[0]
        log_determinant = 2 * np.log(np.diag(factor)).sum() + np.log(b.sum())
        value = -0.5 * (log_determinant + q @ (rate - mean) + (n - 1) * np.log(2 * np.pi))
        if not slope:
            return float(value), np.zeros(3)
        # d(value)/d(parameter) = -<P - q q', dK>/2 with P = K^-1 - b b'/sum(b): the inverse's elements are
        # needed for the trace, so here it is formed (from the factor, lower triangle only).
        inverse = dpotri(factor, lower=1, overwrite_c=1)[0]
        diagonal = np.diag(inverse).copy()
        dR = self._model.log_range_slope(squares / range_m**2)

        def contract(D: Array, diagonal_value: float) -> float:
            trace = 2 * np.vdot(inverse.T, D) - diagonal_value * diagonal.sum()
            return float(trace - b @ D @ b / b.sum() - q @ D @ q)

        d_nugget = diagonal.sum() - b @ b / b.sum() - q @ q
        slopes = [structured * contract(R, 1.0), structured * contract(dR, 0.0), nugget * d_nugget]
        return float(value), -0.5 * np.array(slopes)


def maximise_reml(places: Samples, model: ModelName, extent_m: float) -> RemlEstimate:
    """Posterior mode of the variogram under the restricted likelihood and :class:`Prior`.

    :param places: merged samples, at least one
    :param model: name of the variogram model
    :param extent_m: extent of the field for the prior of the range [m], > 0
    """
    from scipy.optimize import minimize

    prior = Prior.of(places, model, extent_m)
    likelihood = RestrictedLikelihood(places, model, spatial_blocks(places.xy))

    def cost(u: Array) -> tuple[float, Array]:
        value, gradient = likelihood.value_and_gradient(prior.log_median + prior.log_sd * u)
        return float(0.5 * u @ u) - value, u - prior.log_sd * gradient

    bounds = [(-_LARGEST_STEP, _LARGEST_STEP)] * 3
    options = {"ftol": 1e-12, "gtol": 1e-6, "maxiter": 200}
    found = [
        minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        for start in _starts(likelihood, prior)
    ]
    best = min(found, key=lambda result: float(result.fun))
    covariance = _laplace_covariance(lambda u: cost(u)[1], best.x)
    structured, range_m, nugget = np.exp(prior.log_median + prior.log_sd * best.x)
    return RemlEstimate(
        Variogram(model, nugget, range_m, structured + nugget),
        float(0.5 * best.x @ best.x - best.fun),
        _three(prior.log_sd * np.sqrt(covariance)),
        _three(np.clip(covariance, 0, 1)),
        bool(best.success),
        str(best.message),
    )


def spatial_blocks(
    xy: Array, one_block: int = ONE_BLOCK_PLACES, size: int = BLOCK_PLACES
) -> list[NDArray[np.intp]]:
    """Disjoint compact blocks of places: halved across the wider side until no block exceeds ``size``.

    :param xy: places, shape (n, 2) [m]
    :param one_block: up to so many places all are one block
    :param size: largest block otherwise
    :returns: the numbers of the places of each block
    """
    if len(xy) <= one_block:
        return [np.arange(len(xy))]
    blocks, todo = [], [np.arange(len(xy))]
    while todo:
        block = todo.pop()
        if len(block) <= size:
            blocks.append(block)
            continue
        axis = int(np.argmax(np.ptp(xy[block], axis=0)))
        block = block[np.lexsort((xy[block, 1 - axis], xy[block, axis]))]
        todo += [block[len(block) // 2 :], block[: len(block) // 2]]
    return blocks


def _starts(likelihood: RestrictedLikelihood, prior: Prior) -> list[Array]:
    """The two best of a few places to start from, in prior standard deviations."""
    candidates = [np.array([0.0, range_, nugget]) for range_ in (-1.5, -0.75, 0.0, 0.75) for nugget in (-0.5, 1.5)]

    def badness(u: Array) -> float:
        return float(0.5 * u @ u) - likelihood.value(prior.log_median + prior.log_sd * u)

    return sorted(candidates, key=badness)[:2]


def _laplace_covariance(gradient: object, mode: Array, step: float = 1e-3) -> Array:
    """Variances of the parameters at the mode, from differences of the gradient."""
    assert callable(gradient)
    steps = step * np.eye(len(mode))
    hessian = np.array([(gradient(mode + d) - gradient(mode - d)) / (2 * step) for d in steps])
    eigenvalues, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    # The prior alone gives curvature 1; less means that the mode lies on a bound or a saddle.
    inverse = vectors / np.maximum(eigenvalues, 1.0) @ vectors.T
    return np.diag(inverse)


def _three(values: Array) -> tuple[float, float, float]:
    first, second, third = values.tolist()
    return first, second, third


def _squared_distances(xy: Array) -> Array:
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(xy, xy, "sqeuclidean"))
