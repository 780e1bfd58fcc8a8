# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Commands of an operator to a real planner: services, parameters, emergency stops."""

import re
import shlex
import time
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from geometry_msgs.msg import Point32
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import PointCloud2
from soilmoist_msgs.msg import Mission
from soilmoist_msgs.srv import Command
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from test_planner import Planning
from virtual_navigation import FIELD, START_S, STOPS, VirtualNavigation, World

from msg_adapters import counts_to_message, request_from_message, request_to_message, soil_map_from_message
from soilmoist_ros.exploration import OperatorRequest, Phase, Verb
from soilmoist_ros.mapping.soil_map import CELL
from soilmoist_ros.nodes.planner import PARAMETERS
from soilmoist_ros.nodes.topics import LATCHED, RECORDS
from soilmoist_ros.recording.journal import decode
from soilmoist_ros.sensing.records import CountRecord

# rclpy warns when a server of the test disappears during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class Commanded(Planning):
    """A planner process that an operator steers, with its journal."""

    def __init__(self, ros, folder, **params):
        self.journal = folder / "journal"
        self.states = ros.collect(Mission, "mission_state", LATCHED)
        super().__init__(
            ros, folder, **{"hours": 2.0, "dwell": "fmi:600", "journal_dir": str(self.journal), **params}
        )

    @property
    def state(self):
        return self.states[-1] if self.states else None

    def ask(self, verb, who="Ada", **values):
        message = request_to_message(OperatorRequest(verb, who, **values))
        return self.ros.call(Command, "planner/command", message)

    def accepted(self, verb, **values):
        response = self.ask(verb, **values)
        assert (response.accepted, response.code) == (True, "accepted"), response.message
        return response.message

    def refused(self, code, verb, **values):
        response = self.ask(verb, **values)
        assert (response.accepted, response.code) == (False, code), response.message
        assert response.message

    def wait_state(self, condition, message=""):
        self.ros.wait_for(lambda: self.state is not None and condition(self.state), message=message)

    def press(self, publisher, data):
        """Publish until it is heard: the first messages to a new subscription may be lost."""

        def heard():
            publisher.publish(Bool(data=data))
            time.sleep(0.1)
            return self.state is not None and self.state.emergency_stop is data

        self.ros.wait_for(heard, message=f"emergency stop {data}")

    def parameter(self, name):
        answer = self.ros.call(GetParameters, "planner/get_parameters", GetParameters.Request(names=[name]))
        return parameter_value_to_python(answer.values[0])

    def set_parameter(self, name, value):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        (result,) = self.ros.call(SetParameters, "planner/set_parameters", request).results
        return "" if result.successful else result.reason

    def journalled(self):
        """Verb and name of the operator of each command that was written down."""
        entries = decode((self.journal / "journal.jsonl").read_bytes()).entries
        commands = [entry.payload for entry in entries if entry.payload.get("event") == "Command"]
        return [(command["verb"], command["who"]) for command in commands]


def test_every_verb(ros, tmp_path):
    with World(ros, rate=20.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Commanded(ros, tmp_path)
        planning.wait(lambda status: status.reason == "waiting for start")
        planning.refused("refused", "measure", stops=("n11",))
        planning.refused("unknown_verb", "go")
        planning.accepted("start")
        planning.wait_state(lambda state: state.phase == Mission.PHASE_TRAVELLING, "travelling")
        assert planning.state.time_left_s > 7000.0

        for wrong in ({"place": (float("nan"), 1.0)}, {"place": (90.0, 1.0)}, {"place": (10.0, 10.0)}, {}):
            planning.refused("bad_place", "measure", **wrong)
        planning.refused("bad_polygon", "rule_out", polygon=((1.0, 1.0), (5.0, 5.0)))
        planning.refused("refused", "change", hours=0.0001)
        planning.accepted("measure", place=(15.5, 15.0), dwell="20")
        planning.accepted("measure", stops=("n12",))
        planning.accepted("measure", stops=("n02",))
        planning.accepted("order", stops=("n12", "n11"))
        planning.wait_state(lambda state: state.queue == ["n12", "n11"], "the queue in its new order")

        planning.accepted("change", hours=1.5, dwell="fmi:20", strategy="random", home="n00")
        assert [planning.parameter(name) for name in ("hours", "dwell", "strategy", "home")] == [
            1.5, "fmi:20", "random", "n00",
        ]  # fmt: skip
        planning.accepted("rule_out", polygon=((30.0, 0.0), (40.0, 0.0), (40.0, 30.0), (30.0, 30.0)))
        planning.wait_state(lambda state: len(state.ruled_out_areas) == 1, "the area that is ruled out")

        planning.accepted("pause")
        planning.wait_state(lambda state: state.phase == Mission.PHASE_PAUSED, "paused")
        assert "Ada" in planning.state.reason
        planning.accepted("resume", who="Bo")
        planning.wait_state(
            lambda state: state.phase in (Mission.PHASE_TRAVELLING, Mission.PHASE_COUNTING), "resumed"
        )
        ros.wait_for(lambda: planning.ask("skip").accepted, message="a stop to skip")
        planning.wait_state(lambda state: "n11" not in state.queue and state.samples > 0, "the queued stops")
        # A goal that was interrupted is sent again.
        queued = lambda: [one for one, _ in groupby(navigation.goals) if one in ("n12", "n11")][:2]  # noqa: E731
        ros.wait_for(lambda: len(queued()) == 2, message="the goals of the queued stops")
        assert queued() == ["n12", "n11"]

        planning.accepted("return_home")
        planning.wait_state(lambda state: state.phase == Mission.PHASE_FINISHED, "home")
        assert "sent home by Ada" in planning.state.reason
        assert world.place == (5.0, 5.0)
        assert planning.state.ended == Mission.END_RETURNED
        planning.accepted("abort")
        planning.wait_state(lambda state: state.phase == Mission.PHASE_IDLE, "idle")
    assert planning.process.stop() == 0
    assert [command for command, _ in groupby(planning.journalled())] == [
        ("start", "Ada"), ("change", "Ada"), ("measure", "Ada"), ("order", "Ada"),
        ("change", "Ada"), ("rule_out", "Ada"), ("pause", "Ada"), ("resume", "Bo"), ("skip", "Ada"),
        ("return_home", "Ada"), ("abort", "Ada"),
    ]  # fmt: skip


def test_parameters_are_set_while_it_runs(ros, tmp_path):
    with World(ros, rate=5.0) as world, VirtualNavigation(ros, world):
        planning = Commanded(ros, tmp_path, home="n00")
        planning.wait(lambda status: status.reason == "waiting for start")
        assert planning.set_parameter("dwell", "fmi:300") == ""
        assert planning.call("start").success
        planning.wait_state(lambda state: state.phase == Mission.PHASE_TRAVELLING, "travelling")
        for name, value, word in [
            ("hours", 1e-4, "hours"), ("dwell", "often", "fmi"), ("home", "n99", "n99"),
            ("home", "", "empty"), ("strategy", "gredy", "greedy"), ("target", "vwc", "calibration"),
            ("field", "other", "under way"), ("arrival_radius_m", 1.0, "read-only"), ("hours", 1.5, ""),
            ("strategy", "random", ""), ("home", "n01", ""), ("until_gain", -1.0, "until_gain"),
            ("until_gain", 0.5, ""),
        ]:  # fmt: skip
            reason = planning.set_parameter(name, value)
            assert word in reason
            assert bool(reason) is bool(word), (name, reason)
        names = ("hours", "dwell", "strategy", "home", "target", "until_gain")
        assert [planning.parameter(name) for name in names] == [1.5, "fmi:300", "random", "n01", "rate", 0.5]
        planning.wait_state(lambda state: state.time_left_s < 5400.0, "the new budget")
        planning.process.kill()
        again = Commanded(ros, tmp_path, home="n00")
        again.wait_phase(Phase.PAUSED)
        values = [again.parameter(name) for name in ("hours", "dwell", "strategy", "home")]
        assert values == [1.5, "fmi:300", "random", "n01"], "a restart keeps what was changed in mid-mission"
    changes = [who for verb, who in again.journalled() if verb == "change"]
    assert changes == ["ros2 param"] * 5


def test_another_field_is_chosen_between_missions_and_the_mapper_follows(ros, tmp_path):
    west = "[[0, 0], [20, 0], [20, 30], [0, 30]]"
    (tmp_path / "west.yaml").write_text(re.sub(r"polygon: .*", f"polygon: {west}", FIELD))
    maps = ros.collect(PointCloud2, "soil_map", LATCHED)
    counts = ros.node.create_publisher(PointCloud2, "counts", RECORDS)
    # Of an hour ago: the robot is elsewhere now.
    records = [
        CountRecord(START_S - 3600.0 + 10 * n, 2.0 + 4 * (n % 9), 2.0 + 5 * (n // 9), 0.0, 40 + n, 10.0, 10.0)
        for n in range(45)
    ]

    def cells():
        shown = soil_map_from_message(maps[-1]) if maps else np.zeros(0, CELL)
        return shown["x"][np.isfinite(shown["rate"])].max(initial=0.0)

    def parameters(node):
        request = GetParameters.Request(names=["field", "earlier"])
        answer = ros.call(GetParameters, f"{node}/get_parameters", request)
        return [parameter_value_to_python(value) for value in answer.values]

    with World(ros, rate=5.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Commanded(ros, tmp_path)
        saved = str(tmp_path / "saved")
        params = {"field": str(tmp_path / "field.yaml"), "use_sim_time": True, "save_dir": saved}
        mapper = ros.start("mapper", params=params)
        planning.wait(lambda status: status.reason == "waiting for start")
        ros.wait_for(lambda: counts.get_subscription_count() >= 2, message="planner and mapper")
        counts.publish(counts_to_message(records))
        ros.wait_for(lambda: cells() > 30, message="the map of the whole field")
        planning.refused("bad_setting", "change", field=str(tmp_path / "gone.yaml"))
        planning.refused("bad_setting", "change", earlier=(str(tmp_path),))
        assert ros.call(Trigger, "mapper/save").success
        planning.accepted("change", field=str(tmp_path / "west.yaml"), earlier=(saved,))
        ros.wait_for(lambda: 0 < cells() < 20, message="the map of its west")
        for node in ("planner", "mapper"):
            ros.wait_for(
                lambda node=node: parameters(node) == [str(tmp_path / "west.yaml"), [saved]], message=node
            )
        planning.accepted("change", earlier=())
        for node in ("planner", "mapper"):
            ros.wait_for(lambda node=node: not parameters(node)[1], message=node)
        planning.accepted("start")
        planning.refused("refused", "change", field=str(tmp_path / "field.yaml"))
        ros.wait_for(lambda: len(navigation.goals) > 0, message="a goal")
        planning.process.kill()
        again = Commanded(ros, tmp_path)
        again.wait_state(lambda state: state.phase == Mission.PHASE_PAUSED, "paused")
        assert again.state.field == str(tmp_path / "west.yaml"), "a restart keeps the field of the mission"
        again.accepted("abort")
        again.accepted("abort")
        assert again.set_parameter("field", str(tmp_path / "field.yaml")) == ""
        ros.wait_for(lambda: cells() > 30, message="the map of the whole field again")
        assert {stop.name: stop.x_m for stop in STOPS}[navigation.goals[0]] <= 20
    assert (again.process.stop(), mapper.stop()) == (0, 0)
    assert [who for verb, who in again.journalled() if verb == "change"] == ["Ada", "ros2 param"]


def test_an_emergency_stop_is_heard_from_any_publisher_and_lasts(ros, tmp_path):
    latched = ros.node.create_publisher(Bool, "emergency_stop", LATCHED)
    latched.publish(Bool(data=True))
    with World(ros, rate=5.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Commanded(ros, tmp_path, autostart=True)
        planning.wait_state(lambda state: state.emergency_stop, "the press of before the start")
        planning.wait(lambda status: "waiting for start" in status.reason)
        assert "emergency stop" in planning.ask("start").message
        planning.press(latched, False)
        planning.accepted("start")
        planning.wait_state(
            lambda state: state.phase == Mission.PHASE_TRAVELLING and state.distance_m > 0, "driving"
        )

        plain = ros.node.create_publisher(Bool, "emergency_stop", 10)
        planning.press(plain, True)
        planning.wait_state(lambda state: state.emergency_stop and state.phase == Mission.PHASE_PAUSED, "the stop")
        ros.wait_for(lambda: world.goal is None, message="the robot to be stopped")
        goals = len(navigation.goals)
        assert "release it first" in planning.ask("resume").message
        planning.press(plain, False)
        assert planning.state.phase == Mission.PHASE_PAUSED
        assert (world.goal, len(navigation.goals)) == (None, goals), "a release moves nothing"
        planning.accepted("resume")
        planning.wait_state(lambda state: state.phase != Mission.PHASE_PAUSED, "resumed")


PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "robot.md"
COMMANDS = PAGE.read_text().partition("## All commands")[2]
DOCUMENTED = [line for line in COMMANDS.splitlines() if line.startswith("ros2 ")]


def test_the_documented_lines_are_of_the_types_verbs_and_parameters_that_there_are():
    verbs, parameters = set(), {row.name for row in PARAMETERS}
    for line in DOCUMENTED:
        match shlex.split(line)[1:]:
            case ["service", "call", "/planner/command", "soilmoist_msgs/srv/Command", text]:
                values = yaml.safe_load(text)
                values["polygon"] = [Point32(**corner) for corner in values.get("polygon", ())]
                request = Command.Request(**values)
                assert request_to_message(request_from_message(request)) == request
                verbs.add(request.verb)
            case ["param", "set" | "get", "/planner", name, *_]:
                assert name in parameters
            case ["topic", "pub", "--times", _, "--rate", _, "/emergency_stop", "std_msgs/msg/Bool", text]:
                assert Bool(**yaml.safe_load(text))
            case other:
                raise AssertionError(f"what does {other} do?")
    said = "start measure order rule_out change pause resume return_home abort"
    assert verbs == set(said.split()) <= {verb.value for verb in Verb}
