# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The built-in fields against what was published: catalogue.py."""

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.simulation.fields.catalogue import surrogate_field


@pytest.mark.parametrize(
    ("name", "size", "hours", "wet", "dry", "west_east"),
    [
        ("synthetic-high", (60, 50), 2, 2.5, 5.0, [[3, 25], [57, 25]]),
        ("synthetic-low", (60, 50), 2, 3.0, 4.0, [[3, 25], [57, 25]]),
        ("airfield-simulated", (60, 50), 2, 3.015, 3.996, [[3, 25], [57, 25]]),
        ("validation", (210, 330), 4, 2.878, 3.096, [[150, 270], [60, 90]]),
    ],
)
def test_size_time_contrast_and_moisture_are_as_published(name, size, hours, wet, dry, west_east):
    surrogate = surrogate_field(name)
    np.testing.assert_array_equal(np.ptp(surrogate.polygon, axis=0), size)
    assert (surrogate.name, surrogate.hours) == (name, hours)
    assert surrogate.rate_at(west_east) == pytest.approx([wet, dry], rel=0.04)
    rate = surrogate.rate_at(FieldGrid.from_polygon(surrogate.polygon, surrogate.field.cell_m).cells)
    vwc = surrogate.curve.vwc(rate)
    assert surrogate.curve.valid(rate).all()
    assert 0 < vwc.min() < vwc.max() < 1 - surrogate.curve.bulk_density_gcm3 / 2.65, "possible everywhere"


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(
        InputError, match=r"'sythetic-high' -> give one of: synthetic-high, .*did you mean 'synthetic-h"
    ):
        surrogate_field("sythetic-high")
