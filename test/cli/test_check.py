# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist check``: what files mean, mistakes in them, contradictions between them."""

from __future__ import annotations

import json

import shapely
from click.testing import CliRunner

from soilmoist_ros.cli.main import main


def check(*options):
    return CliRunner().invoke(main, ["check", *map(str, options)])


def test_the_command_prints_what_it_understood(roving_record):
    result = check("--site", "gypsum_transect", "--log", roving_record)
    assert result.exit_code == 0, result.output
    assert result.output.count("ok: ") == 2
    assert "  time        2018-05-01 14:14" in result.output


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


def test_the_command_compares_a_topological_map_with_a_field(tmp_path):
    def node(name, x, y):
        return {"node": {"name": name, "pose": {"position": {"x": x, "y": y}}, "edges": [{"node": 1 - name}]}}

    field, graph = tmp_path / "field.yaml", tmp_path / "map.json"
    datum = {"latitude_deg": 53.268, "longitude_deg": -0.5245}
    field.write_text(json.dumps({"name": "plot", "datum": datum, "polygon": [[0, 0], [80, 0], [80, 60], [0, 60]]}))
    graph.write_text(json.dumps({"nodes": [node(0, 10, 20), node(1, 20, 20)]}))
    result = check("--field", field, "--graph", graph)
    assert "graph       2 of 2 nodes are stops in plot; datum of the map: none" in result.output
    shifted = {"meta": {"origin": {"latitude": 53.268642, "longitude": -0.5245095}}}
    graph.write_text(json.dumps({**shifted, "nodes": [node(0, 10, 20), node(1, 20, 20)]}))
    result = check("--field", field, "--graph", graph)
    assert result.exit_code == 2
    assert "no node of the topological map lies in the field 'plot'" in result.output
    assert check("--graph", graph).exit_code == 2
