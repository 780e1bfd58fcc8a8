# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates on the raster of a field."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.covariates import Covariates, joined

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40), (20, 40)], cell_m=5.0)
X, Y = np.meshgrid(GRID.x_m, GRID.y_m)
CENTRES = np.column_stack([X[GRID.mask], Y[GRID.mask]])


def test_covariates_are_standardised_over_the_field():
    covariates = Covariates.over(GRID, ["east", "height"], [X, 300 + Y**2])
    values = covariates.at(CENTRES)
    np.testing.assert_allclose(values.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(values.std(axis=0), 1)


def test_missing_values_and_constants_are_the_mean():
    holed = np.where(X > 30, np.nan, X)
    covariates = Covariates.over(GRID, ["holed", "constant"], [holed, np.full_like(X, 7.0)])
    values = covariates.at(CENTRES)
    assert (values[CENTRES[:, 0] > 48, 0] == 0).all()
    assert (values[:, 1] == 0).all()
    assert (covariates.known_at([(50, 20), (10, 5)])[:, 0] == [0, 1]).all()


@given(x=st.floats(-20, 80), y=st.floats(-20, 60))
def test_a_linear_covariate_is_interpolated_exactly_and_ends_at_the_raster(x, y):
    covariates = Covariates("en", GRID.x_m, GRID.y_m, [X, Y])
    inside = np.clip(x, GRID.x_m[0], GRID.x_m[-1]), np.clip(y, GRID.y_m[0], GRID.y_m[-1])
    np.testing.assert_allclose(covariates.at((x, y)), [inside], atol=1e-9)


def test_wrong_covariates_are_refused():
    with pytest.raises(ValueError, match="distinct"):
        Covariates.over(GRID, ["a", "a"], [X, Y])
    with pytest.raises(ValueError, match="shape"):
        Covariates(("a",), GRID.x_m, GRID.y_m, X)
    with pytest.raises(ValueError, match="increase"):
        Covariates(("a",), GRID.x_m[::-1], GRID.y_m, [X])


def test_covariates_of_one_raster_are_joined():
    rasters = np.random.default_rng(1).normal(size=(2, *GRID.shape))
    both = Covariates.over(GRID, ["a", "b"], rasters)
    alone = [Covariates.over(GRID, [name], [raster]) for name, raster in zip("ab", rasters, strict=True)]
    together = joined(alone[0], None, alone[1])
    assert together.names == both.names
    np.testing.assert_array_equal(together.layers, both.layers)
    assert joined(None, None) is None
    with pytest.raises(ValueError, match="distinct names"):
        joined(alone[0], alone[0])
