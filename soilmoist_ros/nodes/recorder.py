# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writes every topic to a bag that survives a crash, with the parameters of the nodes and the files they name."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.subscription import Subscription
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_adapters import diagnostics_to_message
from soilmoist_ros.foundation import InputError, not_installed
from soilmoist_ros.nodes.node_process import Aside, run
from soilmoist_ros.nodes.parameter_tables import RECORDER as PARAMETERS
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import (
    DEFAULT,
    every,
    interface_class,
    offered_qos,
    quiet_node,
    requested_qos,
    ros_now_s,
)

try:
    from soilmoist_ros.recording import (
        BagRecorder,
        Qos,
        Request,
        RunConfiguration,
        Topic,
        TopicChoice,
        check_name,
        find_definition,
        free_bytes,
        next_bag,
        recorder_health,
        request_for,
    )
except ModuleNotFoundError as error:  # the only node that needs packages without a key of rosdep
    raise SystemExit(f"recorder: {not_installed(error)}; the other nodes do without") from None

__all__ = ["PARAMETERS", "Recorder", "main"]

_LOW_DISK_BYTES: Final = 5e8
"""Free space below which the recorder warns: a long day of records, and room for the map at its end."""
_FULL_SOON_S: Final = 3600.0
"""Time to a full disk below which the recorder warns: enough to drive home [s]."""
_RECORDED: Final = ("sensor_driver", "mapper", "planner")
"""Nodes whose parameters are stored with the bag, in addition to the parameters of the property mappers."""
_TAKE_S: Final = 0.1  # time between two looks for messages [s]; each subscription keeps 500 messages or more
_DISCOVERY_S: Final = 0.2
_OTHER_PUBLISHERS_S: Final = 1.0
_DIAGNOSTICS_S: Final = 1.0
_CONFIGURATION_S: Final = 1.0
_OPEN_S: Final = 5.0
_LOOK_S: Final = 0.01  # pause between looks for messages in transit, before the bag is closed [s]
_QUIET_LOOKS: Final = 20  # looks without messages after which it is closed
_MAX_LOOKS: Final = 100
_ASK_S: Final = 1.0
_AGAIN_S: Final = 10.0  # time between two requests to a node [s]; a restart may change its values
_OF_EVERY_NODE: Final = ("qos_overrides.", "start_type_description_service")


def take_until_quiet(take: Callable[[], int]) -> None:
    """Take the messages in transit, at most for a second or so.

    Looks are counted, not time: on a busy computer this thread and that of DDS may both stand still for longer
    than any time without messages.
    """
    quiet = 0
    for _ in range(_MAX_LOOKS):
        quiet = 0 if take() else quiet + 1
        if quiet == _QUIET_LOOKS:
            return
        time.sleep(_LOOK_S)


class Recorder(Node):
    """Records topics as they appear; services start and stop it."""

    def __init__(self) -> None:
        super().__init__("recorder")
        settings = Parameters(self, PARAMETERS)
        text = settings.text
        self._choice = TopicChoice(text("include"), text("exclude"))
        self._out = Path(text("out")).expanduser()
        check_name(text("name"))
        self._distribution = os.environ.get("ROS_DISTRO", "jazzy")
        self._recorder = BagRecorder(lambda: next_bag(self._out, text("name"), self._distribution))
        self._topics: dict[str, tuple[Topic, Request, Subscription]] = {}
        self._publisher_counts: dict[str, int] = {}
        self._skipped: set[str] = set()
        self._mixed: set[str] = set()
        self._listener = quiet_node(self, "listener")  # an executor would cost more than the recording
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        self._aside = Aside(self)  # a slow disk must not delay messages
        self._aside.offer(Trigger, "recorder/start", self._start)
        self._aside.offer(Trigger, "recorder/stop", self._stop)
        if settings.flag("autostart"):
            self._recorder.start()
        self._discover()
        self._configuration = RunConfiguration()
        self._complaint = ""
        self._collector = ParameterCollector(self, _RECORDED, self._take_parameters)
        timers: list[tuple[float, Callable[[], object]]] = [
            (_TAKE_S, self._record_arrived),
            (_DISCOVERY_S, self._discover),
            (_OTHER_PUBLISHERS_S, lambda: self._discover(known=True)),
            (_DIAGNOSTICS_S, self._diagnose),
            (_CONFIGURATION_S, lambda: self._aside.do(self._keep_configuration, "storing the configuration")),
        ]
        for period_s, call in timers:
            every(self, period_s, call)

    def close(self) -> None:
        """Record the messages in transit, then close the bag."""
        self._aside.close()
        take_until_quiet(self._record_arrived)
        state = self._recorder.stop()
        self._listener.destroy_node()
        if state.gone:
            self.get_logger().error(state.gone)
        if state.bag is not None:
            self.get_logger().info(f"recorded {state.messages} messages to {state.bag}")

    def _record_arrived(self) -> int:
        """Record the messages that arrived; returns their number."""
        count = 0
        for topic, _, subscription in self._topics.values():
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                    data, info = taken
                    self._recorder.put(topic, info["received_timestamp"], info["source_timestamp"], data)
                    count += 1
        return count

    def _start(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._recorder.start()
        response.success = self._recorder.wait_open(_OPEN_S)
        state = self._recorder.state
        response.message = f"recording to {state.bag}" if response.success else state.problem
        return response

    def _stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        state = self._recorder.stop()
        response.message = state.problem or state.gone or f"{state.messages} messages in {state.bag}"
        response.success = not (state.problem or state.gone)
        return response

    def _diagnose(self) -> None:
        state, free = self._recorder.state, free_bytes(self._out)
        health = recorder_health(state, free, _LOW_DISK_BYTES, len(self._skipped), _FULL_SOON_S)
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(diagnostics_to_message([health], ros_now_s(self), name))

    def _take_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        self._configuration.take(node, values)
        if node == "planner" and values.get("properties"):
            from soilmoist_ros.exploration import property_weights  # loads maps: 6 MB that few robots need

            for name in property_weights(values["properties"]):
                self._collector.ask(f"{name}/mapper")

    def _keep_configuration(self) -> None:
        bag = self._recorder.state.bag
        if bag is None:
            return
        try:
            for name in self._configuration.write(bag):
                self.get_logger().info(f"the parameters of {name} are stored with the recording")
            self._complaint = ""
        except InputError as error:
            if str(error) != self._complaint:
                self._complaint = str(error)
                self.get_logger().error(f"the configuration of the nodes is not stored: {error}")

    def _discover(self, known: bool = False) -> None:
        """Subscribe to new topics, and again to ``known`` ones that now need a weaker quality of service."""
        for name, types in self.get_topic_names_and_types():
            if (name in self._topics and not known) or name in self._skipped or not self._choice.wanted(name):
                continue
            publishers = self.count_publishers(name)
            if publishers == self._publisher_counts.get(name, 0):
                continue
            self._publisher_counts[name] = publishers
            offered = tuple(offered_qos(info.qos_profile) for info in self.get_publishers_info_by_topic(name))
            if not offered:
                continue
            try:
                self._subscribe(name, types, offered)
            except (InputError, ImportError) as error:
                self._skipped.add(name)
                self.get_logger().warning(f"{name} is not recorded: {error}")

    def _subscribe(self, name: str, types: list[str], offered: tuple[Qos, ...]) -> None:
        wanted = request_for(offered)
        if name in self._topics:
            topic, request, subscription = self._topics[name]
            if len(types) > 1 and name not in self._mixed:
                self._mixed.add(name)
                here = topic.definition.type_name
                self.get_logger().warning(
                    f"{name} has several types: of {', '.join(types)} only {here} is recorded"
                )
            if not wanted.is_weaker(request):
                return
            wanted = wanted.weakened(request)
            self._listener.destroy_subscription(subscription)
        else:
            if len(types) != 1:
                raise InputError(f"it has several types: {', '.join(types)}", "publish one type per topic")
            topic = Topic(name, find_definition(types[0]), offered)
        message_class = interface_class(topic.definition.type_name)
        subscription = self._listener.create_subscription(
            message_class, name, print, requested_qos(wanted), raw=True
        )
        self._topics[name] = (topic, wanted, subscription)


# Requests the parameters of other nodes regularly, without waiting for the answers ------------------------------


class ParameterCollector:
    """Collects the parameters of nodes in the same namespace, or in namespaces below it."""

    def __init__(
        self, node: Node, names: Iterable[str], take: Callable[[str, Mapping[str, object]], None]
    ) -> None:
        self._take = take
        self._node = node
        self._clients: dict[str, tuple[Client, Client]] = {}
        self._due_s: dict[str, float] = {}
        for name in names:
            self.ask(name)
        self._asked: dict[str, tuple[Client, Future]] = {}
        every(node, _ASK_S, self._look)

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


def main() -> None:
    """Run the node."""
    run(Recorder)


if __name__ == "__main__":
    main()
