from __future__ import annotations

import json

import numpy as np
import pytest
from shapely.geometry import shape

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid, Samples, Variogram, make_soil_map
from soilmoist_ros.reporting import write_samples


def refuse(constant):
    raise AssertionError(f"{constant} is not JSON")


def load(path):
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.fixture(scope="module")
def collection(make_run, tmp_path_factory):
    return load(write_samples(tmp_path_factory.mktemp("gj") / "samples.geojson", make_run()))


def kinds(collection):
    return [feature["properties"]["kind"] for feature in collection["features"]]


def test_kinds(collection):
    assert kinds(collection) == ["field", "track", *["sample"] * 12]
    assert collection["type"] == "FeatureCollection"


def test_polygon_is_right_handed_with_its_hole(collection):
    field = shape(collection["features"][0]["geometry"])
    assert field.exterior.is_ccw
    assert [ring.is_ccw for ring in field.interiors] == [False]
    assert collection["features"][0]["properties"]["area_m2"] == pytest.approx(1106.5)


def test_places_are_rounded_and_lead_back(collection, the_map):
    lon_lat = np.array([f["geometry"]["coordinates"] for f in collection["features"][2:]])
    assert np.array_equal(lon_lat, np.round(lon_lat, 7))
    back = LocalFrame(53.27, -0.52).to_local(lon_lat[:, 1], lon_lat[:, 0])
    np.testing.assert_allclose(back, the_map.samples.xy, atol=0.01)


def test_sample_values(collection, the_map):
    found = collection["features"][2]["properties"]
    rate = the_map.samples.rate_cps[0]
    assert found["raw_counts"] == the_map.samples.counts[0]
    assert found["rate_cps"] == pytest.approx(rate)
    assert found["rate_sd_cps"] == pytest.approx(rate / np.sqrt(found["raw_counts"]))
    assert found["vwc"] == pytest.approx(float(the_map.curve.vwc(rate)))


def test_bbox_holds_everything(collection):
    west, south, east, north = collection["bbox"]
    for feature in collection["features"]:
        x0, y0, x1, y1 = shape(feature["geometry"]).bounds
        assert west <= x0 <= x1 <= east
        assert south <= y0 <= y1 <= north


def test_undefined_is_null(make_run, steep, uncalibrated, tmp_path):
    for soil in (steep, uncalibrated):
        found = load(write_samples(tmp_path / "s.geojson", make_run(soil_map=soil)))
        values = [f["properties"]["vwc"] for f in found["features"] if f["properties"]["kind"] == "sample"]
        assert None in values


def test_nothing_counted_and_nowhere_moved(make_run, the_map, tmp_path):
    soil = make_soil_map(Samples([(1.0, 2.0)], [0], [10.0]), the_map.grid, Variogram("gaussian", 0, 9, 1))
    found = load(write_samples(tmp_path / "s.geojson", make_run(soil_map=soil, track=())))
    assert kinds(found) == ["field", "sample"]
    assert found["features"][1]["properties"]["rate_cps"] == 0
    assert found["features"][1]["properties"]["rate_sd_cps"] is None


def test_field_across_the_antimeridian_is_cut(make_run, tmp_path):
    run = make_run(frame=LocalFrame(-17.0, 180.0))
    found = load(write_samples(tmp_path / "s.geojson", run))
    west, _, east, _ = found["bbox"]
    assert west > 179
    assert east < -179
    field, track = (shape(f["geometry"]) for f in found["features"][:2])
    assert field.geom_type == "MultiPolygon"
    assert all(part.bounds[2] - part.bounds[0] < 0.001 for part in field.geoms)
    assert all(part.exterior.is_ccw for part in field.geoms)
    assert track.geom_type == "MultiLineString"


def test_no_go_area_over_the_edge(make_run, map_of, tmp_path):
    soil = map_of(holes=[[(10.0, -40.0), (30.0, -40.0), (30.0, 0.0), (10.0, 0.0)]])
    found = load(write_samples(tmp_path / "s.geojson", make_run(soil_map=soil)))
    assert shape(found["features"][0]["geometry"]).is_valid
    assert isinstance(soil.grid, FieldGrid)
