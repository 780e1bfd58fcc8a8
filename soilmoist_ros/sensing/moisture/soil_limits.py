# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The least and the most water that a soil can hold."""

from __future__ import annotations

from typing import NamedTuple

PARTICLE_DENSITY_GCM3 = 2.65
"""Density of soil minerals, mostly quartz [g/cm^3] (Danielson & Sutherland 1986, Methods of Soil Analysis 1)."""


class SoilLimits(NamedTuple):
    """Limits of the volumetric water content [m^3/m^3]."""

    dryness: float
    saturation: float


def soil_limits(bulk_density_gcm3: float) -> SoilLimits:
    """Limits of the water in the pores of a mineral soil.

    Saturated soil has all its pores full of water; the pores are ``1 - rho_b / 2.65`` of its volume (Hillel 1998,
    Environmental Soil Physics, chapter 2). Lattice and organic water take no part of the pores: a moisture curve
    subtracts both, and both belong to the solid matter.

    >>> soil_limits(1.325)
    SoilLimits(dryness=0.0, saturation=0.5)

    :param bulk_density_gcm3: dry bulk density [g/cm^3], > 0
    """
    return SoilLimits(0.0, max(1 - bulk_density_gcm3 / PARTICLE_DENSITY_GCM3, 0.0))
