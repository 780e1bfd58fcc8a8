# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.optimize import rosen, rosen_der, rosen_hess

from soilmoist_ros.mapping.variogram.newton import minimise


def quadratic(lowest, curvature, pretended):
    def expand(x):
        away = x - lowest
        return 0.5 * away @ curvature @ away, curvature @ away, pretended

    return expand


CURVATURE = np.array([[3.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]])


def test_one_step_of_newton_ends_a_quadratic():
    calls = []
    expand = quadratic(np.array([1.0, -2.0, 0.5]), CURVATURE, CURVATURE)
    found = minimise(lambda x: calls.append(x) or expand(x), np.zeros(3), 5.0, 1e-2)
    np.testing.assert_allclose(found.at, [1.0, -2.0, 0.5], atol=1e-2)
    assert len(calls) == 2
    assert found.converged


def test_what_the_matrix_lacks_is_learned():
    """As little of the Hessian as its diagonal is enough to converge in a dozen evaluations."""
    calls = []
    expand = quadratic(np.array([1.0, -2.0, 0.5]), CURVATURE, np.eye(3))
    found = minimise(lambda x: calls.append(x) or expand(x), np.zeros(3), 5.0, 1e-8)
    np.testing.assert_allclose(found.at, [1.0, -2.0, 0.5], atol=1e-7)
    assert len(calls) <= 12


def test_bounds_hold_and_the_others_go_on():
    found = minimise(quadratic(np.array([9.0, -2.0, 0.5]), CURVATURE, CURVATURE), np.zeros(3), 5.0, 1e-8)
    at_bound = [5.0, *np.linalg.solve(CURVATURE[1:, 1:], CURVATURE[1:, 1:] @ [-2.0, 0.5] + 4.0 * CURVATURE[1:, 0])]
    np.testing.assert_allclose(found.at, at_bound, atol=1e-7)
    assert found.converged


def test_a_bent_valley_is_followed():
    found = minimise(lambda x: (rosen(x), rosen_der(x), rosen_hess(x)), np.array([-1.2, 1.0, 1.5]), 5.0, 1e-6)
    np.testing.assert_allclose(found.at, 1.0, atol=1e-5)


def test_rounding_does_not_end_the_search_early():
    """With a large constant added, the value is flat to rounding where the gradient is not."""
    expand = quadratic(np.array([1.0, -2.0, 0.5]), CURVATURE, 0.5 * CURVATURE)

    def rounded(x):
        value, gradient, pretended = expand(x)
        return 1e5 + value, gradient, pretended

    found = minimise(rounded, np.zeros(3), 5.0, 1e-8)
    assert found.converged
    np.testing.assert_allclose(found.at, [1.0, -2.0, 0.5], atol=1e-8)


def test_a_start_outside_is_moved_inside():
    found = minimise(quadratic(np.zeros(3), CURVATURE, CURVATURE), np.full(3, 40.0), 5.0, 1e-8)
    np.testing.assert_allclose(found.at, 0.0, atol=1e-7)


@pytest.mark.parametrize("value", [1e300, np.nan])
def test_where_the_function_fails_is_left_out(value):
    """As where a covariance matrix cannot be factored."""
    expand = quadratic(np.array([1.0, -2.0, 0.5]), CURVATURE, 0.3 * CURVATURE)

    def broken(x):
        return (value, np.zeros(3), np.eye(3)) if x[0] > 1.5 else expand(x)

    np.testing.assert_allclose(minimise(broken, np.zeros(3), 5.0, 1e-6).at, [1.0, -2.0, 0.5], atol=1e-5)
