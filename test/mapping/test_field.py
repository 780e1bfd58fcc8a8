# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError, LocalFrame, config_folder, resource_names
from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.mapping.grid import default_cell_m

SQUARE = "datum: {latitude_deg: 53.27, longitude_deg: -0.52}\n"


def write(tmp_path, text):
    path = tmp_path / "field.yaml"
    path.write_text(text)
    return path


def test_every_shipped_field_is_valid():
    names = resource_names("fields")
    assert names
    for name in names:
        load_field(config_folder() / "fields" / f"{name}.yaml")


def test_polygon_in_metres_with_a_closing_vertex_and_a_no_go_area(tmp_path):
    text = SQUARE + "polygon: [[0,0],[60,0],[60,50],[0,50],[0,0]]\nno_go: [[[10,10],[20,10],[20,20]]]\ncell_m: 2\n"
    field = load_field(write(tmp_path, text))
    np.testing.assert_array_equal(field.polygon, [[0, 0], [60, 0], [60, 50], [0, 50]])
    assert len(field.no_go) == 1
    assert field.cell_m == 2


def test_boundary_in_degrees_and_in_geojson_are_the_same_field(tmp_path):
    frame = LocalFrame(-33.9, 18.4)
    corners = np.array([[-100.0, -50.0], [100.0, -50.0], [100.0, 50.0], [-100.0, 50.0]])
    lonlat = frame.to_geographic(corners)[:, ::-1].tolist()
    datum = "datum: {latitude_deg: -33.9, longitude_deg: 18.4}\n"
    listed = load_field(write(tmp_path, datum + f"polygon_lonlat: {lonlat}\n"))
    feature = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[*lonlat, lonlat[0]]]}}
    (tmp_path / "f.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    drawn = load_field(write(tmp_path, datum + "geojson: f.geojson\n"))
    np.testing.assert_allclose(listed.polygon, corners, atol=1e-6)
    np.testing.assert_allclose(drawn.polygon, corners, atol=1e-6)
    undated = load_field(write(tmp_path, "geojson: f.geojson\n"))
    np.testing.assert_allclose(undated.polygon, corners, atol=0.02)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SQUARE, "give one boundary: .* but there is none"),
        (SQUARE + "polygon: [[0,0],[1,0],[1,1]]\ngeojson: a.json\n", "but there are 2: polygon, geojson"),
        ("polygon: [[0,0],[1,0],[1,1]]\n", "needs a 'datum'"),
        (SQUARE + "polygon: [[0,0],[10,10],[10,0],[0,10]]\n", "not a simple polygon: Self-intersection"),
        (SQUARE + "polygon: [[0,0],[1,0],[2,0]]\n", "is not a simple polygon|encloses no area"),
        (SQUARE + "polygon: [[0,0],[1,0]]\n", "at least 3 items"),
        (SQUARE + "polygon_lonlat: [[53,200],[1,0],[1,1]]\n", "is not \\[longitude, latitude\\] in degrees"),
        (SQUARE + "geojson: missing.json\n", "cannot be read"),
        (SQUARE + "geojson: /dev/null\n", "not a regular file"),
        (SQUARE + "polgon: [[0,0],[1,0],[1,1]]\n", "did you mean 'polygon'"),
        ("datum: {latitude_deg: -97.4, longitude_deg: 38.7}\n",
         "-97.4 -> check whether latitude and longitude are"),
        ("datum: {latitude_deg: 53,2, longitude_deg: -0.5}\n", "unknown key '2' -> write decimals with a point"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        load_field(write(tmp_path, text))


def test_a_border_alone_is_a_field_of_its_name(tmp_path):
    path, ring = tmp_path / "east.geojson", [[13.0, 52.0], [13.01, 52.0], [13.01, 52.01], [13.0, 52.0]]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    field, written = load_field(path), load_field(write(tmp_path, "name: east\ngeojson: east.geojson\n"))
    assert (field.name, field.frame) == ("east", written.frame)
    np.testing.assert_array_equal(field.polygon, written.polygon)
    (tmp_path / "empty.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    for unusable in ("empty.geojson", "absent.geojson"):
        with pytest.raises(InputError, match=unusable):
            load_field(tmp_path / unusable)


def test_a_field_and_a_cell_size_make_one_grid(tmp_path):
    field = load_field(write(tmp_path, SQUARE + "polygon: [[0,0],[250,0],[250,250],[0,250]]\n"))
    of_mapper = field.grid(None, footprint_radius_m=40.0)
    assert field.grid().cell_m != of_mapper.cell_m == 5.0, "the footprint decides"
    assert field.grid(of_mapper.cell_m) is of_mapper, "with the cell size of a map, everybody has its grid"


def test_a_cell_size_that_makes_no_grid_is_named(tmp_path):
    field = load_field(write(tmp_path, "name: plot\n" + SQUARE + "polygon: [[0,0],[60,0],[60,50],[0,50]]\n"))
    with pytest.raises(InputError, match=r"the field 'plot' cannot be gridded: .* -> change the cell size"):
        field.grid(500.0)
    assert repr(field) == "Field('plot', 60 m x 50 m, 0 no-go areas)"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("polygon: [[0,0],[0.001,0],[0.001,0.001]]\n",
         "5e-07 m2, smaller than any footprint .*'polygon_lonlat' in deg"),
        ("polygon: [[-0.52,53.27],[-0.519,53.27],[-0.519,53.271]]\n",
         r"m2, .* -> the corners look like degrees: give \[longitude, latitude\] under 'polygon_lonlat'"),
        ("polygon: [[0,0],[40000,0],[40000,40000],[0,40000]]\n", "encloses 1,600 km2, too large for a survey"),
        ("polygon: [[398000,5902000],[398100,5902000],[398100,5902100]]\n",
         "5,915 km from the datum .*map projection"),
        ("polygon_lonlat: [[53.27,-0.52],[53.271,-0.52],[53.271,-0.521]]\n",
         "7,748 km from the datum -> longitude comes first in corners, west is negative: check them and"),
        ("polygon_lonlat: [[0.52,53.27],[0.521,53.27],[0.521,53.271]]\n",
         "69 km from the datum -> .* check them and 'datum'$"),
        ("polygon_lonlat: [[53.27,-100.5],[53.3,-100.5],[53.3,-100.6]]\n", "longitude comes first"),
    ],
)  # fmt: skip
def test_mistakes_of_units_order_and_datum_are_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        load_field(write(tmp_path, SQUARE + text))


BIG = "polygon: [[0,0],[60,0],[60,50],[0,50]]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("no_go: [[[-0.52,53.27],[-0.519,53.27],[-0.519,53.271]]]",
         "lies 3 m from .*looks like .longitude, latitude"),
        ("no_go: [[[53.27,-0.52],[53.271,-0.52],[53.271,-0.521]]]", "lies .* looks like degrees, latitude first"),
        ("no_go: [[[398000,5902000],[398100,5902000],[398100,5902100]]]",
         "5,915 km .*not as coordinates of a map"),
        ("no_go: [[[155000,43000],[155009,43000],[155009,43009]]]", "161 km .*not as coordinates of a map"),
        ("no_go: [[10,10],[20,10],[20,20]]", r":3 \[no_go\]: is a list of areas, each a list of corners"),
        ("no_go: [{name: pond, polygon: [[10,10],[20,10],[20,20]]}]", "is a list of areas, each a list of"),
        ("no_go: pond.geojson", "is a list of areas, each a list of .*, but it is 'pond.geojson'"),
        ("no_go: [[[10,10,0],[20,10],[20,20]]]", r"list should have at most 2 items, not 3 -> .* \[1, 2\]"),
        ("no_go: [[[70,10],[80,10],[80,20]]]", "no-go area 1 lies 10 m from the field -> give it in metres east"),
        ("no_go: [[[60.3,10],[80,10],[80,20]]]", "0.3 m from the field -> .* so that it touches the field"),
        ("no_go: [[[20,55],[30,55],[30,60]]]", "lies 5 m from the field -> with x and y of each corner swapped"),
        ("no_go: [[[20,30],[20.05,30],[20.05,30.05]]]", "no-go area 1 encloses 0.0013 m2"),
        ("no_go: [[[20,30],[20.9,30],[20.9,30.9],[20,30.9]]]",
         "0.81 m2, less than 1 m2 -> give metres; draw a post"),
        ("no_go: [[[130,98],[140,98],[140,108]]]", "85 m from the field -> .* read as feet, it touches"),
        ("no_go: [[[-1,-1],[99,-1],[99,99],[-1,99]]]", "no-go area 1 covers the whole field"),
        ("no_go: [[[-1,-1],[30,-1],[30,99],[-1,99]],[[30,-1],[70,-1],[70,99],[30,99]]]",
         "the 2 no-go areas cover"),
        ("no_go: [[[10,10],[20,20],[20,10],[10,20]]]", "no-go area 1 is not a simple polygon: Self-intersection"),
        ("no_go_lonlat: [[[150,-40],[150.1,-40],[150.1,-40.1]]]", "not on the field's side of the earth"),
        ("no_go_lonlat: [[[-0.5199,53.2701],[-0.5199,53.27010001],[-0.51990001,53.2701]]]",
         "m2 -> draw a post or"),
        ("no_go_lonlat: [[[-0.53,53.27],[-0.529,53.27],[-0.529,53.271]]]", "600 m from .* longitude comes first"),
        ("no_go_lonlat: [[[53.27,-100.5],[53.3,-100.5],[53.3,-100.6]]]", "longitude comes first"),
        ("no_go_lonlat: [[[53.27,-0.52],[53.271,-0.52],[53.271,-0.521]]]", "longitude comes first"),
    ],
)  # fmt: skip
def test_a_no_go_area_of_another_place_or_unit_fences_off_nothing_and_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        load_field(write(tmp_path, SQUARE + BIG + text))


def test_a_no_go_area_in_degrees_and_one_that_reaches_over_the_border(tmp_path):
    ring = LocalFrame(53.27, -0.52).to_geographic([[50, 10], [70, 10], [70, 20]])[:, ::-1].tolist()
    field = load_field(write(tmp_path, SQUARE + BIG + f"no_go_lonlat: [{ring}]"))
    np.testing.assert_allclose(field.no_go[0], [[50, 10], [70, 10], [70, 20]], atol=1e-6)
    post = LocalFrame(53.27, -0.52).to_geographic([[5, 5], [5.3, 5], [5.3, 5.3]])[:, ::-1].tolist()
    assert len(load_field(write(tmp_path, SQUARE + BIG + f"no_go_lonlat: [{post}]")).no_go) == 1


def test_a_key_of_no_go_areas_whose_areas_are_comments_has_none(tmp_path):
    assert load_field(write(tmp_path, SQUARE + BIG + "no_go:\n#  - [[10,10],[20,10],[20,20]]\n")).no_go == ()


def test_small_plots_and_whole_farms_are_fields(tmp_path):
    assert load_field(write(tmp_path, SQUARE + "polygon: [[0,0],[2,0],[2,2],[0,2]]\n")).extent_m == 2.0
    assert load_field(write(tmp_path, SQUARE + "polygon: [[0,0],[9e3,0],[9e3,9e3],[0,9e3]]\n")).extent_m == 9e3


def test_covariates_start_at_the_field_file(tmp_path):
    text = SQUARE + (
        "polygon: [[0,0],[60,0],[60,50],[0,50]]\n"
        "covariates:\n  - image.tif:ndvi\n  - {file: maps/relief.tif, derive: [slope, aspect], name: relief}\n"
    )
    image, relief = load_field(write(tmp_path, text)).covariates
    assert (image.path, image.band) == (tmp_path / "image.tif", "ndvi")
    assert (relief.path, relief.derive, relief.label) == (
        tmp_path / "maps/relief.tif", ("slope", "aspect"), "relief",
    )  # fmt: skip
    with pytest.raises(InputError, match="'elevation', 'slope'"):
        load_field(write(tmp_path, text.replace("[slope,", "[slop,")))


# Grids ---------------------------------------------------------------------------------------------------------

SQUARE_GRID = [[0, 0], [10, 0], [10, 10], [0, 10]]


def test_cells_outside_and_in_holes_are_left_out():
    grid = FieldGrid.from_polygon([[0, 0], [10, 0], [0, 10]], 1.0, holes=[[[1, 1], [3, 1], [3, 3], [1, 3]]])
    row, column = np.indices(grid.shape)
    inside = (row + column + 1 < 10) & ~((row >= 1) & (row < 3) & (column >= 1) & (column < 3))
    np.testing.assert_array_equal(grid.mask, inside)
    assert len(grid.holes) == 1
    assert len(grid.cells) == inside.sum()
    assert (grid.cells.sum(axis=1) < 10).all()


def test_cells_lie_on_multiples_of_their_size_and_cover_the_field():
    grid = FieldGrid.from_polygon(np.add(SQUARE_GRID, [0.3, -7.7]), 0.5)
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
        (SQUARE_GRID, 100 + 400 + np.pi * 100),
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
        ([[0, 0, 0], [1, 1, 1], [1, 0, 0]], 1.0, r"must have shape \(k, 2\)"),
        ([[0, 0], [np.nan, 1], [1, 0]], 1.0, "not finite"),
        (SQUARE_GRID, 11.0, "larger than the field of 10 m x 10 m; use smaller cells"),
        ([[0, 0], [10, 0], [0, 0.1]], 5.0, "no cell centre lies inside"),
        (SQUARE_GRID, 0.001, "gives 1e.08 cells.*use larger cells"),
        (SQUARE_GRID, 0.0, "cell_m must be > 0"),
        (SQUARE_GRID, np.nan, "cell_m must be > 0"),
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
