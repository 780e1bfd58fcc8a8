# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The built-in fields against what was published: catalogue.py."""

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.simulation.fields.catalogue import surrogate_field


def cells_of(surrogate):
    return FieldGrid.from_polygon(surrogate.polygon, surrogate.field.cell_m).cells


@pytest.mark.parametrize(
    ("name", "size", "hours"),
    [
        ("synthetic-high", (60, 50), 2),
        ("synthetic-low", (60, 50), 2),
        ("airfield-simulated", (60, 50), 2),
        ("validation", (210, 330), 4),
    ],
)
def test_size_and_mission_time(name, size, hours):
    surrogate = surrogate_field(name)
    np.testing.assert_array_equal(np.ptp(surrogate.polygon, axis=0), size)
    assert surrogate.hours == hours
    assert surrogate.name == name


@pytest.mark.parametrize(
    ("name", "wet", "dry", "west_east"),
    [
        ("synthetic-high", 2.5, 5.0, [[3, 25], [57, 25]]),
        ("synthetic-low", 3.0, 4.0, [[3, 25], [57, 25]]),
        ("airfield-simulated", 3.015, 3.996, [[3, 25], [57, 25]]),
        ("validation", 2.878, 3.096, [[150, 270], [60, 90]]),
    ],
)
def test_the_contrast_is_right_at_both_ends(name, wet, dry, west_east):
    assert surrogate_field(name).rate_at(west_east) == pytest.approx([wet, dry], rel=0.04)


@pytest.mark.parametrize("name", ["synthetic-high", "synthetic-low", "airfield-simulated", "validation"])
def test_rates_and_moistures_are_possible_everywhere(name):
    surrogate = surrogate_field(name)
    cells = cells_of(surrogate)
    rate = surrogate.rate_at(cells)
    vwc = surrogate.curve.vwc(rate)
    assert rate.min() > 0
    assert surrogate.curve.valid(rate).all()
    porosity = 1 - surrogate.curve.bulk_density_gcm3 / 2.65
    assert vwc.min() > 0
    assert vwc.max() < porosity
    np.testing.assert_allclose(surrogate.curve.rate_cps(vwc), rate)


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(
        InputError, match=r"'sythetic-high' -> give one of: synthetic-high, .*did you mean 'synthetic-h"
    ):
        surrogate_field("sythetic-high")
