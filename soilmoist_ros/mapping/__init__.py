# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts to samples, variogram and Poisson kriging: a map of rate and soil moisture with its uncertainty.

A :class:`FieldMap` takes records or samples and makes a :class:`SoilMap` of them; the others are its parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.mapping.field import Field, load_field
    from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
    from soilmoist_ros.mapping.grid import FieldGrid
    from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
    from soilmoist_ros.mapping.samples.samples import Samples
    from soilmoist_ros.mapping.soil_map import SoilMap, make_soil_map
    from soilmoist_ros.mapping.variogram.fit import fit_variogram
    from soilmoist_ros.mapping.variogram.model import Variogram
    from soilmoist_ros.mapping.variogram.semivariogram import empirical_semivariogram

__all__ = [
    "Field",
    "FieldGrid",
    "FieldMap",
    "FieldMapSettings",
    "PoissonKriging",
    "Samples",
    "SoilMap",
    "Variogram",
    "empirical_semivariogram",
    "fit_variogram",
    "load_field",
    "make_soil_map",
]

__getattr__ = load_on_use(__name__, __file__)
