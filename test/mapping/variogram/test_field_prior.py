# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Prior mean and covariance of the rate."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.mapping.variogram.field_prior import FieldPrior


def prior():
    return FieldPrior(
        lambda xy: np.column_stack([xy[:, 0], xy[:, 0] * xy[:, 1]]),
        np.array([1.0, 2.0]),
        np.array([[-0.3, 0.1], [0.1, 0.5]]),
        np.array([1.0, -0.5]),
    )


def test_mean_and_covariance_are_those_of_the_features():
    xy = np.random.default_rng(0).uniform(-1, 1, (6, 2))
    one = prior()
    features = np.column_stack([xy[:, 0], 2 * xy[:, 0] * xy[:, 1]])
    at = one.at(xy)
    np.testing.assert_allclose(one.mean(at), features @ [1.0, -0.5])
    np.testing.assert_allclose(one.covariance(at, at), features @ one.matrix @ features.T)
    np.testing.assert_allclose(one.variance(at), np.diag(one.covariance(at, at)))
    np.testing.assert_allclose(one.covariance(at[:2], at), one.covariance(at, at[:2]).T)


@given(length_m=st.floats(2.0, 40.0), x=st.floats(-50, 50), y=st.floats(-50, 50))
def test_features_are_averaged_over_the_path_of_a_sample(length_m, x, y):
    spread = np.array([[0.0, 0.0, length_m**2 / 12]])  # along y; both features are linear in y
    place = np.array([[x, y]])
    np.testing.assert_allclose(prior().at(place, spread), prior().at(place), rtol=1e-9, atol=1e-9)
