# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A surrogate field: count rate and soil moisture are known everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import Field, Variogram
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurrogateField:
    """A field whose truth is known.

    :param name: short name, as given to :func:`surrogate_field`
    :param title: name shown in reports
    :param field: plane, boundary, no-go areas and cell size
    :param truth: corrected rate of the whole sensor [counts/s], shape (n,), at positions of shape (n, 2) [m]
    :param curve: calibration that links moisture and rate, ``None`` without a calibration
    :param hours: usual mission time [h]
    :param points_xy: positions of the points for a truth from points [m], shape (k, 2)
    :param points_rate: rates at the points [counts/s], shape (k,)
    :param variogram: that of the rate, if it is a random field
    """

    name: str
    title: str
    field: Field
    truth: Callable[[Array], Array]
    curve: MoistureCurve | None = None
    hours: float = 2.0
    points_xy: Array | None = None
    points_rate: Array | None = None
    variogram: Variogram | None = None

    @property
    def frame(self) -> LocalFrame:
        """East-north plane about the field's datum."""
        return self.field.frame

    @property
    def polygon(self) -> Array:
        """Boundary, shape (k, 2) [m]."""
        return self.field.polygon

    def rate_at(self, xy_m: ArrayLike) -> Array:
        """True corrected count rate of the whole sensor [counts/s] at positions of shape (n, 2) [m], shape (n,).

        Far beyond the boundary, it is the rate at the nearest known position.
        """
        return self.truth(np.atleast_2d(np.asarray(xy_m, float)))

    def vwc_at(self, xy_m: ArrayLike) -> Array:
        """True volumetric water content [m^3/m^3] at positions of shape (n, 2) [m], shape (n,).

        :raises ValueError: if the field has no calibration curve
        """
        if self.curve is None:
            raise ValueError(f"the field {self.name!r} has no calibration curve, hence no soil moisture")
        return self.curve.vwc(self.rate_at(xy_m))
