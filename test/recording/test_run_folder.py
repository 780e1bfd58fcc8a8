# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
import string

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.run_folder import bag_of, configuration_of, read_parameters, write_parameters

TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=20)
VALUES = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    TEXTS,
    st.lists(TEXTS, min_size=1, max_size=3),
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


def test_ros_reads_them_as_well(tmp_path):
    rclpy = pytest.importorskip("rclpy")
    from rclpy.context import Context
    from rclpy.node import Node

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
                "mapper",
                context=context,
                namespace=namespace,
                automatically_declare_parameters_from_overrides=True,
            )
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


def test_no_parameters():
    assert read_parameters(None, "mapper") == {}


@pytest.mark.parametrize(
    "content", ["", "3", "a: 1", "a: {b: 1}", "[]", "a: {ros__parameters: 3}", "{}", "a:\n  - 1"]
)
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "mapper.yaml").write_text(content)
    assert read_parameters(tmp_path, "planner") == {}
    with pytest.raises(InputError, match="is not a file of node parameters") as caught:
        read_parameters(tmp_path, "mapper")
    assert caught.value.mistakes[0].path == tmp_path / "mapper.yaml"


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "configuration").write_text("in the way")
    with pytest.raises(InputError, match="choose another output folder"):
        write_parameters(tmp_path, "mapper", {})


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


def test_the_bag_of_a_run(tmp_path):
    run = tmp_path / "run.2026"
    (run / "bag").mkdir(parents=True)
    assert bag_of(run) == run / "bag"
    assert bag_of(run / "bag") == run / "bag"
    assert bag_of(tmp_path / "none") == tmp_path / "none"
