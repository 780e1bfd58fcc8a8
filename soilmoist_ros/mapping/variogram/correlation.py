# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Correlation models of variograms, by name: the built-in ones, and those that other packages add."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, Registry

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CorrelationModel:
    """A correlation function of the squared distance in units of the range, ``q = (h / range_m)**2``.

    :param correlation: q -> correlation; may overwrite q, which is a float array of any shape
    :param with_slope: q -> correlation and d(correlation) / d(log range); may overwrite q
    :param practical: distance, in units of the range, at which 95 % of the structured variance is reached
        (spherical: all of it, as is usual)
    :param label: name for reports
    :param is_product: whether it is analytic and a product of one factor for each axis, as only a Gaussian is:
        rasters are then interpolated from few points
    :param has_edge: whether it is not smooth at the range
    :param has_one_peak: whether the likelihood of many samples has one maximum, so that one search finds it
    """

    correlation: Callable[[Array], Array]
    with_slope: Callable[[Array], tuple[Array, Array]]
    practical: float
    label: str = ""
    is_product: bool = False
    has_edge: bool = False
    has_one_peak: bool = False


def _gaussian(q: Array) -> Array:
    np.exp(np.negative(q, out=q), out=q)
    return q


def _gaussian_both(q: Array) -> tuple[Array, Array]:
    value = np.exp(-q)
    q *= 2
    q *= value
    return value, q


def _exponential(q: Array) -> Array:
    np.sqrt(q, out=q)
    return _gaussian(q)


def _exponential_both(q: Array) -> tuple[Array, Array]:
    np.sqrt(q, out=q)
    value = np.exp(-q)
    q *= value
    return value, q


def _spherical(q: Array) -> Array:
    u = np.minimum(np.sqrt(q, out=q), 1.0, out=q)
    cubic = u * u
    cubic -= 3.0
    cubic *= u
    cubic *= 0.5
    cubic += 1.0
    return cubic


def _spherical_both(q: Array) -> tuple[Array, Array]:
    u: Array = np.minimum(np.sqrt(q), 1.0)
    return _spherical(q), 1.5 * u * (1 - u * u)


def _matern32(q: Array) -> Array:
    a = np.sqrt(np.multiply(q, 3.0, out=q), out=q)
    decay = np.exp(-a)
    a += 1.0
    a *= decay
    return a


def _matern32_both(q: Array) -> tuple[Array, Array]:
    q *= 3.0
    a = np.sqrt(q)
    decay = np.exp(-a)
    q *= decay
    a += 1.0
    a *= decay
    return a, q


def _matern52(q: Array) -> Array:
    a = np.sqrt(np.multiply(q, 5.0, out=q), out=q)
    decay = np.exp(-a)
    polynomial = a / 3
    polynomial += 1.0
    polynomial *= a
    polynomial += 1.0
    polynomial *= decay
    return polynomial


def _matern52_both(q: Array) -> tuple[Array, Array]:
    q *= 5.0
    a = np.sqrt(q)
    decay = np.exp(-a)
    q /= 3.0
    a += 1.0
    value = a + q
    value *= decay
    q *= a
    q *= decay
    return value, q


BUILT_IN = {
    "gaussian": CorrelationModel(_gaussian, _gaussian_both, 1.7308183826022854, "Gaussian", is_product=True),
    "exponential": CorrelationModel(
        _exponential, _exponential_both, 2.995732273553991, "exponential", has_one_peak=True
    ),
    "spherical": CorrelationModel(_spherical, _spherical_both, 1.0, "spherical", has_edge=True),
    "matern32": CorrelationModel(_matern32, _matern32_both, 2.73887145669191, "Matérn 3/2", has_one_peak=True),
    "matern52": CorrelationModel(_matern52, _matern52_both, 2.64690045466485, "Matérn 5/2", has_one_peak=True),
}


def _checked(plug_in: Any) -> CorrelationModel:
    """A model of another package.

    :raises TypeError: if it is no :class:`CorrelationModel`
    :raises ValueError: if it is no correlation
    """
    if not isinstance(plug_in, CorrelationModel):
        raise TypeError(f"a variogram model must be a CorrelationModel, got {type(plug_in).__name__}")
    q = np.array([0.0, 0.3, 4.0])
    value, (again, slope) = plug_in.correlation(q.copy()), plug_in.with_slope(q.copy())
    if not (np.allclose(value, again) and np.isclose(value[0], 1.0) and np.shape(slope) == q.shape):
        raise ValueError("its correlation must be 1 at distance 0, and the same with and without slope")
    if not plug_in.practical > 0:
        raise ValueError(f"its practical range must be > 0, got {plug_in.practical}")
    return plug_in


VARIOGRAM_MODELS = Registry("soilmoist_ros.variogram_models", "variogram model", BUILT_IN, _checked)
"""Variogram models by name; another package adds one with an entry point ``soilmoist_ros.variogram_models``."""


def correlation_model(name: str) -> CorrelationModel:
    """The model of a name.

    :raises ValueError: if there is none; lists the known ones
    """
    try:
        return VARIOGRAM_MODELS.get(name)
    except InputError as error:
        raise ValueError(str(error)) from None


class _KnownModel:
    """Makes pydantic refuse names that are not registered."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        from pydantic_core import core_schema

        def check(name: str) -> str:
            correlation_model(name)
            return name

        return core_schema.no_info_after_validator_function(check, handler(source))


ModelName = Annotated[str, _KnownModel()]
"""Name of a variogram model in :data:`VARIOGRAM_MODELS`."""
