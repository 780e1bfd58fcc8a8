# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a keep-out mask."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")
pytest.importorskip("nav_msgs")
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.point_cloud import to_seconds
from msg_adapters.soil_map import (
    OUTSIDE,
    mask_to_message,
    soil_map_from_message,
    soil_map_to_message,
    uncertainty_to_message,
)
from soilmoist_ros.exploration.guard.fence import KeepoutMask
from soilmoist_ros.mapping import Bands, FieldGrid, Samples, Variogram, make_soil_map, map_cells
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

STAMP_S = 1780000000.1234567
VARIOGRAM = Variogram("matern32", 0.01, 12.0, 0.2)


def a_map(grid, curve=None, **options):
    places = grid.cells[:: max(1, len(grid.cells) // 5)] + 0.3
    samples = Samples(places, np.full(len(places), 4000), np.full(len(places), 1000.0))
    return make_soil_map(samples, grid, VARIOGRAM, curve, **options)


def rectangle(west, south, columns, rows, cell_m, hole=False):
    east, north = west + columns * cell_m, south + rows * cell_m
    corners = [(west, south), (east, south), (east, north), (west, north)]
    middle = (west + east) / 2, (south + north) / 2
    offsets = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * cell_m
    return FieldGrid.from_polygon(corners, cell_m, [offsets + middle] if hole else [])


grids = st.builds(
    rectangle, st.integers(-400, 400).map(float), st.integers(-400, 400).map(float), st.integers(5, 12),
    st.integers(5, 12), st.sampled_from([0.5, 1.0, 2.5, 10.0]), st.booleans(),
)  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(grids, st.sampled_from([None, CalibrationCurve(6.0, 1.4)]))
def test_a_map_comes_back_in_32_bits_over_the_wire(grid, curve):
    soil_map = a_map(grid, curve)
    wire = serialize_message(soil_map_to_message(grid, soil_map, STAMP_S, "field"))
    message = deserialize_message(wire, PointCloud2)
    cells = soil_map_from_message(message)
    assert cells.tobytes() == map_cells(grid, soil_map).tobytes()
    for name in Bands._fields:
        np.testing.assert_array_equal(cells[name], getattr(soil_map, name).astype(np.float32))
    np.testing.assert_array_equal(cells[grid.mask]["x"], grid.cells[:, 0])
    np.testing.assert_array_equal(cells[grid.mask]["y"], grid.cells[:, 1])
    assert not cells[grid.mask]["z"].any()
    assert all(np.isnan(cells[~grid.mask][name]).all() for name in cells.dtype.names)
    assert (message.height, message.width) == grid.shape
    assert message.row_step == message.point_step * message.width
    assert message.is_dense == grid.mask.all()
    assert (to_seconds(message.header.stamp), message.header.frame_id) == (STAMP_S, "field")


@settings(max_examples=25, deadline=None)
@given(grids, st.booleans())
def test_the_uncertainty_is_a_share_of_not_knowing(grid, keep_nugget):
    soil_map = a_map(grid, keep_nugget=keep_nugget)
    wire = serialize_message(uncertainty_to_message(grid, soil_map, STAMP_S))
    message = deserialize_message(wire, OccupancyGrid)
    values = np.array(message.data, np.int8).reshape(message.info.height, message.info.width)
    unknown = np.sqrt(0.2 if keep_nugget else 0.19)
    inside = grid.mask
    np.testing.assert_array_equal(values[~inside], OUTSIDE)
    np.testing.assert_allclose(
        values[inside], np.minimum(100 * soil_map.rate_sd[inside] / unknown, 100), atol=0.51
    )
    corner = message.info.origin.position
    x_m = corner.x + message.info.resolution * (np.arange(message.info.width) + 0.5)
    y_m = corner.y + message.info.resolution * (np.arange(message.info.height) + 0.5)
    np.testing.assert_allclose(x_m, grid.x_m)
    np.testing.assert_allclose(y_m, grid.y_m)
    assert message.info.origin.orientation.w == 1.0
    assert message.info.map_load_time == message.header.stamp


def test_before_the_first_map_nothing_is_known():
    grid = rectangle(0.0, 0.0, 8, 8, 1.0, hole=True)
    cells = soil_map_from_message(soil_map_to_message(grid, None, 0.0))
    assert np.isnan(cells["rate"]).all()
    np.testing.assert_array_equal(np.isfinite(cells["x"]), grid.mask)
    assert set(uncertainty_to_message(grid, None, 0.0).data) == {-1, 100}


# Messages of a keep-out mask ------------------------------------------------------------------------------------


def test_a_mask_is_an_occupancy_grid():
    mask = KeepoutMask(np.array([[0, 100, 0], [100, 100, 0]], np.int8), 0.25, (-3.5, 7.25))
    message = deserialize_message(serialize_message(mask_to_message(mask, 4.5, "navigation")), OccupancyGrid)
    assert (message.info.width, message.info.height, message.info.resolution) == (3, 2, 0.25)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-3.5, 7.25)
    assert message.info.origin.orientation.w == 1.0
    assert list(message.data) == [0, 100, 0, 100, 100, 0], "row by row, the lowest y first"
    assert (message.header.frame_id, message.header.stamp.sec) == ("navigation", 4)
