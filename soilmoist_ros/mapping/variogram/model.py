# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Variogram models of the latent count rate: correlation, nugget, sill, range and anisotropy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, Registry

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CorrelationModel:
    """A correlation function of the squared distance in units of the range, ``q = (h / range_m)**2``.

    :param correlation: q -> correlation; may overwrite q, which is a float array of any shape
    :param with_slope: q -> correlation and d(correlation) / d(log range); may overwrite q
    :param practical: distance, in units of the range, at which 95 % of the structured variance is reached
        (spherical: all of it, as is usual)
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
    """A model of another package."""
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


# -- Variogram -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Variogram:
    """A variogram model of the latent count rate.

    ``gamma(h) = nugget + (sill - nugget) * (1 - rho(h))`` for h > 0, ``gamma(0) = 0``, with u = h / range_m:

    ============  ==================================  =====================
    model         rho                                 range in PyKrige
    ============  ==================================  =====================
    gaussian      exp(-u^2)                           7/4 range_m
    exponential   exp(-u)                             3 range_m
    spherical     1 - 1.5 u + 0.5 u^3, 0 from u = 1   range_m
    matern32      (1 + s) exp(-s), s = sqrt(3) u      -
    matern52      (1 + s + s^2/3) exp(-s), s = sqrt(5) u   -
    ============  ==================================  =====================

    With a geometric anisotropy (Chiles & Delfiner 2012, Geostatistics, section 2.5.2) the range depends on the
    direction like the radius of an ellipse: ``range_m * sqrt(anisotropy)`` along ``angle_deg`` and
    ``range_m / sqrt(anisotropy)`` across. Methods of a distance apply to directions where the range is
    ``range_m``.

    :param model: name of a model in the table
    :param nugget: micro-scale variance of the rate without Poisson noise [(counts/s)^2], >= 0
    :param range_m: range parameter [m], > 0; geometric mean of the longest and the shortest range
    :param sill: *total* sill, including the nugget [(counts/s)^2], >= nugget
    :param anisotropy: longest range over shortest range [-], >= 1; 1 for an isotropic variogram
    :param angle_deg: direction of the longest range, anticlockwise from east [deg]; kept modulo 180
    :raises ValueError: if the model is unknown or a parameter is out of its range

    >>> variogram = Variogram("matern32", nugget=0.02, range_m=15.0, sill=0.5)
    >>> variogram(np.array([0.0, 15.0, 1000.0])).round(3)
    array([0.   , 0.268, 0.5  ])
    """

    model: ModelName
    nugget: float
    range_m: float
    sill: float
    anisotropy: float = 1.0
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        correlation_model(self.model)
        for name in ("nugget", "range_m", "sill", "anisotropy", "angle_deg"):
            value = float(getattr(self, name))
            if not np.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value}")
            object.__setattr__(self, name, value)
        if self.nugget < 0:
            raise ValueError(f"nugget must be >= 0, got {self.nugget}")
        if self.range_m <= 0:
            raise ValueError(f"range_m must be > 0, got {self.range_m}")
        if self.sill < self.nugget:
            raise ValueError(
                f"sill is the total sill and must be >= nugget ({self.nugget}), got {self.sill}; "
                "add the nugget if you have a partial sill"
            )
        if self.anisotropy < 1:
            raise ValueError(
                f"anisotropy is the longest range over the shortest and must be >= 1, got {self.anisotropy}; "
                "turn angle_deg by 90 and give its inverse"
            )
        object.__setattr__(self, "angle_deg", self.angle_deg % 180.0 % 180.0)  # twice: -1e-20 % 180 is 180

    @property
    def structured_sill(self) -> float:
        """Variance of the spatially correlated part, ``sill - nugget`` [(counts/s)^2]."""
        return self.sill - self.nugget

    @property
    def correlation_model(self) -> CorrelationModel:
        """Correlation model of the structured part."""
        return correlation_model(self.model)

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the structured variance is reached (spherical: all of it) [m]."""
        return self.range_m * self.correlation_model.practical

    def scaled(self, xy: Array) -> Array:
        """Places in the plane where the variogram is isotropic, in units of the range.

        :param xy: places or displacements, shape (..., 2) [m]
        """
        if self.anisotropy == 1:
            return xy / self.range_m
        return np.asarray(xy @ isotropic_plane(self.anisotropy, self.angle_deg) / self.range_m)

    def __call__(self, h_m: ArrayLike) -> Array:
        """Semivariance, see :meth:`semivariance`."""
        return self.semivariance(h_m)

    def semivariance(self, h_m: ArrayLike) -> Array:
        """Semivariance at distances of any shape [m] -> [(counts/s)^2]; 0 at distance 0."""
        h = np.asarray(h_m, float)
        return np.where(h == 0, 0.0, self.nugget + self.structured_sill * (1 - self.correlation(h)))

    def correlation(self, h_m: ArrayLike) -> Array:
        """Correlation of the structured part at distances of any shape [m]; 1 at distance 0."""
        return self.correlation_of_square((np.asarray(h_m, float) / self.range_m) ** 2)

    def covariance(self, h_m: ArrayLike) -> Array:
        """Covariance of the rate at distances of any shape [m]; the nugget only at distance 0."""
        h = np.asarray(h_m, float)
        return self.structured_sill * self.correlation(h) + np.where(h == 0, self.nugget, 0.0)

    def correlation_of_square(self, q: ArrayLike) -> Array:
        """Correlation of the structured part at squared distances in units of the range.

        May overwrite its argument, to save a square root or a copy in inner loops.
        """
        return self.correlation_model.correlation(np.atleast_1d(np.asarray(q, float))).reshape(np.shape(q))


def scaled(variogram: Variogram, x: Array, y: Array) -> tuple[Array, Array]:
    """As :meth:`Variogram.scaled`, but no product of matrices: bits do not depend on the number of places."""
    if variogram.anisotropy == 1:
        return x / variogram.range_m, y / variogram.range_m
    (xx, xy), (_, yy) = isotropic_plane(variogram.anisotropy, variogram.angle_deg) / variogram.range_m
    return xx * x + xy * y, xy * x + yy * y


@lru_cache(maxsize=64)
def isotropic_plane(anisotropy: float, angle_deg: float) -> Array:
    """Matrix M, shape (2, 2), such that the range of places ``xy @ M`` is the geometric mean in all directions.

    M is symmetric with determinant 1, and exactly diagonal if the longest range lies along an axis.

    :param angle_deg: direction of the longest range, anticlockwise from east [deg]
    """
    along, across = 1 / np.sqrt(anisotropy), np.sqrt(anisotropy)
    if angle_deg % 90 == 0:
        plane = np.diag([along, across] if angle_deg % 180 == 0 else [across, along])
    else:
        cosine, sine = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
        axes = np.array([[cosine, sine], [-sine, cosine]])  # along and across, in the rows
        plane = np.asarray(axes.T * [along, across] @ axes)
    plane.setflags(write=False)
    return plane


def mode_of(means: Variogram, log_sd: tuple[float, float, float] | None) -> Variogram:
    """The mode of a variogram of posterior means; :mod:`.reml` says why; the same variogram without errors."""
    if log_sd is None:
        return means
    structured, _, nugget = np.exp(-0.5 * np.square(log_sd)).tolist()
    nugget *= means.nugget
    return replace(means, nugget=nugget, sill=structured * means.structured_sill + nugget)
