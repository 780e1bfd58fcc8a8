# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Surveys of earlier dates and covariates of simulated fields: simulated_knowledge.py."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.simulation import MissionSettings, simulate_mission, surrogate_field
from soilmoist_ros.simulation.mission.simulated_knowledge import earlier_series, simulated_covariates

SETTINGS = MissionSettings(field="smooth", earlier_surveys=2, cell_m=4.0)
FIELD = surrogate_field("smooth")
GRID = FIELD.field.grid(4.0)


def truths(settings: MissionSettings, name: str = "smooth") -> np.ndarray:
    """Present and earlier true rates in the cells, shape (surveys, cells)."""
    field = surrogate_field(name)
    grid = field.field.grid(4.0)
    series = [one.field.rate_at(grid.cells) for one in earlier_series(field, grid, settings)]
    return np.array([field.rate_at(grid.cells), *series])


@pytest.mark.parametrize(("persistence", "expected"), [(1.0, 1.0), (0.6, 0.6), (0.0, 0.0)])
@pytest.mark.slow
def test_patterns_of_all_pairs_of_surveys_correlate_by_the_persistence(persistence, expected):
    # Deviations are about the known mean of the formula, not that of the field; their products average to it.
    products = []
    for seed in range(30):
        _, first, second = truths(replace(SETTINGS, persistence=persistence, seed=seed))
        first, second = first - first.mean(), second - second.mean()
        products.append([first @ second, first @ first, second @ second])
    both, one, other = np.mean(products, axis=0)
    # The present pattern is one draw with a share of the variance; what is drawn anew averages out.
    assert both / np.sqrt(one * other) == pytest.approx(expected, abs=0.12)


def test_a_shorter_series_is_the_end_of_a_longer_one_and_the_present_is_unchanged():
    two, four = truths(SETTINGS), truths(replace(SETTINGS, earlier_surveys=4))
    np.testing.assert_allclose(two, four[:3], rtol=1e-12)


def test_the_pattern_of_a_fixed_field_persists_and_every_survey_has_its_mean():
    present, latest, _ = truths(replace(SETTINGS, persistence=1.0), "patches")
    np.testing.assert_allclose(latest - latest.mean(), present - present.mean(), atol=2e-3 * present.mean())
    assert abs(latest.mean() / present.mean() - 1) > 0.001


@pytest.mark.slow
def test_a_mission_has_the_same_truth_with_and_without_earlier_surveys():
    short = MissionSettings(field="smooth", hours=0.1, cell_m=6.0, strategy="random", random_field=True, seed=4)
    alone, informed = (simulate_mission(replace(short, earlier_surveys=count)) for count in (0, 2))
    np.testing.assert_array_equal(alone.truth_rate, informed.truth_rate)
    assert [one.raw_counts for one in alone.records] == [one.raw_counts for one in informed.records]
    assert [one.name for one in informed.properties[0].series] == ["7 days before", "14 days before"]


SURROGATE = surrogate_field("rough", np.random.default_rng(1))
CELLS = SURROGATE.field.grid(2.0)


def correlations(**changes):
    found = []
    for seed in range(12):
        covariates = simulated_covariates(SURROGATE, CELLS, MissionSettings(seed=seed, **changes))
        values = covariates.layers[:, CELLS.mask]
        found.append(np.corrcoef(np.vstack([SURROGATE.rate_at(CELLS.cells), values]))[0, 1:])
    return covariates.names, np.array(found)


def test_the_correlation_is_the_one_asked_for():
    names, found = correlations(covariate_correlation=0.7, useless_covariates=2)
    assert names == ("simulated", "useless 1", "useless 2")
    assert found[:, 0] == pytest.approx(0.7)
    assert np.abs(found[:, 1:].mean(axis=0)).max() < 0.15
    assert correlations(covariate_correlation=-1.0)[1] == pytest.approx(-1)
