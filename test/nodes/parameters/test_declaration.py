"""Tables of parameters: only what is in them is accepted."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.parameters.declaration import Parameter, Parameters, check_values

TABLE = (
    Parameter(name="field", default="", description="field file"),
    Parameter(name="speed_mps", default=0.6, description="speed", unit="m/s", low=0.1, high=3.0, changeable=True),
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


def test_descriptors_tell_tools_range_unit_and_what_may_change(ros):
    node = make(ros)
    Parameters(node, TABLE)
    speed = node.describe_parameter("speed_mps")
    assert speed.type == ParameterType.PARAMETER_DOUBLE
    assert speed.description == "speed [m/s]"
    assert (speed.floating_point_range[0].from_value, speed.floating_point_range[0].to_value) == (0.1, 3.0)
    assert not speed.read_only
    assert node.describe_parameter("field").read_only
    assert node.describe_parameter("fit").additional_constraints == "one of: reml, soft_l1"


def test_changes_at_run_time_are_checked_and_told(ros):
    node = make(ros)
    parameters = Parameters(node, TABLE)
    told = []
    parameters.on_change(told.append)
    good, bad, fixed = node.set_parameters(
        [
            RosParameter("speed_mps", value=1.0),
            RosParameter("speed_mps", value=0.0),
            RosParameter("field", value="x"),
        ]
    )
    assert (good.successful, bad.successful, fixed.successful) == (True, False, False)
    assert told == [{"speed_mps"}]
    assert parameters.number("speed_mps") == 1.0


def test_values_without_a_node():
    values, mistakes = check_values(
        {row.name: row for row in TABLE}, {"speed_mps": 1, "use_sim_time": True}, ["use_sim_time"]
    )
    assert values["speed_mps"] == 1.0
    assert not mistakes
