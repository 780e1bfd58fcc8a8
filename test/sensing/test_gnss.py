# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The error of a fix from the quality figures of the receiver."""

import math

import numpy as np
import pytest

from soilmoist_ros.sensing.gnss import (
    DEFAULT_UERE_M,
    STATUS_OF_QUALITY,
    FixStatus,
    covariance_of_ellipse,
    diagonal_covariance,
    horizontal_sd,
)


def test_error_ellipse_at_an_angle_has_its_axes() -> None:
    matrix = np.array(covariance_of_ellipse(3.0, 1.0, 30.0, 2.0))
    direction = np.array([math.sin(math.radians(30)), math.cos(math.radians(30)), 0])
    np.testing.assert_allclose(matrix @ direction, 9 * direction)
    np.testing.assert_allclose(np.linalg.eigvalsh(matrix), [1, 4, 9])


def test_a_round_ellipse_has_no_direction() -> None:
    for orientation_deg in (0.0, 17.0, 90.0):
        found = covariance_of_ellipse(2.0, 2.0, orientation_deg, 3.0)
        np.testing.assert_allclose(found, diagonal_covariance(2.0, 2.0, 3.0), atol=1e-12)


def test_the_standard_deviation_of_a_coordinate_is_hdop_times_range_error_over_root_two() -> None:
    assert horizontal_sd(1, 2.0, {1: 10.0}) == pytest.approx(20 / math.sqrt(2))
    assert horizontal_sd(4, 1.0) == pytest.approx(DEFAULT_UERE_M[4] / math.sqrt(2))


@pytest.mark.parametrize(("quality", "hdop"), [(0, 1.0), (7, 1.0), (1, 0.0), (1, 100.0), (1, math.nan)])
def test_without_a_figure_the_error_is_unknown(quality, hdop) -> None:
    assert math.isnan(horizontal_sd(quality, hdop))


def test_every_quality_with_a_fix_has_a_range_error() -> None:
    assert STATUS_OF_QUALITY.keys() == DEFAULT_UERE_M.keys()
    assert FixStatus.NO_FIX not in STATUS_OF_QUALITY.values()
