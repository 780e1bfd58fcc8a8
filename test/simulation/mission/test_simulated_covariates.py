# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated covariates: their correlation with the truth, and that nothing else changes with them."""

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation import MissionSettings, simulate_mission
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.mission.simulated_knowledge import simulated_covariates

FIELD = surrogate_field("rough", np.random.default_rng(1))
GRID = FIELD.field.grid(2.0)


def correlations(**changes):
    found = []
    for seed in range(12):
        covariates = simulated_covariates(FIELD, GRID, MissionSettings(seed=seed, **changes))
        values = covariates.layers[:, GRID.mask]
        found.append(np.corrcoef(np.vstack([FIELD.rate_at(GRID.cells), values]))[0, 1:])
    return covariates.names, np.array(found)


def test_the_correlation_is_the_one_asked_for():
    names, found = correlations(covariate_correlation=0.7, useless_covariates=2)
    assert names == ("simulated", "useless 1", "useless 2")
    assert found[:, 0] == pytest.approx(0.7)
    assert np.abs(found[:, 1:].mean(axis=0)).max() < 0.15
    assert correlations(covariate_correlation=-1.0)[1] == pytest.approx(-1)


def test_useless_covariates_are_the_same_with_and_without_another():
    alone = simulated_covariates(FIELD, GRID, MissionSettings(useless_covariates=2))
    both = simulated_covariates(FIELD, GRID, MissionSettings(useless_covariates=2, covariate_correlation=0.5))
    np.testing.assert_array_equal(alone.layers, both.layers[1:])
    assert simulated_covariates(FIELD, GRID, MissionSettings()) is None


@pytest.mark.slow
def test_a_mission_with_covariates_is_reproducible():
    settings = MissionSettings(hours=0.2, cell_m=4.0, covariate_correlation=0.9, useless_covariates=1, seed=3)
    first, again = (simulate_mission(settings) for _ in range(2))
    np.testing.assert_array_equal(first.soil_map.rate, again.soil_map.rate)
    assert first.properties[0].covariates.names == ("simulated", "useless 1")


def test_impossible_correlations_are_refused():
    with pytest.raises(InputError, match="covariate_correlation: must be >= -1"):
        MissionSettings(covariate_correlation=-1.5).check()
    with pytest.raises(InputError, match="at most 1"):
        MissionSettings(covariate_correlation=1.5).check()
