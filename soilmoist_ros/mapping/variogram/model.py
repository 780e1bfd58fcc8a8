# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Variogram models of the latent count rate, with nugget, sill, range and anisotropy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping.variogram.amplitude import Amplitude
from soilmoist_ros.mapping.variogram.correlation import CorrelationModel, ModelName, correlation_model

Array = NDArray[np.float64]


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
    :param amplitude: for a field that varies more here than there, standard deviation of the rate at each place
        relative to the model's; ``None`` for a stationary variogram. Methods of a distance leave it out
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
    amplitude: Amplitude | None = None

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
    def stationary(self) -> Variogram:
        """The variogram without its amplitude."""
        return self if self.amplitude is None else replace(self, amplitude=None)

    def amplitude_at(self, xy: Array) -> Array | None:
        """Amplitudes at places of shape (n, 2) [m], shape (n,); ``None`` if they are 1 everywhere."""
        return None if self.amplitude is None else self.amplitude(xy)

    def modulated(self, covariance: Array, xy: Array, other_xy: Array) -> Array:
        """A covariance of the stationary variogram times the amplitudes at its places; may change its argument.

        :param covariance: between n and m places, shape (n, m)
        :param xy: the n places [m]
        :param other_xy: the m places [m]
        """
        if self.amplitude is not None:
            covariance *= self.amplitude(xy)[:, None]
            covariance *= self.amplitude(other_xy)
        return covariance

    @property
    def correlation_model(self) -> CorrelationModel:
        """Correlation model of the structured part."""
        return correlation_model(self.model)

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the structured variance is reached (spherical: all of it) [m]."""
        return self.range_m * self.correlation_model.practical

    @property
    def along_axes(self) -> bool:
        """Whether the variogram is isotropic or its longest range lies along an axis."""
        return self.anisotropy == 1 or self.angle_deg % 90 == 0

    def scaled(self, xy: Array) -> Array:
        """Places in the plane where the variogram is isotropic, in units of the range.

        :param xy: places or displacements, shape (..., 2) [m]
        :returns: shape (..., 2), new memory; squared distances are arguments of :meth:`correlation_of_square`
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

    :param anisotropy: longest range over shortest range [-], >= 1
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
