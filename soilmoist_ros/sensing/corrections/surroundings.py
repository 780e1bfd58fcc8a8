# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Constant factors of a site: plants around the probe, and the road that it drives on."""

from __future__ import annotations

import math

DRY_BIOMASS_SHARE_M2KG = 0.009
"""Share of the counts that 1 kg/m^2 of dry biomass takes (Baatz et al. 2015, abstract)."""
BIOMASS_WATER_SHARE_M2KG = 6.4 / 1210
"""Share of the counts that 1 kg/m^2 of biomass water equivalent takes: r2 / N0 of Baatz et al. (2015)."""
CELLULOSE_WATER = 0.494
"""Water equivalent of dry biomass [kg/kg] (Wahbi & Avery 2018, In situ destructive sampling, Springer)."""


def biomass_water_kgm2(fresh_kgm2: float, dry_kgm2: float) -> float:
    """Biomass water equivalent: the water of the plants, and that of their cellulose [kg/m^2].

    :param fresh_kgm2: fresh biomass above the ground [kg/m^2]
    :param dry_kgm2: dry biomass above the ground [kg/m^2]
    """
    return fresh_kgm2 - dry_kgm2 + CELLULOSE_WATER * dry_kgm2


def f_biomass(biomass_kgm2: float, share_m2kg: float) -> float:
    """Factor ``1 / (1 - share * biomass)`` [-] (Baatz et al. 2015, Water Resources Research 51:2030-2046).

    :param biomass_kgm2: dry biomass or biomass water equivalent [kg/m^2], >= 0
    :param share_m2kg: share of the counts that 1 kg/m^2 takes, the one of this kind of biomass [m^2/kg]
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
