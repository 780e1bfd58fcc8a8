# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes of the commands: ``soilmoist bag play`` plays a bag, ``demo`` and ``watch`` follow a mission."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import ReliabilityPolicy
from rclpy.time import Duration
from rosgraph_msgs.msg import Clock

from msg_adapters import diagnostics_from_message, health_from_status, mission_from_message, to_time
from soilmoist_ros.exploration import logger_fault
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import MapWorker
from soilmoist_ros.nodes.topics import CLOCK, DEFAULT, LATCHED, interface_class, published_qos
from soilmoist_ros.recording import BagReader, Pacer, Playback
from soilmoist_ros.reporting import LiveMission, LiveRobot
from soilmoist_ros.simulation import CLOCK_PART, WAITS_FOR

Progress = Callable[[str, float], None]
SomeNode = TypeVar("SomeNode", bound=Node)

_TICK_S: Final = 0.02
_LISTENERS_LIMIT_S: Final = 10.0
_LISTENERS_SETTLE_S: Final = 1.0
_LAST_MESSAGES: Final = Duration(seconds=10)


@contextmanager
def _spinning(make: Callable[[Context], SomeNode], domain: int | None = None) -> Iterator[SomeNode]:
    """Run a node in a thread, in its own ROS context and in a ROS domain, by default the one of the shell."""
    context, ending = Context(), threading.Event()
    rclpy.init(context=context, domain_id=domain)
    executor = SingleThreadedExecutor(context=context)

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.2)

    try:
        node = make(context)
        executor.add_node(node)
        thread = threading.Thread(target=spin, daemon=True)
        thread.start()
        try:
            yield node
        finally:
            ending.set()
            thread.join()  # an executor that is shut down while it spins fails
            node.destroy_node()
    finally:
        executor.shutdown()
        context.try_shutdown()


# A bag ----------------------------------------------------------------------------------------------------------


class BagPlayer(Node):
    """Publishes the messages of a bag at their recorded times, with unchanged bytes."""

    def __init__(
        self,
        playback: Playback,
        pacer: Pacer,
        context: Context,
        say: Callable[[str], None],
        interrupted: threading.Event,
    ) -> None:
        super().__init__("bag_player", context=context)
        self._playback, self._pacer, self._say, self._interrupted = playback, pacer, say, interrupted
        self._clock = None if playback.has_clock else self.create_publisher(Clock, "/clock", CLOCK)
        self._clock_ns = 0
        self._publishers_of: dict[str, Publisher] = {}
        for topic, kind in list(playback.topics.items()):
            self._advertise(topic, kind)
        if not self._publishers_of:
            raise InputError("no topic can be played", "install the packages of their types")

    def wait_for_listeners(self) -> None:
        """Wait, up to a limit, until the number of subscriptions is above zero and constant."""
        began_s = changed_s = time.monotonic()
        listeners = 0
        while time.monotonic() - began_s < _LISTENERS_LIMIT_S:
            now = sum(publisher.get_subscription_count() for publisher in self._publishers_of.values())
            if now != listeners:
                listeners, changed_s = now, time.monotonic()
            elif listeners and time.monotonic() - changed_s >= _LISTENERS_SETTLE_S:
                return
            self._publish_time(self._pacer.now_ns)
            self._sleep(_TICK_S)
        self._say("no node subscribes to the played topics" if not listeners else "more and more nodes subscribe")

    def play(self, progress: Progress) -> int:
        """Publish all messages; returns their number."""
        count, before_s = 0, time.monotonic()
        for message in self._playback.messages():
            while (wait_s := self._pacer.wait_s(message.log_ns)) > 0:
                self._publish_time(self._pacer.now_ns)
                self._sleep(min(wait_s, _TICK_S))
                now_s = time.monotonic()
                self._pacer.step(now_s - before_s)
                before_s = now_s
                progress("playing", self._playback.share(self._pacer.now_ns))
            self._publish_time(message.log_ns)
            self._publishers_of[message.topic].publish(message.data)
            count += 1
        for publisher in self._publishers_of.values():
            if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                publisher.wait_for_all_acked(_LAST_MESSAGES)
        return count

    def _advertise(self, topic: str, kind: str) -> None:
        try:
            message = interface_class(kind)
        except ImportError as error:
            self._say(f"{topic} is not played: {kind} is not installed ({error})")
            self._playback.leave_out(topic)
            return
        profile = published_qos(self._playback.offered(topic))
        self._publishers_of[topic] = self.create_publisher(message, topic, profile)

    def _sleep(self, time_s: float) -> None:
        if self._interrupted.wait(time_s):
            raise KeyboardInterrupt

    def _publish_time(self, now_ns: int) -> None:
        if self._clock is not None and now_ns >= self._clock_ns:
            self._clock_ns = now_ns
            self._clock.publish(Clock(clock=to_time(now_ns * 1e-9)))


@contextmanager
def player_of(
    bag: Path, topics: str, speed: float, start_s: float, say: Callable[[str], None]
) -> Iterator[BagPlayer]:
    """Make a player."""
    interrupted = threading.Event()
    # Python drops a KeyboardInterrupt that is raised within a callback of the garbage collector.
    previous = signal.signal(signal.SIGINT, lambda number, frame: interrupted.set())
    try:
        with BagReader(bag) as reader:
            playback = Playback(reader, topics, start_s)
            pacer = Pacer(playback.start_ns, speed)
            with _spinning(lambda context: BagPlayer(playback, pacer, context, say, interrupted)) as player:
                yield player
    finally:
        signal.signal(signal.SIGINT, previous)


# A mission ------------------------------------------------------------------------------------------------------


class NodeMonitor(Node):
    """Keeps a :class:`LiveMission` up to date; unreadable messages are ignored."""

    def __init__(self, live: LiveMission, context: Context) -> None:
        super().__init__("monitor", context=context)
        self._live = live
        for robot in live.robots:
            below = f"{robot.namespace}/" if robot.namespace else ""
            self.create_subscription(
                DiagnosticStatus, f"{below}mission", partial(self._on_mission, robot), LATCHED
            )
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEFAULT)

    def _on_mission(self, robot: LiveRobot, message: DiagnosticStatus) -> None:
        with contextlib.suppress(ValueError):
            mission_from_message(message)
            robot.status = dict(health_from_status(message).values)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        parts = diagnostics_from_message(message)
        for robot in self._live.robots:
            fault = logger_fault(parts, f"/{robot.namespace}")
            robot.sensor_fault = robot.sensor_fault if fault is None else fault
        for health in parts:
            if health.name.endswith(f": {CLOCK_PART}"):
                self._live.clock_waits_for = health.values.get(WAITS_FOR, "")
            if health.name.endswith(f": {MapWorker.PART}") and MapWorker.RAIN in health.values:
                self._live.rain = health.values[MapWorker.RAIN]


@contextmanager
def monitored(live: LiveMission, domain: int) -> Iterator[None]:
    """Run a :class:`NodeMonitor` in a thread."""
    with _spinning(lambda context: NodeMonitor(live, context), domain):
        yield
