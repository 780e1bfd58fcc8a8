# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Factors of neutron counts: air pressure, humidity, incoming intensity, plants and road; the standard atmosphere.

The counts stay unchanged: the *exposure* is divided by the product of the factors
(:func:`effective_exposure`), so the counts remain Poisson.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SEA_LEVEL_HPA = 1013.25
DRY_BIOMASS_SHARE_M2KG = 0.009
"""Share of the counts that 1 kg/m^2 of dry biomass takes (Baatz et al. 2015, abstract)."""
BIOMASS_WATER_SHARE_M2KG = 6.4 / 1210
"""Share of the counts that 1 kg/m^2 of biomass water equivalent takes: r2 / N0 of Baatz et al. (2015)."""


@dataclass(frozen=True)
class Corrections:
    """Parameters of the three corrections.

    :param beta_per_hpa: barometric coefficient [1/hPa], > 0; site dependent, 1/130 g cm^-2 by default
        (Desilets & Zreda 2003, Earth and Planetary Science Letters 206:21-42)
    :param reference_pressure_hpa: pressure at which the pressure factor is 1 [hPa]
    :param humidity_coefficient_m3g: 0.0054 m^3/g (Rosolem et al. 2013, Journal of Hydrometeorology 14:1659-1671)
    :param reference_humidity_gm3: absolute humidity at which the humidity factor is 1 [g/m^3]
    :param reference_intensity: neutron-monitor rate at which the intensity factor is 1 (any unit), ``None``
        for no correction
    :param intensity_scale: relative change of the intensity at the site for a relative change of 1 at the monitor,
        k [-]; see :func:`soilmoist_ros.sensing.corrections.intensity.intensity_scale`
    :param humidity_response: rate at an absolute humidity [g/m^3] over the rate at the reference humidity [-],
        from a curve that knows the humidity; ``None`` for the linear factor
    :param f_surroundings: constant factor of the site, such as plants and road [-]
    """

    beta_per_hpa: float = 0.0077
    reference_pressure_hpa: float = 1013.25
    humidity_coefficient_m3g: float = 0.0054
    reference_humidity_gm3: float = 0.0
    reference_intensity: float | None = None
    intensity_scale: float = 1.0
    humidity_response: Callable[[float], float] | None = None
    f_surroundings: float = 1.0

    def f_pressure(self, pressure_hpa: float) -> float:
        """``exp(beta (P - P0))`` [-]."""
        _require_positive("pressure_hpa", pressure_hpa)
        return math.exp(self.beta_per_hpa * (pressure_hpa - self.reference_pressure_hpa))

    def pressure_hpa(self, f_pressure: float) -> float:
        """Air pressure of a factor [hPa]."""
        return self.reference_pressure_hpa + math.log(f_pressure) / self.beta_per_hpa

    def f_humidity(self, temperature_degc: float, relative_humidity: float) -> float:
        """``1 + c (Q - Q0)`` with the absolute humidity Q of the air, or one over the response to Q [-]."""
        humidity = absolute_humidity_gm3(temperature_degc, relative_humidity)
        if self.humidity_response is not None:
            return 1 / self.humidity_response(humidity)
        factor = 1 + self.humidity_coefficient_m3g * (humidity - self.reference_humidity_gm3)
        if factor <= 0:
            raise ValueError(f"the humidity factor is {factor:.3g}: reference_humidity_gm3 is far too high")
        return factor

    def humidity_gm3(self, f_humidity: float) -> float:
        """Absolute humidity of a factor [g/m^3]; the reference humidity without a correction.

        A response of a curve is inverted between 0 and 35 g/m^3, where each of them falls.
        """
        if self.humidity_response is not None:
            humidity = np.linspace(0.0, 35.0, 141)
            return float(np.interp(f_humidity, [1 / self.humidity_response(float(h)) for h in humidity], humidity))
        if self.humidity_coefficient_m3g == 0:
            return self.reference_humidity_gm3
        return self.reference_humidity_gm3 + (f_humidity - 1) / self.humidity_coefficient_m3g

    def f_intensity(self, intensity: float) -> float:
        """``1 / (1 + k (C / C0 - 1))`` [-], for k = 1 ``C0 / C``; 1 if no reference intensity is set."""
        if self.reference_intensity is None:
            return 1.0
        _require_positive("intensity", intensity)
        if self.intensity_scale == 1.0:
            return self.reference_intensity / intensity
        at_site = 1 + self.intensity_scale * (intensity / self.reference_intensity - 1)
        if at_site <= 0:
            raise ValueError(f"an intensity of {intensity:g} is far too low for the reference")
        return 1 / at_site


def absolute_humidity_gm3(temperature_degc: float, relative_humidity: float) -> float:
    """Water vapour in the air [g/m^3] (Campbell & Norman 1998, An Introduction to Environmental Biophysics).

    :raises ValueError: if the temperature [degC] or the relative humidity [0..1] is not finite or out of range
    """
    if not (math.isfinite(temperature_degc) and -150 < temperature_degc < 150):
        raise ValueError(f"temperature_degc must be within -150..150 degC, got {temperature_degc}")
    if not 0 <= relative_humidity <= 1:
        raise ValueError(f"relative_humidity must be within 0..1, got {relative_humidity}")
    saturation_pa = 611.0 * math.exp(17.502 * temperature_degc / (temperature_degc + 240.97))
    return 2.16679 * relative_humidity * saturation_pa / (temperature_degc + 273.15)


def effective_exposure(exposure_s: float, factor: float) -> float:
    """Exposure that makes raw counts Poisson with the *corrected* rate [s].

    ``raw ~ Poisson(rate * exposure_s / factor)``, so ``raw / effective_exposure`` estimates the corrected rate
    with the original counting statistics.

    :raises ValueError: if either is not positive and finite
    """
    _require_positive("exposure_s", exposure_s)
    _require_positive("factor", factor)
    return exposure_s / factor


def _require_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be positive and finite, got {value}")


# Pressure and depth of the air above a place, and the barometric coefficient of the neutrons there --------------


def gravity_ms2(latitude_deg: float, altitude_m: float) -> float:
    """Acceleration of gravity on land [m/s^2]: the 1967 formula with free-air and Bouguer terms.

    McJannet & Desilets (2023, Water Resources Research 59:e2022WR033889) use it, with rock of 2670 kg/m^3.
    """
    latitude = math.radians(latitude_deg)
    sea_level = 9.780327 * (1 + 0.0053024 * math.sin(latitude) ** 2 - 0.0000058 * math.sin(2 * latitude) ** 2)
    return sea_level + (-3.086e-6 + 4.193e-10 * 2670) * altitude_m


def standard_pressure_hpa(latitude_deg: float, altitude_m: float) -> float:
    """Mean air pressure [hPa] of the US Standard Atmosphere 1976 under the gravity of the place.

    :raises ValueError: if the latitude is out of range, or the altitude not within -500 to 9000 m
    """
    if not (abs(latitude_deg) <= 90 and -500 <= altitude_m <= 9000):
        raise ValueError(f"there is no place at latitude {latitude_deg:g} and altitude {altitude_m:g} m")
    exponent = gravity_ms2(latitude_deg, altitude_m) * 0.0289644 / (8.31432 * 0.0065)
    return float(SEA_LEVEL_HPA * (1 - 0.0065 / 288.15 * altitude_m) ** exponent)


def atmospheric_depth_gcm2(latitude_deg: float, altitude_m: float) -> float:
    """Mass of the air above a place [g/cm^2]: standard pressure divided by gravity.

    >>> round(atmospheric_depth_gcm2(46.55, 3570.0), 1)  # Jungfraujoch
    665.2
    """
    return 10 * standard_pressure_hpa(latitude_deg, altitude_m) / gravity_ms2(latitude_deg, altitude_m)


def barometric_coefficient(depth_gcm2: float, cutoff_rigidity_gv: float) -> float:
    """Barometric coefficient beta of a cosmic-ray neutron sensor [1/hPa].

    Desilets (2021, Hydroinnova Technical Document 21-01, doi:10.5281/zenodo.4569062). The source gives beta per
    g/cm^2. As in other software for such sensors, it is used per hPa, which is 2 % less mass.

    >>> round(1 / barometric_coefficient(1033.0, 3.0))
    137

    :param depth_gcm2: atmospheric depth [g/cm^2], above 400
    :param cutoff_rigidity_gv: vertical cutoff rigidity [GV], 0 to 20
    :raises ValueError: if a value is out of range
    """
    if not (400 <= depth_gcm2 <= 1100 and 0 <= cutoff_rigidity_gv <= 20):
        raise ValueError(
            f"there is no barometric coefficient for {depth_gcm2:g} g/cm2 and {cutoff_rigidity_gv:g} GV"
        )
    rigidity = cutoff_rigidity_gv
    return (
        0.01231386 / (1 + math.exp(-0.0554611 * rigidity**0.6012159))
        + (4.74235e-06 - 9.66624e-07 * rigidity + 1.42783e-09 * rigidity**2) * depth_gcm2
        + (-3.70478e-09 + 1.27739e-09 * rigidity + 3.58814e-11 * rigidity**2) * depth_gcm2**2
        + (-3.146e-15 - 3.5528e-13 * rigidity - 4.29191e-14 * rigidity**2) * depth_gcm2**3
    )


# Constant factors of a site: plants around the probe, and the road that it drives on ----------------------------


def f_biomass(biomass_kgm2: float, share_m2kg: float) -> float:
    """Factor ``1 / (1 - share * biomass)`` [-] (Baatz et al. 2015, Water Resources Research 51:2030-2046).

    :param biomass_kgm2: dry biomass or biomass water equivalent [kg/m^2], >= 0
    :param share_m2kg: share of the counts that 1 kg/m^2 of it takes [m^2/kg]
    :raises ValueError: if the biomass would take half of the counts or more, far beyond the measurements
    """
    if not 0 <= share_m2kg * biomass_kgm2 < 0.5:
        raise ValueError(f"biomass must be 0 to {0.5 / share_m2kg:.0f} kg/m2, got {biomass_kgm2:g}")
    return 1 / (1 - share_m2kg * biomass_kgm2)


def f_road(width_m: float, road_vwc: float, field_vwc: float, distance_m: float = 0.0) -> float:
    """Factor ``1 / (1 + F1 F2 F3)`` [-] (Schrön et al. 2018, Water Resources Research 54:6441-6459).

    F1 (width), F2 (moisture from counts, equation 6) and F3 (distance) have the parameters of table 1. They were
    found with an unshielded rover.

    :param width_m: width of the road [m], >= 0
    :param road_vwc: moisture of the road: 0.07 for asphalt, 0.12 for gravel, say [m^3/m^3]
    :param field_vwc: typical moisture of the field as the uncorrected counts show it [m^3/m^3]
    :param distance_m: distance of the probe from the middle of the road [m]
    """
    if width_m == 0:
        return 1.0
    geometry = 0.42 * (1 - math.exp(-0.5 * width_m))
    moisture = 1.06 - 4 * road_vwc - (0.16 + road_vwc) / (0.39 + field_vwc)
    near = 0.94 * math.exp(-1.10 * width_m**-2.70 * distance_m**4)
    return 1 / (1 + geometry * moisture * (near + 0.06 * math.exp(-0.01 * distance_m)))
