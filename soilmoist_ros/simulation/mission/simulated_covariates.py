# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates of a surrogate field: one that follows the truth with a given correlation, and useless ones."""

from __future__ import annotations

import math

import numpy as np

from soilmoist_ros.mapping import Covariates, FieldGrid
from soilmoist_ros.simulation.fields.random_field import random_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.earlier_series import pattern_variogram
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.streams import covariate_stream

FOLLOWS = "simulated"
"""Name of the covariate that follows the truth."""


def simulated_covariates(
    field: SurrogateField, grid: FieldGrid, settings: MissionSettings, number: int = 0
) -> Covariates | None:
    """The covariates that the settings ask for; ``None`` for none.

    The covariate that follows the truth is ``r t + sqrt(1 - r^2) e``: t is the standardised truth, and e a random
    field with the correlation R(h) of the truth's pattern, less its regression on the truth and standardised. So r
    is the correlation over the cells. Useless ones are random fields with the correlation R(h), independent of the
    truth: over the cells of one field they may be correlated with it by chance.

    :param field: present truth
    :param grid: cells of the map
    :param settings: ``covariate_correlation``, ``useless_covariates`` and ``seed`` count
    :param number: number of the property, from 0
    """
    wanted = {} if settings.covariate_correlation is None else {FOLLOWS: settings.covariate_correlation}
    wanted |= {f"useless {index}": 0.0 for index in range(1, settings.useless_covariates + 1)}
    if not wanted:
        return None
    pattern = field.variogram or pattern_variogram(field, grid)
    truth = grid.to_raster(field.rate_at(grid.cells))
    truth = (truth - np.nanmean(truth)) / (np.nanstd(truth) or 1.0)
    rasters = []
    for index, (name, share) in enumerate(wanted.items()):
        stream = covariate_stream(settings.seed, number, 0 if name == FOLLOWS else index + (FOLLOWS not in wanted))
        other = random_field(grid.x_m, grid.y_m, pattern.model, pattern.range_m, stream)
        if name == FOLLOWS:
            other -= np.nanmean(other * truth) * truth
            other = (other - np.nanmean(other)) / np.nanstd(other)
        rasters.append(share * truth + math.sqrt(1 - share**2) * other)
    return Covariates.over(grid, list(wanted), np.array(rasters))
