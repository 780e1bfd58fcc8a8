"""Fields whose soil moisture is known everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.geodesy import LocalFrame
from soilmoist_ros.sensing.moisture import CalibrationCurve


@dataclass(frozen=True)
class SurrogateField:
    """A field of known soil moisture.

    :param name: name shown in reports
    :param frame: east-north plane about the field's datum
    :param polygon: boundary, shape (k, 2) [m]
    :param curve: calibration that links moisture and count rate
    :param vwc_at: volumetric water content [m^3/m^3] at places of shape (n, 2) [m]
    """

    name: str
    frame: LocalFrame
    polygon: NDArray[np.float64]
    curve: CalibrationCurve
    vwc_at: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    def rate_at(self, xy_m: ArrayLike) -> NDArray[np.float64]:
        """True corrected count rate of the whole sensor [counts/s] at places of shape (n, 2) [m]."""
        return self.curve.rate_cps(self.vwc_at(np.atleast_2d(np.asarray(xy_m, float))))


def half_wet_field(
    width_m: float = 60.0,
    height_m: float = 50.0,
    dry_vwc: float = 0.08,
    wet_vwc: float = 0.28,
    transition_m: float = 6.0,
) -> SurrogateField:
    """A rectangle that is dry in the west and wet in the east, with a slanting, smooth border.

    :param width_m: extent to the east [m]
    :param height_m: extent to the north [m]
    :param dry_vwc: moisture of the dry half [m^3/m^3]
    :param wet_vwc: moisture of the wet half [m^3/m^3]
    :param transition_m: distance over which most of the change happens [m]
    """

    def vwc_at(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        slant = 0.25 * (xy[:, 1] - height_m / 2)
        wetness = 0.5 * (1 + np.tanh((xy[:, 0] - width_m / 2 - slant) / (transition_m / 2)))
        return np.asarray(dry_vwc + (wet_vwc - dry_vwc) * wetness)

    corners = [(0, 0), (width_m, 0), (width_m, height_m), (0, height_m)]
    return SurrogateField(
        name="half wet, half dry",
        frame=LocalFrame(53.2680, -0.5245),
        polygon=np.array(corners, dtype=float),
        curve=CalibrationCurve(n0_cps=6.0, bulk_density_gcm3=1.4),
        vwc_at=vwc_at,
    )
