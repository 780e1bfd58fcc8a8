# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests the parameters of other nodes regularly, without waiting for the answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Final

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

_LOOK_S: Final = 1.0
_AGAIN_S: Final = 10.0
"""Time between two requests to a node [s]; a restart may change its values."""
_OF_EVERY_NODE: Final = ("qos_overrides.", "start_type_description_service")


class ParameterCollector:
    """Collects the parameters of nodes in the same namespace, or in namespaces below it.

    :param node: the node that sends the requests
    :param names: names of the nodes to ask
    :param take: called with the name and the parameters of a node each time the parameters arrive
    """

    def __init__(
        self,
        node: Node,
        names: Iterable[str],
        take: Callable[[str, Mapping[str, object]], None],
    ) -> None:
        self._take = take
        self._node = node
        self._clients: dict[str, tuple[Client, Client]] = {}
        self._due_s: dict[str, float] = {}
        for name in names:
            self.ask(name)
        self._asked: dict[str, tuple[Client, Future]] = {}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_LOOK_S, self._look, clock=steady)

    def ask(self, name: str) -> None:
        """Collect the parameters of another node as well."""
        if name not in self._clients:
            self._due_s[name] = 0.0
            self._clients[name] = (
                self._node.create_client(ListParameters, f"{name}/list_parameters"),
                self._node.create_client(GetParameters, f"{name}/get_parameters"),
            )

    def _look(self) -> None:
        for name, (lister, _) in list(self._clients.items()):
            if time.monotonic() < self._due_s[name]:
                continue
            self._due_s[name] = time.monotonic() + _AGAIN_S
            if name in self._asked:  # a node that has ended does not answer
                client, future = self._asked.pop(name)
                client.remove_pending_request(future)
            if lister.service_is_ready():
                self._ask(name, lister, ListParameters.Request(), self._on_names)
            else:
                self._due_s[name] = 0.0

    def _ask(self, name: str, client: Client, request: Any, then: Callable[[str, Any], None]) -> None:
        future = client.call_async(request)
        self._asked[name] = client, future
        future.add_done_callback(partial(self._answered, name, then))

    def _answered(self, name: str, then: Callable[[str, Any], None], future: Future) -> None:
        self._asked.pop(name, None)
        if future.exception() is None and future.result() is not None:
            then(name, future.result())

    def _on_names(self, name: str, answer: Any) -> None:
        names = [one for one in answer.result.names if not one.startswith(_OF_EVERY_NODE)]
        request = GetParameters.Request(names=names)
        self._ask(name, self._clients[name][1], request, partial(self._on_values, names))

    def _on_values(self, names: list[str], name: str, answer: Any) -> None:
        values = map(parameter_value_to_python, answer.values)
        self._take(name, {key: value for key, value in zip(names, values, strict=False) if value is not None})
