"""Counts -> samples -> variogram -> Poisson kriging -> a map of rate and soil moisture with its uncertainty."""

from soilmoist_ros.mapping.grid import FieldGrid, default_cell_m
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.samples import Samples, merge_records
from soilmoist_ros.mapping.soil_map import Bands, SoilMap, make_soil_map
from soilmoist_ros.mapping.variogram.fit import VariogramFit, estimate_variogram, fit_variogram
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.mapping.variogram.semivariogram import default_edges, empirical_semivariogram

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
