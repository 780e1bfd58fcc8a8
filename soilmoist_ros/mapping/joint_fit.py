# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The joint model of a survey and all that is known besides, fitted to all counts.

**Pattern.** The structured rate of survey s is ``g_s P(x) + sqrt(1 - g_s^2) D_s(x) + z(x)'b``: P and D_s have the
covariance of the variogram, and the loading g_s is the correlation of the survey's pattern with the persistent
one. Given P and b the surveys are independent, so their information is gathered one after the other (a Kalman
filter over surveys). The unknown mean of each survey is integrated out exactly.

**Features.** Kriging from inducing places u represents a pattern with correlation R by ``Phi(x) c``, where the
coefficients c are independent with variance 1 and ``Phi(x) = R(x, u) L^-T``, ``L L' = R(u, u)``. The variance lost
at x is the kriging variance ``q(x) = 1 - |Phi(x)|^2`` at places of samples. What is lost counts as the part that
does not persist, so the covariance within a survey stays exact. Source: Quinonero-Candela & Rasmussen (2005),
Journal of Machine Learning Research 6:1939-1959. With all earlier samples as inducing places nothing is lost. With
fewer a variance is too large: by at most 0.5 % of the sill in tests with smooth models and 400 earlier samples.
The rough ones (exponential, spherical) need more inducing places: there it is up to 3 and 8 % at single cells.

**Covariates.** The effects b have independent normal priors with variances d. The counts say of b what a normal
distribution with the information J and the score s says, so the marginal likelihood of d is known in closed form:
automatic relevance determination (MacKay 1992, Neural Computation 4:415-447). A covariate may be useless, so d = 0
has a prior probability. Where d = 0 is likely afterwards, the covariate is left out: without a useful one, the map
is the same as without covariates, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S, squared_distances
from soilmoist_ros.mapping.knowledge import Knowledge
from soilmoist_ros.mapping.kriging.system import sample_correlation
from soilmoist_ros.mapping.samples import Samples, merge_exactly, noise_rate, pooled
from soilmoist_ros.mapping.variogram.field_prior import Effect, FieldPrior, Relation
from soilmoist_ros.mapping.variogram.fit import NoiseModel, VariogramFit
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]

MAX_LOST = 0.01  # maximum share of the pattern's variance lost at a place, as long as MAX_RANK allows
MAX_RANK = 250  # maximum number of inducing places
MAX_CANDIDATES = 1000  # maximum number of places among which the inducing places are chosen
_MIN_KEPT, _MAX_KEPT = 200, 6  # number of places from which features are kept, and of sets of places
LOADINGS = np.array([0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.88, 0.94, 0.98])  # values of a loading
PRIOR_OF_LOADINGS = np.array([0.50, 0.03, 0.03, 0.03, 0.06, 0.08, 0.10, 0.10, 0.07])
"""Prior probabilities of the loadings: a survey may be unrelated; with less than 0.5, small maps suffer."""
PRIOR_WORTH = 1.0  # number of earlier surveys that the prior of the loadings is worth
SCALES = np.array([0.0, 0.1, 0.16, 0.25, 0.4, 0.63, 1.0])
"""Possible standard deviations of an effect, in units of a wide prior's."""
MULTIPLICITY = 1.25
"""Each of k covariates has an effect with the prior probability 1 / (1 + k^this): the more there are, the more of
them seem to have one by chance."""
MAX_USELESS = 0.55
"""Posterior probability of no effect above which a covariate is left out: the counts must speak for it. With 0.85,
two covariates that had nothing to do with the rate raised the squared error by 3 % in 21 missions of two hours on
foreign surfaces. With this it is unchanged, and related covariates lower it as much."""
_SWEEPS = 4
FIRST_LOADING = 0.98
"""Loading of the first survey. Only products of loadings matter, so this is nearly a choice of unit."""
MAX_PLACES = 1000
"""Maximum number of places of a survey from which loading and effects are told; of more, neighbours are pooled."""
MAX_FITTED = 500
"""Maximum number of earlier samples to which the variogram is fitted; of more, the last surveys are used."""
DECAYS_DAYS = (math.inf, 365.0, 120.0, 40.0, 14.0)
"""Times in which the correlation of the persistent pattern falls to 1/e."""
NO_DECAY = 0.5  # prior probability that the pattern does not change with time
MIN_DECAYING = 3
"""Minimum number of earlier surveys that tell whether the pattern changes with time, or which of them is odd."""
MAX_ODD = 2
"""Maximum number of surveys left out at the beginning of a history. Where the first of 3 or 6 was unrelated, the
squared error with it was 1.8 and 2.2 times as large; where a pattern faded over 6, 1.2 times without a decay."""
WIDE = 1.0  # standard deviation of the wide prior of an effect, in standard deviations of the structured rate
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class PatternFeatures:
    """Features of a field: the coefficients' shares in the pattern at a place, and covariates."""

    variogram: Variogram  # variogram of the rate
    inducing_xy: Array  # inducing places, shape (r, 2) [m]
    factor: Array  # L, lower triangle, shape (r, r)
    covariates: Callable[[Array], Array]  # values at places of shape (n, 2), shape (n, k)
    _kept: dict[bytes, Array] = field(default_factory=dict)

    @classmethod
    def of(
        cls, variogram: Variogram, candidates: Array, covariates: Callable[[Array], Array] | None = None
    ) -> PatternFeatures:
        """Choose inducing places: each time where most variance is lost (pivoted Cholesky decomposition)."""
        from scipy.linalg.lapack import dpstrf

        covariates = covariates or (lambda xy: np.empty((len(xy), 0)))
        some = candidates[:: max(1, -(-len(candidates) // MAX_CANDIDATES))]
        if not len(some):
            return cls(variogram, some, np.empty((0, 0)), covariates)
        factor, order, rank, _ = dpstrf(_correlation(variogram, some, some), tol=MAX_LOST, lower=1)
        rank = min(rank, MAX_RANK)
        return cls(variogram, some[order[:rank] - 1], np.tril(factor[:rank, :rank]), covariates)

    @property
    def rank(self) -> int:
        """Number of coefficients of the pattern."""
        return len(self.factor)

    def unit(self, effects: Array) -> Array:
        """Prior standard deviation of each coefficient, given that of the effects, shape (r + k,) [counts/s]."""
        return np.concatenate([np.full(self.rank, math.sqrt(self.variogram.structured_sill)), effects])

    def __call__(self, xy: Array) -> Array:
        """Features at places of shape (n, 2) [m]: r of the pattern, then k covariates, shape (n, r + k)."""
        from scipy.linalg import solve_triangular

        key = xy.tobytes() if len(xy) >= _MIN_KEPT else b""
        known = self._kept.get(key)
        if known is not None:
            return known
        with_inducing = _correlation(self.variogram, self.inducing_xy, xy)
        if self.rank:
            with_inducing = solve_triangular(self.factor, with_inducing, lower=True, check_finite=False)
        features = np.ascontiguousarray(np.hstack([with_inducing.T, self.covariates(xy)]))
        if key:
            if len(self._kept) >= _MAX_KEPT:
                self._kept.pop(next(iter(self._kept)), None)
            self._kept[key] = features
        return features


def _correlation(variogram: Variogram, xy: Array, others: Array) -> Array:
    return variogram.correlation_of_square(squared_distances(variogram.scaled(xy), variogram.scaled(others)))


# -- Filter over surveys -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SurveyView:
    """The rates of a survey, ready for conditioning."""

    rate: Array  # rate of each sample, shape (n,) [counts/s]
    covariance: Array  # of the structured rate without effects of covariates, nugget and noise included, (n, n)
    features: Array  # scaled so that the coefficients have the variance 1 a priori, shape (n, r + k) [counts/s]


@dataclass(frozen=True, eq=False)
class PatternState:
    """Knowledge of the coefficients: r of the pattern, then the effects of k covariates."""

    rank: int  # r
    mean: Array  # shape (r + k,)
    covariance: Array  # shape (r + k, r + k)
    log_likelihood: float = 0.0  # logarithm of the probability of the surveys so far
    loadings: tuple[Array, ...] = ()  # posterior probabilities of the loading of each survey so far

    @classmethod
    def before(cls, rank: int, covariates: int = 0) -> PatternState:
        """The state before any survey."""
        return cls(rank, np.zeros(rank + covariates), np.eye(rank + covariates))

    def later(self, share: float) -> PatternState:
        """The state after a time in which the pattern changes."""
        if share == 1:
            return self
        factors = self.scale(share)
        covariance = self.covariance * np.outer(factors, factors)
        index = np.arange(self.rank)
        covariance[index, index] += 1 - share**2
        return replace(self, mean=self.mean * factors, covariance=covariance)

    @property
    def effects(self) -> tuple[Array, Array]:
        """Mean and covariance of the effects of covariates, in units of their prior standard deviations."""
        return self.mean[self.rank :], self.covariance[self.rank :, self.rank :]

    @property
    def excess(self) -> Array:
        """W: covariance of the coefficients minus the pattern's prior, which the variogram has already."""
        excess = self.covariance.copy()
        index = np.arange(self.rank)
        excess[index, index] -= 1.0
        return excess

    @property
    def prior_of_loading(self) -> Array:
        """Probabilities of the loading of the next survey: the prior, and what the loadings were so far.

        The first survey defines the pattern, so it says nothing about loadings.
        """
        related = np.array(self.loadings[1:]).reshape(-1, len(LOADINGS))
        probability: Array = (PRIOR_WORTH * PRIOR_OF_LOADINGS + related.sum(axis=0)) / (PRIOR_WORTH + len(related))
        return probability

    def scale(self, loading: float) -> Array:
        """Factor of each feature for a survey with this loading, shape (r + k,)."""
        factors = np.ones(len(self.mean))
        factors[: self.rank] = loading
        return factors

    def loading_of(self, view: SurveyView) -> tuple[Array, float]:
        """Posterior probabilities of a survey's loading, and the logarithm of the survey's probability."""
        log = self.log_likelihoods(view) + np.log(self.prior_of_loading)
        weight = np.exp(log - log.max())
        return weight / weight.sum(), float(log.max() + np.log(weight.sum()))

    def log_likelihoods(self, view: SurveyView) -> Array:
        """Restricted log-likelihood of a survey with each of :data:`LOADINGS`, given the surveys so far."""
        rank, excess = self.rank, self.excess
        pattern, effects = view.features[:, :rank], view.features[:, rank:]
        square = pattern @ excess[:rank, :rank] @ pattern.T
        across = pattern @ excess[:rank, rank:] @ effects.T
        across = across + across.T
        base = view.covariance + effects @ excess[rank:, rank:] @ effects.T
        of_pattern, rest = pattern @ self.mean[:rank], view.rate - effects @ self.mean[rank:]
        likelihoods = [
            _Factored(base + g * across + g * g * square).log_likelihood(rest - g * of_pattern)
            for g in LOADINGS.tolist()
        ]
        return np.array(likelihoods)

    def after(self, view: SurveyView, probabilities: Array, log_likelihood: float = 0.0) -> PatternState:
        """The state with one more survey, whose loading is the mean of these probabilities."""
        features = view.features * self.scale(float(probabilities @ LOADINGS))
        covariance = view.covariance + features @ self.excess @ features.T
        factored = _Factored(covariance)
        moved = features @ self.covariance
        solved = factored.project(moved)
        left = self.covariance - moved.T @ solved
        return PatternState(
            self.rank,
            self.mean + solved.T @ (view.rate - features @ self.mean),
            (left + left.T) / 2,
            self.log_likelihood + log_likelihood,
            (*self.loadings, probabilities),
        )


class _Factored:
    """A covariance matrix K, and ``P = K^-1 - K^-1 1 1' K^-1 / (1' K^-1 1)``: rates whose mean is unknown."""

    def __init__(self, covariance: Array) -> None:
        from scipy.linalg import cho_factor, cho_solve

        self._factor = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
        self._of_ones = cho_solve(self._factor, np.ones(len(covariance)), check_finite=False)

    def project(self, values: Array) -> Array:
        """P times values of shape (n,) or (n, m)."""
        from scipy.linalg import cho_solve

        b = self._of_ones
        solved: Array = cho_solve(self._factor, values, check_finite=False)
        return np.asarray(solved - np.multiply.outer(b, b @ values / b.sum()))

    def log_likelihood(self, rate: Array) -> float:
        """Restricted log-likelihood of rates with an unknown mean."""
        determinant = 2 * np.log(np.diag(self._factor[0])).sum() + np.log(self._of_ones.sum())
        return float(-0.5 * (determinant + rate @ self.project(rate) + (len(rate) - 1) * np.log(2 * np.pi)))


# -- Shrinkage of effects ------------------------------------------------------------------------------------


def effect_variances(information: Array, score: Array) -> Array:
    """Posterior mean of the prior variance of each effect, given those of the others; 0 for those left out."""
    squares = SCALES**2
    useful = 1 / (1 + len(score) ** MULTIPLICITY)
    prior = np.full(len(SCALES), useful / (len(SCALES) - 1))
    prior[0] = 1 - useful
    variances, useless = np.full(len(score), float(prior @ squares)), np.zeros(len(score), bool)
    for _ in range(_SWEEPS):
        for effect in range(len(score)):
            log = np.log(prior)
            for number, square in enumerate(squares):
                variances[effect] = square
                log[number] += log_marginal(information, score, variances)
            weights = np.exp(log - log.max())
            weights /= weights.sum()
            variances[effect] = weights @ squares
            useless[effect] = weights[0] > MAX_USELESS
    return np.where(useless, 0.0, variances)


def log_marginal(information: Array, score: Array, variances: Array) -> float:
    """Logarithm of the marginal likelihood, relative to no effects at all."""
    root = np.sqrt(variances)
    matrix = np.eye(len(score)) + root[:, None] * information * root
    scaled = root * score
    return float(0.5 * scaled @ np.linalg.solve(matrix, scaled) - 0.5 * np.linalg.slogdet(matrix)[1])


# -- Joint model ---------------------------------------------------------------------------------------------

Estimate = Callable[[Samples, Sequence[Samples], Sequence[Array] | None], VariogramFit]
"""Fits the variogram to the samples of the survey, samples of other surveys, and their known structure."""


@dataclass(frozen=True, eq=False)
class _Past:
    """An earlier survey."""

    name: str
    places: Samples
    stamp_s: float
    days: float  # since the survey before, 0 for the first


@dataclass(frozen=True, eq=False)
class _History:
    """Earlier surveys to use, in order of time, and how fast the pattern changes."""

    past: tuple[_Past, ...]
    decay_days: float  # time in which the correlation falls to 1/e [days]

    def decayed(self, days: float) -> float:
        """Correlation of the pattern with itself after some days."""
        return math.exp(-days / self.decay_days)

    def share(self, stamp_s: float) -> float:
        """Correlation of the pattern at a time with the pattern at the last survey; 1 if the time is unknown."""
        if not self.past or not stamp_s:
            return 1.0
        return self.decayed(abs(stamp_s - self.past[-1].stamp_s) / DAY_S)


@dataclass(frozen=True, eq=False)
class _Model:
    """Parts of a fit that do not depend on the last few samples of the survey."""

    fit: VariogramFit
    features: PatternFeatures
    unit: Array  # standard deviation of each coefficient [counts/s]; empty if what is known tells nothing
    state: PatternState  # distribution of the coefficients, given the earlier surveys


class JointModel:
    """Fits the joint model of the surveys and covariates of a field."""

    def __init__(self, knowledge: Knowledge, estimate: Estimate, noise: NoiseModel) -> None:
        self._covariates = knowledge.covariates
        self._estimate = estimate
        self._local_noise = noise == "local"
        ordered = sorted(knowledge.earlier, key=lambda one: (one.stamp_s, one.name))
        stamps = [one.stamp_s for one in ordered]
        self._all = tuple(
            _Past(one.name, merge_exactly(one.samples)[0], one.stamp_s, (one.stamp_s - before) / DAY_S)
            for one, before in zip(ordered, [*stamps[:1], *stamps], strict=False)
        )
        self._last: tuple[Samples, float, Variogram | None, _Model] | None = None
        # number of earlier samples to which the variogram is fitted
        self.fitted_samples = sum(map(len, _fitted(self._all)))

    def fit(
        self,
        samples: Samples,
        model_samples: Samples,
        stamp_s: float = 0.0,
        given: VariogramFit | None = None,
        alone: VariogramFit | None = None,
    ) -> VariogramFit:
        """Variogram and prior for a survey.

        :param model_samples: those to which all is fitted that earlier surveys determine as well
        :param given: variogram to use instead of a fitted one
        :param alone: variogram of ``model_samples`` where nothing else is known; fitted by default
        """
        known = None if given is None else given.variogram
        last = self._last
        if last is None or last[1:3] != (stamp_s, known) or (known is None and last[0] is not model_samples):
            model = self._model(merge_exactly(model_samples)[0], stamp_s, given, alone)
            self._last = model_samples, stamp_s, known, model
        else:
            model = last[3]
        if not len(model.unit):
            return model.fit
        places, features, unit, state = merge_exactly(samples)[0], model.features, model.unit, model.state
        local_rate = LocalRate.of(places, features.variogram) if self._local_noise else None
        view = view_of(places, features, unit, local_rate or noise_rate(places))
        probabilities, _ = state.loading_of(view)
        loading = float(probabilities @ LOADINGS)
        now = state.after(view, probabilities) if self._covariates else state
        effects, own = self._effects(now, unit)
        relations = self._relations(state, loading, stamp_s)
        scale = state.scale(loading) * unit
        prior = FieldPrior(features, scale, state.excess, state.mean, effects, relations, own)
        mean_rate = places.mean_rate_cps
        return replace(model.fit, prior=prior, local_rate=local_rate, mean_rate=mean_rate, n_samples=len(places))

    def expected(self) -> VariogramFit | None:
        """Variogram and prior before the first sample, from the earlier surveys; ``None`` without any."""
        past = self._history.past
        if not past:
            return None
        first, *others = _fitted(past)
        fit = self._estimate(first, others, None)
        features = self._features(fit)
        unit = features.unit(np.zeros(len(self._covariates or ())))
        state = self._conditioned(features, unit, 0.0)
        scale = state.scale(float(state.prior_of_loading @ LOADINGS)) * unit
        mean_rate = float(np.mean([one.places.mean_rate_cps for one in past]))
        prior = FieldPrior(features, scale, state.excess, state.mean)
        return replace(fit, prior=prior, local_rate=None, mean_rate=mean_rate, n_samples=0)

    def _model(
        self, places: Samples, stamp_s: float, given: VariogramFit | None, alone: VariogramFit | None
    ) -> _Model:
        past, others = self._history.past, _fitted(self._history.past)
        alone = given or alone or self._estimate(places, others, None)
        fit, variances = alone, np.zeros(len(self._covariates or ()))
        features = self._features(fit)
        wide = WIDE * math.sqrt(fit.variogram.structured_sill)
        for _ in range(_ROUNDS if self._covariates else 0):
            unit = features.unit(np.full(len(variances), wide))
            state = self._conditioned(features, unit, stamp_s)
            view = view_of(places, features, unit, fit.noise_rate or noise_rate(places))
            mean, covariance = state.after(view, state.loading_of(view)[0]).effects
            precision = np.linalg.inv(covariance)
            variances = effect_variances(precision - np.eye(len(mean)), precision @ mean)
            if not variances.any():
                if not past:
                    return _Model(alone, features, np.empty(0), state)
                fit = alone
                features = self._features(fit)
                break
            effects = [self._at(one) * (wide * np.sqrt(variances)) for one in (places, *others)]
            fit = given or self._estimate(places, others, effects)
            features = self._features(fit)
        unit = features.unit(wide * np.sqrt(variances))
        return _Model(fit, features, unit, self._conditioned(features, unit, stamp_s))

    @cached_property
    def _history(self) -> _History:
        """Surveys to use, and the decay, by the evidence of the earlier surveys alone."""
        best = _History(self._all, math.inf)
        if len(self._all) < MIN_DECAYING:
            return best
        chosen = _fitted(self._all)
        features = PatternFeatures.of(self._estimate(chosen[0], chosen[1:], None).variogram, _places(self._all))
        unit, begin = features.unit(np.empty(0)), PatternState.before(features.rank)
        views = [self._view(one, features, unit) for one in self._all]
        alone = [float(begin.log_likelihoods(view)[0]) for view in views]

        def evidence(odd: int, decay_days: float) -> float:
            state = _passed(begin, self._all[odd:], views[odd:], decay_days)
            share = NO_DECAY if decay_days == math.inf else (1 - NO_DECAY) / (len(DECAYS_DAYS) - 1)
            return state.log_likelihood + sum(alone[:odd]) + math.log(share)

        last_odd = min(MAX_ODD, len(self._all) - MIN_DECAYING + 1)
        odd = max(range(last_odd + 1), key=lambda number: evidence(number, math.inf))
        return _History(self._all[odd:], max(DECAYS_DAYS, key=lambda days: evidence(odd, days)))

    def _features(self, fit: VariogramFit) -> PatternFeatures:
        covariates = None if self._covariates is None else self._covariates.at
        return PatternFeatures.of(fit.variogram, _places(self._history.past), covariates)

    def _at(self, places: Samples) -> Array:
        """Covariates of samples, shape (n, k)."""
        assert self._covariates is not None
        return Supports(places.xy, places.spread).average_rows(self._covariates.at)

    def _conditioned(self, features: PatternFeatures, unit: Array, stamp_s: float) -> PatternState:
        """Distribution of the coefficients at a time, given the earlier surveys."""
        history, begin = self._history, PatternState.before(features.rank, len(unit) - features.rank)
        views = (self._view(one, features, unit) for one in history.past)
        return _passed(begin, history.past, views, history.decay_days).later(history.share(stamp_s))

    def _view(self, past: _Past, features: PatternFeatures, unit: Array) -> SurveyView:
        rate = LocalRate.of(past.places, features.variogram) if self._local_noise else noise_rate(past.places)
        return view_of(past.places, features, unit, rate)

    def _effects(
        self, state: PatternState, unit: Array
    ) -> tuple[tuple[Effect, ...], Callable[[Array], Array] | None]:
        """Effects of the covariates, and the variance of the rate where covariates are missing."""
        covariates = self._covariates
        if covariates is None:
            return (), None
        mean, covariance = state.effects
        mean, sd = mean * unit[state.rank :], np.sqrt(np.diag(covariance)) * unit[state.rank :]
        columns = zip(covariates.names, mean.tolist(), sd.tolist(), strict=True)
        effects, squares = tuple(Effect(*column) for column in columns), mean**2 + sd**2
        if np.isfinite(covariates.layers).all():
            return effects, None
        return effects, lambda xy: np.asarray((1 - covariates.known_at(xy)) ** 2 @ squares)

    def _relations(self, state: PatternState, loading: float, stamp_s: float) -> tuple[Relation, ...]:
        past, decayed, found = self._history.past, self._history.share(stamp_s), []
        for one, probabilities in zip(reversed(past), reversed(state.loadings), strict=True):
            found.append(Relation(one.name, loading * decayed * float(probabilities @ LOADINGS)))
            decayed *= self._history.decayed(one.days)
        left_out = [Relation(one.name, 0.0) for one in self._all[: len(self._all) - len(past)]]
        return (*left_out, *reversed(found))


def _passed(
    state: PatternState, past: Sequence[_Past], views: Iterable[SurveyView], decay_days: float
) -> PatternState:
    """The state after surveys, one by one."""
    for number, (one, view) in enumerate(zip(past, views, strict=True)):
        if number:
            state = state.later(math.exp(-one.days / decay_days))
            state = state.after(view, *state.loading_of(view))
        else:
            known = (LOADINGS == FIRST_LOADING).astype(float)
            state = state.after(view, known, float(state.log_likelihoods(view)[-1]))
    return state


def _fitted(past: Sequence[_Past]) -> list[Samples]:
    """Earlier surveys to which the variogram is fitted, the last ones first."""
    chosen: list[Samples] = []
    for one in reversed(past):
        if chosen and sum(map(len, chosen)) + len(one.places) > MAX_FITTED:
            break
        chosen.append(one.places)
    return chosen


def _places(past: Sequence[_Past]) -> Array:
    """Places of earlier samples."""
    return np.concatenate([np.empty((0, 2)), *(one.places.xy for one in past)])


def view_of(places: Samples, features: PatternFeatures, unit: Array, rate: float | LocalRate) -> SurveyView:
    """A survey, ready for conditioning, with pools of its places if they are more than :data:`MAX_PLACES`."""
    places, variogram = pooled(places, MAX_PLACES), features.variogram
    covariance = np.ascontiguousarray(sample_correlation(variogram, places.xy, places.spread))
    covariance *= variogram.structured_sill
    noise = noise_rates(rate, places.xy) / places.exposure_s
    covariance[np.diag_indices(len(places))] += variogram.nugget + noise
    at = Supports(places.xy, places.spread).average_rows(features) * unit
    return SurveyView(places.rate_cps, covariance, np.ascontiguousarray(at))
