# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GeoPackage and shapefiles read by GDAL: layers.py."""

from __future__ import annotations

import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import Geod, Transformer

from soilmoist_ros.reporting.exports.layers import write_zones
from soilmoist_ros.reporting.exports.qgis import write_geopackage
from soilmoist_ros.reporting.exports.source import ExportSettings
from soilmoist_ros.reporting.geometry import field_polygon

pytestmark = pytest.mark.slow  # the run that all export takes long to make

LAYERS = {
    "field": "MultiPolygon", "track": "LineString", **dict.fromkeys(("zones", "zones_salt", "no_go"), "Polygon"),
    **dict.fromkeys(("records", "quarantined", "samples", "records_salt", "samples_salt", "visits"), "Point"),
}  # fmt: skip


@pytest.fixture(scope="module")
def gpkg(exported, tmp_path_factory):
    (path,) = write_geopackage(exported.source, tmp_path_factory.mktemp("gpkg"), ExportSettings())
    return path


def read(path, layer=None):
    about, _, wkb, columns = pyogrio.raw.read(path, layer=layer)
    return about, shapely.from_wkb(wkb), dict(zip(about["fields"], columns, strict=True))


def local(exported, shapes, crs):
    move = Transformer.from_crs(crs, exported.run.frame.crs, always_xy=True)
    return shapely.transform(shapes, lambda xy: np.column_stack(move.transform(*xy.T)))


def test_layers_and_reference_systems(gpkg):
    assert dict(pyogrio.list_layers(gpkg).tolist()) == LAYERS
    assert {pyogrio.read_info(gpkg, layer=name)["crs"] for name in LAYERS} == {"EPSG:32630"}


def test_samples_have_their_places_and_values(gpkg, exported):
    _, shapes, columns = read(gpkg, "samples")
    samples = exported.run.soil_map.samples
    xy = shapely.get_coordinates(local(exported, shapes, "EPSG:32630"))
    np.testing.assert_allclose(xy, samples.xy, atol=0.02)
    assert columns["raw_counts"].tolist() == samples.counts.tolist()
    np.testing.assert_allclose(columns["vwc"], exported.run.soil_map.curve.vwc(samples.rate_cps), rtol=1e-9)
    assert (columns["vwc_p05"] < columns["vwc_p95"]).all()


def test_records_in_quarantine_have_a_layer_with_the_reason(gpkg, exported):
    _, shapes, columns = read(gpkg, "quarantined")
    assert columns["reason"].tolist() == ["impossible_count"]
    assert columns["raw_counts"].tolist() == [99999]
    np.testing.assert_allclose(shapely.get_coordinates(local(exported, shapes, "EPSG:32630")), [(3, 4)], atol=1e-6)
    _, shapes, columns = read(gpkg, "records")
    assert len(shapes) == len(exported.run.track)
    assert "reason" not in columns
    _, shapes, _ = read(gpkg, "records_salt")
    assert sum(shape.is_empty for shape in shapes) == 1, "a record without a place is kept"


def test_field_and_no_go_area(gpkg, exported):
    _, (field,), columns = read(gpkg, "field")
    expected = field_polygon(exported.run.soil_map.grid)
    assert columns["area_ha"][0] == pytest.approx(expected.area / 1e4, rel=1e-3)
    assert local(exported, field, "EPSG:32630").symmetric_difference(expected).area < 0.01 * expected.length
    assert columns["start_utc"][0] == np.datetime64("2023-11-14T22:07:37", "ms")
    _, (no_go,), _ = read(gpkg, "no_go")
    assert field.intersection(no_go).area < 1.0
    assert no_go.area == pytest.approx(56.0, rel=2e-3)


def test_zones_are_single_valid_polygons_with_their_areas(exported, tmp_path):
    paths = write_zones(exported.source, tmp_path, ExportSettings())
    assert [path.name for path in paths] == ["zones.zip", "zones_salt.zip"]
    assert len(list(tmp_path.iterdir())) == 2
    about, shapes, columns = read(paths[0])
    assert about["crs"] == "EPSG:4326"
    assert about["geometry_type"] == "Polygon"
    assert all(shape.geom_type == "Polygon" and shape.is_valid for shape in shapes)
    assert all(len(name) <= 10 and name.isascii() for name in columns)
    areas = [abs(Geod(ellps="WGS84").geometry_area_perimeter(shape)[0]) / 1e4 for shape in shapes]
    np.testing.assert_allclose(columns["AREA_HA"], areas, atol=6e-5)
    assert sum(areas) == pytest.approx(field_polygon(exported.run.soil_map.grid).area / 1e4, rel=1e-3)
    np.testing.assert_allclose(columns["WATER_MM"], 3 * columns["VWC_PCT"], atol=0.06)
    assert set(columns["DATE"]) == {np.datetime64("2023-11-14")}
    mean = np.average(columns["VWC_PCT"], weights=areas)
    assert mean == pytest.approx(100 * np.nanmean(exported.run.soil_map.vwc), rel=0.02)
    _, _, columns = read(paths[1])
    assert "RATE_CPS" in columns
    assert "WATER_MM" not in columns
