"""Counts -> samples -> variogram -> Poisson kriging -> a map of rate and soil moisture with its uncertainty."""

from soilmoist_ros.mapping.field_grid import FieldGrid, default_cell_m
from soilmoist_ros.mapping.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples import Samples, merge_records
from soilmoist_ros.mapping.soil_map import Bands, SoilMap, make_soil_map
from soilmoist_ros.mapping.variogram import Variogram, default_edges, empirical_semivariogram
from soilmoist_ros.mapping.variogram_fit import VariogramFit, estimate_variogram, fit_variogram

__all__ = [
    "Bands",
    "FieldGrid",
    "PoissonKriging",
    "Samples",
    "SoilMap",
    "Variogram",
    "VariogramFit",
    "default_cell_m",
    "default_edges",
    "empirical_semivariogram",
    "estimate_variogram",
    "fit_variogram",
    "make_soil_map",
    "merge_records",
]
