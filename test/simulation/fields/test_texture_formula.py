# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fields as soil texture makes them (texture_formula.py), and the field of the demo."""

import numpy as np
import pytest

from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.formulas import formula
from soilmoist_ros.simulation.fields.rate_grid import Extent

EXTENT = Extent.of(np.array([(0, 0), (400, 0), (400, 400), (0, 400)]), 4.0)
CELLS = np.random.default_rng(1).uniform(0, 400, (4000, 2))


def test_values_lie_evenly_between_the_limits():
    texture = formula("texture", quantity="vwc", low=0.1, high=0.3, range_m=10.0)
    values = texture.function(EXTENT)(CELLS)
    assert values.min() > 0.1
    assert values.max() < 0.3
    np.testing.assert_allclose(np.quantile(values, [0.25, 0.5, 0.75]), [0.15, 0.2, 0.25], atol=0.02)


def test_fields_of_one_seed_share_their_zones():
    def values(**more):
        return formula("texture", low=1.0, high=2.0, range_m=30.0, fine_range_m=8.0, **more).function(EXTENT)(
            CELLS
        )

    smooth, rougher, other = values(seed=3, fine=0.0), values(seed=3, fine=0.4), values(seed=4, fine=0.0)
    assert np.corrcoef(smooth, rougher)[0, 1] == pytest.approx(np.sqrt(0.6), abs=0.1)
    assert abs(np.corrcoef(smooth, other)[0, 1]) < 0.5


def test_limits_must_differ():
    with pytest.raises(ValueError, match="'low' must be below 'high'"):
        formula("texture", low=2.0, high=1.0)


def test_the_field_of_the_demo_is_a_farm_field():
    farm = surrogate_field("farm")
    cells = farm.field.grid().cells
    vwc = farm.vwc_at(cells)
    assert 0.08 < vwc.min() < 0.12
    assert 0.27 < vwc.max() < 0.3
    assert 1.0 < len(cells) * farm.field.cell_m**2 / 1e4 < 2.0, "hectares"
    compaction = surrogate_field("farm-compaction")
    np.testing.assert_array_equal(compaction.polygon, farm.polygon)
    assert np.corrcoef(compaction.rate_at(cells), vwc)[0, 1] > 0.6
