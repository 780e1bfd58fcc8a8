# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Families of formula fields: formulas.py."""

import numpy as np
import pytest

from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS
from soilmoist_ros.simulation.fields.formulas import FAMILIES, formula, random_field
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent

SQUARE = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]])
EXTENT = GridExtent.of(SQUARE, 2.0)
LARGE = GridExtent.of(np.array([(0, 0), (400, 0), (400, 400), (0, 400)]), 4.0)
PLACES = np.random.default_rng(1).uniform(0, 400, (4000, 2))
PARAMETERS = {
    "gaussian_field": {"mean": 4.0, "sd": 0.8}, "exponential": {"mean": 4.0, "sd": 0.8},
    "matern32": {"mean": 4.0, "sd": 0.8}, "patches": {"background": 4.0, "patch": 3.0},
    "ridge": {"background": 3.0, "crest": 4.0}, "halves": {"mean": 4.0, "sd": 0.8},
    "rough_patch": {"mean": 4.0, "sd": 0.8}, "strips": {"mean": 4.0, "sd": 0.8},
    "texture": {"low": 3.0, "high": 4.0},
}  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_positive_and_deterministic(family):
    chosen = formula(family, **PARAMETERS[family])
    places = np.random.default_rng(0).uniform(-20, 60, (2000, 2))
    values = chosen.function(EXTENT)(places)
    assert values.shape == (2000,)
    assert values.min() > 0
    assert np.ptp(values) > 0.5
    np.testing.assert_array_equal(values, chosen.function(EXTENT)(places))


@pytest.mark.parametrize(
    ("more", "place", "expected"),
    [
        ({}, [[20, 0], [20, 30], [23, 7], [0, 7]], [4, 4, 3 + np.exp(-0.5), 3]),
        ({"offset_m": 5}, [[25, 7]], [4]),
        ({"angle_deg": 0}, [[0, 15], [40, 18]], [4, 3 + np.exp(-0.5)]),
    ],
)
def test_a_ridge_runs_through_the_middle(more, place, expected):
    ridge = formula("ridge", **PARAMETERS["ridge"], width_m=3, **more)
    np.testing.assert_allclose(ridge.function(EXTENT)(np.array(place, float)), expected, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["gaussian", "matern32"])
def test_random_fields_have_the_variance_and_correlation_of_their_model(model):
    x, y = np.arange(24.0), np.arange(18.0)
    rng = np.random.default_rng(11)
    draws = np.array([random_field(x, y, model, 6.0, rng) for _ in range(2000)])
    here, lags = draws[:, 2, 3], [(2, 4), (8, 3), (6, 9), (17, 23)]
    # The standard error of a variance or correlation from 2000 draws is at most sqrt(2 / 2000) = 0.032.
    assert here.var() == pytest.approx(1.0, abs=0.11)
    assert draws.var(axis=0).mean() == pytest.approx(1.0, abs=0.06)
    assert draws.mean() == pytest.approx(0.0, abs=0.05)
    for row, column in lags:
        expected = MODELS[model].correlation(np.array([((row - 2) ** 2 + (column - 3) ** 2) / 36.0]))[0]
        assert np.mean(here * draws[:, row, column]) == pytest.approx(expected, abs=0.1)


def test_a_random_field_with_a_hopeless_range_is_refused():
    with pytest.raises(ValueError, match="use a shorter range or larger cells"):
        random_field(np.arange(300.0), np.arange(300.0), "matern32", 4000.0, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"family": "gausian_field"},
            r"unknown family 'gausian_field'; known are .*did you mean 'gaussian_field'\?",
        ),
        ({"family": "texture", "low": 1, "hihg": 2}, r"has no parameter 'hihg'; it has .*did you mean 'high'\?"),
        ({"family": "texture", "low": 1}, "high\n  Field required"),
        ({"family": "texture", "low": 0, "high": 2}, "greater than 0"),
        ({"family": "matern32", "mean": 4, "sd": 2}, r"'sd' must be at most a quarter of 'mean' \(1\)"),
        ({"family": "texture", "low": 2, "high": 1}, "'low' must be below 'high'"),
        ({"family": "strips", "mean": 4, "sd": 0.9, "flat_sd": 0.95}, "'flat_sd' must be at most 'sd'"),
        ({"family": "texture", "low": 8, "high": 20, "quantity": "vwc"}, "'low' is a moisture in m3/m3"),
    ],
)
def test_bad_formulas_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        formula(**parameters)


def test_values_lie_evenly_between_the_limits():
    texture = formula("texture", quantity="vwc", low=0.1, high=0.3, range_m=10.0)
    values = texture.function(LARGE)(PLACES)
    assert values.min() > 0.1
    assert values.max() < 0.3
    np.testing.assert_allclose(np.quantile(values, [0.25, 0.5, 0.75]), [0.15, 0.2, 0.25], atol=0.02)


BOX = GridExtent.of(np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 50.0], [0.0, 50.0]]), 2.0)
NODES = np.stack(np.meshgrid(np.arange(0.5, 60), np.arange(0.5, 50)), -1).reshape(-1, 2)
ROUGH = {"mean": 4.0, "sd": 0.9, "flat_sd": 0.15, "range_m": 5.0}
ROUGH_AREA = {"halves": 0.5, "rough_patch": 0.1, "strips": 0.5}


def share(family, seed=1, **parameters):
    return formula(family, **ROUGH, **parameters)._rough_share(NODES, BOX, np.random.default_rng(seed))


@pytest.mark.parametrize("family", ROUGH_AREA)
def test_the_ground_varies_where_it_is_rough_and_hardly_elsewhere(family):
    spread = {"rough": [], "flat": []}
    for seed in range(20):
        values = formula(family, **ROUGH).function(BOX, np.random.default_rng(seed))(NODES) - 4.0
        rough = share(family, seed)
        spread["rough"].append(np.mean(values[rough > 0.97] ** 2))
        spread["flat"].append(np.mean(values[rough < 0.01] ** 2))
    # A drawn field of this range has about ten independent parts in the smallest area: 20 fields have 200.
    assert np.sqrt(np.mean(spread["rough"])) == pytest.approx(0.9, rel=0.15)
    assert np.sqrt(np.mean(spread["flat"])) == pytest.approx(0.15, rel=0.15)
