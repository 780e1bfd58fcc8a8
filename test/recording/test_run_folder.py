# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
import os
import string
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.pipeline.bag_map import ReplaySettings, robot_survey
from soilmoist_ros.recording.run_folder import (
    RunConfiguration,
    configuration_of,
    copy_configuration,
    read_parameters,
    write_parameters,
    write_whole,
)
from soilmoist_ros.sensing.moisture.site import load_site

TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=20)
VALUES = st.one_of(
    st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), TEXTS, st.lists(TEXTS, min_size=1, max_size=3)
)
NAMES = st.text(string.ascii_lowercase + "_", min_size=1, max_size=8).filter(lambda name: name.strip("_"))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=st.dictionaries(NAMES.map("p_{}".format), VALUES, max_size=5))
@pytest.mark.slow
def test_parameters_come_back_as_they_were(tmp_path, values):
    path = write_parameters(tmp_path, "mapper", values)
    assert path == tmp_path / "configuration" / "mapper.yaml"
    found = read_parameters(tmp_path / "configuration", "mapper")
    assert {name: type(value) for name, value in found.items() if isinstance(value, float | bool | str)} == {
        name: type(value) for name, value in values.items() if isinstance(value, float | bool | str)
    }
    assert repr(found) == repr(values)


def test_ros_reads_them_as_well(tmp_path, monkeypatch):
    rclpy = pytest.importorskip("rclpy")
    from rclpy.context import Context
    from rclpy.node import Node

    from soilmoist_ros.nodes.process_group import loopback_environment

    for name, value in loopback_environment(0).items():  # for later tests, too: a process reads its profile once
        monkeypatch.setenv(name, value)
    values = {
        "small": 1e-05, "whole": 3, "number": 2.0, "none": math.nan, "most": -math.inf, "flag": True,
        "path": "/a b/c:d #e/ä.yaml", "quoted": 'a "b" \\n c', "names": ["x", "true", "1"], "empty": "",
        "looks": "1e5",
    }  # fmt: skip
    path = write_parameters(tmp_path, "mapper", values)
    nothing = write_parameters(tmp_path, "planner", {})
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path), "--params-file", str(nothing)], context=context)
    try:
        for namespace in ("/", "/robot1/deep"):
            node = Node(
                "mapper", context=context, namespace=namespace,
                automatically_declare_parameters_from_overrides=True,
            )  # fmt: skip
            found = {name: node.get_parameter(name).value for name in values}
            node.destroy_node()
            assert repr(found) == repr(values)
    finally:
        context.shutdown()


def test_a_run_may_be_moved(tmp_path):
    run = tmp_path / "run"
    configuration = run / "configuration"
    names = {"field": str(configuration / "field.yaml"), "other": "/etc/hostname", "plain": "field.yaml"}
    write_parameters(run, "mapper", names)
    (configuration / "field.yaml").write_text("")
    run.rename(tmp_path / "moved")
    found = read_parameters(tmp_path / "moved" / "configuration", "mapper")
    assert found == {**names, "field": str(tmp_path / "moved" / "configuration" / "field.yaml")}


@pytest.mark.parametrize(
    "content", ["", "3", "a: 1", "a: {b: 1}", "[]", "a: {ros__parameters: 3}", "{}", "a:\n  - 1"]
)
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "mapper.yaml").write_text(content)
    assert read_parameters(tmp_path, "planner") == {}
    with pytest.raises(InputError, match="is not a file of node parameters") as caught:
        read_parameters(tmp_path, "mapper")
    assert caught.value.mistakes[0].path == tmp_path / "mapper.yaml"


def test_where_the_configuration_of_a_bag_is(tmp_path):
    run = tmp_path / "run.2026"
    bag = run / "bag"
    bag.mkdir(parents=True)
    file = bag / "bag_0.mcap"
    file.write_text("")
    assert [configuration_of(path) for path in (run, bag, file)] == [None] * 3
    (tmp_path / "configuration").mkdir()  # of something else
    assert [configuration_of(path) for path in (bag, file)] == [None] * 2
    (run / "configuration").mkdir()
    assert [configuration_of(path) for path in (run, bag, file)] == [run / "configuration"] * 3
    (bag / "configuration").mkdir()
    assert [configuration_of(path) for path in (bag, file)] == [bag / "configuration"] * 2


def test_the_file_before_stays_if_the_new_one_does_not_reach_the_disk(tmp_path, monkeypatch):
    path = tmp_path / "state"
    write_whole(path, b"one")

    def full(descriptor):
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="no space"):
        write_whole(path, b"two")
    assert path.read_bytes() == b"one"
    assert list(tmp_path.iterdir()) == [path], "nothing half written keeps a disk full"


SQUARE = "name: {name}\ndatum: {{latitude_deg: 53.2, longitude_deg: -0.5}}\npolygon: [[0, 0], [9, 0], [9, 9]]\n"
SITE = """
# ours
corrections:
  intensity:
    reference: 150.0   # of the year
    file: {file}
"""
MONITOR = "2026-06-01 06:00,151\n2026-06-01 07:00,152\n"
GEOJSON = '{"type": "Polygon", "coordinates": [[[-0.5, 53.2], [-0.49, 53.2], [-0.49, 53.21], [-0.5, 53.2]]]}'


@pytest.fixture
def files(tmp_path):
    """Files of a user: a field and a site that name other files elsewhere."""
    folder = tmp_path / "mine"
    (folder / "data").mkdir(parents=True)
    (folder / "data" / "monitor.csv").write_text(MONITOR)
    (folder / "data" / "edge.geojson").write_text(GEOJSON)
    (folder / "site.yaml").write_text(SITE.format(file="data/monitor.csv"))
    (folder / "farm.yaml").write_text("name: farm\ngeojson: data/edge.geojson\n")
    (folder / "other.yaml").write_text(SQUARE.format(name="other"))
    return folder


def test_a_recording_holds_all_that_its_nodes_were_set_up_with(files, tmp_path):
    bag = tmp_path / "recordings" / "run"
    bag.mkdir(parents=True)
    configuration = RunConfiguration()
    values = {"field": str(files / "farm.yaml"), "site": str(files / "site.yaml"), "cell_m": 2.0}
    configuration.take("mapper", values)
    configuration.take("planner", {"field": str(files / "farm.yaml"), "graph": "topic", "seed": 3})
    assert configuration.write(bag) == ["mapper", "planner"]
    assert configuration.write(bag) == []
    for path in sorted(files.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    moved = (tmp_path / "recordings").rename(tmp_path / "moved") / "run"

    folder = configuration_of(moved)
    mapper, planner = read_parameters(folder, "mapper"), read_parameters(folder, "planner")
    assert (mapper["cell_m"], planner["graph"], planner["seed"]) == (2.0, "topic", 3)
    assert planner["field"] == mapper["field"]
    assert load_field(folder / mapper["field"]).name == "farm"
    site = load_site(folder / mapper["site"])
    assert site.corrections.intensity.file.read_text() == MONITOR
    assert site.corrections.intensity.file.parent == folder
    assert "# of the year" in (folder / "site.yaml").read_text()

    copy_configuration(moved, tmp_path / "again")
    assert read_parameters(configuration_of(tmp_path / "again"), "planner")["seed"] == 3


def test_what_the_nodes_have_replaces_what_they_were_started_with(files, tmp_path):
    """A replay would take a file without the choice of a drift for one of an earlier version, which had none."""
    configuration = RunConfiguration()
    first, second = tmp_path / "run" / "bag", tmp_path / "run" / "bag_2"
    write_parameters(tmp_path / "run", "mapper", {"field": "farm", "model": "matern52"})
    write_parameters(tmp_path / "run", "console", {"port": 1})
    had = {"field": str(files / "other.yaml"), "model": "matern52", "noise": "local", "drift_model": "auto"}
    configuration.take("mapper", had)
    assert configuration.write(first) == ["mapper"]
    assert configuration.write(first) == []
    survey, _ = robot_survey(first, configuration_of(first.parent), ReplaySettings())
    assert (survey.map.settings.drift_model, survey.map.settings.noise) == ("auto", "local")
    assert survey.field.name == "other"
    (files / "other.yaml").write_text(SQUARE.format(name="changed"))
    configuration.take("mapper", {**had, "cell_m": 2.0})  # an operator chooses another field
    configuration.take("planner", {"hours": 1.0})
    assert configuration.write(first) == ["mapper", "planner"]
    folder = configuration_of(first.parent)
    mapper = read_parameters(folder, "mapper")
    assert (mapper["cell_m"], load_field(folder / mapper["field"]).name) == (2.0, "changed")
    assert read_parameters(folder, "console") == {"port": 1}
    second.mkdir()
    assert configuration.write(second) == ["mapper", "planner"]
    assert read_parameters(configuration_of(second), "planner") == {"hours": 1.0}


def test_what_cannot_be_written_is_reported_and_retried(files, tmp_path):
    configuration = RunConfiguration()
    configuration.take("mapper", {"field": str(files / "other.yaml")})
    (tmp_path / "configuration").write_text("in the way")
    for _ in range(2):
        with pytest.raises(InputError, match="cannot be written"):
            configuration.write(tmp_path)
    (tmp_path / "configuration").unlink()
    assert configuration.write(tmp_path) == ["mapper"]


def test_a_recorder_stores_configurations_without_the_models_of_files(tmp_path):
    code = """
import sys
from pathlib import Path
from soilmoist_ros.recording.run_folder import RunConfiguration
configuration = RunConfiguration()
configuration.take("sensor_driver", {"field": "example", "site": "example", "logger_format": "thorvald_crs"})
print(configuration.write(Path(sys.argv[1])), "pydantic" in sys.modules)
"""
    result = subprocess.run([sys.executable, "-c", code, tmp_path], capture_output=True, text=True, timeout=60)
    assert result.stdout == "['sensor_driver'] False\n", result.stderr
    stored = {path.name for path in (tmp_path / "configuration").iterdir()}
    assert stored == {"sensor_driver.yaml", "field.yaml", "site.yaml", "logger_format.yaml"}
