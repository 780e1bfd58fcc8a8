# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts to samples, variogram and Poisson kriging: a map of rate and soil moisture with its uncertainty.

A :class:`FieldMap` takes records or samples and makes a :class:`SoilMap` of them; the others are its parts.
"""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.mapping.border_file import BorderSource as BorderSource
    from soilmoist_ros.mapping.covariate_files import RasterBands as RasterBands, opened_raster as opened_raster
    from soilmoist_ros.mapping.covariates import Covariates as Covariates, CovariateSource as CovariateSource, read_covariates as read_covariates, require_covariates as require_covariates
    from soilmoist_ros.mapping.drift import Change as Change, Changing as Changing, Drift as Drift, DriftModel as DriftModel, TimedSamples as TimedSamples
    from soilmoist_ros.mapping.field import Field as Field, FieldFile as FieldFile, Misplaced as Misplaced, load_field as load_field, require_no_go as require_no_go
    from soilmoist_ros.mapping.field_map import FieldMap as FieldMap, FieldMapSettings as FieldMapSettings, MapState as MapState, Snapshot as Snapshot, default_merge_radius_m as default_merge_radius_m
    from soilmoist_ros.mapping.grid import FieldGrid as FieldGrid
    from soilmoist_ros.mapping.knowledge import EarlierSurvey as EarlierSurvey, Knowledge as Knowledge, samples_at_end as samples_at_end
    from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging as PoissonKriging
    from soilmoist_ros.mapping.kriging.system import coincident as coincident, sample_correlation as sample_correlation
    from soilmoist_ros.mapping.map_worker import MapWorker as MapWorker, map_health as map_health
    from soilmoist_ros.mapping.mapping_settings import FIT_SETTINGS as FIT_SETTINGS, MappingSettings as MappingSettings
    from soilmoist_ros.mapping.placement import Placement as Placement, PositionSource as PositionSource, likely_cause as likely_cause, require_near as require_near
    from soilmoist_ros.mapping.records import Skip as Skip, SkippedRecords as SkippedRecords, StampLimits as StampLimits, survey_samples as survey_samples, without_verdict as without_verdict
    from soilmoist_ros.mapping.samples import Samples as Samples
    from soilmoist_ros.mapping.several_surveys import FieldChange as FieldChange, JointKriging as JointKriging, Persistence as Persistence, SurveysEstimate as SurveysEstimate, field_change as field_change, mean_places as mean_places, moisture_slope as moisture_slope
    from soilmoist_ros.mapping.soil_map import CELL as CELL, Bands as Bands, SoilMap as SoilMap, common_rate_sd as common_rate_sd, level_of as level_of, make_bands as make_bands, make_soil_map as make_soil_map, map_cells as map_cells, moisture_terms as moisture_terms, possible_moisture as possible_moisture
    from soilmoist_ros.mapping.variogram.field_prior import Effect as Effect
    from soilmoist_ros.mapping.variogram.farm_prior import FarmPrior as FarmPrior, FarmSurvey as FarmSurvey
    from soilmoist_ros.mapping.variogram.fit import FitMethod as FitMethod, NoiseModel as NoiseModel, VariogramFit as VariogramFit, estimate_variogram as estimate_variogram, fit_variogram as fit_variogram
    from soilmoist_ros.mapping.variogram.local_rate import LocalRate as LocalRate
    from soilmoist_ros.mapping.variogram.model import VARIOGRAM_MODELS as VARIOGRAM_MODELS, CorrelationModel as CorrelationModel, ModelName as ModelName, Variogram as Variogram, correlation_model as correlation_model
    from soilmoist_ros.mapping.variogram.reml import Prior as Prior
    from soilmoist_ros.mapping.variogram.semivariogram import default_edges as default_edges, empirical_semivariogram as empirical_semivariogram
    from soilmoist_ros.mapping.variogram.support import Supports as Supports
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "border_file": "BorderSource",
        "covariate_files": "RasterBands opened_raster",
        "covariates": "CovariateSource Covariates read_covariates require_covariates",
        "drift": "Change Changing Drift DriftModel TimedSamples",
        "field": "Field FieldFile Misplaced load_field require_no_go",
        "field_map": "FieldMap FieldMapSettings MapState Snapshot default_merge_radius_m",
        "grid": "FieldGrid",
        "knowledge": "EarlierSurvey Knowledge samples_at_end",
        "kriging.poisson_kriging": "PoissonKriging",
        "kriging.system": "coincident sample_correlation",
        "map_worker": "MapWorker map_health",
        "mapping_settings": "FIT_SETTINGS MappingSettings",
        "placement": "Placement PositionSource likely_cause require_near",
        "records": "Skip SkippedRecords StampLimits survey_samples without_verdict",
        "samples": "Samples",
        "several_surveys": "FieldChange JointKriging Persistence SurveysEstimate field_change mean_places moisture_slope",
        "soil_map": "Bands CELL SoilMap common_rate_sd level_of make_bands make_soil_map map_cells moisture_terms possible_moisture",
        "variogram.field_prior": "Effect",
        "variogram.farm_prior": "FarmPrior FarmSurvey",
        "variogram.fit": "FitMethod NoiseModel VariogramFit estimate_variogram fit_variogram",
        "variogram.local_rate": "LocalRate",
        "variogram.model": "CorrelationModel ModelName VARIOGRAM_MODELS Variogram correlation_model",
        "variogram.reml": "Prior",
        "variogram.semivariogram": "default_edges empirical_semivariogram",
        "variogram.support": "Supports",
    },
)
