# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Commands of an operator to the planner: services, live parameters, and emergency stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from soilmoist_ros.exploration import TRIGGERS, EmergencyTopic, MissionControl, OperatorRequest, Reply, Verb
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.parameter import Value
from soilmoist_ros.nodes.runtime.qos import LATCHED, NO_EVENTS, SENSOR
from soilmoist_ros.nodes.runtime.topic_types import interface_class

LOOK_S: Final = 0.5
"""Time between two checks whether a release of the emergency stop counts [s]."""
WHO: Final = "ros2 param"
"""Who sets a parameter: ROS does not say."""


class PlannerCommands:
    """Passes commands to the control, and logs each with its reply.

    :param node: node of the services
    :param control: carries out the commands
    :param parameters: parameters of the node; the live ones become commands
    :param stopped: called when somebody aborts or presses an emergency stop: nothing may start by itself then
    """

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
        node.create_timer(LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_trigger(self, verb: Verb, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        reply = self._request(OperatorRequest(verb))
        response.success, response.message = reply.accepted, reply.message
        return response

    def _offer_commands(self) -> None:
        """Offer ``planner/command`` if its type is built."""
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

    # Parameters ----------------------------------------------------------------------------------------------

    def _on_parameters(self, values: Mapping[str, Value]) -> str:
        """Make a command of new values; why they are refused, empty if they are used."""
        now = self._control.settings
        new: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in values.items()
            if value != now.get(name)
        }
        if not new:
            return ""  # they are shown after a command
        empty = [name for name, value in new.items() if not value and value != ()]
        if empty:
            return f"{', '.join(empty)} cannot be empty while the planner runs: restart it without"
        reply = self._control.request(OperatorRequest(Verb.CHANGE, who=WHO, **new))
        return "" if reply.accepted else reply.message

    def _show_settings(self) -> None:
        self._parameters.show(self._control.settings)

    # Emergency stop ------------------------------------------------------------------------------------------

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
