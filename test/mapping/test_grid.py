# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.mapping.grid import default_cell_m

SQUARE = [[0, 0], [10, 0], [10, 10], [0, 10]]


def test_a_rectangle_is_full():
    grid = FieldGrid.from_polygon([[0, 0], [60, 0], [60, 50], [0, 50]], 1.0)
    assert grid.shape == (50, 60)
    assert grid.mask.all()
    np.testing.assert_allclose(grid.x_m, np.arange(60) + 0.5)
    np.testing.assert_allclose(grid.y_m, np.arange(50) + 0.5)
    assert grid.area_m2 == 3000
    assert grid.polygons[0].shape == (4, 2)


def test_cells_outside_and_in_holes_are_left_out():
    grid = FieldGrid.from_polygon([[0, 0], [10, 0], [0, 10]], 1.0, holes=[[[1, 1], [3, 1], [3, 3], [1, 3]]])
    row, column = np.indices(grid.shape)
    inside = (row + column + 1 < 10) & ~((row >= 1) & (row < 3) & (column >= 1) & (column < 3))
    np.testing.assert_array_equal(grid.mask, inside)
    assert len(grid.holes) == 1
    assert len(grid.cells) == inside.sum()
    assert (grid.cells.sum(axis=1) < 10).all()


def test_a_field_may_have_several_parts():
    far = np.add(SQUARE, [30, 0])
    equal, mixed = FieldGrid.from_polygon([SQUARE, far], 1.0), FieldGrid.from_polygon([SQUARE, far[:3]], 1.0)
    assert equal.shape == (10, 40)
    assert equal.mask.sum() == 200
    assert not equal.mask[:, 10:30].any()
    assert mixed.mask.sum() == 145
    assert len(mixed.polygons) == 2


def test_cells_lie_on_multiples_of_their_size_and_cover_the_field():
    grid = FieldGrid.from_polygon(np.add(SQUARE, [0.3, -7.7]), 0.5)
    np.testing.assert_allclose((grid.x_m - 0.25) % 0.5, 0, atol=1e-12)
    assert grid.x_m[0] - 0.25 <= 0.3
    assert grid.x_m[-1] + 0.25 >= 10.3
    assert grid.y_m[0] - 0.25 <= -7.7
    assert grid.y_m[-1] + 0.25 >= 2.3


def test_to_raster_puts_values_where_their_cells_are():
    grid = FieldGrid.from_polygon([[0, 0], [10, 0], [0, 10]], 1.0)
    raster = grid.to_raster(grid.cells @ [1, 100])
    x, y = np.meshgrid(grid.x_m, grid.y_m)
    np.testing.assert_allclose(raster[grid.mask], (x + 100 * y)[grid.mask])
    assert np.isnan(raster[~grid.mask]).all()
    with pytest.raises(ValueError, match=r"values must have shape \(45,\), one per inside cell, got \(3,\)"):
        grid.to_raster([1, 2, 3])


@pytest.mark.parametrize(
    ("track", "area"),
    [
        ([[5, 5]], np.pi * 100),
        ([[0, 0], [50, 0], [100, 0]], 2000 + np.pi * 100),
        (SQUARE, 100 + 400 + np.pi * 100),
    ],
    ids=["one point", "collinear", "square"],
)
def test_a_track_is_widened_by_the_margin(track, area):
    grid = FieldGrid.from_track(track, margin_m=10.0, cell_m=0.5)
    assert grid.area_m2 == pytest.approx(area, rel=0.02)


@pytest.mark.parametrize(
    ("vertices", "cell_m", "message"),
    [
        ([[0, 0], [10, 10], [10, 0], [0, 10]], 1.0, "crosses itself"),
        ([[0, 0], [1, 1]], 1.0, "at least 3 vertices, got 2"),
        ([[0, 0], [1, 1], [0, 0]], 1.0, "at least 3 vertices, got 2"),
        ([[0, 0], [5, 5], [10, 10]], 1.0, "no area"),
        ([SQUARE, [[0, 0], [5, 5], [10, 10]]], 1.0, "polygon 2 has no area"),
        ([[0, 0, 0], [1, 1, 1], [1, 0, 0]], 1.0, r"must have shape \(k, 2\)"),
        ([[0, 0], [np.nan, 1], [1, 0]], 1.0, "not finite"),
        (SQUARE, 11.0, "larger than the field of 10 m x 10 m; use smaller cells"),
        ([[0, 0], [10, 0], [0, 0.1]], 5.0, "no cell centre lies inside"),
        (SQUARE, 0.001, "gives 1e.08 cells.*use larger cells"),
        (SQUARE, 0.0, "cell_m must be > 0"),
        (SQUARE, np.nan, "cell_m must be > 0"),
    ],
)
def test_bad_fields_are_refused(vertices, cell_m, message):
    with pytest.raises(ValueError, match=message):
        FieldGrid.from_polygon(vertices, cell_m)


@pytest.mark.parametrize(
    ("xy", "margin_m", "message"),
    [([], 5.0, "at least one point"), ([[0, np.nan]], 5.0, "all finite"), ([[0, 0]], 0.0, "margin_m must be > 0")],
)
def test_bad_tracks_are_refused(xy, margin_m, message):
    with pytest.raises(ValueError, match=message):
        FieldGrid.from_track(xy, margin_m, 1.0)


@pytest.mark.parametrize(
    ("extent_m", "radius_m", "cell_m"),
    [
        ((60, 50), 10, 1.0),  # fifty cells across
        ((210, 330), 10, 2.0),  # a quarter of the footprint
        ((3000, 2000), 10, 10.0),  # 70,000 cells
        ((3000, 2000), 200, 50.0),
        ((1.0, 1.0), 10, 0.02),
        ((500, 500), 8, 2.0),
    ],
)
def test_default_cell_size(extent_m, radius_m, cell_m):
    assert default_cell_m(extent_m, radius_m) == pytest.approx(cell_m)
