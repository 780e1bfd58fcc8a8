# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kept covariances, and weighted sums of them, against the formula."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import Variogram
from soilmoist_ros.mapping.kriging.covariances import AxesCovariances, PointCovariances, Rows, add_rows

X_M, Y_M = np.linspace(0.0, 60.0, 13), np.linspace(-20.0, 30.0, 11)
GRID = np.stack(np.meshgrid(X_M, Y_M), axis=-1).reshape(-1, 2)
RNG = np.random.default_rng(8)
SAMPLES = np.column_stack([RNG.uniform(0, 50, (9, 2)), np.zeros((9, 3))])
WEIGHTS = RNG.normal(size=(4, 9))


def sums(covariances, variogram, samples=SAMPLES, weights=WEIGHTS):
    covariances.begin(variogram)
    assert covariances.keep(samples, np.arange(len(samples)), 10**6)
    total = np.empty((len(weights), covariances.size))
    for some, part in covariances.combine(weights):
        total[:, some] = part
    return total


@pytest.mark.parametrize("model", ["gaussian", "exponential", "spherical", "matern32", "matern52"])
def test_sums_are_those_of_the_covariance_function(model):
    variogram = Variogram(model, 0.0, 20.0, 0.4)
    expected = WEIGHTS @ variogram.covariance(cdist(SAMPLES[:, :2], GRID))
    np.testing.assert_allclose(sums(PointCovariances(GRID, True), variogram), expected, atol=1e-12)


def test_a_target_at_a_sample_shares_its_nugget_if_asked():
    variogram, samples = Variogram("matern32", 0.1, 20.0, 0.4), SAMPLES.copy()
    samples[3, :2] = GRID[57]
    shared, smooth = (sums(PointCovariances(GRID, keep), variogram, samples) for keep in (True, False))
    difference = shared - smooth
    np.testing.assert_allclose(difference[:, 57], 0.1 * WEIGHTS[:, 3])
    assert not np.delete(difference, 57, axis=1).any()


@pytest.mark.parametrize("angle_deg", [0.0, 90.0])
def test_gaussian_covariances_along_axes_are_products(angle_deg):
    variogram = Variogram("gaussian", 0.0, 20.0, 0.4, 2.0, angle_deg)
    samples = SAMPLES.copy()
    samples[::2, 2:] = 9.0, 2.0, 4.0
    found = sums(AxesCovariances(X_M, Y_M), variogram, samples)
    np.testing.assert_allclose(found, sums(PointCovariances(GRID, False), variogram, samples), atol=1e-12)


def test_too_much_is_not_kept():
    covariances = PointCovariances(GRID, False)
    covariances.begin(Variogram("matern32", 0.0, 20.0, 0.4))
    assert not covariances.keep(SAMPLES, np.arange(len(SAMPLES)), 9 * len(GRID) - 1)


def test_rows_are_added_with_their_factors_and_squares():
    covariances, variogram = PointCovariances(GRID, False), Variogram("matern32", 0.0, 20.0, 0.4)
    rows = sums(covariances, variogram)
    of_data, squares, data = np.ones((2, len(GRID))), np.zeros(len(GRID)), RNG.normal(size=(2, 4))
    add_rows(covariances, WEIGHTS, data, of_data, squares)
    np.testing.assert_allclose(of_data, 1 + data @ rows)
    np.testing.assert_allclose(squares, (rows**2).sum(axis=0))


def test_a_table_grows_over_its_chunks():
    table, values = Rows(3), RNG.normal(size=(300, 3))
    for start, rows in table.writable(0, 300):
        rows[:] = values[start : start + len(rows)]
    weights = RNG.normal(size=(2, 290))
    np.testing.assert_allclose(table.combine(weights), weights @ values[:290])
