# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Commands from the operator's page to the planners, and the emergency stop."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from soilmoist_ros.console import Board
from soilmoist_ros.exploration import TRIGGERS, OperatorRequest, Reply, ReplyCode, Verb
from soilmoist_ros.foundation import foreign_text
from soilmoist_ros.nodes.runtime.qos import LATCHED
from soilmoist_ros.nodes.runtime.topic_types import interface_class

REPEAT_S: Final = 0.5
"""Time between two messages of a pressed stop [s]; a planner takes silence of 2 s for a release."""


class ConsoleSteering:
    """The :class:`Steering` of a node. The thread of the server calls it.

    :param node: the node, which is not spinning yet
    :param robots: namespaces of the planners
    :param board: receives the section ``pressed``: who has pressed the stop here, empty if nobody
    """

    def __init__(self, node: Node, robots: Sequence[str], board: Board) -> None:
        self._node, self._board = node, board
        self._pressed = threading.Event()
        below = {robot: f"/{robot}/" if robot else "" for robot in robots}
        self._buttons = [node.create_publisher(Bool, f"{name}emergency_stop", LATCHED) for name in below.values()]
        self._clients, self._convert = self._typed_clients(below)
        self._triggers = {
            (robot, str(verb)): node.create_client(Trigger, f"{name}planner/{verb}")
            for robot, name in below.items()
            for verb in TRIGGERS
        } if not self._clients else {}  # fmt: skip
        board.put("pressed", "")
        node.create_timer(REPEAT_S, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def command(self, robot: str, request: OperatorRequest) -> Future[Reply]:
        """Pass a request to the planner of a robot."""
        said: Future[Reply] = Future()
        said.set_running_or_notify_cancel()  # the answer may come after the wait for it
        client, message, reply_of = self._call(robot, request)
        if client is None or not client.service_is_ready():
            text = "the planner does not answer: it is not running, or the link to the robot is lost"
            if client is None:
                text = f"{request.verb} needs soilmoist_msgs, which is not installed here"
            said.set_result(Reply(ReplyCode.REFUSED, text))
            return said

        def on_reply(future: Any) -> None:
            try:
                said.set_result(reply_of(future.result()))
            except Exception as error:  # of another version
                said.set_exception(error)

        client.call_async(message).add_done_callback(on_reply)
        self._node.get_logger().info(
            f"{request.verb} for {robot or 'the planner'} by {request.who or 'the operator'}"
        )
        return said

    def press(self, who: str) -> None:
        """Press the emergency stop of all robots, and pause their missions, which names the operator."""
        self._pressed.set()
        self._repeat()
        self._board.put("pressed", who or "the operator")
        self._node.get_logger().error(f"STOP by {who or 'the operator'}")
        for robot in self._board.get("robots", []):
            self.command(robot, OperatorRequest(Verb.PAUSE, who=who))

    def release(self, who: str) -> None:
        """Release the emergency stop of all robots; nothing moves before somebody resumes."""
        self._pressed.clear()
        self._board.put("pressed", "")
        self._node.get_logger().warning(f"STOP is released by {who or 'the operator'}")
        for button in self._buttons:
            button.publish(Bool(data=False))

    def _repeat(self) -> None:
        if self._pressed.is_set():
            for button in self._buttons:
                button.publish(Bool(data=True))

    def _call(self, robot: str, request: OperatorRequest) -> tuple[Any, Any, Any]:
        """Client, message, and the function that reads the reply; no client if the verb needs more."""
        if self._clients:
            to_message, from_message = self._convert
            return self._clients[robot], to_message(request), from_message

        def read(response: Any) -> Reply:
            code = ReplyCode.ACCEPTED if response.success else ReplyCode.REFUSED
            return Reply(code, foreign_text(response.message))

        return self._triggers.get((robot, request.verb)), Trigger.Request(), read

    def _typed_clients(self, below: dict[str, str]) -> tuple[dict[str, Any], Any]:
        try:
            kind = interface_class("soilmoist_msgs/srv/Command")

            from msg_adapters import reply_from_message, request_to_message
        except ImportError as error:
            self._node.get_logger().warning(
                "the console can start, pause, resume, abort and skip only: soilmoist_msgs is not installed "
                f"({error}; build interfaces/soilmoist_msgs)"
            )
            return {}, None
        clients = {
            robot: self._node.create_client(kind, f"{name}planner/command") for robot, name in below.items()
        }
        return clients, (request_to_message, reply_from_message)
