# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Serves the operator's page: shows the survey while it runs, and passes commands to the planners."""

from __future__ import annotations

import math
import socket
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, NavSatFix, PointCloud2
from std_msgs.msg import Bool, String

from msg_adapters import (
    battery_from_message,
    diagnostics_from_message,
    health_from_status,
    mission_from_message,
    model_from_message,
    path_to_places,
    samples_from_message,
    soil_map_from_message,
    to_seconds,
)
from soilmoist_ros.console import (
    LOOPBACK,
    Access,
    Board,
    ConsoleServer,
    MapLayers,
    RobotHistory,
    SurveyFiles,
    VisitHistory,
    Walk,
    battery_view,
    choices_view,
    field_view,
    graph_views,
    health_view,
    invitation,
    live_dose,
    mission_view,
    place_views,
    reachable,
)
from soilmoist_ros.exploration import OperatorRequest, Reply, ReplyCode, Verb, parse_topological_map
from soilmoist_ros.foundation import Batches, Health, InputError, Level, resource
from soilmoist_ros.mapping import load_field
from soilmoist_ros.nodes.node_process import run
from soilmoist_ros.nodes.parameter_tables import CONSOLE as PARAMETERS
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import DEFAULT, LATCHED, SENSOR, VISITS, Faults, every, interface_class
from soilmoist_ros.sensing import fix_from_message

__all__ = ["PARAMETERS", "Console", "main"]

STALE_S: Final = 30.0  # age at which the health of a part is shown as unknown [s]
SHOW_S: Final = 1.0
REPEAT_S: Final = 0.5
"""Time between two messages of a pressed stop [s]; a planner takes silence of 2 s for a release."""
DOSE_PAUSE_S: Final = 10.0  # shortest time from one dose to the next [s]


class Console(Node):
    """Keeps a :class:`Board` up to date, and serves it; unreadable messages are named and ignored."""

    def __init__(self) -> None:
        super().__init__("console")
        values = Parameters(self, PARAMETERS)
        start = resource("fields", values.text("field"))
        self._field, self._start = load_field(start), start
        self._chosen: dict[str, str] = {}
        self._board, self._faults = Board(), Faults(self)
        self._picture: MapLayers | None = None
        self._dose_parts: dict[str, Any] = {}
        self._doses: Batches[dict[str, Any]] = Batches(self._show_dose, "dose", rest_s=DOSE_PAUSE_S)
        self._health: dict[str, tuple[Health, float]] = {}
        self._visits = VisitHistory(self._board)
        robots = [name.strip("/") for name in values.texts("robots")] or [""]
        self._history = {robot: RobotHistory(self._board, robot) for robot in robots}
        self._board.put("robots", robots)
        self._walks = {robot: Walk(self._board, robot) for robot in robots}
        self._board.put("field", field_view(self._field))
        self._board.put("choices", choices_view())
        self._subscribe(robots, values.text("map_topic"))
        self._steering = ConsoleSteering(self, robots, self._board)
        host = values.text("host")
        names = (socket.gethostname(), f"{socket.gethostname()}.local", *values.texts("names"))
        access = Access(names, self._show_token)
        self._invites = host not in LOOPBACK
        fields, runs = (Path(values.text(name)).expanduser() for name in ("field_dir", "runs"))
        files = SurveyFiles(fields, runs, start)
        self._server = ConsoleServer(
            self._board, self._steering, access, lambda: self._picture, files, self._walks
        )
        port = self._server.start(host, values.whole("port"))
        self._page = f"http://{reachable(host)}:{port}/"
        self.get_logger().info(f"console: {self._page}")
        self._show_token(access.token)
        self._present = [
            self.create_publisher(Bool, f"/{robot}/operator_present" if robot else "operator_present", SENSOR)
            for robot in robots
        ]
        every(self, SHOW_S, self._show_health)

    def close(self) -> None:
        """End the server."""
        self._server.close()
        self._doses.close()

    def _subscribe(self, robots: list[str], map_topic: str) -> None:
        def hear(kind: Any, topic: str, take: Any, profile: Any, robot: str | None = None) -> None:
            if robot is not None:
                topic, take = f"/{robot}/{topic}" if robot else topic, partial(take, robot)
            self.create_subscription(kind, topic, self._faults.guarded(topic, take), profile)

        for robot in robots:
            hear(DiagnosticStatus, "mission", self._on_mission, LATCHED, robot)
            hear(NavSatFix, "fix", self._on_fix, SENSOR, robot)
            hear(BatteryState, "battery_state", self._on_battery, SENSOR, robot)
            hear(PathMessage, "plan", self._on_plan, LATCHED, robot)
        hear(PointCloud2, "soil_map", self._on_map, LATCHED)
        hear(PointCloud2, "samples", self._on_samples, LATCHED)
        hear(String, "model", lambda message: self._hear_dose(model=message), LATCHED)
        hear(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEFAULT)
        if map_topic:
            hear(String, map_topic, self._on_graph, LATCHED)
        try:
            visit, mission = (interface_class(f"soilmoist_msgs/msg/{one}") for one in ("Visit", "Mission"))
        except ImportError:  # it is not built
            return
        for robot in robots:
            hear(visit, "visits", self._on_visit, VISITS, robot)
            hear(mission, "mission_state", self._on_state, LATCHED, robot)

    # Messages ------------------------------------------------------------------------------------------------

    def _on_mission(self, robot: str, message: DiagnosticStatus) -> None:
        status, values = mission_from_message(message), health_from_status(message).values
        self._board.put(f"mission/{robot}", mission_view(status, values))
        self._history[robot].follow(status)
        self._board.hear(f"mission/{robot}")

    def _on_state(self, robot: str, message: Any) -> None:
        if message.field != self._chosen.get(robot, ""):
            self._chosen[robot] = message.field
            self._use_field(Path(message.field) if message.field else self._start)
        areas = [place_views((one.x, one.y) for one in area.points) for area in message.ruled_out_areas]
        self._board.put(f"ruled_out/{robot}", areas)

    def _use_field(self, path: Path) -> None:
        try:
            self._field = load_field(path)
        except InputError as error:
            self._faults.ignore("the field of the planner", error)
            return
        if self._picture is not None:
            self._picture.widest.clear()  # the colours follow the maps of the new field
        self._board.put("field", field_view(self._field))

    def _on_battery(self, robot: str, message: BatteryState) -> None:
        if (battery := battery_from_message(message)) is not None:
            self._board.put(f"battery/{robot}", battery_view(*battery))
            self._board.hear(f"battery/{robot}")

    def _on_fix(self, robot: str, message: NavSatFix) -> None:
        fix = fix_from_message(message)
        position = fix.position
        x_m, y_m = self._field.frame.to_local(position.latitude_deg, position.longitude_deg)[0]
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return
        self._history[robot].place(float(x_m), float(y_m), position.horizontal_sd_m)
        self._walks[robot].place(float(x_m), float(y_m), position.horizontal_sd_m)

    def _on_plan(self, robot: str, message: PathMessage) -> None:
        self._board.put(f"plan/{robot}", place_views(path_to_places(message)))

    def _on_visit(self, _robot: str, message: Any) -> None:
        from msg_adapters import visit_from_message

        visit = visit_from_message(message)
        self._visits.add((visit.x_m, visit.y_m))

    def _on_map(self, message: PointCloud2) -> None:
        cells = soil_map_from_message(message)
        self._picture = MapLayers.after(self._picture, cells)
        self._board.put("map", self._picture.about)
        self._board.hear("map")
        self._hear_dose(map=(cells, to_seconds(message.header.stamp)))

    def _on_samples(self, message: PointCloud2) -> None:
        samples = samples_from_message(message)
        self._board.put("samples", tuple(place_views(samples.xy)))
        self._hear_dose(samples=(samples, to_seconds(message.header.stamp)))

    def _hear_dose(self, **part: Any) -> None:
        """Compute the dose soon, in a thread that rests between two doses."""
        self._dose_parts = {**self._dose_parts, "field": self._field, **part}
        if len(self._dose_parts) == 4:
            self._doses.put(self._dose_parts)

    def _show_dose(self, heard: Sequence[dict[str, Any]]) -> None:
        (cells, stamp_s), (samples, samples_s) = heard[-1]["map"], heard[-1]["samples"]
        try:
            model, dose = model_from_message(heard[-1]["model"]), ""
            if model.fit is not None and model.dose_basis is not None:
                if max(abs(one - model.stamp_s) for one in (stamp_s, samples_s)) > 1e-3:
                    return  # a part of the map is still to come
                given = cells, samples, model.fit, model.dose_basis, stamp_s
                dose = live_dose(heard[-1]["field"], model.cell_m, *given)
        except (ValueError, TypeError, LookupError, InputError) as error:
            self._faults.ignore("the map for a dose", error)
            dose = ""
        self._board.put("dose", dose)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s = self._board.now_s()
        for part in diagnostics_from_message(message):
            self._health[part.name] = part, now_s

    def _on_graph(self, message: String) -> None:
        found = parse_topological_map(message.data)
        xy, datum = found.graph.xy, found.datum
        if datum is not None:
            xy = self._field.frame.to_local(*datum.to_geographic(xy).T)
        nodes, edges = graph_views(found.graph.names, xy, found.graph.edges)
        self._board.put("nodes", nodes)
        self._board.put("edges", edges)
        if lost := len(xy) - len(nodes):
            remedy = "check the datum of the map (meta)"
            raise InputError(f"{lost} of {len(xy)} nodes are on the other side of the earth", remedy)

    def _show_health(self) -> None:
        oldest_s = self._board.now_s() - STALE_S
        parts = [
            part
            if heard_s > oldest_s
            else Health(part.name, Level.STALE, f"not heard any more; last: {part.message}")
            for part, heard_s in self._health.values()
        ]
        self._board.put("health", health_view(parts))
        if self._server.operators:  # silence says that nobody is there
            for one in self._present:
                one.publish(Bool(data=True))

    def _show_token(self, token: str) -> None:
        """Print the address that lets one visitor from another machine steer.

        The log is published on ``/rosout``, recorded, and given to visitors who may only look.
        """
        if not self._invites:
            return
        try:
            print(invitation(self._page, token), file=sys.stderr, flush=True)
        except OSError as error:  # the terminal is closed, or its file is on a full disk
            reason = error.strerror or error
            self.get_logger().warning(
                f"no address for a further operator, the terminal cannot be written: {reason}"
            )


# Commands from the operator's page to the planners, and the emergency stop --------------------------------------


class ConsoleSteering:
    """The :class:`Steering` of a node, called by the thread of the server."""

    def __init__(self, node: Node, robots: Sequence[str], board: Board) -> None:
        self._node, self._board = node, board
        self._pressed = threading.Event()
        below = {robot: f"/{robot}/" if robot else "" for robot in robots}
        self._buttons = [node.create_publisher(Bool, f"{name}emergency_stop", LATCHED) for name in below.values()]
        self._clients, self._convert = self._typed_clients(below)
        every(node, REPEAT_S, self._repeat)

    def command(self, robot: str, request: OperatorRequest) -> Future[Reply]:
        """Pass a request to the planner of a robot."""
        said: Future[Reply] = Future()
        said.set_running_or_notify_cancel()  # the answer may come after the wait for it
        client = self._clients.get(robot)
        if client is None or not client.service_is_ready():
            text = "the planner does not answer: it is not running, or the link to the robot is lost"
            if client is None:
                text = f"{request.verb} needs soilmoist_msgs, which is not installed here"
            said.set_result(Reply(ReplyCode.REFUSED, text))
            return said
        to_message, from_message = self._convert

        def on_reply(future: Any) -> None:
            try:
                said.set_result(from_message(future.result()))
            except Exception as error:  # of another version
                said.set_exception(error)

        client.call_async(to_message(request)).add_done_callback(on_reply)
        self._node.get_logger().info(
            f"{request.verb} for {robot or 'the planner'} by {request.who or 'the operator'}"
        )
        return said

    def press(self, who: str) -> None:
        """Press the emergency stop of all robots, and pause their missions, which names the operator."""
        self._pressed.set()
        self._repeat()
        self._node.get_logger().error(f"STOP by {who or 'the operator'}")
        for robot in self._board.get("robots", []):
            self.command(robot, OperatorRequest(Verb.PAUSE, who=who))

    def release(self, who: str) -> None:
        """Release the emergency stop of all robots; nothing moves before somebody resumes."""
        self._pressed.clear()
        self._node.get_logger().warning(f"STOP is released by {who or 'the operator'}")
        for button in self._buttons:
            button.publish(Bool(data=False))

    def _repeat(self) -> None:
        if self._pressed.is_set():
            for button in self._buttons:
                button.publish(Bool(data=True))

    def _typed_clients(self, below: dict[str, str]) -> tuple[dict[str, Any], Any]:
        try:
            kind = interface_class("soilmoist_msgs/srv/Command")

            from msg_adapters import reply_from_message, request_to_message
        except ImportError as error:
            self._node.get_logger().warning(
                f"the page can stop the robots, and shows them: soilmoist_msgs is not installed ({error}; build "
                "interfaces/soilmoist_msgs); services such as planner/start do the rest"
            )
            return {}, None
        clients = {
            robot: self._node.create_client(kind, f"{name}planner/command") for robot, name in below.items()
        }
        return clients, (request_to_message, reply_from_message)


def main() -> None:
    """Run the console."""
    run(Console)


if __name__ == "__main__":
    main()
