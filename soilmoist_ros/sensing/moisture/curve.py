# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Corrected neutron count rate <-> volumetric water content (VWC), and the limits of the water in a soil.

Desilets, Zreda & Ferre (2010), Water Resources Research 46, W11505:
``vwc = rho_b * (A0 / (N/N0 - A1) - A2 - w)`` with the lattice and organic water ``w`` subtracted.

The universal transport solution of Köhli, Weimar, Schrön, Baatz & Schmidt (2021), Frontiers in Water 2:544847,
equation 15, is the rate as a function of soil moisture and of absolute air humidity. With all water of the soil
``w`` [m^3/m^3] at the density of the simulated soil, 1.43 g/cm^3, and the humidity ``h`` [g/m^3]::

    N/N_D = (p1 + p2 w)/(p1 + w) * (p0 + p6 h + p7 h^2) + exp(-p3 w) (p4 + p5 h)

``N_D`` is called N0 here: it is the one number to calibrate, and is not the N0 of another curve.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats

Array = NDArray[np.float64]
A0, A1, A2 = 0.0808, 0.372, 0.115
_NEAR_LIMIT = 1.1
PARTICLE_DENSITY_GCM3 = 2.65
"""Density of soil minerals, mostly quartz [g/cm^3] (Danielson & Sutherland 1986, Methods of Soil Analysis 1)."""
LATTICE_WATER_OF_CLAY = 0.097
"""Lattice water of clay [g/g]: regression of Kansas State University, as documented by crnpy."""
MATTER_OF_CARBON = 2.0  # organic matter per organic carbon [g/g] (Pribyl 2010, Geoderma 156:75-83)
WATER_OF_MATTER = 0.556
"""Water equivalent of organic matter with the hydrogen of cellulose, five H2O in C6H10O5 [g/g]."""
SIMULATED_DENSITY_GCM3 = 1.43
"""Dry bulk density of the soil in the simulations behind the universal solution [g/cm^3]."""
MAX_HUMIDITY_GM3 = 60.0  # absolute humidity up to which every parameter set falls with moisture [g/m^3]
_BY_KEYWORD = ("bound_water_sd", "n0_per_bound_water", "n0_per_density")
_MAX_STEPS = 60
_LAST_STEP = 1e-7  # relative size of a step after which the error is that of rounding: Newton's method squares it


class SoilLimits(NamedTuple):
    """Limits of the volumetric water content [m^3/m^3]."""

    dryness: float
    saturation: float


def soil_limits(bulk_density_gcm3: float) -> SoilLimits:
    """Limits of the water in the pores of a mineral soil, ``1 - rho_b / 2.65`` (Hillel 1998, Environmental Soil
    Physics).

    Lattice and organic water take no part of the pores: both belong to the solid matter.

    >>> soil_limits(1.325)
    SoilLimits(dryness=0.0, saturation=0.5)
    """
    return SoilLimits(0.0, max(1 - bulk_density_gcm3 / PARTICLE_DENSITY_GCM3, 0.0))


def lattice_water(clay: float) -> float:
    """Gravimetric lattice water of a clay content [g/g], where it was not measured."""
    return LATTICE_WATER_OF_CLAY * clay


def organic_water(organic_carbon: float) -> float:
    """Gravimetric water equivalent of the organic matter of an organic carbon content [g/g]."""
    return WATER_OF_MATTER * MATTER_OF_CARBON * organic_carbon


@dataclass(frozen=True)
class MoistureCurve(ABC):
    """The calibration of one sensor at one site: moisture as a decreasing function of the corrected rate.

    Rates are proportional to N0 at a given moisture. All methods take arrays of any shape.

    :param n0_cps: count rate over dry soil N0, all tubes, corrected [counts/s]
    :param bulk_density_gcm3: dry bulk density of the soil [g/cm^3]
    :param lattice_water: gravimetric lattice water [g/g]
    :param organic_water: gravimetric water equivalent of soil organic matter [g/g]
    :param n0_sd_cps: standard deviation of N0 [counts/s]; 0 if unknown
    :param bulk_density_sd_gcm3: standard deviation of the bulk density [g/cm^3]; 0 if unknown
    :param bound_water_sd: standard deviation of lattice and organic water together [g/g]; 0 if unknown
    :param n0_per_bound_water: d(log N0)/d(bound water) [1/(g/g)], ``n0_per_density`` d(log N0)/d(bulk density)
        [1/(g/cm^3)], of an N0 from cores, see :meth:`of_cores`; 0 for an N0 that does not depend on them
    :raises ValueError: if N0 or the bulk density is not positive and finite, or another value is negative
    """

    n0_cps: float
    bulk_density_gcm3: float
    lattice_water: float = 0.0
    organic_water: float = 0.0
    n0_sd_cps: float = 0.0
    bulk_density_sd_gcm3: float = 0.0
    bound_water_sd: float = field(default=0.0, kw_only=True)
    n0_per_bound_water: float = field(default=0.0, kw_only=True)
    n0_per_density: float = field(default=0.0, kw_only=True)
    name: ClassVar[str]
    """Name of the curve in files."""

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            positive = name in ("n0_cps", "bulk_density_gcm3")
            signed = name.startswith("n0_per_")
            inside = isinstance(value, str) or signed or (value > 0 if positive else value >= 0)
            if isinstance(value, str) or (np.isfinite(value) and inside):
                continue
            raise ValueError(f"{name} must be {'' if positive else 'zero or '}positive and finite, got {value}")

    @property
    def parameters(self) -> dict[str, str | float]:
        """Name and parameters of the curve, for files; without those by keyword where they are 0."""
        known = {"curve": self.name, **asdict(self)}
        return {name: value for name, value in known.items() if value != 0 or name not in _BY_KEYWORD}

    def of_cores(self, vwc: float, weight: float = 1.0, by_volume: float = 1.0) -> tuple[float, float]:
        """Dependence of N0 on the soil properties that it was found with: cores of a fixed moisture [m^3/m^3].

        More bound water makes N0 larger, so that the curve still meets the cores: at their moisture the two errors
        cancel. So do those of the density, but for cores by mass, whose moisture has the same density.

        :param weight: weight of the cores in log N0
        :param by_volume: share of the cores whose moisture does not depend on the density
        :returns: ``n0_per_bound_water`` and ``n0_per_density``
        """
        rate = float(self.rate_cps(vwc))
        per_vwc = -weight / (float(self.slope(rate)) * rate)
        per_density = -by_volume * per_vwc * vwc / self.bulk_density_gcm3
        return per_vwc * self.bulk_density_gcm3, per_density

    @property
    @abstractmethod
    def lowest(self) -> float:
        """Rate at or below which VWC is undefined, in units of N0 [-]."""

    @property
    def lowest_rate_cps(self) -> float:
        """Rate at or below which VWC is undefined [counts/s]."""
        return self.n0_cps * self.lowest

    def valid(self, rate_cps: ArrayLike) -> NDArray[np.bool_]:
        """Mask of rates [counts/s] that have a soil moisture: above :attr:`lowest_rate_cps`."""
        return floats(rate_cps) / self.n0_cps > self.lowest

    @abstractmethod
    def vwc(self, rate_cps: ArrayLike) -> Array:
        """Volumetric water content [m^3/m^3] of corrected rates [counts/s]; NaN where not :meth:`valid`.

        Values below 0 are not clipped, because they show that N0 or the water terms are wrong.
        """

    @abstractmethod
    def rate_cps(self, vwc: ArrayLike) -> Array:
        """Corrected rate [counts/s] of a volumetric water content [m^3/m^3]; the inverse of :meth:`vwc`.

        :raises ValueError: below the driest soil of the curve
        """

    @abstractmethod
    def slope(self, rate_cps: ArrayLike) -> Array:
        """d(vwc)/d(rate) [m^3/m^3 per count/s], negative; NaN where not :meth:`valid`."""

    @abstractmethod
    def vwc_and_sd(self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike) -> tuple[Array, Array]:
        """:meth:`vwc`, and its standard deviation by the third-order expansion of a Gaussian rate.

        The expansion of Jakobi et al. (2020), Frontiers in Water 2:10, is larger than the first order where the
        noise reaches the curve's steep end.
        """

    def weight(self, rate_cps: ArrayLike) -> Array:
        """Squared slope: factor from rate variance to VWC variance [(m^3/m^3 per count/s)^2], finite everywhere.

        The curve is so steep near its lowest rate that one place would dominate a plan. Rates there are raised to
        a tenth above the lowest.
        """
        return self.slope(np.maximum(floats(rate_cps), _NEAR_LIMIT * self.lowest_rate_cps)) ** 2


@dataclass(frozen=True)
class CalibrationCurve(MoistureCurve):
    """The curve of Desilets et al. (2010); parameters of :class:`MoistureCurve`."""

    name = "desilets"

    lowest = A1  # where the curve diverges

    def vwc(self, rate_cps: ArrayLike) -> Array:
        """Volumetric water content of corrected rates."""
        return self._vwc(self._excess(rate_cps))

    def rate_cps(self, vwc: ArrayLike) -> Array:
        """Corrected rate of a volumetric water content, where ``vwc / rho_b + A2 + w`` is positive."""
        gravimetric = floats(vwc) / self.bulk_density_gcm3
        total = gravimetric + A2 + self.lattice_water + self.organic_water
        if np.any(total <= 0):
            raise ValueError("soil moisture is below what the calibration curve can express")
        return np.asarray(self.n0_cps * (A0 / total + A1))

    def slope(self, rate_cps: ArrayLike) -> Array:
        """d(vwc)/d(rate), in closed form."""
        return -self.bulk_density_gcm3 * A0 / (self.n0_cps * self._excess(rate_cps) ** 2)

    def vwc_and_sd(self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike) -> tuple[Array, Array]:
        """VWC and its third-order standard deviation; in place, for large maps."""
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

    def _vwc(self, excess: Array) -> Array:
        vwc = np.asarray(A0 / excess)
        vwc -= A2 + self.lattice_water + self.organic_water
        vwc *= self.bulk_density_gcm3
        return vwc

    def _excess(self, rate_cps: ArrayLike) -> Array:
        excess = np.asarray(floats(rate_cps) / self.n0_cps)
        excess -= A1
        excess[~(excess > 0)] = np.nan
        return excess


class UniversalParameters(NamedTuple):
    """Parameters p0 to p7 of the universal transport solution; humidity in g/m^3, water in m^3/m^3."""

    p0: float
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    p6: float
    p7: float


PARAMETER_SETS = {
    "mcnp_drf": UniversalParameters(1.0940, 0.0280, 0.254, 3.537, 0.139, -0.00140, -0.0088, 0.000115),
    "mcnp_thl": UniversalParameters(1.2650, 0.0259, 0.135, 1.237, 0.063, -0.00021, -0.0117, 0.000120),
    "uranos_drf": UniversalParameters(1.0240, 0.0226, 0.207, 1.625, 0.235, -0.00290, -0.0093, 0.000074),
    "uranos_thl": UniversalParameters(1.2230, 0.0185, 0.142, 2.568, 0.155, -0.00047, -0.0119, 0.000092),
}
"""Parameter sets of Köhli et al. (2021): two transport codes, each with the response function of a moderated
detector (drf) and with energy thresholds (thl)."""


@dataclass(frozen=True)
class UniversalCurve(MoistureCurve):
    """The universal transport solution at one humidity; further parameters are those of :class:`MoistureCurve`.

    Counts at another humidity are corrected to this one by :meth:`humidity_response`. So corrected rate and curve
    belong together, and humidity is corrected once.

    :param humidity_gm3: absolute humidity to which the rates are corrected [g/m^3]
    :param parameter_set: name in :data:`PARAMETER_SETS`
    :raises ValueError: if a value is not finite or out of range, or the set is unknown
    """

    humidity_gm3: float = 0.0
    parameter_set: str = "mcnp_drf"
    name = "universal"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.humidity_gm3 > MAX_HUMIDITY_GM3:
            raise ValueError(f"humidity_gm3 must be at most {MAX_HUMIDITY_GM3:g}, got {self.humidity_gm3}")
        if self.parameter_set not in PARAMETER_SETS:
            raise ValueError(f"parameter_set must be one of {', '.join(PARAMETER_SETS)}")

    @property
    def lowest(self) -> float:
        """Rate over endless water, in units of N0 [-]."""
        return self._set.p2 * self._amplitude

    def vwc(self, rate_cps: ArrayLike) -> Array:
        """Volumetric water content of corrected rates."""
        return self._vwc(self._water(rate_cps))

    def rate_cps(self, vwc: ArrayLike) -> Array:
        """Corrected rate of a volumetric water content, where all water of the soil is above ``-p1``."""
        water = SIMULATED_DENSITY_GCM3 * (floats(vwc) / self.bulk_density_gcm3 + self._bound)
        if np.any(water <= -self._set.p1):
            raise ValueError("soil moisture is below what the calibration curve can express")
        return np.asarray(self.n0_cps * self._response(water, 0)[0])

    def slope(self, rate_cps: ArrayLike) -> Array:
        """d(vwc)/d(rate), by the derivative of the solution."""
        return self._scale / (self.n0_cps * self._response(self._water(rate_cps), 1)[1])

    def vwc_and_sd(self, rate_cps: ArrayLike, rate_sd_cps: ArrayLike) -> tuple[Array, Array]:
        """VWC and its third-order standard deviation.

        ``f'^2 s^2 + (f''^2/2 + f' f''') s^4 + 5/12 f'''^2 s^6`` with the derivatives of the inverse function.
        """
        water = self._water(rate_cps)
        _, d1, d2, d3 = self._response(water, 3)
        sd = floats(rate_sd_cps) / self.n0_cps
        first, second, third = 1 / d1, -d2 / d1**3, (3 * d2**2 - d1 * d3) / d1**5
        ratio = sd * sd
        variance = ratio * (first**2 + ratio * (second**2 / 2 + first * third + ratio * 5 / 12 * third**2))
        return self._vwc(water), np.asarray(self._scale * np.sqrt(variance))

    def humidity_response(self, vwc: float, humidity_gm3: float) -> float:
        """Rate at a moisture and a humidity [g/m^3], relative to the rate at the curve's humidity [-].

        ``f_humidity = 1 / humidity_response`` is evaluated at one typical moisture of the site, because a single
        record does not show its moisture. With the default set and 0.20 m^3/m^3 as typical, a moisture between
        0.05 and 0.40 m^3/m^3 is wrong by at most 0.003 m^3/m^3 (its rate by 0.2 %) at a humidity 5 g/m^3 from the
        reference, and by 0.006 m^3/m^3 (0.4 %) at 10 g/m^3.

        :raises ValueError: for a humidity beyond :data:`MAX_HUMIDITY_GM3`
        """
        return float(replace(self, humidity_gm3=humidity_gm3).rate_cps(vwc) / self.rate_cps(vwc))

    @property
    def _set(self) -> UniversalParameters:
        return PARAMETER_SETS[self.parameter_set]

    @property
    def _amplitude(self) -> float:
        h = self.humidity_gm3
        return self._set.p0 + self._set.p6 * h + self._set.p7 * h**2

    @property
    def _bound(self) -> float:
        return self.lattice_water + self.organic_water

    @property
    def _scale(self) -> float:
        return self.bulk_density_gcm3 / SIMULATED_DENSITY_GCM3

    def _vwc(self, water: Array) -> Array:
        return np.asarray(self._scale * water - self.bulk_density_gcm3 * self._bound)

    def _response(self, water: Array, order: int) -> list[Array]:
        """The relative rate and its derivatives with respect to the water up to an order."""
        p, amplitude = self._set, self._amplitude
        pole = p.p1 + water
        hyperbola = amplitude * p.p1 * (1 - p.p2) / pole
        remainder = (p.p4 + p.p5 * self.humidity_gm3) * np.exp(-p.p3 * water)
        terms = [np.asarray(amplitude * p.p2 + hyperbola + remainder)]
        for n in range(1, order + 1):
            hyperbola = -n * hyperbola / pole
            remainder = -p.p3 * remainder
            terms.append(np.asarray(hyperbola + remainder))
        return terms

    def _water(self, rate_cps: ArrayLike) -> Array:
        """All water of the soil at a rate; NaN where the rate has none.

        The solution falls and is convex in the water, and its hyperbola alone lies below it. So Newton's method
        that starts at the root of the hyperbola approaches the root from one side and cannot leave the range.
        """
        relative = np.where(self.valid(rate_cps), floats(rate_cps) / self.n0_cps, np.nan)
        p1 = self._set.p1
        water = np.asarray(p1 * (self._amplitude - relative) / (relative - self.lowest))
        for _ in range(_MAX_STEPS):
            value, slope = self._response(water, 1)
            step = np.asarray((relative - value) / slope)
            water = water + step
            if not np.any(step > _LAST_STEP * (p1 + water)):
                break
        return water
