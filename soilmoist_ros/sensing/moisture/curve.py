# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Corrected neutron count rate <-> volumetric water content (VWC): the protocol, and the curve of Desilets.

Desilets, Zreda & Ferre (2010), Water Resources Research 46, W11505:
``vwc = rho_b * (A0 / (N/N0 - A1) - A2 - w)`` with the lattice and organic water ``w`` subtracted.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats

A0, A1, A2 = 0.0808, 0.372, 0.115
_NEAR_POLE = 1.1


class MoistureCurve(Protocol):
    """The calibration of one sensor at one site: moisture as a decreasing function of the corrected rate.

    Rates are proportional to N0 at a given moisture. All methods take arrays of any shape.
    """

    @property
    def n0_cps(self) -> float:
        """Count rate over dry soil, all tubes, corrected [counts/s]."""

    @property
    def bulk_density_gcm3(self) -> float:
        """Dry bulk density of the soil [g/cm^3]."""

    @property
    def lattice_water(self) -> float:
        """Gravimetric lattice water [g/g]."""

    @property
    def organic_water(self) -> float:
        """Gravimetric water equivalent of soil organic matter [g/g]."""

    @property
    def n0_sd_cps(self) -> float:
        """Standard deviation of N0 [counts/s]; 0 if unknown."""

    @property
    def bulk_density_sd_gcm3(self) -> float:
        """Standard deviation of the bulk density [g/cm^3]; 0 if unknown."""

    @property
    def lowest_rate_cps(self) -> float:
        """Rate at or below which VWC is undefined [counts/s]."""

    @property
    def parameters(self) -> dict[str, str | float]:
        """Name and parameters of the curve, for files."""

    def valid(self, rate_cps: ArrayLike) -> NDArray[np.bool_]:
        """Where a rate [counts/s] has a soil moisture."""

    def vwc(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """Volumetric water content [m^3/m^3] of corrected rates [counts/s]; NaN where not :meth:`valid`."""

    def rate_cps(self, vwc: ArrayLike) -> NDArray[np.float64]:
        """Corrected rate [counts/s] of a volumetric water content [m^3/m^3].

        :raises ValueError: below the driest soil of the curve
        """

    def slope(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """d(vwc)/d(rate) [m^3/m^3 per count/s], negative; NaN where not :meth:`valid`."""

    def weight(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """Factor from rate variance to VWC variance [(m^3/m^3 per count/s)^2], finite everywhere."""

    def vwc_sd(self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Standard deviation of the VWC [m^3/m^3] from the one of the rate; order 1 or 3.

        :raises ValueError: for another order
        """

    def vwc_and_sd(
        self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """:meth:`vwc` and third-order :meth:`vwc_sd`, faster than two calls."""


def check_parameters(curve: MoistureCurve, *more: str) -> None:
    """Check the values that all curves have.

    :param more: names of further values that must be zero or positive
    :raises ValueError: if N0 or the bulk density is not positive and finite, or another value is negative
    """
    for name in ("n0_cps", "bulk_density_gcm3"):
        value = getattr(curve, name)
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    for name in ("lattice_water", "organic_water", "n0_sd_cps", "bulk_density_sd_gcm3", *more):
        value = getattr(curve, name)
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be zero or positive and finite, got {value}")


def sd_of_vwc(
    curve: MoistureCurve, rate_cps: ArrayLike, rate_sd_cps: ArrayLike, order: int
) -> NDArray[np.float64]:
    """Standard deviation of the VWC of any curve, see :meth:`MoistureCurve.vwc_sd`.

    :raises ValueError: for another order than 1 or 3
    """
    if order == 1:
        return np.asarray(np.abs(curve.slope(rate_cps)) * floats(rate_sd_cps))
    if order != 3:
        raise ValueError(f"order must be 1 or 3, got {order}")
    return curve.vwc_and_sd(rate_cps, rate_sd_cps)[1]


@dataclass(frozen=True)
class CalibrationCurve:
    """The calibration of one sensor at one site with the curve of Desilets et al. (2010).

    :param n0_cps: count rate over dry soil N0, all tubes, corrected [counts/s]
    :param bulk_density_gcm3: dry bulk density of the soil [g/cm^3]
    :param lattice_water: gravimetric lattice water [g/g]
    :param organic_water: gravimetric water equivalent of soil organic matter [g/g]
    :param n0_sd_cps: standard deviation of N0 [counts/s]; 0 if unknown
    :param bulk_density_sd_gcm3: standard deviation of the bulk density [g/cm^3]; 0 if unknown
    :raises ValueError: if N0 or the bulk density is not positive and finite, or another value is negative
    """

    n0_cps: float
    bulk_density_gcm3: float
    lattice_water: float = 0.0
    organic_water: float = 0.0
    n0_sd_cps: float = 0.0
    bulk_density_sd_gcm3: float = 0.0

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def lowest_rate_cps(self) -> float:
        """Rate at which the curve diverges, ``A1 * N0`` [counts/s]; at or below it VWC is undefined."""
        return A1 * self.n0_cps

    @property
    def parameters(self) -> dict[str, str | float]:
        """Name and parameters of the curve, for files."""
        return {"curve": "desilets", **asdict(self)}

    def valid(self, rate_cps: ArrayLike) -> NDArray[np.bool_]:
        """Where a rate has a soil moisture: above ``A1 * N0``."""
        return floats(rate_cps) / self.n0_cps > A1

    def vwc(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """Volumetric water content [m^3/m^3] of corrected rates [counts/s], any shape.

        NaN where :meth:`valid` is false. Values below 0 are not clipped, because they show that N0 or the water
        terms are wrong.
        """
        return self._vwc(self._excess(rate_cps))

    def rate_cps(self, vwc: ArrayLike) -> NDArray[np.float64]:
        """Corrected rate [counts/s] of a volumetric water content [m^3/m^3]; the inverse of :meth:`vwc`.

        :raises ValueError: where ``vwc / rho_b + A2 + w`` is not positive
        """
        gravimetric = floats(vwc) / self.bulk_density_gcm3
        total = gravimetric + A2 + self.lattice_water + self.organic_water
        if np.any(total <= 0):
            raise ValueError("soil moisture is below what the calibration curve can express")
        return np.asarray(self.n0_cps * (A0 / total + A1))

    def slope(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """d(vwc)/d(rate) [m^3/m^3 per count/s], negative; NaN where :meth:`valid` is false."""
        return -self.bulk_density_gcm3 * A0 / (self.n0_cps * self._excess(rate_cps) ** 2)

    def weight(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        """Squared slope: factor from rate variance to VWC variance [(m^3/m^3 per count/s)^2].

        Near and below its pole, the curve is so steep that one place would dominate a plan. Rates there are
        raised to a tenth above the pole.
        """
        return self.slope(np.maximum(floats(rate_cps), _NEAR_POLE * self.lowest_rate_cps)) ** 2

    def vwc_sd(self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Standard deviation of the VWC [m^3/m^3] from the standard deviation of the rate.

        :param rate_cps: corrected rate [counts/s], any shape
        :param rate_sd_cps: standard deviation of the rate [counts/s], same shape
        :param order: 1, ``|d vwc/d rate| * sd``; or 3, the third-order expansion of Jakobi et al. (2020),
            Frontiers in Water 2:10, which is larger where the noise reaches the curve's steep end
        :raises ValueError: for another order
        """
        return sd_of_vwc(self, rate_cps, rate_sd_cps, order)

    def vwc_and_sd(
        self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """:meth:`vwc` and third-order :meth:`vwc_sd`, faster than two calls.

        :param rate_cps: corrected rate [counts/s], any shape
        :param rate_sd_cps: standard deviation of the rate [counts/s], same shape
        """
        excess = self._excess(rate_cps)
        relative = floats(rate_sd_cps) / excess
        relative /= self.n0_cps
        ratio = relative * relative
        series = 15.0 * ratio
        series += 8.0
        series *= ratio
        series += 1.0
        sd = np.sqrt(series)
        sd *= relative
        sd /= excess
        sd *= self.bulk_density_gcm3 * A0
        return self._vwc(excess), np.asarray(sd)

    def _vwc(self, excess: NDArray[np.float64]) -> NDArray[np.float64]:
        vwc = np.asarray(A0 / excess)
        vwc -= A2 + self.lattice_water + self.organic_water
        vwc *= self.bulk_density_gcm3
        return vwc

    def _excess(self, rate_cps: ArrayLike) -> NDArray[np.float64]:
        excess = np.asarray(floats(rate_cps) / self.n0_cps)
        excess -= A1
        excess[~(excess > 0)] = np.nan
        return excess
