# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Hydrogen in the soil that is not moisture, from clay and organic carbon, where it was not measured."""

from __future__ import annotations

LATTICE_WATER_OF_CLAY = 0.097
"""Lattice water of clay [g/g]: regression of Kansas State University, as documented by crnpy."""
MATTER_OF_CARBON = 2.0
"""Organic matter per organic carbon [g/g] (Pribyl 2010, Geoderma 156:75-83)."""
WATER_OF_MATTER = 0.556
"""Water equivalent of organic matter with the hydrogen of cellulose, five H2O in C6H10O5 [g/g]."""


def lattice_water(clay: float) -> float:
    """Gravimetric lattice water [g/g].

    :param clay: clay content of the dry soil [g/g]
    """
    return LATTICE_WATER_OF_CLAY * clay


def organic_water(organic_carbon: float) -> float:
    """Gravimetric water equivalent of organic matter [g/g].

    :param organic_carbon: organic carbon of the dry soil [g/g]
    """
    return WATER_OF_MATTER * MATTER_OF_CARBON * organic_carbon
