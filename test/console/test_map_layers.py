# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the map, and the sentence of its dose (map_layers.py)."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from matplotlib.image import imread

from soilmoist_ros.console.map_layers import LATER, LAYERS, MapLayers, live_dose
from soilmoist_ros.mapping import map_cells
from soilmoist_ros.pipeline import open_survey
from soilmoist_ros.reporting import irrigation
from soilmoist_ros.sensing import CountRecord

BANDS = ("x", "y", "z", "rate", "rate_sd", "vwc", "vwc_sd", "vwc_p05", "vwc_p95")


def cells(moisture=True):
    """Two columns and three rows of 2 m, empty ones around, and a cell outside the field in the north-east."""
    made = np.full((5, 4), np.nan, [(name, "<f4") for name in BANDS])
    part = made[1:4, 1:3]
    part["x"], part["y"] = np.meshgrid([11.0, 13.0], [1.0, 3.0, 5.0])
    part["rate"], part["rate_sd"] = np.arange(6).reshape(3, 2), 0.5
    if moisture:
        part["vwc"], part["vwc_sd"] = part["rate"] / 10, 0.05
    made[3, 2] = (np.nan,) * len(BANDS)
    return made


def test_a_picture_has_a_pixel_a_cell_with_north_up():
    layers = MapLayers(cells(), 3)
    assert layers.extent == [10.0, 14.0, 0.0, 6.0]
    picture = imread(io.BytesIO(layers.png("rate")), format="png")
    assert picture.shape == (3, 2, 4)
    assert (picture[..., 3] == [[1, 0], [1, 1], [1, 1]]).all()
    dry_to_wet = LAYERS[0].colours / 255
    assert picture[2, 0, :3] == pytest.approx(dry_to_wet[-1], abs=0.01), "the lowest rate is the wettest place"
    assert imread(io.BytesIO(layers.png("vwc")), format="png")[2, 0, :3] == pytest.approx(dry_to_wet[0], abs=0.01)


def test_limits_only_widen_and_moisture_is_in_percent_by_volume():
    widest, wetter, narrow = {}, cells(), cells()
    wetter["vwc"] += 0.2
    narrow["vwc"] = narrow["vwc"] / 10 + 0.3
    shown = [MapLayers(one, 1, widest).about["layers"][0] for one in (cells(), wetter, narrow)]
    assert {one["key"] for one in shown} == {"vwc"}
    low, high = zip(*(one["limits"] for one in shown), strict=True)
    assert low[0] == low[1] == low[2] < 5
    assert 35 < high[0] < high[1] == high[2]
    assert MapLayers(narrow, 1).about["layers"][0]["limits"][0] > 29


def test_values_at_a_place_are_those_of_its_cell_and_layers_are_those_that_have_values():
    layers = MapLayers(cells(), 1)
    assert layers.at(13.9, 2.1) == pytest.approx({"rate": 3.0, "rate_sd": 0.5, "vwc": 0.3, "vwc_sd": 0.05})
    for outside in ((13.0, 5.0), (9.9, 1.0), (11.0, 6.1), (float("nan"), 1.0)):
        assert layers.at(*outside) == {}
    dry = MapLayers(cells(moisture=False), 7)
    assert [layer["key"] for layer in dry.about["layers"]] == ["rate", "rate_sd"]
    assert dry.about["version"] == 7
    for one, key in ((dry, "vwc"), (layers, "x")):
        with pytest.raises(KeyError):
            one.png(key)


# The sentence of the dose that leads the page ------------------------------------------------------------------

FIELD = {
    "name": "meadow",
    "datum": {"latitude_deg": 52.0, "longitude_deg": 13.0},
    "polygon": [[0, 0], [120, 0], [120, 80], [0, 80]],
    "cell_m": 4,
}
SITE = {
    "name": "meadow",
    "soil": {"bulk_density_gcm3": 1.4, "lattice_water": 0.02},
    "irrigation": {"wilting_point": 0.12, "field_capacity": 0.3, "width_m": 6},
    "calibration": {"n0_cps": 40.0, "n0_sd_cps": 0.6},
}
GENERAL = {key: value for key, value in SITE.items() if key != "calibration"} | {"sensor_sensitivity": 60.0}


def meadow(folder, site):
    """A survey of a field that is dry in the west, with its records; its files are in the folder."""
    for name, content in (("field", FIELD), ("site", site)):
        (folder / f"{name}.json").write_text(json.dumps(content))
    survey, rng = open_survey(str(folder / "field.json"), str(folder / "site.json")), np.random.default_rng(1)
    for number, (x, y) in enumerate((x, y) for x in range(5, 120, 12) for y in range(5, 80, 12)):
        counts = int(rng.poisson(600 * (28 - x / 40)))
        factors = {"f_pressure": 0.9 + number / 1e4, "f_humidity": 1.03}
        survey.map.add(CountRecord(1.78e9 + 600 * number, x, y, 0.0, counts, 600.0, 600.0, **factors))
    return survey


def said(survey, **changes):
    state = survey.map.state
    soil_map, basis = survey.map.compute(state), json.loads(json.dumps(survey.dose_basis(state)))
    cells = map_cells(survey.map.grid, soil_map)
    return live_dose(survey.field, 4.0, cells, state.samples, soil_map.fit, basis | changes, state.stamp_s)


@pytest.mark.slow
@pytest.mark.parametrize("site", [SITE, GENERAL])
def test_the_page_says_what_the_report_says(tmp_path, site):
    survey = meadow(tmp_path, site)
    run = survey.run(survey.map.snapshot())
    of_report = irrigation(run)
    if site is SITE:
        assert said(survey) == of_report.steps[0]
        assert "rrigate " in said(survey)
        assert "mm on 0." in said(survey)
        assert said(survey, simulated=True).startswith("Simulated: ")
        assert said(survey, earlier=True) == LATER
    else:
        assert run.calibration.method == "general"
        assert said(survey) == f"No dose: {of_report.dose.missing}; {of_report.dose.remedy}."


def test_without_irrigation_or_another_field_nothing_is_said(tmp_path):
    survey = meadow(tmp_path, {key: value for key, value in SITE.items() if key != "irrigation"})
    assert survey.dose_basis(survey.map.state) is None
    basis = {"site": {"irrigation": {}}, "air": [1.0, 1.0], "simulated": False, "earlier": False}
    state = survey.map.state
    soil_map = survey.map.compute(state)
    cells = map_cells(survey.map.grid, soil_map)
    given = state.samples, soil_map.fit, basis, state.stamp_s
    assert live_dose(survey.field, 5.0, cells, *given) == ""
    assert live_dose(survey.field, 4.0, cells, *given).startswith("No dose: the sensor is not calibrated; ")
