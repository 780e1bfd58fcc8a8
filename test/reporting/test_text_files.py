# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import shape

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation import LocalFrame, csv_text, text_of_csv
from soilmoist_ros.mapping import Samples, Variogram, make_soil_map
from soilmoist_ros.reporting.opened_run import OpenedRun
from soilmoist_ros.reporting.text_files import write_samples, write_visits


def refuse(constant):
    raise AssertionError(f"{constant} is not JSON")


def load(path):
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.fixture(scope="module")
def collection(make_run, tmp_path_factory):
    return load(write_samples(tmp_path_factory.mktemp("gj") / "samples.geojson", make_run()))


def kinds(collection):
    return [feature["properties"]["kind"] for feature in collection["features"]]


def of_kind(collection, kind):
    return [feature for feature in collection["features"] if feature["properties"]["kind"] == kind]


def test_polygon_is_right_handed_with_its_hole(collection):
    field = shape(collection["features"][0]["geometry"])
    assert field.exterior.is_ccw
    assert [ring.is_ccw for ring in field.interiors] == [False]
    assert collection["features"][0]["properties"]["area_m2"] == pytest.approx(1106.5)


def test_places_are_rounded_and_lead_back(collection, the_map):
    lon_lat = np.array([f["geometry"]["coordinates"] for f in of_kind(collection, "sample")])
    assert np.array_equal(lon_lat, np.round(lon_lat, 7))
    back = LocalFrame(53.27, -0.52).to_local(lon_lat[:, 1], lon_lat[:, 0])
    np.testing.assert_allclose(back, the_map.samples.xy, atol=0.01)


def test_sample_values(collection, the_map):
    found = of_kind(collection, "sample")[0]["properties"]
    rate = the_map.samples.rate_cps[0]
    assert found["raw_counts"] == the_map.samples.counts[0]
    assert found["rate_cps"] == pytest.approx(rate)
    assert found["rate_sd_cps"] == pytest.approx(rate / np.sqrt(found["raw_counts"]))
    assert found["vwc"] == pytest.approx(float(the_map.curve.vwc(rate)))
    assert found["vwc_p05"] < found["vwc"] < found["vwc_p95"]


def test_nothing_counted_and_nowhere_moved(make_run, the_map, tmp_path):
    soil = make_soil_map(Samples([(1.0, 2.0)], [0], [10.0]), the_map.grid, Variogram("gaussian", 0, 9, 1))
    found = load(write_samples(tmp_path / "s.geojson", make_run(soil_map=soil, track=())))
    assert kinds(found) == ["field", "no_go", "sample"]
    (sample,) = of_kind(found, "sample")
    assert sample["properties"]["rate_cps"] == 0
    assert sample["properties"]["rate_sd_cps"] is None


def test_a_field_on_the_antimeridian_is_one_piece(make_run, tmp_path):
    found = load(write_samples(tmp_path / "s.geojson", make_run(frame=LocalFrame(-17.0, 180.0))))
    west, _, east, _ = found["bbox"]
    assert 179.99 < west < 180 < east < 180.01
    assert all(shape(of_kind(found, kind)[0]["geometry"]).length < 0.01 for kind in ("field", "track"))


# The tables of a mission ----------------------------------------------------------------------------------------


@given(st.text(max_size=8), st.sampled_from("=+-@\t'＝"))
def test_no_text_is_a_formula_of_a_spreadsheet_and_every_text_comes_back(text, first):
    for name in (text, first + text, f'{first}HYPERLINK("http://x","y")'):
        cell = csv_text(name)
        assert not cell.startswith(("=", "+", "-", "@", "\t", "\r", "＝"))
        assert text_of_csv(cell) == name


def test_numbers_stay_numbers_beside_a_formula(tmp_path):
    visit = Visit("=1+2", -1.5, -2.0, 0.0, 60.0, 262, "@SUM(A1)")
    path = write_visits(tmp_path / "visits.csv", SimpleNamespace(visits=[visit]))
    (row,) = csv.DictReader(path.read_text().splitlines())
    assert (row["name"], row["reason"], row["x_m"], row["y_m"]) == ("'=1+2", "'@SUM(A1)", "-1.5", "-2")
    (tmp_path / "summary.json").write_text("{}")
    (again,) = OpenedRun(tmp_path).visits
    assert (again.name, again.reason, again.x_m) == ("=1+2", "@SUM(A1)", -1.5)
