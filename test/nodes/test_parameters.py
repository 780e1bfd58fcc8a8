# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of tables of parameters, and that nodes accept nothing else."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from soilmoist_ros.exploration import Cause, Response
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.parameter_tables import table_of
from soilmoist_ros.nodes.parameters import NODES, OF_OTHERS, REMOVED, SILENCE_S, Parameter, Parameters
from soilmoist_ros.nodes.planner_parameters import WATCH_PARAMETERS, failsafe_responses

ROOT = Path(__file__).resolve().parents[2]
TABLE = (
    Parameter(name="field", default="", description="field file"),
    Parameter(name="speed_mps", default=0.6, description="speed", unit="m/s", low=0.1, high=3.0),
    Parameter(name="retries", default=1, description="retries", low=0),
    Parameter(name="fit", default="reml", description="variogram fit", choices=("reml", "soft_l1")),
    Parameter(name="autostart", default=True, description="start at once"),
    Parameter(name="topics", default=["a"], description="topics"),
)


def make(ros, **given):
    overrides = [RosParameter(name, value=value) for name, value in given.items()]
    return Node("example", context=ros.context, parameter_overrides=overrides)


def test_defaults_and_given_values(ros):
    parameters = Parameters(make(ros, speed_mps=2, retries=0, topics=["x", "y"]), TABLE)
    assert parameters.as_dict() == {
        "field": "", "speed_mps": 2.0, "retries": 0, "fit": "reml", "autostart": True, "topics": ["x", "y"],
    }  # fmt: skip
    assert parameters.number("speed_mps") == 2.0
    assert parameters.texts("topics") == ["x", "y"]


def test_every_mistake_is_named_at_once(ros):
    with pytest.raises(InputError) as caught:
        Parameters(make(ros, sped_mps=1.0, fit="rmel", retries=-1, autostart="yes", speed_mps=9.0), TABLE)
    said = str(caught.value)
    for part in (
        "there is no parameter 'sped_mps'", "did you mean 'speed_mps'?", "did you mean 'reml'?",
        "retries must be >= 0, got -1", "autostart must be true or false", "speed_mps must be 0.1 .. 3 m/s, got 9",
    ):  # fmt: skip
        assert part in said


class Public:
    """A node of an rclpy whose private attributes have other names."""

    def __init__(self, node):
        self._node = node

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._node, name)


def test_without_the_private_list_of_rclpy_the_known_names_are_asked_for(ros):
    parameters = Parameters(Public(make(ros, speed_mps=2, topics=["x"], sped_mps=1.0)), TABLE)
    assert (parameters.number("speed_mps"), parameters.texts("topics")) == (2.0, ["x"])
    with pytest.raises(InputError, match="retries must be >= 0, got -1"):
        Parameters(Public(make(ros, retries=-1)), TABLE)


def test_nothing_else_that_is_private_in_ros_is_used():
    """A private name has no promise: only the one above is read, whose fall-back is tested."""
    taken = set()
    for path in (*ROOT.glob("soilmoist_ros/nodes/*.py"), *ROOT.glob("msg_adapters/*.py")):
        text = path.read_text(encoding="utf-8")
        own = {name for found in re.findall(r"\b(?:self|cls)\.(_\w+)|def (_\w+)", text) for name in found}
        private = (
            r"\b(?!self\b|cls\b)\w+\.(_[A-Za-z]\w*)|getattr\(\w+, \"(_\w+)|import (_\w+)|(rclpy\.impl|\b_rclpy\w*)"
        )
        taken |= {name for found in re.findall(private, text) for name in found} - own
    assert taken - {""} == {"_parameter_overrides", "_exit"}, "os._exit is public"


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        ("/**:\n  ros__parameters: {robot_name: t14, ramp: 1.0}", ()),
        ("/**:\n  ros__parameters: {robot_name: t14, sped_mps: 1.0}", ("sped_mps",)),
        (
            "/**:\n  ros__parameters: {robot_name: t14}\nexample:\n  ros__parameters: {sped_mps: 1.0}",
            ("sped_mps",),
        ),
        ("/farm/*:\n  ros__parameters: {arm: {robot_name: t14}, ramp: 1.0}", ("robot_name",)),
        ("/**/example:\n  ros__parameters: {robot_name: t14, sped_mps: 1.0}", ("robot_name", "sped_mps")),
        ("farm:\n  example:\n    ros__parameters: {robot_name: t14, sped_mps: 1.0}", ("robot_name", "sped_mps")),
    ],
)
def test_unknown_names_that_are_meant_for_all_nodes_are_ignored(ros, tmp_path, capfd, text, refused):
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    names = [name for name in ("robot_name", "sped_mps", "ramp") if name in text]
    node = make(ros, **dict.fromkeys(names, 1.0))
    arguments = ["planner", "--ros-args", "--params-file", str(file)]
    if refused:
        with pytest.raises(InputError) as caught:
            Parameters(node, TABLE, arguments)
        assert [name for name in names if f"'{name}'" in str(caught.value)] == list(refused)
        return
    Parameters(node, TABLE, arguments)
    assert "does not have are ignored: ramp, robot_name" in capfd.readouterr().err
    with pytest.raises(InputError, match="there is no parameter 'ramp'"):
        Parameters(make(ros, ramp=1.0), TABLE, [*arguments, "-p", "ramp:=1.0"])


def test_values_in_messages_are_as_people_write_them():
    class Answer(StrEnum):
        HOME = "return_home"

    row = Parameter(name="low", default=Answer.HOME.value, description="low", choices=tuple(Answer))
    with pytest.raises(
        ValueError, match=r"one of: return_home; got 'Return_Home' \(did you mean 'return_home'\?\)"
    ):
        row.checked("Return_Home")
    with pytest.raises(ValueError, match="must be text, got False: YAML reads on, off, yes and no as such"):
        row.checked(False)
    topics = Parameter(name="topics", default=["a"], description="topics")
    assert topics.checked(None) == topics.checked([""]) == [], "an empty list has no type in ROS"


def test_descriptors_show_range_and_unit(ros):
    node = make(ros)
    Parameters(node, TABLE)
    speed = node.describe_parameter("speed_mps")
    assert speed.type == ParameterType.PARAMETER_DOUBLE
    assert speed.description == "speed [m/s]"
    assert (speed.floating_point_range[0].from_value, speed.floating_point_range[0].to_value) == (0.1, 3.0)
    assert speed.read_only
    assert node.describe_parameter("fit").additional_constraints == "one of: reml, soft_l1"


def test_the_page_names_the_parameters_that_may_change():
    page = (ROOT / "docs" / "parameters.md").read_text()
    for node in NODES:
        (cell,) = re.findall(rf"^\| `{node}` \| .* \| (.*) \|$", page, re.MULTILINE)
        assert re.findall(r"`(\w+)`", cell) == [row.name for row in table_of(node) if row.live]


def test_a_live_parameter_is_set_if_its_value_is_allowed_and_used(ros):
    node, given = make(ros), []
    rows = (*TABLE, Parameter(name="hours", default=4.0, description="hours", low=0.01, live=True))
    parameters = Parameters(node, rows)
    parameters.watch(lambda values: given.append(values) or ("" if values["hours"] < 9 else "too long"))

    def put(**values):
        results = node.set_parameters([RosParameter(name, value=value) for name, value in values.items()])
        return [result.reason for result in results if not result.successful]

    assert not node.describe_parameter("hours").read_only
    assert put(hours=1.5) == []
    assert put(hours=10.0) == ["too long"]
    (reason,) = put(hours=0.001)
    assert "hours" in reason
    assert "read-only parameter: field" in put(field="x")[0]
    assert given == [{"hours": 1.5}, {"hours": 10.0}]
    parameters.show({"hours": 2.0, "field": ""})
    assert node.get_parameter("hours").value == 2.0
    assert parameters.number("hours") == 4.0, "that of the start"


def test_removed_parameters_are_named_and_ignored(ros, capfd):
    parameters = Parameters(make(ros, backoff_s=9.0, speed_mps=2.0), TABLE)
    assert parameters.number("speed_mps") == 2.0
    assert "parameter backoff_s is not used any more: the wait after the first failure" in capfd.readouterr().err
    of_planner = {"antenna_x_m", "antenna_y_m", "autostart"}
    assert {row.name for node in NODES for row in table_of(node)} & set(REMOVED) == {*OF_OTHERS, *of_planner}
    assert {row.name for row in table_of("planner")} & set(REMOVED) == of_planner
    with pytest.raises(InputError, match="not served behind a proxy -> leave address out"):
        Parameters(make(ros, address="https://robot.example/"), table_of("console"))
    Parameters(make(ros, max_stamp_age_s=0.0), (*TABLE, *table_of("planner")))
    assert "parameter max_stamp_age_s is not used any more" in capfd.readouterr().err


def test_failsafes_are_read_as_before_and_as_a_list(ros, capfd):
    table = (*TABLE, *WATCH_PARAMETERS)
    given = {"failsafe.off_route": "pause", "failsafe.battery_low": "warn", "failsafes": ["battery_low: abort"]}
    responses = failsafe_responses(Parameters(make(ros, **given), table))
    assert (responses[Cause.OFF_ROUTE], responses[Cause.BATTERY_LOW]) == (Response.PAUSE, Response.ABORT)
    assert responses[Cause.MOVING] is Response.PAUSE
    assert "set failsafes: [battery_low:warn, off_route:pause]" in capfd.readouterr().err
    silent = Parameters(make(ros, on_silence="abort"), (*table_of("planner"),))
    assert failsafe_responses(silent)[Cause.RECORDS_OLD] is Response.ABORT
    old = Parameters(make(ros, on_silence="pause", records_old_s=0.0, strategy="ivr"), table_of("planner"))
    assert failsafe_responses(old)[Cause.RECORDS_OLD] is Response.PAUSE
    assert (old.number("records_old_s"), old.text("strategy")) == (SILENCE_S, "gcb")
    said = capfd.readouterr().err
    assert "records_old_s: 60, which is used instead of 0" in said
    assert "strategy ivr is gone" in said
    waits = Parameters(make(ros, on_silence="wait"), table_of("planner"))
    assert failsafe_responses(waits)[Cause.RECORDS_OLD] is Response.WARN
    assert "on_silence is read in this release only: leave it out" in capfd.readouterr().err
    with pytest.raises(InputError, match="must be wait, pause or abort; got 'stop'"):
        Parameters(make(ros, on_silence="stop"), table_of("planner"))
    for wrong in ("ofroute:pause", "off_route:paus", "off_route"):
        with pytest.raises(InputError, match="write CAUSE:RESPONSE"):
            failsafe_responses(Parameters(make(ros, failsafes=[wrong]), table))
    with pytest.raises(InputError, match="watchdog:hold is not possible"):
        failsafe_responses(Parameters(make(ros, failsafes=["watchdog:hold"]), table))
