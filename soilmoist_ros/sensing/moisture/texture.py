# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil by its USDA texture class: density, clay, wilting point and field capacity, each with its range.

Densities, wilting points (1500 kPa) and field capacities (33 kPa) are those of Saxton & Rawls (2006), Soil Science
Society of America Journal 70:1569-1578, table 3: soil of the middle of the class with 2.5 % of organic matter. A
class is a range, and so is each value. Its standard deviation has two parts: the standard error of the regression
(their table 1: 0.02, 0.05 and 0.04 m^3/m^3 for wilting point, field capacity and pores), and the range of clay in
the class, taken as uniform. These are default ranges, not measurements of a field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

TextureName = Literal[
    "sand", "loamy sand", "sandy loam", "loam", "silt loam", "silt", "sandy clay loam", "clay loam",
    "silty clay loam", "silty clay", "sandy clay", "clay",
]  # fmt: skip
"""Names of the USDA texture classes."""
_WILTING_ERROR, _CAPACITY_ERROR, _PORES_ERROR = 0.02, 0.05, 0.04  # table 1 of Saxton & Rawls [m^3/m^3]
_WATER_OF_CLAY = 0.6  # moisture at both limits per clay, from the middles of the classes [m^3/m^3 per g/g]
_TILLAGE_GCM3 = 0.1  # spread of the bulk density by tillage and traffic [g/cm^3]


@dataclass(frozen=True)
class SoilTexture:
    """Properties of a texture class; each ``_sd`` is the standard deviation of the value before it.

    :param sand: sand in the middle of the class [g/g]
    :param clay: clay in the middle of the class [g/g]
    :param clay_range: lower and upper limit of the clay in the class [g/g]
    :param wilting_point: moisture at 1500 kPa [m^3/m^3]
    :param field_capacity: moisture at 33 kPa [m^3/m^3]
    :param bulk_density_gcm3: dry bulk density [g/cm^3]
    """

    sand: float
    clay: float
    clay_range: tuple[float, float]
    wilting_point: float
    field_capacity: float
    bulk_density_gcm3: float

    @property
    def clay_sd(self) -> float:
        """Standard deviation of the clay in the class [g/g]."""
        return (self.clay_range[1] - self.clay_range[0]) / math.sqrt(12)

    @property
    def wilting_point_sd(self) -> float:
        """Standard deviation of the wilting point [m^3/m^3]."""
        return math.hypot(_WILTING_ERROR, _WATER_OF_CLAY * self.clay_sd)

    @property
    def field_capacity_sd(self) -> float:
        """Standard deviation of the field capacity [m^3/m^3]."""
        return math.hypot(_CAPACITY_ERROR, _WATER_OF_CLAY * self.clay_sd)

    @property
    def bulk_density_sd_gcm3(self) -> float:
        """Standard deviation of the bulk density [g/cm^3]."""
        return math.hypot(2.65 * _PORES_ERROR, _TILLAGE_GCM3)


TEXTURES: dict[TextureName, SoilTexture] = {
    "sand": SoilTexture(0.88, 0.05, (0.0, 0.10), 0.05, 0.10, 1.43),
    "loamy sand": SoilTexture(0.80, 0.05, (0.0, 0.15), 0.05, 0.12, 1.43),
    "sandy loam": SoilTexture(0.65, 0.10, (0.0, 0.20), 0.08, 0.18, 1.46),
    "loam": SoilTexture(0.40, 0.20, (0.07, 0.27), 0.14, 0.28, 1.43),
    "silt loam": SoilTexture(0.20, 0.15, (0.0, 0.27), 0.11, 0.31, 1.38),
    "silt": SoilTexture(0.10, 0.05, (0.0, 0.12), 0.06, 0.30, 1.38),
    "sandy clay loam": SoilTexture(0.60, 0.25, (0.20, 0.35), 0.17, 0.27, 1.50),
    "clay loam": SoilTexture(0.30, 0.35, (0.27, 0.40), 0.22, 0.36, 1.39),
    "silty clay loam": SoilTexture(0.10, 0.35, (0.27, 0.40), 0.22, 0.38, 1.30),
    "silty clay": SoilTexture(0.10, 0.45, (0.40, 0.60), 0.27, 0.41, 1.26),
    "sandy clay": SoilTexture(0.50, 0.40, (0.35, 0.55), 0.25, 0.36, 1.47),
    "clay": SoilTexture(0.25, 0.50, (0.40, 0.80), 0.30, 0.42, 1.33),
}
"""Texture classes by their names."""
