# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Missions with a real planner process (planner_inputs.py, planner_outputs.py), a virtual robot and navigation."""

import math
from dataclasses import replace

import pytest
from pydantic import TypeAdapter

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from sensor_msgs.msg import PointCloud2
from soilmoist_msgs.msg import Visit as VisitMessage
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from topological_navigation_msgs.action import GotoNode
from virtual_navigation import FIELD, STOPS, VirtualNavigation, World
from visualization_msgs.msg import MarkerArray

from msg_adapters.counts import counts_to_message
from msg_adapters.mission import mission_from_message, mission_to_message
from msg_adapters.places import path_to_places
from msg_adapters.soilmoist_types import visit_from_message
from soilmoist_ros.exploration import Phase, Visit, VisitEnd
from soilmoist_ros.exploration.mission.journal import VISIT
from soilmoist_ros.nodes.topics import LATCHED, RECORDS, VISITS
from soilmoist_ros.recording import BagReader
from soilmoist_ros.recording.journal import decode
from soilmoist_ros.sensing.records import CountRecord

# rclpy warns when a server of the test disappears during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class Planning:
    """A planner process and its messages."""

    def __init__(self, ros, folder, namespace="", remaps=(), executable="planner", **params):
        self.ros, self.namespace = ros, namespace
        (folder / "field.yaml").write_text(FIELD)
        given = {
            "use_sim_time": True, "field": str(folder / "field.yaml"), "dwell": "fmi:20", "hours": 0.1,
            "speed_mps": 1.0, "stop_overhead_s": 2.0, "min_dwell_s": 20.0, "return_margin_s": 10.0,
            "strategy": "greedy", "arrival_radius_m": 2.0, "fix_frozen_s": 0.0, **params,
        }  # fmt: skip
        self.messages = ros.collect(DiagnosticStatus, f"{namespace}/mission", LATCHED)
        self.process = ros.start(executable, params=given, namespace=namespace, remaps=remaps)

    @property
    def status(self):
        return mission_from_message(self.messages[-1]) if self.messages else None

    @property
    def reasons(self):
        return [message.message for message in list(self.messages)]

    def call(self, verb):
        return self.ros.call(Trigger, f"{self.namespace}/planner/{verb}")

    def wait(self, condition, message=""):
        self.ros.wait_for(lambda: self.status is not None and condition(self.status), message=message)

    def wait_phase(self, *phases):
        self.wait(lambda status: status.phase in phases, f"one of {phases}")

    def wait_end(self):
        """Wait until the process has ended by itself, and its last message has come."""
        assert self.process.wait() == 0
        self.wait_phase(Phase.FINISHED)


def test_a_mission_is_published_recorded_and_logged_as_it_was(ros, tmp_path):
    saved = []

    def save(request, response):
        saved.append(1)
        response.success = True
        return response

    name = "/robot_1"
    recorder = ros.start("recorder", params={"out": str(tmp_path), "name": "bag"}, namespace=name)
    published = ros.collect(VisitMessage, f"{name}/visits", VISITS)
    ros.node.create_service(Trigger, f"{name}/mapper/save", save)
    plans = ros.collect(Path, f"{name}/plan", LATCHED)
    markers = ros.collect(MarkerArray, f"{name}/plan_markers", LATCHED)
    with (
        World(ros, rate=20.0, namespace=name) as world,
        VirtualNavigation(ros, world, namespace=name) as navigation,
    ):
        planning = Planning(
            ros, tmp_path, name, autostart=True, exit_when_finished=True, home="shed",
            journal_dir=str(tmp_path / "journal"),
        )  # fmt: skip
        planning.wait(lambda status: status.samples >= 1)
        late = ros.collect(VisitMessage, f"{name}/visits", VISITS)
        planning.wait_end()
        samples = planning.status.samples
        ros.wait_for(lambda: len(published) >= samples and len(late) >= samples, message="the visits")
        assert "home" in planning.status.reason
        assert world.place == (-10.0, 5.0)
        assert set(navigation.ends) == {"succeeded"}
        assert navigation.goals[-1] == "shed"
        assert set(navigation.goals[:-1]) <= {stop.name for stop in STOPS}
        assert len(set(navigation.goals)) == len(navigation.goals), "no stop twice in so short a mission"
        counted = sum(world.counted.values())
    assert saved
    ros.wait_for(lambda: plans[-1].poses == [], message="the plan of the end")
    assert 5.0 <= path_to_places(next(plan for plan in plans if plan.poses))[0][0] <= 35.0
    texts = [marker.text for array in markers for marker in array.markers if marker.text]
    assert any(text.endswith(", 20 s") for text in texts)
    assert recorder.stop() == 0
    entries = decode((tmp_path / "journal" / "journal.jsonl").read_bytes()).entries
    logged = [TypeAdapter(Visit).validate_python(entry.payload) for entry in entries if entry.kind == VISIT]
    assert len(logged) == samples >= 2
    assert [visit_from_message(message) for message in published] == logged
    assert late == published, "a late receiver gets all of them"
    with BagReader(tmp_path / "bag") as bag:
        assert bag.read_visits() == logged
    assert {(message.robot, message.header.frame_id) for message in published} == {("robot_1", "map")}
    assert 0 < sum(visit.raw_counts for visit in logged) <= counted
    assert {visit.dwell for visit in logged} == {"fmi:20"}
    assert logged[-1].ended in (VisitEnd.ENOUGH, VisitEnd.TIME_UP)
    for visit in logged[:-1]:
        assert visit.ended is VisitEnd.ENOUGH
        assert visit.records >= 2
        assert visit.exposure_s >= 20.0


@pytest.mark.slow
def test_abort_is_not_behind_a_flood_of_records(ros, tmp_path):
    with World(ros) as world, VirtualNavigation(ros, world):
        journal = tmp_path / "journal"
        planning = Planning(ros, tmp_path, autostart=True, dwell="fmi:3000", hours=3.0, journal_dir=str(journal))
        planning.wait_phase(Phase.COUNTING)
        world.rate = 1.0
        abort = ros.node.create_client(Trigger, "planner/abort")
        counts = ros.node.create_publisher(PointCloud2, "counts", RECORDS)
        ros.wait_for(lambda: abort.service_is_ready() and counts.get_subscription_count(), message="the planner")
        flood = [CountRecord(world.now_s + i * 1e-6, *world.place, 0.0, 3, 1e-6, 1e-6) for i in range(10_000)]
        message = counts_to_message(flood)
        for _ in range(30):
            counts.publish(message)
        answer = abort.call_async(Trigger.Request())
        ros.wait_for(answer.done, message="the answer")
        assert answer.result().success
        planning.process.kill()
    kinds = [entry.payload.get("event") for entry in decode((journal / "journal.jsonl").read_bytes()).entries]
    aborted = len(kinds) - 1 - kinds[::-1].index("Command")
    assert kinds[:aborted].count("RecordArrived") < 30 * len(flood), "commands come between the slices"


def test_a_mission_by_poses_alone_without_the_message_types(ros, tmp_path):
    def take(message):
        world.goal = (message.pose.position.x, message.pose.position.y)

    hidden = tmp_path / "hidden" / "soilmoist_msgs"
    hidden.mkdir(parents=True)
    (hidden / "__init__.py").write_text("raise ImportError('not built')")
    ros.environment["PYTHONPATH"] = str(hidden.parent)
    with World(ros, rate=20.0) as world:
        world.place = (-3.0, 5.0)
        ros.node.create_subscription(PoseStamped, "goal_pose", take, 10)
        planning = Planning(
            ros, tmp_path, navigator="goal_pose", graph="free", autostart=True, home="r0c0",
            exit_when_finished=True, hours=0.15,
        )  # fmt: skip
        planning.wait_end()
        # A last stop next to home is home.
        assert math.dist(world.place, (1.0, 1.0)) < 2.5, planning.process.output()
    output = planning.process.output()
    assert output.count("visits and mission_state are not published: soilmoist_msgs is not installed") == 1
    assert output.count("visit: ") == planning.status.samples >= 2


def test_what_is_missing_is_said_and_services_steer_the_mission(ros, tmp_path):
    found = ros.collect(DiagnosticArray, "/diagnostics", 10)
    planning = Planning(ros, tmp_path, hours=2.0, dwell="fmi:600")
    for part in ("/clock", "map of the navigation", "a position", "topological_navigation"):
        planning.wait(lambda status, part=part: part in status.reason, part)
    assert "not yet, waiting for" in planning.call("start").message
    parts = {f"/planner: {part}" for part in ("navigation", "position", "records", "frames", "guard")}
    ros.wait_for(lambda: found)
    assert {status.name for status in found[-1].status} >= parts
    with World(ros, rate=20.0) as world, VirtualNavigation(ros, world) as navigation:
        planning.wait(lambda status: "waiting for start" in status.reason)
        assert not planning.call("resume").success
        assert planning.call("start").success
        planning.wait_phase(Phase.TRAVELLING)
        assert planning.call("pause").success
        planning.wait_phase(Phase.PAUSED)
        ros.wait_for(lambda: planning.messages[-1].level == b"\x01", message="a warning while paused")
        assert world.goal is None, "a paused robot stands"
        target = planning.status.target
        assert planning.call("resume").success
        planning.wait_phase(Phase.COUNTING)
        assert planning.call("skip").success
        planning.wait(lambda status: status.phase is Phase.TRAVELLING and status.target != target)
        assert planning.call("abort").success
        planning.wait_phase(Phase.IDLE)
        assert world.goal is None, "an aborted robot stands"
        assert planning.call("start").success
        planning.wait_phase(Phase.TRAVELLING, Phase.COUNTING)
        assert navigation.most_at_once == 1
        assert planning.process.stop() == 0
        ros.wait_for(lambda: world.goal is None, message="the robot to stop with its planner")


def test_other_robots_are_heard_if_they_have_the_same_datum(ros, tmp_path):
    said = ros.collect(DiagnosticArray, "/diagnostics")
    others = {name: ros.node.create_publisher(DiagnosticStatus, f"{name}/mission", LATCHED)
              for name in ("/robot_2", "/robot_3")}  # fmt: skip
    planning = Planning(
        ros, tmp_path, "/robot_1", navigator="goal_pose", graph="free", others=["/robot_1", *others]
    )
    planning.wait_phase(Phase.IDLE)

    def named(text):
        found = [status for message in said for status in message.status if status.name.endswith(": others")]
        return found and text in found[-1].message

    ros.wait_for(lambda: named("no status of /robot_2, /robot_3 yet"))
    there = replace(planning.status, phase=Phase.COUNTING, place=(12.0, 7.0))
    others["/robot_2"].publish(mission_to_message(there))
    others["/robot_3"].publish(mission_to_message(there, {"datum": "[53.9, -0.5]"}))
    ros.wait_for(lambda: named("/robot_3 is not heard: its places are about another datum (53.900000 N"))
    assert not planning.call("release_lost").success


def test_a_planner_that_ends_stops_a_robot_whose_navigation_has_not_answered_yet(ros, tmp_path):
    """It would drive without a planner."""
    with World(ros, rate=2.0) as world, VirtualNavigation(ros, world) as navigation:
        navigation.accepts_after_s = 0.4
        planning = Planning(ros, tmp_path, autostart=True, hours=2.0)
        ros.wait_for(navigation.asked.is_set, message="a goal")
        assert planning.process.stop() == 0
        ros.wait_for(lambda: navigation.ends, message="the end of the goal")
        assert navigation.ends == ["canceled"]


def test_what_drives_the_robot_without_a_mission_is_stopped(ros, tmp_path):
    """The goal of a mission that is forgotten, and one that somebody else has sent."""
    journal = {"journal_dir": str(tmp_path / "journal"), "hours": 2.0}
    with World(ros, rate=2.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Planning(ros, tmp_path, autostart=True, **journal)
        ros.wait_for(lambda: world.goal, message="a goal")
        planning.process.kill()
        fresh = Planning(ros, tmp_path, resume="fresh", **journal)
        ros.wait_for(lambda: navigation.ends == ["canceled"], message="the end of the forgotten goal")
        fresh.wait_phase(Phase.IDLE)

        somebody = ActionClient(ros.node, GotoNode, "topological_navigation")
        somebody.send_goal_async(GotoNode.Goal(target=STOPS[-1].name))
        ros.wait_for(lambda: world.goal, message="the goal of somebody")
        ros.node.create_publisher(Bool, "emergency_stop", LATCHED).publish(Bool(data=True))
        ros.wait_for(lambda: navigation.ends == ["canceled"] * 2, message="the end of this goal")
