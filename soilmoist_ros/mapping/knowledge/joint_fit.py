# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The joint model of a survey and all that is known besides, fitted to all counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping.knowledge.conditioning import LOADINGS, PatternState, SurveyView
from soilmoist_ros.mapping.knowledge.knowledge import Knowledge
from soilmoist_ros.mapping.knowledge.pattern import PatternFeatures
from soilmoist_ros.mapping.knowledge.pooling import pooled
from soilmoist_ros.mapping.knowledge.shrinkage import effect_variances
from soilmoist_ros.mapping.kriging.targets import sample_correlation
from soilmoist_ros.mapping.samples.samples import Samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.variogram.field_prior import Effect, FieldPrior, Relation
from soilmoist_ros.mapping.variogram.fit import NoiseModel, VariogramFit
from soilmoist_ros.mapping.variogram.local_rate import LocalRate, noise_rates
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.support import Supports

Array = NDArray[np.float64]


class Estimate(Protocol):
    """Fits the variogram to the samples of the survey, those of others, and their known further structure."""

    def __call__(
        self, samples: Samples, others: Sequence[Samples] = (), effects: Sequence[Array] | None = None
    ) -> VariogramFit:
        """See :func:`estimate_variogram`."""
        ...


FIRST_LOADING = 0.98
"""Loading of the first survey. Only products of loadings matter, so this is nearly a choice of unit."""
MAX_PLACES = 1000
"""Maximum number of places of a survey from which loading and effects are told; of more, neighbours are pooled."""
MAX_FITTED = 500
"""Maximum number of earlier samples to which the variogram is fitted; of more, the last surveys are used."""
DECAYS_DAYS = (math.inf, 365.0, 120.0, 40.0, 14.0)
"""Times in which the correlation of the persistent pattern falls to 1/e."""
NO_DECAY = 0.5
"""Prior probability that the pattern does not change with time."""
MIN_DECAYING = 3
"""Minimum number of earlier surveys that tell whether the pattern changes with time, or which of them is odd."""
MAX_ODD = 2
"""Maximum number of surveys left out at the beginning of a history."""
WIDE = 1.0
"""Standard deviation of the wide prior of an effect, in standard deviations of the structured rate."""
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class _Past:
    """An earlier survey.

    :param days: since the survey before, 0 for the first
    """

    name: str
    places: Samples
    stamp_s: float
    days: float


@dataclass(frozen=True, eq=False)
class _Model:
    """What does not depend on the last few samples of the survey.

    :param fit: variogram
    :param features: features of the field
    :param unit: standard deviation of each coefficient [counts/s]; empty if what is known tells nothing
    :param state: what the earlier surveys say of the coefficients
    """

    fit: VariogramFit
    features: PatternFeatures
    unit: Array
    state: PatternState


class JointModel:
    """Fits the joint model of the surveys and covariates of a field.

    :param knowledge: what is known besides the survey
    :param estimate: fits a variogram
    :param noise: rate in the Poisson noise: ``local`` to each place, or ``mean``

    Attributes
    ----------
    fitted_samples : int
        number of earlier samples to which the variogram is fitted
    """

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

        :param samples: the samples, at least one
        :param model_samples: those to which all is fitted that earlier surveys determine as well
        :param stamp_s: time of the survey [s since 1970-01-01 UTC]; 0 if it is unknown
        :param given: variogram to use instead of a fitted one
        :param alone: without earlier surveys, the variogram of ``model_samples`` if nothing else is known; it is
            fitted by default
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
        places, variogram, state = merge_exactly(samples)[0], model.fit.variogram, model.state
        local_rate = LocalRate.of(places, variogram) if self._local_noise else None
        view = view_of(places, variogram, model.features, model.unit, local_rate or noise_rate(places))
        probabilities, _ = state.loading_of(view)
        loading = float(probabilities @ LOADINGS)
        effects = self._effects(state.after(view, probabilities), model.unit) if self._covariates else ()
        prior = FieldPrior(
            model.features,
            state.scale(loading) * model.unit,
            state.excess,
            state.mean,
            effects,
            self._relations(state, loading, stamp_s),
            self._missing(effects),
        )
        mean_rate = places.mean_rate_cps
        return replace(model.fit, prior=prior, local_rate=local_rate, mean_rate=mean_rate, n_samples=len(places))

    def expected(self, stamp_s: float = 0.0) -> VariogramFit | None:
        """Variogram and prior before the first sample, from the earlier surveys; ``None`` without any.

        :param stamp_s: time of the survey, as in :meth:`fit`
        """
        past = self._history.past
        if not past:
            return None
        first, *others = _fitted(past)
        fit = _stationary(self._estimate(first, others))
        features = self._features(fit.variogram)
        unit = _unit(fit.variogram, features, np.zeros(len(self._covariates or ())))
        state = self._conditioned(past, fit.variogram, features, unit, stamp_s)
        loading = float(state.prior_of_loading @ LOADINGS)
        prior = FieldPrior(features, state.scale(loading) * unit, state.excess, state.mean)
        mean_rate = float(np.mean([one.places.mean_rate_cps for one in past]))
        return replace(fit, prior=prior, local_rate=None, mean_rate=mean_rate, n_samples=0)

    def _model(
        self, places: Samples, stamp_s: float, given: VariogramFit | None, alone: VariogramFit | None
    ) -> _Model:
        past, others = self._history.past, _fitted(self._history.past)
        alone = given or alone or self._estimate(places, others)
        fit, variances = _stationary(alone), np.zeros(len(self._covariates or ()))
        features = self._features(fit.variogram)
        wide = WIDE * math.sqrt(fit.variogram.structured_sill)
        for _ in range(_ROUNDS if self._covariates else 0):
            unit = _unit(fit.variogram, features, np.full(len(self._covariates or ()), wide))
            state = self._conditioned(past, fit.variogram, features, unit, stamp_s)
            view = view_of(places, fit.variogram, features, unit, fit.noise_rate or noise_rate(places))
            mean, covariance = state.after(view, state.loading_of(view)[0]).effects
            precision = np.linalg.inv(covariance)
            variances = effect_variances(precision - np.eye(len(mean)), precision @ mean)
            if not variances.any():
                if not past:
                    return _Model(alone, features, np.empty(0), state)
                fit = _stationary(alone)
                features = self._features(fit.variogram)
                break
            effects = [self._at(one) * (wide * np.sqrt(variances)) for one in (places, *others)]
            fit = _stationary(given or self._estimate(places, others, effects))
            features = self._features(fit.variogram)
        unit = _unit(fit.variogram, features, wide * np.sqrt(variances))
        return _Model(fit, features, unit, self._conditioned(past, fit.variogram, features, unit, stamp_s))

    @cached_property
    def _history(self) -> _History:
        """Surveys to use, and the decay, by the evidence of the earlier surveys alone."""
        best = _History(self._all, math.inf)
        if len(self._all) < MIN_DECAYING:
            return best
        chosen = _fitted(self._all)
        variogram = self._estimate(chosen[0], chosen[1:]).variogram
        features = PatternFeatures.of(variogram, _places(self._all))
        unit = _unit(variogram, features, np.empty(0))
        views = [self._view(one.places, variogram, features, unit) for one in self._all]
        alone = [float(PatternState.before(features.rank).log_likelihoods(view)[0]) for view in views]

        def evidence(odd: int, decay_days: float) -> float:
            state = _passed(PatternState.before(features.rank), self._all[odd:], views[odd:], decay_days)
            share = NO_DECAY if decay_days == math.inf else (1 - NO_DECAY) / (len(DECAYS_DAYS) - 1)
            return state.log_likelihood + sum(alone[:odd]) + math.log(share)

        last_odd = min(MAX_ODD, len(self._all) - MIN_DECAYING + 1)
        odd = max(range(last_odd + 1), key=lambda number: evidence(number, math.inf))
        return _History(self._all[odd:], max(DECAYS_DAYS, key=lambda days: evidence(odd, days)))

    def _features(self, variogram: Variogram) -> PatternFeatures:
        covariates = self._covariates
        return PatternFeatures.of(variogram, _places(self._history.past), covariates.at if covariates else None)

    def _at(self, places: Samples) -> Array:
        """Covariates of samples, shape (n, k)."""
        assert self._covariates is not None
        return Supports(places.xy, places.spread).average_rows(self._covariates.at)

    def _conditioned(
        self,
        past: tuple[_Past, ...],
        variogram: Variogram,
        features: PatternFeatures,
        unit: Array,
        stamp_s: float,
    ) -> PatternState:
        """What earlier surveys say of the coefficients at a time."""
        views = (self._view(one.places, variogram, features, unit) for one in past)
        state = _passed(
            PatternState.before(features.rank, len(unit) - features.rank), past, views, self._history.decay_days
        )
        return state.later(self._history.share(stamp_s))

    def _view(self, places: Samples, variogram: Variogram, features: PatternFeatures, unit: Array) -> SurveyView:
        """An earlier survey."""
        rate = LocalRate.of(places, variogram) if self._local_noise else noise_rate(places)
        return view_of(places, variogram, features, unit, rate)

    def _effects(self, state: PatternState, unit: Array) -> tuple[Effect, ...]:
        assert self._covariates is not None
        mean, covariance = state.effects
        sd, unit = np.sqrt(np.diag(covariance)), unit[state.rank :]
        columns = zip(self._covariates.names, (mean * unit).tolist(), (sd * unit).tolist(), strict=True)
        return tuple(Effect(*column) for column in columns)

    def _missing(self, effects: Sequence[Effect]) -> Callable[[Array], Array] | None:
        """Variance of the rate where covariates are missing."""
        covariates = self._covariates
        if covariates is None or np.isfinite(covariates.layers).all():
            return None
        squares = np.array([one.mean**2 + one.sd**2 for one in effects])
        return lambda xy: np.asarray((1 - covariates.known_at(xy)) ** 2 @ squares)

    def _relations(self, state: PatternState, loading: float, stamp_s: float) -> tuple[Relation, ...]:
        past, decayed, found = self._history.past, self._history.share(stamp_s), []
        for one, probabilities in zip(reversed(past), reversed(state.loadings), strict=True):
            found.append(Relation(one.name, loading * decayed * float(probabilities @ LOADINGS)))
            decayed *= self._history.decayed(one.days)
        left_out = [Relation(one.name, 0.0) for one in self._all[: len(self._all) - len(past)]]
        return (*left_out, *reversed(found))


@dataclass(frozen=True, eq=False)
class _History:
    """Earlier surveys to use, in order of time, and how fast the pattern changes.

    :param past: the surveys
    :param decay_days: time in which the correlation falls to 1/e [days]
    """

    past: tuple[_Past, ...]
    decay_days: float

    def decayed(self, days: float) -> float:
        """Correlation of the pattern with itself after some days."""
        return math.exp(-days / self.decay_days)

    def share(self, stamp_s: float) -> float:
        """Correlation of the pattern at a time with the pattern at the last survey; 1 if the time is unknown."""
        if not self.past or not stamp_s:
            return 1.0
        return self.decayed(abs(stamp_s - self.past[-1].stamp_s) / DAY_S)


def _stationary(fit: VariogramFit) -> VariogramFit:
    """The fit without an amplitude, which cannot be used together with a prior."""
    return replace(fit, variogram=fit.stationary.stationary, local=None)


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


def _unit(variogram: Variogram, features: PatternFeatures, effects: Array) -> Array:
    """Prior standard deviation of each coefficient, shape (r + k,) [counts/s]."""
    return np.concatenate([np.full(features.rank, math.sqrt(variogram.structured_sill)), effects])


def view_of(
    places: Samples, variogram: Variogram, features: PatternFeatures, unit: Array, rate: float | LocalRate
) -> SurveyView:
    """A survey, ready for conditioning, from pools of its places if they are more than :data:`MAX_PLACES`.

    :param places: samples at distinct places
    :param unit: standard deviation of the coefficient of each feature, shape (r + k,) [counts/s]
    :param rate: rate in the Poisson noise of the samples [counts/s]
    """
    places = pooled(places, MAX_PLACES)
    covariance = np.ascontiguousarray(sample_correlation(variogram, places.xy, places.spread))
    covariance *= variogram.structured_sill
    noise = noise_rates(rate, places.xy) / places.exposure_s
    covariance[np.diag_indices(len(places))] += variogram.nugget + noise
    at = Supports(places.xy, places.spread).average_rows(features) * unit
    return SurveyView(places.rate_cps, covariance, np.ascontiguousarray(at))
