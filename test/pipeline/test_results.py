# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""JSON files of a run that were changed by others."""

import json

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.pipeline.results import curve_of, read_features, read_summary, shape_of
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve

GOOD = {
    "datum": {"latitude_deg": 52.0, "longitude_deg": 5},
    "survey_start_utc": "2026-05-01T08:00:00Z",
    "first_stamp_s": 0.0,
    "properties": [{"name": "moisture", "label": None}],
    "calibration": None,
    "a key of another version": [1],
}


def test_a_summary_comes_back_as_it_was_written(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(GOOD))
    assert read_summary(tmp_path) == GOOD


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("datum", {"latitude_deg": 52.0}),
        ("datum", {"latitude_deg": "52", "longitude_deg": 5.0}),
        ("datum", {"latitude_deg": float("nan"), "longitude_deg": 5.0}),
        ("datum", {"latitude_deg": 90.1, "longitude_deg": 5.0}),
        ("last_stamp_s", 1e300),
        ("survey_start_utc", "yesterday"),
        ("mission", [1]),
        ("properties", ["moisture"]),
        ("corrections", [{"parameters": {}}]),
        ("cell_m", 0),
        ("irrigation", {"zone_limits_vwc": 0.3}),
    ],
)
def test_a_part_of_another_kind_is_named(tmp_path, key, value):
    (tmp_path / "summary.json").write_text(json.dumps({**GOOD, key: value}))
    with pytest.raises(InputError, match=rf"summary.json \[{key}.*-> restore the file"):
        read_summary(tmp_path)


@pytest.mark.parametrize(
    "curve", [CalibrationCurve(7.0, 1.4, 0.02), UniversalCurve(7.0, 1.4, 0.02, 0.01, 0.1, 0.0, 8.0, "uranos_thl")]
)
def test_a_calibration_comes_back_as_it_was_written(tmp_path, curve):
    more = {"n0_sd_cps": curve.n0_sd_cps or None, "lowest_rate_cps": curve.lowest_rate_cps, "source": "6 cores"}
    (tmp_path / "summary.json").write_text(json.dumps({**GOOD, "calibration": {**curve.parameters, **more}}))
    assert curve_of(read_summary(tmp_path), tmp_path) == curve
    assert curve_of(GOOD, tmp_path) is None


@pytest.mark.parametrize("key", ["curve", "n0_cps", "bulk_density_gcm3"])
def test_a_calibration_with_a_part_missing_is_refused(tmp_path, key):
    calibration = {**CalibrationCurve(7.0, 1.4).parameters, key: None}
    with pytest.raises(InputError, match=rf"summary\.json.*calibration.*{key}.*-> restore the file"):
        curve_of({"calibration": calibration}, tmp_path)


@pytest.mark.parametrize("feature", [5, {}, {"properties": {}}, {"properties": {}, "geometry": None}])
def test_a_feature_has_a_geometry_and_properties(tmp_path, feature):
    path = tmp_path / "samples.geojson"
    path.write_text(json.dumps({"features": [feature]}))
    with pytest.raises(InputError, match=r"features\.0"):
        read_features(path)


@pytest.mark.parametrize(
    "geometry", [{}, {"type": "Polygon"}, {"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]}, {"type": "Cube"}]
)
def test_a_damaged_geometry_is_refused(tmp_path, geometry):
    with pytest.raises(InputError, match="damaged geometry"):
        shape_of({"geometry": geometry}, tmp_path / "samples.geojson")
