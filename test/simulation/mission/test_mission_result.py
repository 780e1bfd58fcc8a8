# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of a map against the truth: mission_result.py."""

import numpy as np
import pytest

from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation.mission.mission_result import map_errors

CURVE = CalibrationCurve(6.0, 1.4, 0.02, 0.01)
PORES = 1 - 1.4 / 2.65
TRUTH = np.array([3.6, 3.8, 4.0, 4.5])
ONE = np.ones(4)


def test_coverage_counts_the_cells_whose_interval_holds_the_truth():
    error = np.array([1.95, -1.97, 1.97, -1.95])
    assert map_errors(TRUTH + error, ONE, TRUTH, None)[2] == 0.5
    assert map_errors(TRUTH + error, 2 * ONE, TRUTH, None)[2] == 1.0


def test_the_error_of_the_moisture_is_that_of_the_curve():
    wrong = TRUTH + 0.1
    expected = np.sqrt(np.mean((CURVE.vwc(wrong) - CURVE.vwc(TRUTH)) ** 2))
    assert map_errors(wrong, ONE, TRUTH, CURVE)[1] == pytest.approx(expected)


def test_a_truth_beyond_the_curve_does_no_harm():
    truth = np.array([1.0, 3.0, *TRUTH[:2]])
    assert map_errors(truth, ONE, truth, CURVE) == (0.0, 0.0, 1.0)


def test_one_cell_at_the_pole_does_not_decide():
    for low in (CURVE.lowest_rate_cps * (1 + 1e-12), CURVE.lowest_rate_cps, 0.1, -3.0):
        rate = np.array([low, *TRUTH[1:]])
        expected = (PORES - CURVE.vwc(TRUTH)[0]) / 2
        assert map_errors(rate, ONE, TRUTH, CURVE)[1] == pytest.approx(float(expected))
