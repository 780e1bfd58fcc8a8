# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Gaussian kriging from features of the axes is that of single points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging.product_features import ProductFeatures
from soilmoist_ros.mapping.kriging.system import target_variance

OF_SILL, OF_SD = 1e-8, 1e-6


def fitted(variogram, seed=0, n=60, exposure_s=200.0):
    """Samples in and around 90 x 60 m, some of lines and areas."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform((-20, -5), (100, 70), (n, 2))
    spread = np.zeros((n, 3))
    spread[::7], spread[1::7] = (3.0, -2.0, 4.0), (9.0, 0.0, 0.0)
    kriging = PoissonKriging(variogram, keep_nugget=False)
    return kriging.fit(xy, rng.poisson(4.0 * exposure_s, n), np.full(n, exposure_s), spread)


@settings(max_examples=30, deadline=None)
@given(
    st.floats(8, 400),
    st.sampled_from([(1.0, 0.0), (1.0, 30.0), (3.0, 0.0), (2.0, 90.0)]),
    st.sampled_from([0.0, 0.05]),
    st.sampled_from([10.0, 1e4]),
    st.integers(0, 10**6),
)
def test_grids_are_those_of_points(range_m, anisotropy, nugget, exposure_s, seed):
    variogram = Variogram("gaussian", nugget, range_m, 0.5, *anisotropy)
    kriging = fitted(variogram, seed, exposure_s=exposure_s)
    x_m, y_m = np.linspace(0, 90, 12), np.linspace(60, 0, 9)
    features = ProductFeatures(kriging.system, x_m, y_m)
    for axes in ((x_m, y_m), (x_m[3:6], y_m[:1])):  # the features serve any grid in the box
        x, y = np.meshgrid(*axes)
        rate, variance = features.surfaces(*axes)
        expected = kriging.predict(np.column_stack([x.ravel(), y.ravel()]))
        np.testing.assert_allclose(rate.ravel(), expected[0], rtol=0, atol=OF_SD)
        variance += target_variance(variogram, False)
        np.testing.assert_allclose(np.maximum(variance.ravel(), 0), expected[1], rtol=0, atol=OF_SILL)


def test_few_pairs_of_features_matter_where_the_range_is_long():
    sizes = []
    for range_m in (10.0, 40.0, 160.0):
        kriging = fitted(Variogram("gaussian", 0.0, range_m, 0.5))
        sizes.append(ProductFeatures(kriging.system, np.linspace(0, 90, 99), np.linspace(0, 60, 66)).size)
    assert sizes[2] < 60 < sizes[1] < 300 < sizes[0]


@pytest.mark.parametrize("axes", [(np.array([5.0]), np.arange(9.0)), (np.array([5.0]), np.array([7.0]))])
def test_one_row_or_one_place_is_a_grid(axes):
    kriging = fitted(Variogram("gaussian", 0.0, 25.0, 0.5))
    rate, _ = ProductFeatures(kriging.system, *axes).surfaces(*axes)
    x, y = np.meshgrid(*axes)
    expected, _ = kriging.predict(np.column_stack([x.ravel(), y.ravel()]))
    np.testing.assert_allclose(rate.ravel(), expected, rtol=0, atol=1e-8)
    alone = PoissonKriging(kriging.variogram).fit([(5.0, 7.0)], [800], [200.0])
    assert ProductFeatures(alone.system, np.array([5.0]), np.array([7.0])).size == 1
