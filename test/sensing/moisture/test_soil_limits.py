# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from soilmoist_ros.sensing.moisture.curve import soil_limits


@pytest.mark.parametrize(("density", "pores"), [(1.325, 0.5), (1.59, 0.4), (0.265, 0.9), (2.65, 0.0), (2.7, 0.0)])
def test_the_pores_are_what_the_minerals_leave(density, pores):
    assert soil_limits(density) == pytest.approx((0.0, pores))
