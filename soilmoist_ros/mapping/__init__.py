"""Counts to samples, variogram and Poisson kriging: a map of rate and soil moisture with its uncertainty.

A :class:`FieldMap` takes records or samples and makes a :class:`SoilMap` of them; the others are its parts.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

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

_MODULES = {
    "Field": "field",
    "FieldGrid": "grid",
    "FieldMap": "field_map",
    "FieldMapSettings": "field_map",
    "PoissonKriging": "kriging.poisson_kriging",
    "Samples": "samples.samples",
    "SoilMap": "soil_map",
    "Variogram": "variogram.model",
    "empirical_semivariogram": "variogram.semivariogram",
    "fit_variogram": "variogram.fit",
    "load_field": "field",
    "make_soil_map": "soil_map",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
