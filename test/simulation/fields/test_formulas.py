# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Families of formula fields: formulas.py."""

import numpy as np
import pytest
from pydantic import ValidationError

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


BOX = Extent.of(np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 50.0], [0.0, 50.0]]), 2.0)
NODES = np.stack(np.meshgrid(np.arange(0.5, 60), np.arange(0.5, 50)), -1).reshape(-1, 2)
UNEVEN = {"mean": 4.0, "sd": 0.9, "flat_sd": 0.15, "range_m": 5.0}
ROUGH_AREA = {"halves": 0.5, "rough_patch": 0.1, "strips": 0.5}


def share(family, seed=1, **parameters):
    return formula(family, **UNEVEN, **parameters).rough_share(NODES, BOX, np.random.default_rng(seed))


@pytest.mark.parametrize("family", ROUGH_AREA)
def test_the_ground_varies_where_it_is_rough_and_hardly_elsewhere(family):
    spread = {"rough": [], "flat": []}
    for seed in range(20):
        values = formula(family, **UNEVEN).function(BOX, np.random.default_rng(seed))(NODES) - 4.0
        rough = share(family, seed)
        spread["rough"].append(np.mean(values[rough > 0.97] ** 2))
        spread["flat"].append(np.mean(values[rough < 0.01] ** 2))
    # A drawn field of this range has about ten independent parts in the smallest area: 20 fields have 200.
    assert np.sqrt(np.mean(spread["rough"])) == pytest.approx(0.9, rel=0.15)
    assert np.sqrt(np.mean(spread["flat"])) == pytest.approx(0.15, rel=0.15)


@pytest.mark.parametrize(("family", "area"), ROUGH_AREA.items())
def test_the_rough_area_has_its_size_and_is_drawn_from_the_seed(family, area):
    shares = [share(family, seed) for seed in range(8)]
    assert np.mean([rough.mean() for rough in shares]) == pytest.approx(area, abs=0.03)
    assert np.abs(shares[0] - shares[1]).max() > 0.5
    assert all(rough.min() >= 0 and rough.max() <= 1 for rough in shares)


def test_given_directions_are_kept():
    halves = share("halves", angle_deg=90)
    assert halves[NODES[:, 1] > 30].min() > 0.9
    assert halves[NODES[:, 1] < 20].max() < 0.1
    strips = share("strips", angle_deg=0, width_m=10).reshape(50, 60)
    np.testing.assert_allclose(strips, strips[:, :1] * np.ones((1, 60)), atol=1e-12)  # alike along the strips
    np.testing.assert_allclose(strips[:30], strips[20:], atol=1e-12)  # repeated after two widths


@pytest.mark.parametrize("name", ["halves", "rough-patch", "strips"])
def test_the_fields_that_come_along_are_of_their_family(name):
    rate = surrogate_field(name).rate_at(NODES)
    assert rate.min() > 0
    assert 0.15 < rate.std() < 0.9


@pytest.mark.parametrize(
    ("more", "message"),
    [({"sd": 2.0}, "'sd' must be at most a quarter"), ({"flat_sd": 0.95}, "'flat_sd' must be at most 'sd'")],
)
def test_bad_parameters_are_refused(more, message):
    with pytest.raises(ValidationError, match=message):
        formula("strips", **(UNEVEN | more))
