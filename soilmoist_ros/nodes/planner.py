# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs the mission. This node only passes messages in and out; the core makes the decisions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from soilmoist_ros.exploration import (
    FORGOTTEN,
    TRIGGERS,
    EmergencyTopic,
    ExplorerSettings,
    MissionClock,
    MissionControl,
    MissionJournal,
    MissionRules,
    MissionSetup,
    OperatorRequest,
    Reply,
    Verb,
    boot_id,
    check_places,
    check_time,
    property_weights,
    read_travel_map,
)
from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.nodes.navigators import make_navigator
from soilmoist_ros.nodes.node_process import run
from soilmoist_ros.nodes.parameters import Parameters, Value, other_namespaces
from soilmoist_ros.nodes.planner_inputs import PlannerFrames, PlannerInputs
from soilmoist_ros.nodes.planner_outputs import PlannerKeepout, PlannerOutputs
from soilmoist_ros.nodes.planner_parameters import (
    PARAMETERS,
    PERSON,
    chosen_survey,
    make_team,
    make_watch,
    mission_rules,
)
from soilmoist_ros.nodes.topics import LATCHED, NO_EVENTS, SENSOR, every, interface_class
from soilmoist_ros.recording import StoredMission

__all__ = ["PARAMETERS", "Planner", "main"]

MISSION_TICK_S: Final = 1.0
TICK_S: Final = 0.2
SHOW_S: Final = 1.0
LOOK_S: Final = 0.5  # time between two checks whether a release of the emergency stop counts [s]
WATCHDOG_SHOWS: Final = 15
"""Number of looks after which a watchdog is missed: starting it takes seconds."""
UNWATCHED: Final = "none is heard: if the planner dies, nothing stops the robot (start the node watchdog)"
WHO: Final = "ros2 param"  # name for clients that set a parameter: ROS does not report them


class Planner(Node):
    """Explores a field: chooses stops, sends the robot to them, and lets it count."""

    finished = False
    _shown = 0

    def __init__(self) -> None:
        super().__init__("planner")
        self._values = Parameters(self, PARAMETERS)
        self._field, settings = chosen_survey(self._values, None)
        rules = mission_rules(self._values, settings)
        folder, resume = self._values.text("journal_dir"), self._values.text("resume")
        journal_dir = Path(folder).expanduser() if folder else None
        self._stored = StoredMission(journal_dir, rules, resume, self._values.number("respawn_limit_s"))
        try:
            if self._stored.mission is not None:
                self._field, settings = chosen_survey(self._values, self._stored.mission.state.changes)
            self._wire(settings, rules)
        except BaseException:  # a planner that cannot start has not crashed
            self._stored.close()
            raise

    def _wire(self, settings: ExplorerSettings, rules: MissionRules) -> None:
        for problem in self._stored.problems:
            self.get_logger().warning(problem)
        if (curve := settings.curve) is not None:
            error = f"{curve.n0_sd_cps / curve.n0_cps:.0%}" if curve.n0_sd_cps else "an unknown error"
            self.get_logger().info(f"target vwc, by N0 {curve.n0_cps:.4g} counts/s +- {error}")
        properties = property_weights(self._values.texts("properties"))
        self._outputs = PlannerOutputs(
            self, lambda: self._control.hand_on(), properties, self._values.text("frame")
        )
        self._frames = PlannerFrames(self, self._values, self._field)
        setup = MissionSetup(
            field=self._field, settings=settings, rules=rules, home=self._values.text("home"),
            start_delay_s=self._values.number("start_delay_s"), properties=properties,
            open_survey=partial(chosen_survey, self._values),
        )  # fmt: skip
        self._control: MissionControl = MissionControl(
            setup, partial(make_navigator, self, self._values, lambda: self._control.may_count()), self._outputs,
            MissionJournal(self._stored.journal), clock=self._mission_clock(), watch=make_watch(self._values),
            mission=self._stored.mission, team=make_team(self._values), frames=self._frames.robot,
        )  # fmt: skip
        self._autostart = self._values.flag("autostart") and self._stored.starts
        if self._stored.mission is not None:
            self._control.take_up(self._stored.mission, self._stored.resumes)
        if self._stored.left_driving:
            self._control.navigator.cancel(FORGOTTEN)
        graph = self._values.text("graph")
        map_topic = self._values.text("map_topic") if graph == "topic" else ""
        others = self._values.texts("others")
        check_places(self._values.whole("certify"), 1 + len(other_namespaces(self, others)))
        check_time(settings.certify, self._field.grid().area_m2, settings.motion, rules)
        by_name = self._values.text("navigator") == "goto_node"
        robot = self._values.texts("robot_properties")
        self._inputs = PlannerInputs(
            self, self._control, self._frames, map_topic, others, properties, by_name, robot
        )
        if graph == "free":
            self._control.use_graph(None)
        elif graph != "topic":
            self._inputs.use_map(read_travel_map(Path(graph), self._field).for_robot(robot))
        self._keepout = PlannerKeepout(self, self._values)
        self._is_person = self._values.text("navigator") == PERSON
        self._commands = PlannerCommands(self, self._control, self._values, self._stay)
        # Limits of the mission use ROS time. Messages, displays and limits of the navigation use steady time.
        self.create_timer(MISSION_TICK_S, self._control.tick)
        every(self, TICK_S, self._tick)
        every(self, SHOW_S, self._show)

    def leave(self) -> Callable[[], bool]:
        """Stop the robot; the function says whether its navigation has heard of it."""
        self._control.close()
        return lambda: not self._control.navigator.stop_unheard

    def close(self) -> None:
        """Close the files, and end the threads."""
        self._frames.close()
        self._stored.close()
        self._keepout.close()

    def _mission_clock(self) -> MissionClock:
        simulated = self.get_parameter("use_sim_time").value
        steady_s = time.monotonic
        return MissionClock(self._outputs.now_s, None if simulated else steady_s, boot_id(), steady_s)

    def _stay(self) -> None:
        self._autostart = False

    def _tick(self) -> None:
        self._control.tick()
        self._control.check()
        self._outputs.doubt(self._control.doubts())
        self._outputs.beat(not self._control.stuck, self._control.about_to_move)
        if self._autostart and not self._control.missing() and not self._control.dangers:
            self._autostart = not self._control.command(Verb.START).accepted
        self.finished = self._outputs.all_done and self._values.flag("exit_when_finished")

    def _show(self) -> None:
        self._inputs.tick()
        self._keepout.tick(self._control.fence, self._frames.robot.move)
        self._control.show()
        self._shown += 1
        unwatched = self._shown > WATCHDOG_SHOWS and not (self._control.watch.has_watchdog or self._is_person)
        watchdog = [Health("watchdog", Level.WARN, UNWATCHED)] if unwatched else []
        self._outputs.diagnose([*self._control.health(), self._frames.health(), *watchdog])


# Commands of an operator to the planner: services, live parameters, and emergency stops -------------------------


class PlannerCommands:
    """Passes commands to the control, and logs each with its reply."""

    def __init__(
        self, node: Node, control: MissionControl, parameters: Parameters, stopped: Callable[[], None]
    ) -> None:
        self._node = node
        self._control = control
        self._parameters = parameters
        self._stopped = stopped
        for verb in TRIGGERS:
            node.create_service(Trigger, f"planner/{verb}", partial(self._on_trigger, verb))
        self._offer_commands()
        parameters.watch(self._on_parameters)
        self._show_settings()
        self._topic = EmergencyTopic()
        self._source = node.resolve_topic_name("emergency_stop")
        # The first hears a latched press of earlier, the second every publisher; what one misses is no fault.
        for profile in (LATCHED, SENSOR):
            node.create_subscription(
                Bool, "emergency_stop", self._on_emergency, profile, event_callbacks=NO_EVENTS
            )
        every(node, LOOK_S, self._look)

    def _on_trigger(self, verb: Verb, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        reply = self._request(OperatorRequest(verb))
        response.success, response.message = reply.accepted, reply.message
        return response

    def _offer_commands(self) -> None:
        try:
            kind = interface_class("soilmoist_msgs/srv/Command")

            from msg_adapters import reply_to_message, request_from_message
        except ImportError as error:
            self._node.get_logger().warning(
                f"there is no service planner/command: soilmoist_msgs is not installed ({error}; build "
                "interfaces/soilmoist_msgs); planner/start, pause, resume, abort and skip work"
            )
            return

        def on_command(message: Any, _response: Any) -> Any:
            return reply_to_message(self._request(request_from_message(message)))

        self._node.create_service(kind, "planner/command", on_command)

    def _request(self, request: OperatorRequest) -> Reply:
        if request.verb == Verb.ABORT:
            self._stopped()
        reply = self._control.request(request)
        note = self._node.get_logger()
        said = f"{request.verb} by {request.who or 'the operator'}: {reply.message}"
        if reply.accepted:
            note.info(said)
            self._show_settings()
        else:
            note.warning(f"refused: {said}")
        return reply

    def _on_parameters(self, values: Mapping[str, Value]) -> str:
        """Make a command of new values; why they are refused, empty if they are used."""
        now = self._control.settings
        given = {name: tuple(one) if isinstance(one, list) else one for name, one in values.items()}
        new: dict[str, Any] = {name: value for name, value in given.items() if value != now.get(name)}
        if not new:
            return ""  # they are shown after a command
        empty = [name for name, value in new.items() if not value and value != ()]
        if empty:
            return f"{', '.join(empty)} cannot be empty while the planner runs: restart it without"
        reply = self._control.request(OperatorRequest(Verb.CHANGE, who=WHO, **new))
        return "" if reply.accepted else reply.message

    def _show_settings(self) -> None:
        now = self._control.settings
        self._parameters.show({name: list(one) if isinstance(one, tuple) else one for name, one in now.items()})

    def _on_emergency(self, message: Bool) -> None:
        publishers = self._node.count_publishers("emergency_stop")
        self._take(self._topic.hear(message.data, publishers, time.monotonic()))

    def _look(self) -> None:
        self._take(self._topic.tick(time.monotonic()))

    def _take(self, pressed: bool | None) -> None:
        if pressed is None:
            return
        if pressed:
            self._stopped()
            self._node.get_logger().error(f"emergency stop ({self._source}): the robot is stopped")
        else:
            self._node.get_logger().warning("the emergency stop is released: resume or abort")
        self._control.emergency(pressed, self._source)


def main() -> None:
    """Run the planner."""
    run(Planner)


if __name__ == "__main__":
    main()
