# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Zones of maps: zones.py."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.reporting.exports.source import ExportedProperty
from soilmoist_ros.reporting.exports.zones import management_zones, thirds

FRAME = LocalFrame(53.27, -0.52)
CELL_M = 2.0
SIZE = 30


def a_map(vwc, boundary, sd=0.01):
    side = CELL_M * SIZE / 2
    transform = Affine(CELL_M, 0, -side, 0, -CELL_M, side)
    one = ExportedProperty("", "", {}, transform, FRAME.crs, {}, FRAME, {}, {})
    row, column = np.indices(vwc.shape)
    xy = one.to_local(np.column_stack([column.ravel(), row.ravel()]))
    inside = shapely.contains_xy(boundary, xy[:, 0], xy[:, 1]).reshape(vwc.shape)
    bands = {"vwc": np.where(inside, vwc, np.nan), "vwc_sd": np.where(inside, sd, np.nan)}
    bands["rate"] = np.where(inside, 5.0, np.nan)
    return ExportedProperty("", "", bands, transform, FRAME.crs, {}, FRAME, {}, {})


def star(radii):
    """A polygon around the origin with corners at even angles; a hole near its centre."""
    angles = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    outline = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    return shapely.Polygon(outline).difference(shapely.box(-3, -2, 2, 3))


@pytest.mark.slow
@given(
    seed=st.integers(0, 1000),
    radii=st.lists(st.floats(12, 29), min_size=4, max_size=9),
    smooth=st.floats(0.5, 5),
    classes=st.integers(1, 3),
    share=st.floats(0, 0.2),
)
@settings(max_examples=10, deadline=None)
def test_zones_partition_the_field(seed, radii, smooth, classes, share):
    field = star(np.array(radii))
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(SIZE, SIZE)), smooth)
    the_map = a_map(0.25 + 0.05 * noise / noise.std(), field)
    smallest = share * field.area
    limits = {1: (), 2: thirds(the_map.values)[:1], 3: thirds(the_map.values)}[classes]
    zones = management_zones(the_map, field, limits, smallest)
    shapes = [zone.shape for zone in zones]
    assert all(shape.geom_type == "Polygon" and shape.is_valid for shape in shapes)
    together = shapely.union_all(shapes)
    assert sum(shape.area for shape in shapes) == pytest.approx(together.area, rel=1e-9), "no overlap"
    # Corners lie on a raster of a millimetre.
    assert together.symmetric_difference(field).area < 1e-3 * field.length
    # Borders are simplified after small parts were joined.
    assert min(shape.area for shape in shapes) >= 0.9 * min(smallest, field.area) - CELL_M**2
    assert {zone.number for zone in zones} <= set(range(1, classes + 1))


def test_zones_of_two_halves():
    field = shapely.box(-28, -20, 28, 20)
    columns = np.broadcast_to(np.where(np.arange(SIZE) < SIZE / 2, 0.12, 0.30), (SIZE, SIZE))
    dry, wet = management_zones(a_map(columns, field), field, [20.0])
    assert (dry.number, wet.number) == (1, 2)
    assert (dry.mean, wet.mean) == pytest.approx((12.0, 30.0))
    assert dry.area_ha == pytest.approx(0.112, rel=0.03)
    assert (dry.certainty.sure, dry.other) == (1.0, 0.0)
    assert dry.shape.centroid.x < 0 < wet.shape.centroid.x
    assert len(dry.shape.exterior.coords) < 12, "a straight border has few corners"


def test_a_field_of_two_parts_has_zones_in_both():
    field = shapely.union_all([shapely.box(-28, -28, 10, 28), shapely.box(20, -4, 28, 4)])
    rows = np.broadcast_to(np.where(np.arange(SIZE) < SIZE / 2, 0.12, 0.30)[:, None], (SIZE, SIZE))
    zones = management_zones(a_map(rows, field), field, [20.0], 50.0)
    assert sum(zone.shape.area for zone in zones) == pytest.approx(field.area)
    assert shapely.union_all([zone.shape for zone in zones]).equals(field)
    small = [zone for zone in zones if zone.shape.centroid.x > 20]
    assert len(small) == 1, "halves of 32 m2 are one zone"
    assert len(zones) == 3


def test_an_area_out_of_range_is_refused():
    field = shapely.box(-20, -20, 20, 20)
    with pytest.raises(InputError, match="is no area"):
        management_zones(a_map(np.full((SIZE, SIZE), 0.2), field), field, [], -1.0)


def test_limits_of_a_flat_map_do_not_divide_it():
    assert thirds([0.2, np.nan, 0.2]).size == 0
    np.testing.assert_allclose(thirds(np.arange(10.0)), [3, 6])
