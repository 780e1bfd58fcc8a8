# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What files mean, in words, and contradictions between them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from soilmoist_ros.foundation import LocalFrame, Mistake, config_folder
from soilmoist_ros.mapping import Field, PositionSource, load_field
from soilmoist_ros.pipeline import contradictions, field_findings, log_findings, logger_findings, site_findings
from soilmoist_ros.pipeline.logs import log_positions, read_logs
from soilmoist_ros.sensing import Calibration, Site, load_logger_format, load_site

EXAMPLE = load_field(config_folder() / "fields" / "example.yaml")
KANSAS = load_site("gypsum_transect")
NOW_S = 1.78e9
SOURCE = PositionSource("a.log")


def texts(findings, name):
    return [finding.text for finding in findings if finding.name == name]


@pytest.fixture(scope="module")
def log(roving_record):
    return read_logs([roving_record], None, KANSAS)


def facts_of(log, site=KANSAS, now_s=NOW_S):
    return list(log_findings(log, log_positions(log, None, site), site, now_s))


@pytest.mark.slow
def test_a_field_has_area_place_direction_and_cells():
    found = list(field_findings(EXAMPLE))
    assert texts(found, "field")[0].startswith("Example field: 0.30 ha at 53.27 N, 0.52 W")
    assert texts(found, "extent") == ["60 m east-west, 50 m north-south; longest side at 90 deg"]
    assert texts(found, "map") == ["11880 cells of 0.5 m, 1 no-go area"]
    assert not texts(found, "doubt")


@pytest.mark.slow
def test_a_site_shows_the_values_that_follow_from_its_place():
    found = list(site_findings(load_site("station_kansas")))
    assert texts(found, "cosmic rays") == ["cutoff rigidity 2.94 GV, atmospheric depth 979 g/cm2"]
    assert texts(found, "correction")[0].startswith("pressure (0.00737 1/hPa, 1 at 959.81 hPa)")
    assert not texts(found, "doubt")
    intensity = {"reference": 150, "constant": 148, "monitor": "JUNG", "scaling": "hawdon2014"}
    high = Site(
        location={"latitude_deg": 47, "longitude_deg": 11, "altitude_m": 1500},
        corrections={"intensity": intensity},
    )
    found = list(site_findings(high))
    assert "incoming neutrons (scaling hawdon2014, k 1.0" in texts(found, "correction")[0]
    assert "846 hPa are usual at 1500 m" in texts(found, "doubt")[0]
    known = high.model_copy(update={"calibration": Calibration(n0_cps=1.0, reference_hpa=1013.25)})
    assert not texts(site_findings(known), "doubt"), "N0 was found with this reference"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("corners", "doubts"),
    [
        ([[0, 0], [5, 0], [5, 5], [0, 5]], ["smaller than the footprint"]),
        ([[0, 0], [2e4, 0], [2e4, 2e4], [0, 2e4]], ["very large"]),
        ([[9000, 0], [9060, 0], [9060, 50]], ["9.0 km from its datum"]),
    ],
)
def test_doubts_about_a_field(corners, doubts):
    field = Field("x", LocalFrame(53.0, 0.0), np.array(corners, float))
    found = texts(field_findings(field), "doubt")
    assert len(found) == len(doubts)
    assert all(doubt in text for doubt, text in zip(doubts, found, strict=True))


def test_a_site_has_the_moisture_of_its_calibration():
    (moisture,) = texts(site_findings(KANSAS), "moisture")
    assert moisture.startswith(
        "N0 9 counts/s (illustrative), desilets curve: 7.25 counts/s on dry soil (0.05 m3/m3), "
    )
    assert "4.94 on wet soil" in moisture
    curve = KANSAS.curve
    assert curve.vwc([7.25, 4.94]) == pytest.approx([0.05, 0.40], abs=0.002)
    assert texts(site_findings(Site()), "moisture") == [
        "not mapped, only the count rate: there is no soil and calibration"
    ]


def test_a_site_shows_what_follows_from_its_irrigation():
    limits = {"wilting_point": 0.13, "field_capacity": 0.31, "root_depth_mm": 60, "efficiency": 0.8}
    found = list(site_findings(Site(irrigation=limits)))
    assert texts(found, "irrigation") == [
        "roots to 60 mm (given); wilting point 0.13, field capacity 0.31 (given); 11 mm of available water, "
        "filled to 0.31 (target_share default); largest dose 13 mm (efficiency 0.8 given)"
    ]
    assert texts(found, "doubt") == [Site(irrigation=limits).irrigation.doubt]
    assert "write 600 if it is in cm" in texts(found, "doubt")[0]
    found = list(site_findings(Site(soil={"texture": "loam"}, irrigation={"root_depth_mm": 900})))
    assert "(typical of loam)" in texts(found, "irrigation")[0]
    assert texts(found, "irrigation")[0].endswith("largest dose 60 mm (max_dose_mm default)")
    assert not texts(found, "doubt")
    assert "so no dose" in texts(site_findings(Site(irrigation={"root_depth_mm": 900})), "irrigation")[0]
    assert not texts(site_findings(Site()), "irrigation")


def test_a_logger_format_has_tubes_quantities_and_clock(tmp_path):
    found = list(logger_findings(load_logger_format("hydroinnova_rover")))
    assert texts(found, "quantities") == [
        "pressure, temperature, humidity, positions; longitudes without a sign: the site file names the side"
    ]
    assert texts(found, "clock") == ["UTC, stamped at the end of the interval"]
    assert texts(found, "logger")[0].startswith("Hydroinnova CRS probe with GNSS (rover): counts of ")
    assert not texts(found, "doubt")
    older = tmp_path / "older.yaml"
    text = (config_folder() / "loggers" / "hydroinnova_rover.yaml").read_text()
    older.write_text(text.replace("longitude_signed:", "zero_is_no_fix: true\n  longitude_signed:"))
    assert "'zero_is_no_fix' is no longer" in texts(logger_findings(load_logger_format(older)), "doubt")[0]


@pytest.mark.slow
def test_a_log_has_dates_tubes_place_and_rate(log):
    found = facts_of(log)
    assert texts(found, "time") == ["2018-05-01 14:14 to 2018-05-01 17:34 UTC (3 h 20 min), a record every 60 s"]
    assert texts(found, "tubes")[0].startswith("8, counting 0.71, 0.72")
    assert texts(found, "place")[0].startswith("200 of 201 records at 38.73 N, 97.42 W")
    assert texts(found, "rate")[0].startswith("mean 5.4")
    assert "0.25" in texts(found, "rate")[0]
    assert not texts(found, "doubt")


@pytest.mark.slow
def test_doubts_about_a_log(log):
    assert any("in the future" in text for text in texts(facts_of(log, now_s=1.5e9), "doubt"))
    calibration = KANSAS.calibration.model_copy(update={"n0_cps": 4.0})
    other = KANSAS.model_copy(update={"calibration": calibration})
    assert any("check N0 (4 counts/s)" in text for text in texts(facts_of(log, other), "doubt"))
    weak = [
        dataclasses.replace(record, tube_counts=(0.0, *record.tube_counts[1:]), position=None)
        for record in log[0].records
    ]
    doubts = texts(facts_of([dataclasses.replace(log[0], records=tuple(weak))], Site()), "doubt")
    assert any("tube 1 counts much less" in text for text in doubts)
    assert any("no record has a position" in text for text in doubts)


def at(latitude_deg, longitude_deg):
    return Site(name="st", location={"latitude_deg": latitude_deg, "longitude_deg": longitude_deg})


def test_files_that_fit_together():
    places = np.array([(53.2681, -0.5241)] * 3 + [(53.2689, -0.5241)] * 4)
    found = list(contradictions(EXAMPLE, at(53.268, -0.524), places, SOURCE))
    assert texts(found, "together") == ["3 of 7 records lie inside the field 'Example field'"]
    assert texts(found, "doubt") == ["only 3 of 7 records lie inside: is it the right field?"]
    assert not list(contradictions(EXAMPLE, at(53.2681, -0.5241), places[:0], SOURCE))
    assert not list(contradictions(None, None, places, SOURCE))


def test_files_that_contradict_each_other():
    nowhere = np.empty((0, 2))
    (probe,) = contradictions(EXAMPLE, at(53.268, 0.524), nowhere, PositionSource("'location' in the site file"))
    assert isinstance(probe, Mistake)
    assert probe.message.startswith("the probe lies 70 km east")
    assert "sign of the longitude, west is negative: in 'location' in the site file" in probe.remedy
    places = np.array([(53.2681, -0.5241)])
    (elsewhere,) = contradictions(None, at(-53.268, -0.524), places, SOURCE)
    assert elsewhere.message.endswith("of the place of the site 'st'")
    assert "sign of the latitude" in elsewhere.remedy
    (other,) = contradictions(EXAMPLE, None, np.array([(38.7, -97.4)]), SOURCE)
    assert "a.log has records at 38.7000 N" in other.remedy
