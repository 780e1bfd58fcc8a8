# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fitting a variogram to counts: restricted maximum likelihood, or least squares on the binned estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.samples import Samples, Surveys, as_samples, merge_exactly, noise_rate
from soilmoist_ros.mapping.variogram.farm_prior import FarmPrior
from soilmoist_ros.mapping.variogram.field_prior import FieldPrior
from soilmoist_ros.mapping.variogram.local_rate import LocalRate
from soilmoist_ros.mapping.variogram.model import ModelName, Variogram, correlation_model, mode_of
from soilmoist_ros.mapping.variogram.reml import maximise_reml
from soilmoist_ros.mapping.variogram.semivariogram import default_edges, fit_soft_l1, semivariogram_of

Array = NDArray[np.float64]
FitMethod = Literal["reml", "soft_l1"]
NoiseModel = Literal["local", "mean"]

MAX_PAIRED_PLACES = 5000
"""Maximum number of places in the empirical semivariogram; of more places, every k-th is used."""
UNKNOWN_EXTENT_M = 100.0
"""Extent assumed for the prior of the range when all samples are at one place and no extent is given [m]."""


@dataclass(frozen=True, eq=False)
class VariogramFit:
    """A fitted variogram and the details of the fit.

    :param mean_rate: mean rate m* of the data [counts/s]
    :param objective: restricted log-likelihood at the mode (reml; larger is better), or cost (soft_l1; smaller
        is)
    :param log_sd: standard errors of the logarithms of structured sill, range and nugget; ``None`` for soft_l1
    :param prior_share: influence of the prior on structured sill, range and nugget, from 0 (data only) to 1 (prior
        only); zeros for soft_l1, which has no prior
    :param lag_m: mean distance of each class of the empirical semivariogram [m]
    :param gamma: empirical semivariance [(counts/s)^2], NaN for an empty class
    :param weight: weight of each class [s]
    :param edges_m: edges of the classes, one more than classes [m]; empty with fewer than two places
    :param local_rate: rate in the Poisson noise of each sample of a map; ``None`` for the mean rate
    :param other_fields: verdict of the counts on surveys of other fields, and what these expect; empty without any
    """

    variogram: Variogram
    method: FitMethod
    mean_rate: float
    n_samples: int
    objective: float
    log_sd: tuple[float, float, float] | None
    prior_share: tuple[float, float, float]
    converged: bool
    lag_m: Array
    gamma: Array
    weight: Array
    edges_m: Array
    local_rate: LocalRate | None = None
    prior: FieldPrior | None = None
    other_fields: str = ""

    @property
    def mode(self) -> Variogram:
        """The mode of the fit, whose variances are posterior means."""
        return mode_of(self.variogram, self.log_sd)

    @property
    def noise_rate(self) -> float | LocalRate | None:
        """Rate in the Poisson noise of samples; ``None`` if nothing was counted, for that of the samples."""
        return self.local_rate or self.mean_rate or None

    @property
    def prior_mattered(self) -> bool:
        """True if the prior determined the structured sill or the range more than the data did."""
        return max(self.prior_share[:2]) > 0.5


def fit_variogram(
    xy: ArrayLike,
    counts: ArrayLike,
    exposure_s: ArrayLike,
    model: ModelName = "matern32",
    method: FitMethod = "reml",
    **options: Any,
) -> Variogram:
    """Fit a variogram; parameters, options and errors as :func:`estimate_variogram`.

    >>> xy = [(0, 0), (10, 0), (20, 5), (40, 10), (45, 30)]
    >>> fit_variogram(xy, counts=[300, 320, 380, 500, 470], exposure_s=[100.0] * 5, extent_m=60.0).model
    'matern32'
    """
    return estimate_variogram(xy, counts, exposure_s, model, method, **options).variogram


def estimate_variogram(
    xy: ArrayLike,
    counts: ArrayLike,
    exposure_s: ArrayLike,
    model: ModelName = "matern32",
    method: FitMethod = "reml",
    *,
    extent_m: float | None = None,
    spread: ArrayLike | None = None,
    anisotropy: bool = True,
    local_noise: bool = False,
    others: Sequence[Samples] = (),
    effects: Sequence[Array] | None = None,
    like: VariogramFit | None = None,
    farm: FarmPrior | None = None,
) -> VariogramFit:
    """Fit a variogram of the latent rate to counts.

    ``"reml"`` (recommended, with Matern 3/2) uses the restricted likelihood of the rates with the known noise
    m*/t, times weak priors (:func:`maximise_reml`). One sample is enough; the result is then the prior's. Above
    1000 places the likelihood is a composite over blocks of at most 500 neighbours.

    ``"soft_l1"`` uses least squares with soft-L1 loss on the binned semivariogram, as published for this robot. It
    needs two distinct places and ignores the uncertainty of each class. In simulations its intervals were as good
    as with REML in fields of strong contrast, and too narrow in faint fields.

    :param xy: places, shape (n, 2) [m]; records at one place are merged
    :param counts: raw counts, shape (n,)
    :param exposure_s: effective exposures, shape (n,) [s]
    :param extent_m: extent (longest side) of the field, for the prior of the range [m]. By default that of
        the samples, which understates it early in a mission
    :param spread: as :class:`Samples`. REML estimates the variogram of the rate at points; the semivariogram and
        soft_l1 ignore the spread
    :param anisotropy: whether the range may depend on the direction; it never does with soft_l1
    :param local_noise: whether the Poisson noise in a map has the rate at each place, instead of the mean
    :param others: samples of other surveys at distinct places, whose rates have the same variogram and a mean of
        their own; soft_l1 ignores them
    :param effects: known further structure of each survey, as in :class:`Surveys`, where ``xy`` has no place twice
    :param like: fit to fewer of the samples, for a quick one: the search begins at it, and its direction is used;
        soft_l1 ignores it
    :param farm: surveys of other fields, which inform the prior; soft_l1 ignores them
    :raises ValueError: if there are too few samples, for an unknown model or method, for bad input
    """
    correlation_model(model)
    if method not in ("reml", "soft_l1"):
        raise ValueError(f"unknown method {method!r}; known are reml, soft_l1")
    places, _ = merge_exactly(as_samples(xy, counts, exposure_s, spread))
    if not len(places):
        raise ValueError("fitting a variogram needs at least one sample; wait for the first record")
    if extent_m is not None and not (np.isfinite(extent_m) and extent_m > 0):
        raise ValueError(f"extent_m must be positive and finite, got {extent_m}")
    classes = _classes(places)
    if method == "soft_l1":
        fit = _fit_soft_l1(places, model, classes)
        return replace(fit, local_rate=LocalRate.of(places, fit.variogram)) if local_noise else fit
    surveys = Surveys((places, *others), None if effects is None else tuple(effects))
    extent_m = extent_m or float(np.ptp(places.xy, axis=0).max()) or UNKNOWN_EXTENT_M
    estimate = maximise_reml(surveys, model, extent_m, anisotropy, None if like is None else like.mode, farm)
    local_rate = LocalRate.of(places, estimate.variogram) if local_noise else None
    found = estimate.log_likelihood, estimate.log_sd, estimate.prior_share, estimate.converged
    return VariogramFit(
        estimate.variogram, "reml", places.mean_rate_cps, len(places), *found, *classes, local_rate,
        other_fields=estimate.other_fields,
    )  # fmt: skip


_Classes = tuple[Array, Array, Array, Array]  # the empirical semivariogram: lag_m, gamma, weight, and edges_m


def _classes(places: Samples) -> _Classes:
    if len(places) < 2:
        return np.empty(0), np.empty(0), np.empty(0), np.empty(0)
    limits = default_edges(places.xy)
    if (every := -(-len(places) // MAX_PAIRED_PLACES)) > 1:
        places = Samples(places.xy[::every], places.counts[::every], places.exposure_s[::every])
    return (*semivariogram_of(places, limits), limits)


def _fit_soft_l1(places: Samples, model: ModelName, classes: _Classes) -> VariogramFit:
    """Soft-L1 least squares of nugget, range and structured sill on the classes that are not empty.

    The fit uses units of the mean absolute semivariance and of the largest lag, so the unit of time does not
    matter. The structured sill stays above (1 % of the mean rate)^2; below, nothing could be mapped.
    """
    lag_m, gamma, weight, _ = classes
    if len(places) < 2 or not weight.any():
        raise ValueError(
            "method soft_l1 needs samples at two distinct places within the distance classes; "
            "take another sample, or use method reml"
        )
    lag_m, gamma = lag_m[weight > 0], gamma[weight > 0]
    floor = (0.01 * noise_rate(places)) ** 2
    unit = max(float(np.mean(np.abs(gamma))), floor)
    longest = float(lag_m.max())

    found = fit_soft_l1(lag_m / longest, gamma / unit, model, floor / unit)
    nugget, structured = found.nugget * unit, found.structured * unit
    return VariogramFit(
        Variogram(model, nugget, found.range_ * longest, nugget + structured),
        "soft_l1",
        places.mean_rate_cps,
        len(places),
        found.cost,
        None,
        (0.0, 0.0, 0.0),
        True,
        *classes,
    )
