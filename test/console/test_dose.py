# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sentence of the dose that leads the page: live_dose() of console/map_layers.py."""

from __future__ import annotations

import json

import numpy as np
import pytest

from soilmoist_ros.console.map_layers import LATER, live_dose
from soilmoist_ros.mapping import map_cells
from soilmoist_ros.pipeline import open_survey
from soilmoist_ros.reporting import irrigation
from soilmoist_ros.sensing import CountRecord

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
    """The sentence, from what a mapper publishes."""
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
        assert said(survey).startswith("Irrigate ")
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
