# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist check``: what files mean, mistakes in them, contradictions between them."""

from __future__ import annotations

import json

import pytest
import shapely
from click.testing import CliRunner

from soilmoist_ros.cli.main import main


def check(*options):
    return CliRunner().invoke(main, ["check", *map(str, options)])


@pytest.mark.slow
def test_the_command_refuses_contradictions_and_options_that_do_not_fit(roving_record):
    result = check("--site", "gypsum_transect", "--log", roving_record, "--field", "example")
    assert result.exit_code == 2
    assert "all 200 records lie 7,079 km north-west" in result.output
    assert check("--nmea", roving_record, "--site", "example").exit_code == 2
    assert check("--log", roving_record, "--site", "example", "--site", "gypsum_transect").exit_code == 2
    assert check().exit_code == 2


def test_the_command_says_what_covariates_cover(tmp_path):
    west, south, width, height = -0.5245, 53.268, 0.0004, 0.0002  # the western half of the field
    boxes = [(west, y, west + width, y + height) for y in (south, south + height)]
    features = [
        {"type": "Feature", "properties": {"soil": name}, "geometry": shapely.geometry.mapping(shapely.box(*box))}
        for name, box in zip(("clay", "sand"), boxes, strict=True)
    ]
    (tmp_path / "soils.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    text = f"datum: {{latitude_deg: {south}, longitude_deg: {west}}}\ncell_m: 1\n"
    text += "polygon: [[0, 0], [53, 0], [53, 44], [0, 44]]\n"
    path = tmp_path / "field.yaml"
    path.write_text(text + "covariates: [soils.geojson]\n")
    result = check("--field", path)
    assert "covariates  soils sand (51% of the field)" in result.output
    assert "not used" not in result.output
    for feature in features:
        feature["properties"]["owner"] = "x"
    (tmp_path / "soils.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    path.write_text(text + "covariates: ['soils.geojson:soil']\n")
    assert "covariates  attributes of soils.geojson that are not used: owner" in check("--field", path).output
    path.write_text(text + "covariates: [soil.geojson]\n")
    result = check("--field", path)
    assert result.exit_code == 2
    assert "no such file" in result.output


def test_the_command_says_of_a_map_what_the_planner_says(tmp_path):
    def node(name, x, y, *ends):
        edges = [{"node": end, "edge_id": f"{name}-{end}", "action": "hop"} for end in ends]
        return {"node": {"name": name, "pose": {"position": {"x": x, "y": y}}, "edges": edges}}

    field, graph = tmp_path / "field.yaml", tmp_path / "map.json"
    datum = {"latitude_deg": 53.268, "longitude_deg": -0.5245}
    ditch = [[38, 1], [42, 1], [42, 60], [38, 60]]
    shape = {"name": "plot", "datum": datum, "polygon": [[0, 0], [80, 0], [80, 60], [0, 60]], "no_go": [ditch]}
    field.write_text(json.dumps(shape))
    nodes = [node("a", 10, -5, "b"), node("b", 70, -5, "a", "yard"), node("yard", 120, -5, "b")]
    graph.write_text(
        json.dumps({"meta": {"origin": {"latitude": 53.26805, "longitude": -0.5245}}, "nodes": nodes})
    )
    narrow = check("--field", field, "--graph", graph).output
    for said in (
        "divide the field into 2 parts that cannot be reached from each other by a robot that keeps 0.75",
        "1 of 3 nodes are stops in plot; datum of the map: its own; frame of its places: not named",
        "1 edge across the border or a no-go area (a - b); 1 of them only for robot_radius_m, 0.75 m",
        "the planner does not drive: the datum 53.2680500,-0.5245000 of the navigation's map lies 5.6 m from",
        "4 of 4 edges have an action that is not known (hop)",
    ):
        assert said in narrow
    wide = check("--field", field, "--graph", graph, "--robot-radius", "0", "--home", "yard").output
    assert "2 of 3 nodes are stops in plot" in wide
    assert "the home yard lies 40 m outside the field: the robot drives there and back outside" in wide
    assert "divide" not in wide
    cut_off = check("--field", field, "--graph", graph, "--home", "yard")
    assert cut_off.exit_code == 2
    assert "the home yard, 40 m outside the field, and the nodes" in cut_off.output
    assert "(a - b); 1 of them only for robot_radius_m" in cut_off.output
    assert check("--field", field, "--home", "yard").exit_code == 2
    missing = check("--field", field, "--graph", graph, "--home", "yrad")
    assert missing.exit_code == 2
    assert "map.json: there is no stop 'yrad'" in missing.output
    assert "did you mean 'yard'" in missing.output
    broad = check("--field", field, "--graph", graph, "--robot-radius", "31")
    assert "nodes are in the field: check its no-go areas, and robot_radius_m (31 m)" in broad.output


SITE = """\
location: {latitude_deg: 51.5, longitude_deg: -1.5, altitude_m: 190}
corrections: {pressure: {reference_hpa: auto}, intensity: {reference: 150, file: monitor.txt}}
soil: {bulk_density_gcm3: 1.3}
calibration: {n0_cps: 0.7, date: "2026-05-01"}
"""
MONITOR = "# STATION: JUNG\n2026-05-01 00:00:00;151.0\n2026-05-03 00:00:00;152.0\n"


@pytest.mark.parametrize(
    ("old", "new", "doubt"),
    [
        ("reference: 150", "reference: 1500",
         "incoming neutrons is 9.87 to 9.93: are monitor and 'reference' of one"),
        ("0.7,", "2520,", "N0 of 2520 counts/s is unusual: 0.7 counts/s if it is per hour"),
        (', date: "2026-05-01"', "", "no date, note or n0_sd_cps: give one, or write 'illustrative: true'"),
        ("file: monitor.txt, monitor: JUNG", "constant: 100", "incoming neutrons is 1.50 to 1.50"),
    ],
)  # fmt: skip
def test_a_site_whose_factors_or_n0_cannot_be_right_is_doubted(tmp_path, old, new, doubt):
    text = SITE.replace("monitor.txt", "monitor.txt, monitor: JUNG")
    (tmp_path / "monitor.txt").write_text(MONITOR)
    (tmp_path / "site.yaml").write_text(text)
    good = check("--site", tmp_path / "site.yaml").output
    assert "monitor     JUNG, 2026-05-01 00:00 to 2026-05-03 00:00 UTC, 151 to 152, reference C0 150" in good
    assert "doubt" not in good
    (tmp_path / "site.yaml").write_text(text.replace(old, new))
    assert doubt in check("--site", tmp_path / "site.yaml").output


FORMAT = """\
title: table
source: hand
delimiter: comma
header: {}
time: {columns: [time], formats: [iso8601], marks: end}
counts: {columns: [counts]}
live_time: {columns: [live], unit: s}
pressure: {sensors: [{column: P, unit: hPa}]}
temperature: {sensors: [{column: T, unit: degC}]}
humidity: {sensors: [{column: RH, unit: percent}]}
"""


def table_of(pressure=990.0, temperature=12.0, humidity=60.0):
    rows = [
        f"2026-05-01 {h:02}:00:00,{1470 + 37 * h % 60},3600,{pressure},{temperature},{humidity - h / 1000}"
        for h in range(24)
    ]
    return "\n".join(["time,counts,live,P,T,RH", *rows]) + "\n"


@pytest.mark.parametrize(
    ("weather", "n0", "text"),
    [
        ({}, "0.7",
         "factors     pressure 0.995 to 0.995, humidity 1.034 to 1.035, incoming neutrons 1.000 to 1.000"),
        ({}, "2520", "N0 of 2520 counts/s fits these counts if it is per hour: 0.7 counts/s"),
        ({"humidity": 0.6}, "0.7",
         "relative humidity is 0.58 to 0.60 %: if it is a fraction, write 'unit: fraction'"),
        ({"temperature": 54.0}, "0.7",
         "temperature is 54 degC in the middle of the records: if it is in Fahrenheit"),
        ({"pressure": 99000}, "0.7",
         "the pressure 99000 is not credible (300..1085) -> if it is in Pa, write 'unit: Pa'"),
        ({"pressure": 1045}, "0.7",
         "1045 hPa on average, but 991 hPa are usual at 190 m: is it reduced to sea level"),
        ({"pressure": 29.2}, "0.7", "-> if it is in inHg, write 'unit: inHg' into the logger format"),
        ({"temperature": 285.0}, "0.7", "if it is in K, write 'unit: K' into the logger format"),
    ],
)  # fmt: skip
def test_weather_and_n0_in_other_units_are_said_so(tmp_path, weather, n0, text):
    (tmp_path / "log.csv").write_text(table_of(**weather))
    (tmp_path / "format.yaml").write_text(FORMAT)
    site = SITE.replace(", intensity: {reference: 150, file: monitor.txt}", "").replace("0.7", n0)
    (tmp_path / "site.yaml").write_text(site)
    files = "--site", tmp_path / "site.yaml", "--logger", tmp_path / "format.yaml", "--log", tmp_path / "log.csv"
    output = check(*files).output
    assert text in output, output
    assert "switch" not in output


def test_a_truth_is_shown_and_counts_per_hour_are_doubted(tmp_path):
    (tmp_path / "points.csv").write_text("x_m,y_m,rate_cps\n0,0,3600\n50,0,3500\n50,40,3900\n")
    (tmp_path / "field.yaml").write_text(
        "datum: {latitude_deg: 53.268, longitude_deg: -0.5245}\npolygon: [[0, 0], [60, 0], [60, 50], [0, 50]]\n"
        "truth: {points: points.csv, soil: {bulk_density_gcm3: 1.4}, calibration: {n0_cps: 4.4}}\n"
    )
    said = check("--field", tmp_path / "field.yaml").output
    assert "counts/s is unusual: 1.079 counts/s if it is per hour" in said
    assert "no soil has these rates" in said
    assert "a rate of 2.766 to 3.544 counts/s, a moisture of 0.10 to 0.28" in check("--field", "patches").output


@pytest.mark.slow
def test_records_that_cannot_be_corrected_have_their_reason(roving_record, tmp_path):
    log = roving_record.with_name("station_kansas_2021-10.dat")
    days = "".join(f"2021-10-{day} 00:00;150\n" for day in range(18, 30))
    (tmp_path / "monitor.csv").write_text(days)
    (tmp_path / "site.yaml").write_text(
        "logger_utc_offset_hours: -6\ncorrections: {intensity: {reference: 150, file: monitor.csv}}\n"
    )
    said = check("--site", tmp_path / "site.yaml", "--log", log).output
    assert "252 records are quarantined or cannot be corrected: soilmoist map lists them. Most often: " in said
    assert "the neutron monitor, 2021-10-18 00:00 to 2021-10-29 00:00 UTC, has no rate at this time" in said
