# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts to samples, variogram and Poisson kriging: a map of rate and soil moisture with its uncertainty.

A :class:`FieldMap` takes records or samples and makes a :class:`SoilMap` of them; the others are its parts.
"""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.mapping.border_file import BorderSource as BorderSource
    from soilmoist_ros.mapping.border_file import read_border as read_border
    from soilmoist_ros.mapping.cells import BANDS as BANDS
    from soilmoist_ros.mapping.cells import CELL as CELL
    from soilmoist_ros.mapping.cells import map_cells as map_cells
    from soilmoist_ros.mapping.cells import placed_cells as placed_cells
    from soilmoist_ros.mapping.covariates.rasters import RasterBands as RasterBands
    from soilmoist_ros.mapping.covariates.rasters import opened_raster as opened_raster
    from soilmoist_ros.mapping.covariates.reading import coverage as coverage
    from soilmoist_ros.mapping.covariates.reading import read_covariates as read_covariates
    from soilmoist_ros.mapping.covariates.reading import require_covariates as require_covariates
    from soilmoist_ros.mapping.covariates.reading import unused_parts as unused_parts
    from soilmoist_ros.mapping.covariates.source import CovariateSource as CovariateSource
    from soilmoist_ros.mapping.expected_counts import UNEXPECTED as UNEXPECTED
    from soilmoist_ros.mapping.expected_counts import without_verdict as without_verdict
    from soilmoist_ros.mapping.field import MIN_AREA_M2 as MIN_AREA_M2
    from soilmoist_ros.mapping.field import Field as Field
    from soilmoist_ros.mapping.field import FieldFile as FieldFile
    from soilmoist_ros.mapping.field import Misplaced as Misplaced
    from soilmoist_ros.mapping.field import load_field as load_field
    from soilmoist_ros.mapping.field import misplaced as misplaced
    from soilmoist_ros.mapping.field import require_no_go as require_no_go
    from soilmoist_ros.mapping.field_map import FieldMap as FieldMap
    from soilmoist_ros.mapping.field_map import FieldMapSettings as FieldMapSettings
    from soilmoist_ros.mapping.field_map import MapState as MapState
    from soilmoist_ros.mapping.field_map import SkippedRecords as SkippedRecords
    from soilmoist_ros.mapping.field_map import Snapshot as Snapshot
    from soilmoist_ros.mapping.field_map import default_merge_radius_m as default_merge_radius_m
    from soilmoist_ros.mapping.field_map import drifting as drifting
    from soilmoist_ros.mapping.grid import FieldGrid as FieldGrid
    from soilmoist_ros.mapping.health import MAP_PART as MAP_PART
    from soilmoist_ros.mapping.health import RAIN as RAIN
    from soilmoist_ros.mapping.health import map_health as map_health
    from soilmoist_ros.mapping.knowledge.change import FALSE_SHARE as FALSE_SHARE
    from soilmoist_ros.mapping.knowledge.change import Estimate as Estimate
    from soilmoist_ros.mapping.knowledge.change import FieldChange as FieldChange
    from soilmoist_ros.mapping.knowledge.change import field_change as field_change
    from soilmoist_ros.mapping.knowledge.change import mean_places as mean_places
    from soilmoist_ros.mapping.knowledge.change import mean_variance_of as mean_variance_of
    from soilmoist_ros.mapping.knowledge.change import moisture_slope as moisture_slope
    from soilmoist_ros.mapping.knowledge.covariates import Covariates as Covariates
    from soilmoist_ros.mapping.knowledge.covariates import joined as joined
    from soilmoist_ros.mapping.knowledge.drift import Change as Change
    from soilmoist_ros.mapping.knowledge.drift import Changing as Changing
    from soilmoist_ros.mapping.knowledge.drift import Drift as Drift
    from soilmoist_ros.mapping.knowledge.drift import DriftModel as DriftModel
    from soilmoist_ros.mapping.knowledge.drift import TimedSamples as TimedSamples
    from soilmoist_ros.mapping.knowledge.earlier import EarlierSurvey as EarlierSurvey
    from soilmoist_ros.mapping.knowledge.earlier import samples_at_end as samples_at_end
    from soilmoist_ros.mapping.knowledge.joint_kriging import JointKriging as JointKriging
    from soilmoist_ros.mapping.knowledge.joint_kriging import Persistence as Persistence
    from soilmoist_ros.mapping.knowledge.joint_kriging import estimate_persistence as estimate_persistence
    from soilmoist_ros.mapping.knowledge.knowledge import NOTHING as NOTHING
    from soilmoist_ros.mapping.knowledge.knowledge import Knowledge as Knowledge
    from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging as PoissonKriging
    from soilmoist_ros.mapping.kriging.targets import Points as Points
    from soilmoist_ros.mapping.kriging.targets import coincident as coincident
    from soilmoist_ros.mapping.kriging.targets import sample_correlation as sample_correlation
    from soilmoist_ros.mapping.kriging.tiled_kriging import Compute as Compute
    from soilmoist_ros.mapping.map_worker import MapWorker as MapWorker
    from soilmoist_ros.mapping.mapping_settings import MappingSettings as MappingSettings
    from soilmoist_ros.mapping.moisture_bands import QUANTILE_SD as QUANTILE_SD
    from soilmoist_ros.mapping.moisture_bands import Bands as Bands
    from soilmoist_ros.mapping.moisture_bands import common_rate_sd as common_rate_sd
    from soilmoist_ros.mapping.moisture_bands import make_bands as make_bands
    from soilmoist_ros.mapping.moisture_bands import moisture_terms as moisture_terms
    from soilmoist_ros.mapping.moisture_bands import possible_moisture as possible_moisture
    from soilmoist_ros.mapping.placement import PositionSource as PositionSource
    from soilmoist_ros.mapping.placement import require_near as require_near
    from soilmoist_ros.mapping.record_check import Skip as Skip
    from soilmoist_ros.mapping.record_check import StampLimits as StampLimits
    from soilmoist_ros.mapping.samples.merging import survey_samples as survey_samples
    from soilmoist_ros.mapping.samples.samples import NO_SAMPLES as NO_SAMPLES
    from soilmoist_ros.mapping.samples.samples import Samples as Samples
    from soilmoist_ros.mapping.samples.samples import as_samples as as_samples
    from soilmoist_ros.mapping.samples.samples import merge_exactly as merge_exactly
    from soilmoist_ros.mapping.samples.spread import footprint_spread as footprint_spread
    from soilmoist_ros.mapping.soil_map import MAX_EXACT_SAMPLES as MAX_EXACT_SAMPLES
    from soilmoist_ros.mapping.soil_map import SoilMap as SoilMap
    from soilmoist_ros.mapping.soil_map import make_soil_map as make_soil_map
    from soilmoist_ros.mapping.variogram.amplitude import Amplitude as Amplitude
    from soilmoist_ros.mapping.variogram.correlation import VARIOGRAM_MODELS as VARIOGRAM_MODELS
    from soilmoist_ros.mapping.variogram.correlation import CorrelationModel as CorrelationModel
    from soilmoist_ros.mapping.variogram.correlation import ModelName as ModelName
    from soilmoist_ros.mapping.variogram.correlation import correlation_model as correlation_model
    from soilmoist_ros.mapping.variogram.field_prior import Effect as Effect
    from soilmoist_ros.mapping.variogram.field_prior import FieldPrior as FieldPrior
    from soilmoist_ros.mapping.variogram.fit import FitMethod as FitMethod
    from soilmoist_ros.mapping.variogram.fit import LocalModel as LocalModel
    from soilmoist_ros.mapping.variogram.fit import NoiseModel as NoiseModel
    from soilmoist_ros.mapping.variogram.fit import VariogramFit as VariogramFit
    from soilmoist_ros.mapping.variogram.fit import estimate_variogram as estimate_variogram
    from soilmoist_ros.mapping.variogram.fit import fit_variogram as fit_variogram
    from soilmoist_ros.mapping.variogram.local_fit import LocalFit as LocalFit
    from soilmoist_ros.mapping.variogram.local_rate import LocalRate as LocalRate
    from soilmoist_ros.mapping.variogram.model import Variogram as Variogram
    from soilmoist_ros.mapping.variogram.reml import Prior as Prior
    from soilmoist_ros.mapping.variogram.reml import RestrictedLikelihood as RestrictedLikelihood
    from soilmoist_ros.mapping.variogram.reml import mode_of as mode_of
    from soilmoist_ros.mapping.variogram.reml import spatial_blocks as spatial_blocks
    from soilmoist_ros.mapping.variogram.semivariogram import default_edges as default_edges
    from soilmoist_ros.mapping.variogram.semivariogram import empirical_semivariogram as empirical_semivariogram
    from soilmoist_ros.mapping.variogram.support import Supports as Supports

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "border_file": "BorderSource read_border",
        "cells": "BANDS CELL map_cells placed_cells",
        "covariates.rasters": "RasterBands opened_raster",
        "covariates.reading": "coverage read_covariates require_covariates unused_parts",
        "covariates.source": "CovariateSource",
        "expected_counts": "UNEXPECTED without_verdict",
        "field": "Field FieldFile MIN_AREA_M2 Misplaced load_field misplaced require_no_go",
        "field_map": "FieldMap FieldMapSettings MapState SkippedRecords Snapshot default_merge_radius_m drifting",
        "grid": "FieldGrid",
        "health": "MAP_PART RAIN map_health",
        "knowledge.change": "Estimate FALSE_SHARE FieldChange field_change mean_places mean_variance_of moisture_slope",
        "knowledge.covariates": "Covariates joined",
        "knowledge.drift": "Change Changing Drift DriftModel TimedSamples",
        "knowledge.earlier": "EarlierSurvey samples_at_end",
        "knowledge.joint_kriging": "JointKriging Persistence estimate_persistence",
        "knowledge.knowledge": "Knowledge NOTHING",
        "kriging.poisson_kriging": "PoissonKriging",
        "kriging.targets": "Points coincident sample_correlation",
        "kriging.tiled_kriging": "Compute",
        "map_worker": "MapWorker",
        "mapping_settings": "MappingSettings",
        "moisture_bands": "Bands QUANTILE_SD common_rate_sd make_bands moisture_terms possible_moisture",
        "placement": "PositionSource require_near",
        "record_check": "Skip StampLimits",
        "samples.merging": "survey_samples",
        "samples.samples": "NO_SAMPLES Samples as_samples merge_exactly",
        "samples.spread": "footprint_spread",
        "soil_map": "MAX_EXACT_SAMPLES SoilMap make_soil_map",
        "variogram.amplitude": "Amplitude",
        "variogram.correlation": "CorrelationModel ModelName VARIOGRAM_MODELS correlation_model",
        "variogram.field_prior": "Effect FieldPrior",
        "variogram.fit": "FitMethod LocalModel NoiseModel VariogramFit estimate_variogram fit_variogram",
        "variogram.local_fit": "LocalFit",
        "variogram.local_rate": "LocalRate",
        "variogram.model": "Variogram",
        "variogram.reml": "Prior RestrictedLikelihood mode_of spatial_blocks",
        "variogram.semivariogram": "default_edges empirical_semivariogram",
        "variogram.support": "Supports",
    },
)
