# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.interpolate import BSpline

from soilmoist_ros.mapping.variogram.amplitude import Amplitude, knots, lattice, spline_matrix

BOX = ((-10.0, 5.0), (50.0, 45.0))
RNG = np.random.default_rng(3)
TABLE = RNG.normal(0, 0.7, (6, 8))
BUMPY = Amplitude(*BOX, tuple(map(tuple, TABLE)))
PLACES = RNG.uniform((-30, -20), (70, 70), (200, 2))


def test_the_logarithm_is_linear_in_the_coefficients():
    expected = np.exp(spline_matrix(*BOX, TABLE.shape, PLACES) @ TABLE.ravel())
    np.testing.assert_allclose(BUMPY(PLACES), expected, rtol=1e-12)


def test_splines_are_a_partition_of_unity_and_reproduce_slopes():
    inside = RNG.uniform(*BOX, (50, 2))
    matrix = spline_matrix(*BOX, TABLE.shape, inside)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    np.testing.assert_allclose(matrix @ knots(*BOX, TABLE.shape), inside)


def test_splines_equal_those_of_scipy():
    x = np.linspace(-10, 50, 31)
    steps = np.arange(-3, 9) * 12.0 - 10.0  # eight splines over five intervals
    expected = BSpline.design_matrix(np.minimum(x, 50 - 1e-9), steps, 3).toarray()
    matrix = spline_matrix(*BOX, TABLE.shape, np.column_stack([x, np.full(31, 20.0)]))
    np.testing.assert_allclose(matrix.reshape(31, 6, 8).sum(axis=1), expected, atol=1e-8)


def test_outside_the_box_it_is_that_of_the_nearest_place_inside():
    np.testing.assert_array_equal(BUMPY(PLACES), BUMPY(np.clip(PLACES, *BOX)))


def test_a_place_does_not_depend_on_the_others_bit_for_bit():
    alone = np.concatenate([BUMPY(place[None]) for place in PLACES])
    np.testing.assert_array_equal(alone, BUMPY(PLACES))


def test_it_is_smooth():
    along = np.column_stack([np.linspace(-9, 49, 60_001), np.full(60_001, 30.0)])
    slope = np.diff(np.log(BUMPY(along)), 2)
    assert np.abs(slope).max() < 1e-6


def test_spread_bounds_the_amplitudes_at_the_lattice():
    low, high = BUMPY.spread
    values = BUMPY(lattice(*BOX, TABLE.shape))
    assert (low, high) == (values.min(), values.max())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0), (0, 5), TABLE), "must have an extent"),
        ((*BOX, TABLE[:3]), "at least 4 x 4"),
        ((*BOX, [*TABLE[:4], TABLE[0, :5]]), "at least 4 x 4"),
        ((*BOX, TABLE * np.nan), "finite"),
    ],
)
def test_bad_amplitudes_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Amplitude(*arguments)
