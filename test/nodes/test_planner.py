# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Missions with a real planner process (planner_inputs.py, planner_outputs.py), a virtual robot and navigation."""

import math
from dataclasses import replace
from functools import partial

import pytest
from pydantic import TypeAdapter

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from topological_navigation_msgs.action import GotoNode
from virtual_navigation import FIELD, STOPS, VirtualNavigation, World, make_map
from visualization_msgs.msg import MarkerArray

from msg_adapters.counts import counts_to_message, samples_from_message
from msg_adapters.mission import mission_from_message, mission_to_message
from msg_adapters.places import path_to_places
from soilmoist_ros.exploration.mission.journal import VISIT
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.exploration.mission.visit import Visit, VisitEnd
from soilmoist_ros.nodes.topics import LATCHED, RECORDS, VISITS
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.journal import load_journal
from soilmoist_ros.sensing.records import CountRecord

# rclpy warns when a server of the test disappears during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class Planning:
    """A planner process and its messages."""

    def __init__(self, ros, folder, namespace="", remaps=(), **params):
        self.ros, self.namespace = ros, namespace
        (folder / "field.yaml").write_text(FIELD)
        given = {
            "use_sim_time": True, "field": str(folder / "field.yaml"), "dwell": "fmi:20", "hours": 0.1,
            "speed_mps": 1.0, "stop_overhead_s": 2.0, "min_dwell_s": 20.0, "return_margin_s": 10.0,
            "strategy": "greedy", "arrival_radius_m": 2.0, "fix_frozen_s": 0.0, **params,
        }  # fmt: skip
        self.messages = ros.collect(DiagnosticStatus, f"{namespace}/mission", LATCHED)
        self.process = ros.start("planner", params=given, namespace=namespace, remaps=remaps)

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


def test_a_whole_mission_by_itself(ros, tmp_path):
    saved = []

    def save(request, response):
        saved.append(1)
        response.success = True
        return response

    ros.node.create_service(Trigger, "mapper/save", save)
    plans, markers = ros.collect(Path, "plan", LATCHED), ros.collect(MarkerArray, "plan_markers", LATCHED)
    with World(ros, rate=20.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Planning(ros, tmp_path, autostart=True, home="shed", exit_when_finished=True)
        planning.wait_end()
        assert planning.status.samples >= 2
        assert "home" in planning.status.reason
        assert world.place == (-10.0, 5.0)
        assert set(navigation.ends) == {"succeeded"}
        assert navigation.goals[-1] == "shed"
        assert set(navigation.goals[:-1]) <= {stop.name for stop in STOPS}
        assert len(set(navigation.goals)) == len(navigation.goals), "no stop twice in so short a mission"
    assert saved
    ros.wait_for(lambda: plans[-1].poses == [], message="the plan of the end")
    assert 5.0 <= path_to_places(next(plan for plan in plans if plan.poses))[0][0] <= 35.0
    texts = [marker.text for array in markers for marker in array.markers if marker.text]
    assert any(text.endswith(", 20 s") for text in texts)


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
    kinds = [entry.payload.get("event") for entry in load_journal(journal, whole=True).entries]
    aborted = len(kinds) - 1 - kinds[::-1].index("Command")
    assert kinds[:aborted].count("RecordArrived") < 30 * len(flood), "commands come between the slices"


def test_every_visit_is_published_and_recorded_as_the_mission_had_it(ros, tmp_path):
    from soilmoist_msgs.msg import Visit as VisitMessage

    from msg_adapters.soilmoist_types import visit_from_message

    recorder = ros.start("recorder", params={"out": str(tmp_path), "name": "bag"}, namespace="/robot_1")
    published = ros.collect(VisitMessage, "/robot_1/visits", VISITS)
    with World(ros, namespace="/robot_1") as world, VirtualNavigation(ros, world, namespace="/robot_1"):
        journal = str(tmp_path / "journal")
        planning = Planning(
            ros, tmp_path, "/robot_1", autostart=True, exit_when_finished=True, journal_dir=journal
        )
        planning.wait(lambda status: status.samples >= 1)
        late = ros.collect(VisitMessage, "/robot_1/visits", VISITS)
        planning.wait_end()
        samples = planning.status.samples
        ros.wait_for(lambda: len(published) >= samples and len(late) >= samples, message="the visits")
        counted = sum(world.counted.values())
    assert recorder.stop() == 0
    entries = load_journal(tmp_path / "journal", whole=True).entries
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


def test_without_its_message_type_the_planner_logs_the_visits_only(ros, tmp_path):
    hidden = tmp_path / "hidden" / "soilmoist_msgs"
    hidden.mkdir(parents=True)
    (hidden / "__init__.py").write_text("raise ImportError('not built')")
    ros.environment["PYTHONPATH"] = str(hidden.parent)
    with World(ros) as world, VirtualNavigation(ros, world):
        planning = Planning(ros, tmp_path, autostart=True, exit_when_finished=True)
        planning.wait_end()
    assert (
        planning.process.output().count(
            "visits and mission_state are not published: soilmoist_msgs is not installed"
        )
        == 1
    )
    assert planning.process.output().count("visit: ") == planning.status.samples >= 2


def test_pause_resume_skip_and_abort(ros, tmp_path):
    with World(ros, rate=20.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Planning(ros, tmp_path, hours=2.0, dwell="fmi:600")
        planning.wait(lambda status: "waiting for start" in status.reason)
        assert not planning.call("pause").success
        assert not planning.call("resume").success
        assert not planning.call("skip").success
        assert planning.call("start").success
        assert "resume or abort it" in planning.call("start").message

        planning.wait_phase(Phase.TRAVELLING)
        assert planning.call("pause").success
        planning.wait_phase(Phase.PAUSED)
        ros.wait_for(lambda: planning.messages[-1].level == b"\x01", message="a warning while paused")
        assert world.goal is None, "a paused robot stands"
        target = planning.status.target
        assert planning.call("resume").success
        planning.wait_phase(Phase.COUNTING)
        assert planning.status.target == target

        assert planning.call("pause").success
        planning.wait_phase(Phase.PAUSED)
        assert planning.call("resume").success
        planning.wait_phase(Phase.COUNTING)
        assert planning.call("skip").success
        planning.wait(lambda status: status.phase is Phase.TRAVELLING and status.target != target)
        assert target.name in planning.status.blacklisted

        assert planning.call("abort").success
        planning.wait_phase(Phase.IDLE)
        assert world.goal is None, "an aborted robot stands"
        assert planning.call("abort").success
        assert planning.call("start").success
        planning.wait_phase(Phase.TRAVELLING, Phase.COUNTING)
        assert navigation.most_at_once == 1
        assert planning.process.stop() == 0
        ros.wait_for(lambda: world.goal is None, message="the robot to stop with its planner")


def test_stops_that_cannot_be_reached_are_ruled_out(ros, tmp_path):
    with World(ros) as world, VirtualNavigation(ros, world) as navigation:
        navigation.blocked = {stop.name for stop in STOPS if stop.name not in ("n00", "n31")}
        planning = Planning(ros, tmp_path, strategy="random", seed=3, hours=2.0)
        planning.wait(lambda status: "waiting for start" in status.reason)
        planning.call("start")
        while planning.status.samples < 1:
            planning.wait(lambda status: status.samples >= 1 or status.phase is Phase.PAUSED)
            if planning.status.phase is Phase.PAUSED:  # after five failures
                planning.call("resume")
                planning.wait(lambda status: status.samples >= 1 or status.phase is not Phase.PAUSED)
        assert "aborted" in navigation.ends
        assert planning.status.blacklisted


def test_a_robot_that_did_not_move_does_not_count(ros, tmp_path):
    with World(ros) as world, VirtualNavigation(ros, world) as navigation:
        navigation.lies = True
        planning = Planning(ros, tmp_path, autostart=True, hours=2.0)
        planning.wait_phase(Phase.PAUSED)
        assert any("reported as reached, but the robot is" in reason for reason in planning.reasons)
        assert planning.status.samples == 0


def test_the_operator_is_asked_when_nothing_works(ros, tmp_path):
    with World(ros) as world, VirtualNavigation(ros, world) as navigation:
        navigation.rejects = True
        planning = Planning(ros, tmp_path, autostart=True)
        planning.wait_phase(Phase.PAUSED)
        assert "5 failures" in planning.status.reason
        assert planning.messages[-1].level == b"\x02"


def test_what_is_missing_is_said(ros, tmp_path):
    found = ros.collect(DiagnosticArray, "/diagnostics", 10)
    planning = Planning(ros, tmp_path)
    for part in ("/clock", "map of the navigation", "a position", "topological_navigation"):
        planning.wait(lambda status, part=part: part in status.reason, part)
    answer = planning.call("start")
    assert not answer.success
    assert "not yet, waiting for" in answer.message
    ros.wait_for(lambda: found)
    assert {status.name for status in found[-1].status} >= {
        "/planner: navigation", "/planner: position", "/planner: records", "/planner: frames", "/planner: guard",
    }  # fmt: skip


def test_a_mission_by_poses_alone_in_a_namespace(ros, tmp_path):
    def take(message):
        world.goal = (message.pose.position.x, message.pose.position.y)

    with World(ros, rate=20.0, namespace="/robot_1") as world:
        world.place = (-3.0, 5.0)
        ros.node.create_subscription(PoseStamped, "/robot_1/goal_pose", take, 10)
        planning = Planning(
            ros, tmp_path, "/robot_1", navigator="goal_pose", graph="free", autostart=True, home="r0c0",
            exit_when_finished=True, hours=0.15,
        )  # fmt: skip
        planning.wait_end()
        assert planning.status.samples >= 2
        # A last stop beside home is home.
        assert math.dist(world.place, (1.0, 1.0)) < 2.5, planning.process.output()


def test_two_robots_share_one_mapper_and_never_count_at_the_same_place(ros, tmp_path):
    names = ("/robot_1", "/robot_2")
    team = {"others": list(names), "navigator": "goal_pose", "graph": "free", "strategy": "ivr", "autostart": True,
            "exit_when_finished": True, "hours": 0.08}  # fmt: skip
    (tmp_path / "field.yaml").write_text(FIELD)
    mapper = {"field": str(tmp_path / "field.yaml"), "use_sim_time": True, "others": list(names)}
    ros.start("mapper", params=mapper, namespace=names[0])
    shared = [f"{topic}:={names[0]}/{topic}" for topic in ("samples", "model", "mapper/save")]
    samples = ros.collect(PointCloud2, f"{names[0]}/samples", LATCHED)
    ros.wait_for(lambda: ros.node.count_subscribers(f"{names[1]}/counts"), message="the mapper")

    def drive(world, message):
        world.goal = (message.pose.position.x, message.pose.position.y)

    first, second = worlds = [
        World(ros, namespace=name, clock=name == names[0], mapper=False, rate=20.0) for name in names
    ]
    with first, second:
        for name, world in zip(names, worlds, strict=True):
            world.place = (-3.0, 5.0)
            ros.node.create_subscription(PoseStamped, f"{name}/goal_pose", partial(drive, world), 10)
        robots = [
            Planning(ros, tmp_path, name, remaps, **team) for name, remaps in zip(names, ((), shared), strict=True)
        ]
        for robot in robots:
            robot.wait_end()
    stops = []
    for robot in robots:
        assert robot.status.samples >= 2
        assert any("most variance less per second" in reason for reason in robot.reasons), "the map has come"
        said = [mission_from_message(message) for message in robot.messages]
        stops.append({status.target.name for status in said if status.phase is Phase.COUNTING})
    assert not stops[0] & stops[1]
    # The map has the counts of both robots, more than each robot counted alone.
    counted = samples_from_message(samples[-1]).counts.sum()
    assert counted > max(sum(world.counted.values()) for world in worlds)


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


def test_the_map_may_not_come(ros, tmp_path):
    with World(ros, mapper=False) as world, VirtualNavigation(ros, world):
        planning = Planning(ros, tmp_path, autostart=True, hours=1.0)
        planning.wait(lambda status: "no map has come: is the mapper running?" in status.reason)
        assert planning.status.samples == 3


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"strategy": "gredy"}, "did you mean 'greedy'"),
        ({"dwel": "fmi:20"}, "did you mean 'dwell'"),
        ({"dwell": "fim:20"}, "did you mean 'fmi'"),
        ({"field": "patchs"}, "did you mean 'patches'"),
        ({"action_type": "topological_navigation_msgs/action/GotoNod"}, "did you mean 'GotoNode'"),
        ({"graph": "no_such_map.yaml"}, "cannot be read"),
        ({"graph": "free"}, "graph is free"),
        ({"others": ["robot 2"]}, "'/robot 2' is not a namespace"),
        ({"properties": ["/compaction:-1"]}, "'/compaction:-1' is not a namespace with a weight"),
        ({"properties": ["soil salt"]}, "'soil salt' is not a namespace"),
        ({"navigator": "goal_pose", "graph": "free", "home": "r0c"}, "did you mean 'r0c"),
    ],
)
def test_mistakes_in_parameters(ros, tmp_path, params, said):
    planning = Planning(ros, tmp_path, **params)
    assert planning.process.wait() == 2
    assert said in planning.process.output()


def test_bad_messages_do_no_harm(ros, tmp_path):
    with World(ros) as world, VirtualNavigation(ros, world):
        node = ros.node
        for topic, kind, message in [
            ("samples", PointCloud2, PointCloud2()),
            ("model", String, String(data="{")),
            ("counts", PointCloud2, PointCloud2()),
            ("fix", NavSatFix, NavSatFix(latitude=float("nan"), longitude=0.0)),
        ]:
            publisher = node.create_publisher(kind, topic, LATCHED)
            node.create_timer(0.1, lambda publisher=publisher, message=message: publisher.publish(message))
        planning = Planning(ros, tmp_path, autostart=True, hours=2.0)
        planning.wait(lambda status: "highest kriging variance" in status.reason)
        for part in ("samples cannot be used", "model cannot be used", "counts cannot be used"):
            assert part in planning.process.output()


@pytest.mark.parametrize("accepts_after_s", [0.0, 0.4])
def test_a_planner_that_ends_stops_the_robot(ros, tmp_path, accepts_after_s):
    """Also one to which the navigation has not answered yet: it would drive without a planner."""
    with World(ros, rate=2.0) as world, VirtualNavigation(ros, world) as navigation:
        navigation.accepts_after_s = accepts_after_s
        planning = Planning(ros, tmp_path, autostart=True, hours=2.0)
        ros.wait_for(navigation.asked.is_set if accepts_after_s else lambda: world.goal, message="a goal")
        assert planning.process.stop() == 0
        ros.wait_for(lambda: navigation.ends, message="the end of the goal")
        assert navigation.ends == ["canceled"]


def test_a_mission_survives_its_planner(ros, tmp_path):
    journal = {"journal_dir": str(tmp_path / "journal"), "hours": 2.0, "dwell": "fmi:300"}
    with World(ros, rate=5.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Planning(ros, tmp_path, autostart=True, **journal)
        planning.wait(lambda status: status.phase is Phase.TRAVELLING and status.distance_m > 0)
        target = planning.status.target
        planning.process.kill()
        world.rate = 1.0  # the restart takes a moment
        assert world.goal is not None, "nothing stopped the robot"

        again = Planning(ros, tmp_path, autostart=True, **journal)
        again.wait_phase(Phase.PAUSED)
        assert "resumable: interrupted while travelling" in again.status.reason
        assert again.status.target == target
        assert again.messages[-1].level == b"\x02"
        ros.wait_for(lambda: world.goal is None, message="the robot to be stopped")
        assert navigation.ends == ["canceled"], "it does not move by itself"
        world.rate = 30.0
        ros.wait_for(lambda: again.call("resume").success)
        again.wait_phase(Phase.COUNTING)
        assert again.status.target == target
        again.wait(lambda status: status.raw_counts > 0)
        counts = again.status.raw_counts
        again.process.kill()

        auto = Planning(ros, tmp_path, resume="auto", **journal)
        auto.wait(lambda status: status.phase is Phase.COUNTING and status.raw_counts > counts)
        auto.process.kill()

        fresh = Planning(ros, tmp_path, resume="fresh", **journal)
        fresh.wait(lambda status: "waiting for start" in status.reason)
        assert fresh.status.samples == 0


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


def test_a_bad_fix_before_an_abort_does_not_send_the_robot_away(ros, tmp_path):
    """Poses alone cannot stop a robot: the place that the planner publishes must be where the robot was."""
    poses = []

    def take(message):
        poses.append((message.pose.position.x, message.pose.position.y))
        world.goal = poses[-1]

    with World(ros, rate=5.0) as world:
        world.place = (3.0, 3.0)
        ros.node.create_subscription(PoseStamped, "goal_pose", take, 10)
        planning = Planning(ros, tmp_path, navigator="goal_pose", graph="free", hours=1.0)
        ros.wait_for(lambda: planning.call("start").success, message="all that a mission needs")
        ros.wait_for(lambda: poses, message="a goal")
        start = world.place
        ros.wait_for(lambda: world.place != start, message="motion")
        world.bad_place = (1984.8, 25.4)
        assert planning.call("abort").success
        world.bad_place = None
        ros.wait_for(lambda: len(poses) > 1, message="a pose that stops the robot")
        assert all(-15.0 <= x_m <= 45.0 and -5.0 <= y_m <= 35.0 for x_m, y_m in poses)


def test_edges_that_the_navigation_refuses_are_named(ros, tmp_path):
    path = tmp_path / "old_map.json"
    path.write_text(make_map().to_json().replace("NavigateToPose", "move_base", 1))
    planning = Planning(ros, tmp_path, graph=str(path))
    ros.wait_for(lambda: "(move_base)" in planning.process.output(), message="a warning of the edge")
