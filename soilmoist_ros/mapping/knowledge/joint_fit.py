"""The joint model of a survey and all that is known besides, fitted to all counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.conditioning import LOADINGS, PatternState, SurveyView
from soilmoist_ros.mapping.knowledge.knowledge import Knowledge
from soilmoist_ros.mapping.knowledge.pattern import PatternFeatures
from soilmoist_ros.mapping.kriging.targets import Points
from soilmoist_ros.mapping.samples.samples import Samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
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
MAX_FITTED = 500
"""Maximum number of earlier samples to which the variogram is fitted; of more, the last surveys are used."""


class JointModel:
    """Fits the joint model of the surveys and covariates of a field.

    :param grid: the field
    :param knowledge: what is known besides the survey
    :param estimate: fits a variogram
    :param noise: rate in the Poisson noise: ``local`` to each place, or ``mean``
    """

    def __init__(self, grid: FieldGrid, knowledge: Knowledge, estimate: Estimate, noise: NoiseModel) -> None:
        self._grid = grid
        self._knowledge = knowledge
        self._estimate = estimate
        self._local_noise = noise == "local"
        ordered = sorted(knowledge.earlier, key=lambda one: (one.stamp_s, one.name))
        self._earlier = [merge_exactly(one.samples)[0] for one in ordered]

    def fit(self, samples: Samples) -> VariogramFit:
        """Variogram and prior for a survey."""
        places = merge_exactly(samples)[0]
        fit = self._estimate(places, self._fitted())
        variogram = fit.variogram
        features = PatternFeatures.of(variogram, self._candidates())
        unit = np.full(features.rank, np.sqrt(variogram.structured_sill))
        state = PatternState.before(features.rank)
        for survey in self._earlier:
            view = self._view(survey, variogram, features, unit)
            if not state.loadings:
                state = state.after(view, (LOADINGS == FIRST_LOADING).astype(float))
            else:
                state = state.after(view, *state.loading_of(view))
        rate = fit.noise_rate or noise_rate(places)
        probabilities, _ = state.loading_of(view_of(places, variogram, features, unit, rate))
        prior = FieldPrior(features, state.scale(float(probabilities @ LOADINGS)) * unit, state.excess, state.mean)
        return replace(fit, prior=prior)

    def _fitted(self) -> list[Samples]:
        """Earlier surveys to which the variogram is fitted."""
        chosen: list[Samples] = []
        for survey in reversed(self._earlier):
            if chosen and sum(map(len, chosen)) + len(survey) > MAX_FITTED:
                break
            chosen.append(survey)
        return chosen

    def _candidates(self) -> Array:
        """Places of earlier samples."""
        return np.concatenate([np.empty((0, 2)), *(one.xy for one in self._earlier)])

    def _view(self, places: Samples, variogram: Variogram, features: PatternFeatures, unit: Array) -> SurveyView:
        """An earlier survey."""
        rate = LocalRate.of(places, variogram) if self._local_noise else noise_rate(places)
        return view_of(places, variogram, features, unit, rate)


def view_of(
    places: Samples, variogram: Variogram, features: PatternFeatures, unit: Array, rate: float | LocalRate
) -> SurveyView:
    """A survey, ready for conditioning.

    :param places: samples at distinct places
    :param unit: standard deviation of the coefficient of each feature, shape (r + k,) [counts/s]
    :param rate: rate in the Poisson noise of the samples [counts/s]
    """
    supports = Supports(places.xy, places.spread)

    def with_points(xy: Array) -> Array:
        return Points(variogram, places.xy, xy, places.spread).correlation(slice(0, len(xy))).T

    covariance = np.ascontiguousarray(supports.average(with_points)) * variogram.structured_sill
    noise = noise_rates(rate, places.xy) / places.exposure_s
    covariance[np.diag_indices(len(places))] += variogram.nugget + noise
    at = supports.average(lambda points: features(points).T.copy()).T * unit
    return SurveyView(places.rate_cps, covariance, np.ascontiguousarray(at))
