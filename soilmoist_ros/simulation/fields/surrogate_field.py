"""A field whose count rate, and so its soil moisture, is known everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurrogateField:
    """A field whose truth is known.

    :param name: short name, as given to :func:`surrogate_field`
    :param title: name shown in reports
    :param field: where it lies: plane, boundary, no-go areas, cell size
    :param truth: corrected rate of the whole sensor [counts/s], shape (n,), at places of shape (n, 2) [m]
    :param curve: calibration that links moisture and rate, ``None`` if there is none
    :param hours: usual mission time [h]
    :param points_xy: places of the point rates it was extrapolated from [m], shape (k, 2); none otherwise
    :param points_rate: these rates [counts/s], shape (k,)
    """

    name: str
    title: str
    field: Field
    truth: Callable[[Array], Array]
    curve: CalibrationCurve | None = None
    hours: float = 2.0
    points_xy: Array | None = None
    points_rate: Array | None = None

    @property
    def frame(self) -> LocalFrame:
        """East-north plane about the field's datum."""
        return self.field.frame

    @property
    def polygon(self) -> Array:
        """Boundary, shape (k, 2) [m]."""
        return self.field.polygon

    def rate_at(self, xy_m: ArrayLike) -> Array:
        """True corrected count rate of the whole sensor [counts/s] at places of shape (n, 2) [m], shape (n,).

        Defined everywhere: well beyond the boundary the rate is that at the nearest place that is known.
        """
        return self.truth(np.atleast_2d(np.asarray(xy_m, float)))

    def vwc_at(self, xy_m: ArrayLike) -> Array:
        """True volumetric water content [m^3/m^3] at places of shape (n, 2) [m], shape (n,).

        :raises ValueError: if the field has no calibration curve
        """
        if self.curve is None:
            raise ValueError(f"the field {self.name!r} has no calibration curve, hence no soil moisture")
        return self.curve.vwc(self.rate_at(xy_m))
