# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts of the viewers for a namespace and a field."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.reporting.layouts import write_layouts


def field(width_m, height_m, at=(0.0, 0.0), cell_m=None):
    corners = np.array([(0, 0), (width_m, 0), (width_m, height_m), (0, height_m)]) + np.array(at)
    return Field("Long acre", LocalFrame(53.0, -0.5), corners, cell_m=cell_m)


def read(paths):
    rviz, foxglove, plotjuggler = paths
    displays = yaml.safe_load(rviz.read_text())["Visualization Manager"]
    return displays, json.loads(foxglove.read_text()), ET.parse(plotjuggler).getroot()


def rviz_topics(manager):
    return {one["Topic"]["Value"] for one in manager["Displays"] if "Topic" in one}


def test_everything_of_a_robot_is_in_its_namespace_and_a_shared_map_is_shown_too(tmp_path):
    rviz, foxglove, plotjuggler = read(write_layouts(field(60, 50), "/robot_1/", [], tmp_path))
    topics = rviz_topics(rviz)
    assert {name for name in topics if not name.startswith("/robot_1/")} == {
        "/soil_map", "/uncertainty", "/samples",
    }  # fmt: skip
    assert {"/robot_1/soil_map", "/robot_1/robot_pose", "/robot_1/plan_markers", "/robot_1/odom"} <= topics
    assert not any("compaction" in name for name in topics)
    shared = [one for one in rviz["Displays"] if one["Name"].endswith("(shared mapper)")]
    assert {one["Topic"]["Value"] for one in shared} == {"/soil_map", "/uncertainty", "/samples"}
    model = next(one for one in rviz["Displays"] if one["Class"].endswith("RobotModel"))
    assert model["Description Topic"]["Value"] == "/robot_1/robot_description"
    panels = foxglove["configById"]
    assert {"/soil_map", "/robot_1/soil_map", "/robot_1/plan"} <= set(panels["3D!map"]["topics"])
    assert panels["CallService!start"]["serviceName"] == "/robot_1/planner/start"
    assert panels["CallService!start"]["foxglovePanelTitle"] == "Mission: start (/robot_1)"
    assert panels["Publish!emergency"]["topicName"] == "/robot_1/emergency_stop"
    assert panels["map!fix"]["followTopic"] == "/robot_1/fix"
    assert panels["RawMessages!model"]["topicPath"] == "/robot_1/model.data"
    assert panels["DiagnosticSummary!health"]["topicToRender"] == "/diagnostics"
    plotted = [path["value"] for path in panels["Plot!mission"]["paths"]]
    assert all(path.startswith("/robot_1/mission_state.") for path in plotted)
    curves = {one.attrib["name"] for one in [*plotjuggler.iter("curve"), *plotjuggler.iter("topic")]}
    assert all(name.startswith("/robot_1/") for name in curves)


def test_each_property_has_a_layer(tmp_path):
    rviz, foxglove, _ = read(write_layouts(field(60, 50), "", ["salt", "rock"], tmp_path))
    names = [one["Name"] for one in rviz["Displays"] if one.get("Topic", {}).get("Value", "").count("/") > 1]
    assert names == ["Rate of salt", "Rate of rock"]
    maps = {name for name in foxglove["configById"]["3D!map"]["topics"] if name.endswith("/soil_map")}
    assert maps == {"/soil_map", "/salt/soil_map", "/rock/soil_map"}
    assert "/soil_map" in rviz_topics(rviz)
    assert len(rviz_topics(rviz)) == len([one for one in rviz["Displays"] if "Topic" in one]) - 2, (
        "map as vwc, rate, sd"
    )


@pytest.mark.parametrize(
    ("size", "at", "step_m"), [((60, 50), (0, 0), 10), ((900, 400), (-450, 2000), 100), ((12, 9), (3, 3), 10)]
)
def test_the_view_shows_the_whole_field_whatever_its_size(tmp_path, size, at, step_m):
    rviz, foxglove, _ = read(write_layouts(field(*size, at), "", [], tmp_path))
    view = rviz["Views"]["Current"]
    centre = (at[0] + size[0] / 2, at[1] + size[1] / 2)
    assert (view["X"], view["Y"]) == centre
    assert max(size) * view["Scale"] == pytest.approx(600, rel=1e-3)
    camera = foxglove["configById"]["3D!map"]["cameraState"]
    assert camera["targetOffset"] == [*centre, 0]
    assert camera["distance"] == pytest.approx(1.5 * max(size))
    assert camera["far"] > camera["distance"]
    reach = max(abs(value) for value in (at[0], at[1], at[0] + size[0], at[1] + size[1]))
    grid = foxglove["configById"]["3D!map"]["layers"]["grid"]
    assert grid["label"] == f"Grid of {step_m} m"
    assert grid["size"] / 2 >= reach
    assert grid["size"] / grid["divisions"] == step_m
    assert grid["divisions"] <= 120
    grid = next(one for one in rviz["Displays"] if one["Class"].endswith("/Grid"))
    assert grid["Cell Size"] * grid["Plane Cell Count"] / 2 >= reach


def test_points_of_the_map_have_the_size_of_its_cells(tmp_path):
    rviz, foxglove, _ = read(write_layouts(field(60, 60, cell_m=3.0), "", [], tmp_path))
    maps = [one for one in rviz["Displays"] if one.get("Style") == "Flat Squares"]
    assert {one["Size (m)"] for one in maps} == {3.0}
    assert foxglove["configById"]["3D!map"]["topics"]["/soil_map"]["pointSize"] == 24


def test_watch_writes_a_folder_for_each_of_several_robots(tmp_path):
    arguments = ["watch", "--field", "example", "--layouts", str(tmp_path), "--robot", "/r1", "--robot", "r2"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    files = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*"))
    names = ["foxglove.json", "plotjuggler.xml", "soilmoist.rviz"]
    assert files == [f"{robot}/{name}" for robot in ("r1", "r2") for name in names]
    assert "/r2/mission" in (tmp_path / "r2" / "foxglove.json").read_text()


def test_bad_names_and_folders_are_input_errors(tmp_path):
    with pytest.raises(InputError, match="'my robot' is not a namespace"):
        write_layouts(field(9, 9), "my robot", [], tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        write_layouts(field(9, 9), "", [], tmp_path / "file" / "below")
