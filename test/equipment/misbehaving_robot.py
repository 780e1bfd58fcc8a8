# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A robot whose true place is known and whose navigation misbehaves, around the real nodes in real time."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import struct
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import shapely
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from real_nodes import Operator
from std_msgs.msg import String
from topological_navigation_msgs.action import GotoNode
from unique_identifier_msgs.msg import UUID

from msg_adapters.places import pose_stamped
from soilmoist_ros.exploration import MissionStatus, OperatorRequest, Phase, Stop, Verb, make_topological_map
from soilmoist_ros.exploration.travel.travel_graph import open_lattice
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.nodes.process_group import ProcessGroup, free_domain, loopback_environment
from soilmoist_ros.nodes.topics import DEFAULT, LATCHED
from soilmoist_ros.recording.run_folder import write_parameters
from soilmoist_ros.sensing import TUBES, LoggerRecord, Position, format_header, format_record
from soilmoist_ros.simulation.robot.simulated_links import LineServer
from soilmoist_ros.simulation.robot.virtual_devices import nmea_sentences

SPEED_MPS, SD_M, RECORD_S, TICK_S, READY_S = 1.0, 0.015, 2.0, 0.04, 120.0
LIMIT_S, WRONG_M, STILL_M = 3.0, 3.0, 0.12
"""Time until a robot stops [s]; error of a mapped record [m]; motion in 3 s that is no standstill [m]."""
ACTIONS = {
    "goto_node": ("topological_navigation", GotoNode),
    "navigate_to_pose": ("navigate_to_pose", NavigateToPose),
}
RESTING, STOPS = (Phase.PAUSED, Phase.IDLE, Phase.FINISHED), (Phase.CANCELLING, Phase.PAUSED)
FIELDS = {
    "open": ((66, 66), 12, []),
    "near": ((36, 36), 12, []),
    "strip": ((66, 18), 12, []),
    "dense": ((30, 6), 2, []),
    "ponds": ((66, 66), 12, [(x + 6.5, y + 6) for x in range(0, 60, 12) for y in range(0, 60, 12)]),
}
"""Width and height, distance of nodes, and corners of no-go areas of 5 x 6 m [m]."""


@dataclass(frozen=True)
class Scenario:
    """A misbehaviour and what must follow.

    :param name: its name
    :param when: driving, counting, paused or idle; or driving, together with a command: pause, abort
    :param does: what happens then: attributes and methods of :class:`MisbehavingRobot`
    :param seen: what it can be known from: a distance of the robot [m], or a time since then [s]
    :param then: alarms, phases or ends of visits of which one must follow in time; more stop_requests than one
    :param must: stop (the robot truly stands), ask (a stop is asked for), quiet (no alarm), or nothing
    :param by: how the planner sends goals
    :param field: one of :data:`FIELDS`
    :param limit_s: time in which it must follow [s]
    :param watch_s: time for which it is watched afterwards [s]
    """

    name: str
    when: str
    does: list[str]
    seen: list[str]
    then: list[str]
    must: str
    by: str = "goto_node"
    field: str = "open"
    fix_hz: float = 5.0
    limit_s: float = LIMIT_S
    watch_s: float = 5.0

    @classmethod
    def parse(cls, line: str) -> Scenario:
        first, does, seen, then, must, more = (part.strip() for part in line.split("|"))
        name, when = first.split(", ")
        given: Any = {key: _value(value) for key, value in (word.split("=") for word in more.split())}
        return cls(name, when, does.split("; ") if does else [], seen.split(), then.split(), must, **given)


def _value(text: str) -> Any:
    return float(text) if text.replace(".", "").isdigit() else text


def serve(navigator: str, channel: Connection) -> None:
    """Process of a navigation server: it passes on what it hears, and answers as it is told."""
    rclpy.init()
    node, running = Node("navigation"), dict[bytes, tuple[Any, Future]]()
    poses = navigator == "navigate_to_pose"

    async def execute(handle: Any) -> Any:
        identity, goal = bytes(handle.goal_id.uuid), handle.request
        running[identity] = handle, Future()
        channel.send(("goal", identity, xy(goal.pose) if poses else goal.target))
        end = await running[identity][1]
        verb = "abort" if end == "canceled" and not handle.is_cancel_requested else end
        getattr(handle, {"succeeded": "succeed", "aborted": "abort"}.get(verb, verb))()
        return NavigateToPose.Result() if poses else GotoNode.Result(success=end == "succeeded")

    def cancel(handle: Any) -> CancelResponse:
        channel.send(("cancel", bytes(handle.goal_id.uuid), None))
        return CancelResponse.ACCEPT if poses else CancelResponse.REJECT

    def listen() -> None:
        while channel.poll():
            identity, value = channel.recv()
            if identity in running and isinstance(value, str):
                running.pop(identity)[1].set_result(value)
            elif identity in running:
                running[identity][0].publish_feedback(NavigateToPose.Feedback(distance_remaining=value))

    def on_pose(message: PoseStamped) -> None:
        channel.send(("goal", struct.pack("dd", *xy(message)), xy(message)))

    if navigator == "goal_pose":
        node.create_subscription(PoseStamped, "goal_pose", on_pose, DEFAULT)
    else:
        name, kind = ACTIONS[navigator]
        ActionServer(node, kind, name, execute, cancel_callback=cancel)
    node.create_timer(0.02, listen)
    with suppress(EOFError, OSError, ExternalShutdownException):
        rclpy.spin(node)


def xy(pose: PoseStamped) -> tuple[float, float]:
    """Place of a pose [m]."""
    return pose.pose.position.x, pose.pose.position.y


class Panel(Operator):
    """An operator's computer, which can be another client of the navigation."""

    def __init__(self, domain: int, navigator: str, topological_map: str) -> None:
        self.said: list[tuple[float, MissionStatus, list[str]]] = []
        self.foreign: set[bytes] = set()
        super().__init__(domain, 0.0)
        self._navigator = navigator
        self._poses = self._node.create_publisher(PoseStamped, "goal_pose", DEFAULT)
        self._node.create_publisher(String, "/topological_map_2", LATCHED).publish(String(data=topological_map))
        if navigator in ACTIONS:
            name, kind = ACTIONS[navigator]
            self._client = ActionClient(self._node, kind, name)
            self._cancels = self._node.create_client(CancelGoal, f"{name}/_action/cancel_goal")

    def _on_mission(self, message: Any) -> None:
        super()._on_mission(message)
        alarms = json.loads({pair.key: pair.value for pair in message.values}.get("alarms", "{}"))
        self.said.append((time.time(), self.heard.statuses[-1][1], sorted(alarms)))

    def drive(self, stop: Stop) -> None:
        """Send the robot somewhere, without the planner."""
        identity = struct.pack("dd", stop.x_m, stop.y_m)
        self.foreign.add(identity)
        pose = pose_stamped(stop.x_m, stop.y_m, time.time(), "map", 0.0)
        if self._navigator == "goal_pose":
            self._poses.publish(pose)
        else:
            given = {"target": stop.name} if self._navigator == "goto_node" else {"pose": pose}
            goal = ACTIONS[self._navigator][1].Goal(**given)
            self._client.send_goal_async(goal, goal_uuid=UUID(uuid=list(identity)))

    def cancel_all(self) -> None:
        self._cancels.call_async(CancelGoal.Request())


class MisbehavingRobot:
    """The robot, its devices and its navigation around the nodes of one scenario.

    :param scenario: what happens
    :param out: folder of the run
    """

    def __init__(self, scenario: Scenario, out: Path) -> None:
        self.scenario, self.out, self.rng = scenario, out, np.random.default_rng(1)
        self.place = self.measured = self.begun_at = np.zeros(2)
        self.track: list[tuple[float, float, float]] = []
        self.now_s = self.begun_s = self.seen_s = math.inf
        self.legs: list[Any] = []  # ahead
        self.route: list[tuple[float, float]] = []  # of the last goal, from where it was sent
        self.goal: tuple[bytes, Any] | None = None
        self.open: set[bytes] = set()  # goals of the planner that have not ended
        self.goals: list[tuple[float, bytes]] = []
        self.cancels: list[tuple[float, bytes]] = []
        self.faults: list[str] = []
        self.stopped_s = self.foreign_s = math.inf  # since when people or another client want no goal
        self.longest_s = 0.0
        self.servers: list[tuple[Any, Connection]] = []
        self.fixes: list[tuple[float, bytes]] = []
        self.later: list[tuple[float, str]] = []
        # The misbehaviour
        self.pushed, self.push_m = np.zeros(2), 0.0
        self.shift, self.drift_mps, self.noise_m = np.zeros(2), 0.0, SD_M
        self.fixing, self.frozen, self.late_s = 1.0, 0.0, 0.0
        self.on_cancel, self.creeps_mps, self.on_goal, self.feedback = "stops", 0.0, "drives", "true"

    def start_server(self) -> None:
        spawn = multiprocessing.get_context("spawn")
        ours, its = spawn.Pipe()
        process = spawn.Process(target=serve, args=(self.scenario.by, its), daemon=True)
        process.start()
        self.servers.append((process, ours))

    def kill_server(self) -> None:
        """Kill the navigation server without warning; the robot drives on."""
        self.servers.pop()[0].kill()
        self.open.clear()

    def push(self, mps: float, distance_m: float, angle_rad: float = math.nan) -> None:
        """Move without a goal, in the direction of the last motion unless it is given."""
        given = np.array((math.cos(angle_rad), math.sin(angle_rad)))
        self.pushed, self.push_m = mps * (self.ahead if math.isnan(angle_rad) else given), distance_m

    def aside(self, metres: float) -> None:
        """Drive next to the route, on the side with more space."""
        here, left = self.place, metres * np.array((-self.ahead[1], self.ahead[0]))
        space = {}
        for self.place in (here + left, here - left):
            space[self.off_m - 1000 * self.outside_m] = self.place
        self.place, parallel = here, space[max(space)]
        self.legs = [parallel, parallel + 2 * metres * self.ahead, *self.legs[-1:]]

    def into_pond(self) -> None:
        """Drive through the middle of the nearest no-go area."""
        centres = [np.array(pond.centroid.coords[0]) for pond in self.ponds]
        self.legs.insert(0, min(centres, key=lambda one: math.dist(one, self.place)))

    def away(self) -> None:
        """Drive on ahead, past the goal and out of the field."""
        self.legs = [self.place + 200 * self.ahead]

    def jump(self, metres: float) -> None:
        self.shift = metres * np.array((0.6, 0.8))

    def other_goal(self) -> None:
        """Let another client send the robot to the farthest node."""
        self.foreign_s = self.now_s
        self.panel.drive(max(self.graph.stops, key=lambda one: math.dist((one.x_m, one.y_m), self.place)))

    def other_cancels(self) -> None:
        self.foreign_s = self.now_s
        self.panel.cancel_all()

    def command(self, verb: str) -> None:
        self.stopped_s = math.inf if verb == Verb.RESUME else self.now_s
        threading.Thread(target=self.panel.ask, args=(OperatorRequest(verb),), daemon=True).start()

    def end_goal(self, end: str) -> None:
        if self.goal is not None:
            identity, self.goal = self.goal[0], None
            self.open.discard(identity)
            for _, channel in self.servers:
                channel.send((identity, end))

    def do(self, step: str) -> None:
        """Do what a step of a scenario says: NAME=VALUE, METHOD VALUE ..., or after SECONDS STEP."""
        name, *values = step.replace("=", " = ").split()
        if name == "after":
            self.later.append((self.now_s + float(values[0]), " ".join(values[1:])))
        elif values[:1] == ["="]:
            setattr(self, name, _value(values[1]))
        else:
            getattr(self, name)(*map(_value, values))

    @property
    def ahead(self) -> Any:
        places = (np.array(place) for _, *place in reversed(self.track))
        step = self.place - next((place for place in places if math.dist(place, self.place) > 0.3), np.zeros(2))
        return step / np.hypot(*step)

    @property
    def another(self) -> int:
        return sum(at_s > self.begun_s for at_s, identity in self.goals if identity not in self.open)

    @property
    def moved_m(self) -> float:
        """Distance from where it was when the misbehaviour began [m]."""
        return math.dist(self.place, self.begun_at)

    @property
    def depth_m(self) -> float:
        """Depth in a no-go area [m]."""
        here = shapely.Point(self.place)
        return max((here.distance(pond.exterior) for pond in self.ponds if pond.contains(here)), default=0.0)

    @property
    def outside_m(self) -> float:
        """Distance from the field [m]."""
        return float(self.outline.distance(shapely.Point(self.place)))

    @property
    def off_m(self) -> float:
        """Distance from the route [m]."""
        return float(shapely.LineString(self.route).distance(shapely.Point(self.place))) if self.route else 0.0

    # The run -------------------------------------------------------------------------------------------------

    def run(self) -> dict[str, Any]:
        scenario, out, uri = self.scenario, self.out, "tcp://{}:{}".format
        size_m, step_m, ponds = FIELDS[scenario.field]
        out.mkdir(parents=True, exist_ok=True)
        self.outline = shapely.box(0, 0, *size_m)
        self.ponds = [shapely.box(x, y, x + 5, y + 6) for x, y in ponds]
        rings = [[list(corner) for corner in ring.exterior.coords[:4]] for ring in (self.outline, *self.ponds)]
        (out / "field.yaml").write_text(
            "name: rig\ndatum: {latitude_deg: 53.268, longitude_deg: -0.5245}\ncell_m: 4\n"
            f"polygon: {rings[0]}\nno_go: {rings[1:]}\n"
        )
        field = load_field(out / "field.yaml")
        self.graph, self.frame = open_lattice(field, step_m, neighbours=4, margin_m=1).graph, field.frame
        self.place = self.graph.xy[0]
        with free_domain() as domain, ExitStack() as stack:
            environment = loopback_environment(domain)
            os.environ.update(environment, ROS_LOG_DIR=str(out / "log"))
            header = format_header("rig", RECORD_S, simulated=True) + "\n"
            self.logger = LineServer("logger", "127.0.0.1", 0, header.encode())
            self.gnss = LineServer("receiver", "127.0.0.1", 0)
            group = stack.enter_context(ProcessGroup(environment, out / "log"))
            given: dict[str, dict[str, object]] = {
                "mapper": {"merge_radius_m": 1.0, "save_dir": str(out / "map")},
                "planner": {
                    "strategy": "random", "dwell": "fmi:600" if scenario.when == "counting" else "fmi:8",
                    "hours": 1.0, "seed": 1, "min_dwell_s": 2.0, "navigator": scenario.by,
                    "autostart": True, "speed_mps": SPEED_MPS, "stop_overhead_s": 1.0,
                },
                "sensor_driver": {"logger_uri": uri(*self.logger.address), "gnss_uri": uri(*self.gnss.address)},
            }  # fmt: skip
            for name, values in given.items():
                group.start(name, write_parameters(out, name, values | {"field": str(out / "field.yaml")}))
            self.start_server()
            stack.callback(lambda: [process.kill() for process, _ in self.servers])
            document = make_topological_map(self.graph, "rig", datetime(2026, 1, 1)).to_json()
            self.panel = Panel(domain, scenario.by, document)
            stack.callback(self.panel.close)
            self._spin()
            self.faults += [f"{name} ended with code {code}" for name, code in group.ended().items()]
            return self._judged()

    def _spin(self) -> None:
        self.now_s = began_s = time.time()
        fixes = records = 0
        after_s = self.scenario.limit_s + self.scenario.watch_s
        while self.now_s < min(began_s + READY_S, self.seen_s + after_s):
            time.sleep(max(0.0, self.now_s + TICK_S - time.time()))
            step_s, self.now_s = time.time() - self.now_s, time.time()
            self.longest_s = max(self.longest_s, step_s)
            self._move(step_s)
            if (self.now_s - began_s) * self.scenario.fix_hz > fixes:
                fixes += 1
                self._fix()
            if (self.now_s - began_s) > RECORD_S * (records + 1):
                records += 1
                counts = tuple(self.rng.poisson(6.0, TUBES).astype(float).tolist())
                record = LoggerRecord(self.now_s, counts, (RECORD_S,) * TUBES, 1013.25, 15.0, 0.5)
                self.logger.send(f"{format_record(record)}\n".encode())
            self.logger.poll()
            self.gnss.poll()
            self._serve()
            self._follow()
        if math.isinf(self.seen_s):
            what = "the misbehaviour was never seen" if self.begun_s < math.inf else "its time never came"
            self.faults.append(what)

    def _move(self, step_s: float) -> None:
        if self.push_m > 0:
            self.place = self.place + self.pushed * step_s
            self.push_m -= float(np.hypot(*self.pushed)) * step_s
        elif self.legs:
            away, step_m = self.legs[0] - self.place, SPEED_MPS * step_s
            left_m = float(np.hypot(*away))
            self.place = self.place + away * min(1.0, step_m / max(left_m, 1e-9))
            if left_m <= step_m:
                self.legs.pop(0)
        elif self.goal is not None:
            self.end_goal("succeeded")
        self.track.append((self.now_s, *self.place.tolist()))

    def _fix(self) -> None:
        self.shift = self.shift + np.array((self.drift_mps / self.scenario.fix_hz, 0.0))
        if not self.frozen:
            self.measured = self.place + self.shift + self.rng.normal(0.0, self.noise_m, 2)
        latitude, longitude = self.frame.to_geographic([tuple(self.measured)])[0].tolist()
        lines = nmea_sentences(self.now_s, Position(latitude, longitude, 30.0, SD_M)) if self.fixing else []
        self.fixes.append((self.now_s + self.late_s, "".join(f"{line}\r\n" for line in lines).encode()))
        while self.fixes and self.fixes[0][0] <= self.now_s:
            self.gnss.send(self.fixes.pop(0)[1])

    def _serve(self) -> None:
        for _, channel in list(self.servers):
            with suppress(EOFError, OSError):
                while channel.poll():
                    verb, identity, target = channel.recv()
                    if verb == "goal":
                        self._take(identity, target)
                    else:
                        self.cancels.append((self.now_s, identity))
                        self._cancel(identity)
                if self.goal is not None and self.feedback != "none" and self.scenario.by == "navigate_to_pose":
                    left_m = math.dist(self.place, self.goal[1])
                    channel.send((self.goal[0], 0.0 if self.feedback == "lies" else left_m))

    def _take(self, identity: bytes, target: Any) -> None:
        planned = identity not in self.panel.foreign
        if planned:
            self.goals.append((self.now_s, identity))
            if self.open and self.scenario.by in ACTIONS:
                self.faults.append("a goal was sent before the end of the one before")
            self.open.add(identity)
        self.end_goal("succeeded" if self.scenario.by == "goto_node" else "aborted")  # it is superseded
        legs = [np.array(target)]
        if isinstance(target, str):
            path = self.graph.path(self.graph.nearest(self.place), target)
            legs = [self.graph.xy[self.graph.index(name)] for name in path]
        if planned:
            self.route = [tuple(self.place), *map(tuple, legs)]
        self.goal = identity, legs[-1]
        if planned and self.on_goal == "neighbour":
            del legs[-1]
        self.legs = [] if planned and self.on_goal == "stays" else legs

    def _cancel(self, identity: bytes) -> None:
        if self.goal is None or self.goal[0] != identity or self.on_cancel == "drives_on":
            return
        if self.creeps_mps:
            self.push(self.creeps_mps, 100.0)
        if self.on_cancel != "confirms":
            self.legs = []
        if self.on_cancel == "no_result":
            self.goal = None
        else:
            self.end_goal("canceled")

    def _follow(self) -> None:
        """Begin when it is time, and note when it can be seen."""
        for due in [one for one in self.later if one[0] <= self.now_s]:
            self.later.remove(due)
            self.do(due[1])
        if self.begun_s == math.inf and self._is_time():
            self.begun_s, self.begun_at = self.now_s, self.place
            for step in self.scenario.does:
                self.do(step)
            if self.scenario.when in ("pause", "abort"):
                self.command(self.scenario.when)
        if self.seen_s == math.inf > self.begun_s:
            *name, limit = self.scenario.seen
            found = getattr(self, name[0]) if name else self.now_s - self.begun_s
            status = self.panel.status
            early = self.scenario.when == "driving" and status is not None and status.phase in STOPS
            if found >= float(limit) or early:
                self.seen_s = self.now_s

    def _is_time(self) -> bool:
        status, when = self.panel.status, self.scenario.when
        if status is None:
            return False
        if when == "counting":
            return status.phase is Phase.COUNTING and status.raw_counts > 0 and status.dwell_s > 5.0
        left_m = math.dist(self.goal[1], self.place) if self.goal else 0.0
        gone_m = math.dist(self.route[0], self.place) if self.route else 0.0
        driving = status.phase is Phase.TRAVELLING and gone_m > 3.0 and left_m > 5.0
        if when in ("paused", "idle"):
            if driving and self.stopped_s == math.inf:
                self.command("pause" if when == "paused" else "abort")
            rests = [at_s for at_s, one, _ in self.panel.said if at_s > self.stopped_s and one.phase == when]
            return bool(rests) and self.now_s > rests[0] + 4.0
        return driving

    # The judgement -------------------------------------------------------------------------------------------

    def _judged(self) -> dict[str, Any]:
        scenario, faults, until_s = self.scenario, self.faults, self.seen_s + self.scenario.limit_s
        said = [one for one in self.panel.said if one[0] >= self.begun_s]
        happened = [(at_s, word) for at_s, status, alarms in said for word in (*alarms, str(status.phase))]
        happened += [(at_s, "stop_requests") for at_s, status, _ in said if status.stop_requests > 1]
        happened += [(at_s, str(visit.ended)) for at_s, visit in self.panel.heard.visits if at_s >= self.begun_s]
        alarms = list(dict.fromkeys(name for _, _, names in said for name in names))
        followed_s = min((at_s for at_s, word in happened if word in scenario.then), default=math.inf)
        if scenario.then and followed_s > until_s:
            faults.append(f"none of {scenario.then} in {scenario.limit_s:g} s")
        end_s, *end = self.track[-1]
        still_s = max((at_s for at_s, *place in self.track if math.dist(place, end) > 0.02), default=0.0)
        still_s = still_s if still_s < end_s - 1.0 else math.inf
        if scenario.must == "stop" and still_s > until_s:
            faults.append(f"no standstill in {scenario.limit_s:g} s")
        if scenario.must == "ask" and not any(self.begun_s <= at_s <= until_s for at_s, _ in self.cancels):
            faults.append(f"no stop asked for in {scenario.limit_s:g} s")
        if scenario.must == "quiet" and alarms:
            faults.append("an alarm without need")
        self._judge_statuses()
        for whom, from_s in (("another client", self.foreign_s), ("people", self.stopped_s)):
            if late := [at_s - from_s for at_s, _ in self.goals if at_s > from_s + 1.0]:
                faults.append(f"a goal against {whom} after {late[0]:.1f} s")
        if self.panel.foreign & {identity for _, identity in self.cancels}:
            faults.append("the goal of another client was cancelled")
        if mapped := self._wrong_records():
            faults.append(f"{mapped} records farther than {WRONG_M:g} m from the truth are mapped")
        return {
            "name": scenario.name, "faults": list(dict.fromkeys(faults)), "longest_tick_s": self.longest_s,
            "followed_s": followed_s - self.seen_s, "stopped_s": still_s - self.seen_s,
            "phases": list(dict.fromkeys(str(status.phase) for _, status, _ in said)), "alarms": alarms,
        }  # fmt: skip

    def _judge_statuses(self) -> None:
        """Nobody says of a moving robot that it stands, or counts at a stop that is elsewhere."""
        before = RESTING[1]
        for at_s, status, alarms in self.panel.said:
            places = [place for then_s, *place in self.track if at_s - 2.0 <= then_s <= at_s + 1.0]
            moved_m = max((math.dist(place, places[-1]) for place in places), default=0.0)
            rests = status.phase in RESTING and before not in RESTING and "moving" not in alarms
            if rests and at_s < self.foreign_s and moved_m > STILL_M:
                self.faults.append(f"{status.phase} of a robot that moves {moved_m:.2f} m in 3 s")
            if before is not Phase.COUNTING and status.phase is Phase.COUNTING and status.target is not None:
                stop = status.target.x_m, status.target.y_m
                apart_m = np.hypot(*(self.graph.xy - stop).T)
                away_m, reach_m = math.dist(places[-1], stop), min(3.0, float(np.sort(apart_m)[1]) / 2)
                if away_m > reach_m + 0.2:
                    self.faults.append(f"counts at {status.target.name} from {away_m:.1f} m away")
            before = status.phase

    def _wrong_records(self) -> int:
        times, path = np.array([at_s for at_s, *_ in self.track]), np.array([place for _, *place in self.track])
        right, wrong = [], []
        for record in self.panel.heard.records:
            truth = path[(times >= record.stamp_s - RECORD_S) & (times <= record.stamp_s)]
            if len(truth):
                error_m = np.hypot(*(truth - (record.x_m, record.y_m)).T).min()
                (wrong if error_m > WRONG_M + 0.1 else right).append(record)
        samples = self.panel.heard.samples
        if not wrong or samples is None:
            return 0
        places = np.array([(one.x_m, one.y_m) for one in right]).reshape(-1, 2)
        exposure_s = np.array([one.effective_exposure_s for one in right])
        mapped = 0
        for one in wrong:  # the map has more there than what is right
            its_s = samples.exposure_s[np.hypot(*(samples.xy - (one.x_m, one.y_m)).T) < 1.5].sum()
            mapped += its_s > 0.1 + exposure_s[np.hypot(*(places - (one.x_m, one.y_m)).T) < 2.6].sum()
        return mapped
