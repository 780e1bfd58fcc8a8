# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pressure and depth of the air above a place, and the barometric coefficient of the neutrons there."""

from __future__ import annotations

import math

SEA_LEVEL_HPA = 1013.25


def gravity_ms2(latitude_deg: float, altitude_m: float) -> float:
    """Acceleration of gravity on land [m/s^2]: the 1967 formula with free-air and Bouguer terms.

    McJannet & Desilets (2023, Water Resources Research 59:e2022WR033889) use it, with rock of 2670 kg/m^3.
    """
    latitude = math.radians(latitude_deg)
    sea_level = 9.780327 * (1 + 0.0053024 * math.sin(latitude) ** 2 - 0.0000058 * math.sin(2 * latitude) ** 2)
    return sea_level + (-3.086e-6 + 4.193e-10 * 2670) * altitude_m


def standard_pressure_hpa(latitude_deg: float, altitude_m: float) -> float:
    """Mean air pressure [hPa] of the US Standard Atmosphere 1976 under the gravity of the place.

    :param latitude_deg: latitude [deg]
    :param altitude_m: altitude above mean sea level, -500 to 9000 [m]
    :raises ValueError: if a value is out of range
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
