# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts of the viewers, and the picture of the system: only what the nodes publish, in its types and fields."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent.parent
SVG = "{http://www.w3.org/2000/svg}"
TOPICS = {
    "counts": "PointCloud2", "quarantined_counts": "PointCloud2", "fix": "NavSatFix",
    "pressure": "FluidPressure", "temperature": "Temperature",
    "relative_humidity": "RelativeHumidity", "samples": "PointCloud2", "soil_map": "PointCloud2",
    "uncertainty": "OccupancyGrid", "model": "String", "plan": "Path", "plan_markers": "MarkerArray",
    "mission": "DiagnosticStatus", "diagnostics": "DiagnosticArray", "mission_state": "Mission",
    "emergency_stop": "Bool", "robot_pose": "PoseWithCovarianceStamped",
}  # fmt: skip
OF_THE_ROBOT = {"robot_description": "String", "odom": "Odometry"}
"""Topics that the robot itself may publish."""
LATCHED = {"samples", "soil_map", "uncertainty", "model", "plan", "plan_markers", "mission"}
RVIZ_SHOWS = {
    "PointCloud2": "PointCloud2", "Map": "OccupancyGrid", "Path": "Path", "MarkerArray": "MarkerArray",
    "PoseWithCovariance": "PoseWithCovarianceStamped",
}  # fmt: skip
"""Message type by display of RViz."""


NUMBERS = {"double", "uint8", "uint32", "uint64"}


def base(topic):
    """Name of a topic without the namespace of the property that the layouts have as an example."""
    return topic.removeprefix("/").removeprefix("compaction/")


def rviz_layout():
    return yaml.safe_load((ROOT / "config" / "rviz" / "soilmoist.rviz").read_text())["Visualization Manager"]


def rviz_displays():
    topics = [display for display in rviz_layout()["Displays"] if "Topic" in display]
    return [display for display in topics if base(display["Topic"]["Value"]) not in OF_THE_ROBOT]


def foxglove_layout():
    return json.loads((ROOT / "config" / "foxglove" / "soilmoist.json").read_text())


@pytest.fixture
def fields():
    pytest.importorskip("rclpy")
    import numpy as np

    from msg_adapters import counts
    from msg_adapters import counts as samples
    from msg_adapters.soil_map import soil_map_to_message
    from soilmoist_ros.mapping.grid import FieldGrid
    from soilmoist_ros.mapping.samples import Samples
    from soilmoist_ros.sensing.records import CountRecord

    grid = FieldGrid.from_polygon([(0, 0), (9, 0), (9, 9), (0, 9)], cell_m=1.0)
    nothing = Samples(np.empty((0, 2)), np.empty(0), np.empty(0))
    messages = {
        "soil_map": soil_map_to_message(grid, None, 0.0),
        "samples": samples.samples_to_message(nothing, 0.0),
        "counts": counts.counts_to_message([CountRecord(1.0, 2.0, 0.0, 0.0, 0.0, 10, 10.0)]),
    }
    return {topic: {field.name for field in message.fields} for topic, message in messages.items()}


def test_rviz_shows_topics_in_their_type_and_quality_and_has_no_tool_that_could_drive_the_robot_by_accident():
    displays, layout = rviz_displays(), rviz_layout()
    for display in displays:
        topic = base(display["Topic"]["Value"])
        assert TOPICS[topic] == RVIZ_SHOWS[display["Class"].removeprefix("rviz_default_plugins/")]
        durability = "Transient Local" if topic in LATCHED else "Volatile"
        quality = display["Topic"]["Durability Policy"], display["Topic"]["Reliability Policy"]
        assert (*quality, display["Enabled"]) == (durability, "Reliable", display["Value"])
    maps = [one for one in displays if base(one["Topic"]["Value"]) in ("soil_map", "uncertainty")]
    assert [one["Name"] for one in maps if one["Enabled"]] == ["Soil moisture"]
    assert layout["Global Options"]["Fixed Frame"] == "map"
    shown = {display["Class"].removeprefix("rviz_default_plugins/"): display for display in layout["Displays"]}
    model = shown["RobotModel"]["Description Topic"]
    assert (model["Value"], model["Durability Policy"]) == ("/robot_description", "Transient Local")
    tools = {tool["Class"].removeprefix("rviz_default_plugins/") for tool in layout["Tools"]}
    assert tools == {"MoveCamera", "Select", "FocusCamera", "Measure"}
    text = (ROOT / "config" / "rviz" / "soilmoist.rviz").read_text()
    named = {base(topic) for topic in re.findall(r"Value: (/\S+)", text)}
    assert named - {"uncertainty_updates"} <= TOPICS.keys() | OF_THE_ROBOT.keys()


def test_coloured_fields_exist(fields):
    for display in rviz_displays():
        if "Channel Name" in display:
            assert display["Channel Name"] in fields[base(display["Topic"]["Value"])]
    for name, settings in foxglove_layout()["configById"]["3D!map"]["topics"].items():
        if "colorField" in settings:
            assert settings["colorField"] in fields[base(name)]


def test_foxglove_panels_show_topics_that_they_can_show():
    panels = foxglove_layout()["configById"]
    for name, settings in panels["3D!map"]["topics"].items():
        assert TOPICS[base(name)] in set(RVIZ_SHOWS.values()), settings
    assert TOPICS[panels["map!fix"]["followTopic"].removeprefix("/")] == "NavSatFix"
    assert TOPICS[panels["DiagnosticSummary!health"]["topicToRender"].removeprefix("/")] == "DiagnosticArray"
    raw = [panel["topicPath"] for name, panel in panels.items() if name.startswith("RawMessages!")]
    assert raw == ["/mission", "/model.data"]
    plotted = [path["value"] for path in panels["Plot!weather"]["paths"]]
    assert plotted == ["/pressure.fluid_pressure"]
    button = panels["Publish!emergency"]
    assert (button["topicName"], button["datatype"]) == ("/emergency_stop", "std_msgs/Bool")
    assert json.loads(button["value"]) == {"data": True}
    called = {panel["serviceName"] for name, panel in panels.items() if name.startswith("CallService!")}
    assert called == {f"/planner/{verb}" for verb in ("start", "pause", "resume", "abort", "skip", "command")}
    request = json.loads(panels["CallService!home"]["requestPayload"])
    assert request == {"verb": "return_home", "who": "Foxglove"}


def test_plots_are_of_numbers_of_the_topics():
    pytest.importorskip("rclpy")
    from sensor_msgs.msg import FluidPressure, RelativeHumidity, Temperature
    from soilmoist_msgs.msg import Mission

    root = ET.parse(ROOT / "config" / "plotjuggler" / "soilmoist.xml").getroot()
    kinds = {"/mission_state": Mission, "/pressure": FluidPressure, "/temperature": Temperature}
    kinds["/relative_humidity"] = RelativeHumidity
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(curves) == len(set(curves)) == 10
    for curve in curves:
        _, topic, field = curve.split("/")
        assert kinds[f"/{topic}"].get_fields_and_field_types()[field] in NUMBERS, curve
        assert "header" in kinds[f"/{topic}"].get_fields_and_field_types(), "its time stamps are the header's"
    assert {one.attrib["name"] for one in root.iter("topic")} == {f"/{curve.split('/')[1]}" for curve in curves}
    for panel in ("mission", "map"):
        for path in foxglove_layout()["configById"][f"Plot!{panel}"]["paths"]:
            topic, _, field = path["value"].partition(".")
            assert kinds[topic].get_fields_and_field_types()[field] in NUMBERS
    for splitter in root.iter("DockSplitter"):
        assert len(list(splitter)) == int(splitter.attrib["count"]) == len(splitter.attrib["sizes"].split(";"))


def test_the_architecture_picture_names_every_node_and_topic():
    root = ET.parse(ROOT / "docs" / "architecture.svg").getroot()
    words = set(re.findall(r"[\w/]+", " ".join("".join(text.itertext()) for text in root.iter(f"{SVG}text"))))
    assert {"sensor_driver", "mapper", "planner", "recorder", "field_simulator", "console", "watchdog"} <= words
    assert {topic for topic in TOPICS if topic not in words and f"/{topic}" not in words} == set()
