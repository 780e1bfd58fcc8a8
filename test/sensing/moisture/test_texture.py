# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest

from soilmoist_ros.sensing import Soil
from soilmoist_ros.sensing.moisture.texture import TEXTURES


def saxton_rawls(sand, clay, matter=2.5):
    """Wilting point, field capacity and pores by the equations 1, 2, 3 and 5 of Saxton & Rawls (2006)."""
    dry = -0.024 * sand + 0.487 * clay + 0.006 * matter + 0.031
    dry += 0.005 * sand * matter - 0.013 * clay * matter + 0.068 * sand * clay
    wilting = 1.14 * dry - 0.02
    moist = -0.251 * sand + 0.195 * clay + 0.011 * matter + 0.299
    moist += 0.006 * sand * matter - 0.027 * clay * matter + 0.452 * sand * clay
    capacity = moist + 1.283 * moist**2 - 0.374 * moist - 0.015
    wet = 0.278 * sand + 0.034 * clay + 0.022 * matter + 0.078
    wet += -0.018 * sand * matter - 0.027 * clay * matter - 0.584 * sand * clay
    return wilting, capacity, capacity + 1.636 * wet - 0.107 - 0.097 * sand + 0.043


@pytest.mark.parametrize("name", TEXTURES)
def test_the_table_is_that_of_the_equations(name):
    soil = TEXTURES[name]
    wilting, capacity, pores = saxton_rawls(soil.sand, soil.clay)
    assert soil.wilting_point == pytest.approx(wilting, abs=0.011)
    assert soil.field_capacity == pytest.approx(capacity, abs=0.011)
    assert soil.bulk_density_gcm3 == pytest.approx(2.65 * (1 - pores), abs=0.03)
    assert soil.clay_range[0] <= soil.clay <= soil.clay_range[1]
    assert 0.02 < soil.wilting_point_sd < soil.field_capacity_sd < 0.1


def test_a_texture_gives_what_the_file_leaves_out():
    by_class = Soil(texture="loam")
    assert (by_class.bulk_density_gcm3, by_class.lattice_water) == (1.43, pytest.approx(0.0194))
    assert 0.1 < by_class.bulk_density_sd_gcm3 < 0.2
    assert 0.005 < by_class.bound_water_sd < 0.03
    measured = Soil(texture="loam", bulk_density_gcm3=1.3, lattice_water=0.03)
    assert (measured.bulk_density_sd_gcm3, measured.bound_water_sd) == (None, None)  # no range of a class
    assert measured.organic_water == 0
