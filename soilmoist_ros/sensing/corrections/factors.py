# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Correction of neutron counts for air pressure, humidity and incoming cosmic-ray intensity.

The counts stay unchanged: the *exposure* is divided by the product of the factors
(:func:`effective_exposure`), so the counts remain Poisson.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


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
    :raises ValueError: if a parameter is not finite or out of range
    """

    beta_per_hpa: float = 0.0077
    reference_pressure_hpa: float = 1013.25
    humidity_coefficient_m3g: float = 0.0054
    reference_humidity_gm3: float = 0.0
    reference_intensity: float | None = None
    intensity_scale: float = 1.0
    humidity_response: Callable[[float], float] | None = None
    f_surroundings: float = 1.0

    def __post_init__(self) -> None:
        _require_positive("beta_per_hpa", self.beta_per_hpa)
        _require_positive("f_surroundings", self.f_surroundings)
        _require_positive("reference_pressure_hpa", self.reference_pressure_hpa)
        for name in ("humidity_coefficient_m3g", "reference_humidity_gm3"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} must be zero or positive and finite, got {getattr(self, name)}")
        if self.reference_intensity is not None:
            _require_positive("reference_intensity", self.reference_intensity)
        _require_positive("intensity_scale", self.intensity_scale)

    def f_pressure(self, pressure_hpa: float) -> float:
        """``exp(beta (P - P0))`` [-]."""
        _require_positive("pressure_hpa", pressure_hpa)
        return math.exp(self.beta_per_hpa * (pressure_hpa - self.reference_pressure_hpa))

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

    :param temperature_degc: air temperature [degC], above absolute zero and not near -240.97
    :param relative_humidity: relative humidity [0..1]
    :raises ValueError: if either is not finite or out of range
    """
    if not (math.isfinite(temperature_degc) and -150 < temperature_degc < 150):
        raise ValueError(f"temperature_degc must be within -150..150 degC, got {temperature_degc}")
    if not 0 <= relative_humidity <= 1:
        raise ValueError(f"relative_humidity must be within 0..1, got {relative_humidity}")
    saturation_pa = 611.0 * math.exp(17.502 * temperature_degc / (temperature_degc + 240.97))
    return 2.16679 * relative_humidity * saturation_pa / (temperature_degc + 273.15)


def effective_exposure(exposure_s: float, factor: float) -> float:
    """Exposure that makes raw counts Poisson with the *corrected* rate [s].

    ``raw ~ Poisson(rate * exposure_s / factor)``, so ``raw / effective_exposure`` estimates the
    corrected rate with the original counting statistics.

    :param exposure_s: live time of the record [s], > 0
    :param factor: product of the correction factors [-], > 0
    :raises ValueError: if either is not positive and finite
    """
    _require_positive("exposure_s", exposure_s)
    _require_positive("factor", factor)
    return exposure_s / factor


def _require_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be positive and finite, got {value}")
