# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shrinkage of the effects of covariates."""

import numpy as np
import pytest

from soilmoist_ros.mapping.knowledge.shrinkage import SCALES, effect_variances, log_marginal


def test_the_marginal_likelihood_is_that_of_a_regression():
    rng = np.random.default_rng(0)
    design, noise = rng.standard_normal((12, 3)), rng.uniform(0.5, 2.0, 12)
    data, variances = rng.standard_normal(12), np.array([0.3, 0.0, 1.0])
    information, score = (design.T / noise) @ design, (design.T / noise) @ data
    expected = []
    for covariance in (np.diag(noise), np.diag(noise) + design * variances @ design.T):
        fit = data @ np.linalg.solve(covariance, data)
        expected.append(-0.5 * (fit + np.linalg.slogdet(covariance)[1]))
    assert log_marginal(information, score, variances) == pytest.approx(expected[1] - expected[0])


def test_clear_effects_stay_and_others_vanish():
    information = np.diag([200.0, 200.0, 200.0])
    clear, none, faint = effect_variances(information, information @ [0.6, 0.0, 0.05])
    assert clear > 0.2
    assert none == faint == 0


def test_without_information_one_covariate_stays_possible_and_many_are_left_out():
    few, many = (effect_variances(np.zeros((count, count)), np.zeros(count)) for count in (1, 5))
    assert few == pytest.approx(0.5 * np.mean(SCALES[1:] ** 2))
    assert (many == 0).all()


@pytest.mark.parametrize("share", [0.0, 0.03, 0.06])
def test_counts_that_do_not_speak_for_covariates_leave_them_out(share):
    """Two smooth covariates over one field: it has few independent places."""
    information = np.diag([20.0, 20.0])
    assert (effect_variances(information, information @ [share, -share]) == 0).all()
