# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interpolation, and kriging against equations solved directly: rate_grid.py."""

import numpy as np
import pytest

from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.simulation.fields.rate_grid import GridExtent, RateGrid, kriged_grid

SQUARE = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]])
EXTENT = GridExtent.of(SQUARE, 2.0)


def test_kriging_agrees_with_the_equations_solved_directly():
    rng = np.random.default_rng(4)
    xy, values = rng.uniform(0, 40, (9, 2)), rng.uniform(3, 5, 9)
    variogram = Variogram("matern32", 0.0, 12.0, 0.7)
    place = np.array([[11.0, 17.0]])
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    system = np.block([[variogram.covariance(distance), np.ones((9, 1))], [np.ones((1, 9)), np.zeros((1, 1))]])
    right = np.append(variogram.covariance(np.hypot(*(xy - place).T)), 1.0)
    expected = np.linalg.solve(system, right)[:9] @ values
    assert kriged_grid(xy, values, variogram, place[:, 0], place[:, 1]).values[0, 0] == pytest.approx(
        expected, rel=1e-9
    )


def test_a_nugget_is_filtered_without_spikes():
    rng = np.random.default_rng(5)
    xy, values = rng.uniform(0, 40, (30, 2)), rng.normal(4, 0.1, 30)
    variogram = Variogram("exponential", 0.01, 20.0, 0.02)
    at, near = (
        kriged_grid(xy, values, variogram, xy[:1, 0] + shift, xy[:1, 1]).values[0, 0] for shift in (0.0, 1e-6)
    )
    assert at == pytest.approx(near, abs=1e-5)
    assert abs(at - values[0]) > 1e-3


def test_an_ill_conditioned_system_is_refused():
    xy = np.column_stack([np.linspace(0, 10, 60), np.zeros(60)])
    with pytest.raises(ValueError, match="ill-conditioned for the gaussian model with range 50 m"):
        kriged_grid(
            xy, np.sin(xy[:, 0]) + 4, Variogram("gaussian", 0.0, 50.0, 1.0), np.arange(3.0), np.arange(3.0)
        )


def test_an_extrapolation_below_zero_is_refused():
    xy = np.array([[0.0, 10.0], [8.0, 10.0], [10.0, 10.0], [30.0, 10.0]])
    with pytest.raises(ValueError, match=r"the extrapolated rate is -.* counts/s at x = .*overshoots"):
        kriged_grid(xy, np.array([9.0, 1.0, 0.01, 9.0]), Variogram("matern52", 0.0, 30.0, 10.0), *EXTENT.axes())


def test_interpolation_is_bilinear_and_constant_beyond_the_edge():
    grid = RateGrid(np.array([0.0, 2.0]), np.array([0.0, 4.0]), np.array([[1.0, 3.0], [5.0, 7.0]]))
    places = np.array([[0, 0], [1, 0], [1, 2], [2, 4], [-9, 0], [9, 9]], float)
    np.testing.assert_allclose(grid(places), [1, 2, 4, 7, 1, 7])
