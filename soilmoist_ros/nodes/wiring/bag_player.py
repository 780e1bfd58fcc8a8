"""``soilmoist replay --live``: a bag played to real nodes, with the time of its recording."""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import ReliabilityPolicy
from rclpy.time import Duration
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from msg_adapters.offered_qos import published_qos
from msg_adapters.stamps import to_time
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.runtime.qos import CLOCK
from soilmoist_ros.recording.bag.playback import Pacer, Playback
from soilmoist_ros.recording.bag.reader import BagReader

Progress = Callable[[str, float], None]

_TICK_S: Final = 0.02
_LISTENERS_LIMIT_S: Final = 10.0
_LISTENERS_SETTLE_S: Final = 1.0
_LAST_MESSAGES: Final = Duration(seconds=10)


class BagPlayer(Node):
    """Publishes a bag's messages, byte by byte as they were, when their time has come.

    :param playback: the messages
    :param pacer: the time
    :param context: where it publishes
    :param say: is told what the user should know
    """

    def __init__(self, playback: Playback, pacer: Pacer, context: Context, say: Callable[[str], None]) -> None:
        super().__init__("bag_player", context=context)
        self._playback = playback
        self._pacer = pacer
        self._say = say
        self._clock = None if playback.has_clock else self.create_publisher(Clock, "/clock", CLOCK)
        self._told_ns = 0
        self._publishers_of: dict[str, Publisher] = {}
        for topic, kind in list(playback.topics.items()):
            self._advertise(topic, kind)
        if not self._publishers_of:
            raise InputError("no topic can be played", "install the packages of their types")
        self.create_service(Trigger, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/resume", self._on_resume)

    def toggle(self) -> None:
        """Pause, or go on."""
        self._pacer.paused = not self._pacer.paused

    def wait_for_listeners(self) -> None:
        """Wait until somebody has subscribed and nobody else does so any more, but not for ever."""
        began_s = changed_s = time.monotonic()
        listeners = 0
        while time.monotonic() - began_s < _LISTENERS_LIMIT_S:
            now = sum(publisher.get_subscription_count() for publisher in self._publishers_of.values())
            if now != listeners:
                listeners, changed_s = now, time.monotonic()
            elif listeners and time.monotonic() - changed_s >= _LISTENERS_SETTLE_S:
                return
            self._tell_time(self._pacer.now_ns)
            time.sleep(_TICK_S)
        self._say("nobody listens to what is played" if not listeners else "more and more nodes subscribe")

    def play(self, progress: Progress) -> int:
        """Publish all messages; the number of them."""
        count, before_s = 0, time.monotonic()
        for message in self._playback.messages():
            while (wait_s := self._pacer.wait_s(message.log_ns)) > 0:
                self._tell_time(self._pacer.now_ns)
                time.sleep(min(wait_s, _TICK_S))
                now_s = time.monotonic()
                self._pacer.step(now_s - before_s)
                before_s = now_s
                step = "paused (space goes on)" if self._pacer.paused else "playing (space pauses)"
                progress(step, self._playback.share(self._pacer.now_ns))
            self._tell_time(message.log_ns)
            self._publishers_of[message.topic].publish(message.data)
            count += 1
        for publisher in self._publishers_of.values():
            if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                publisher.wait_for_all_acked(_LAST_MESSAGES)
        return count

    def _advertise(self, topic: str, kind: str) -> None:
        package, _, name = kind.split("/")
        try:
            message = getattr(importlib.import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError):
            self._say(f"{topic} is not played: {kind} is not installed")
            self._playback.leave_out(topic)
            return
        profile = published_qos(self._playback.offered(topic))
        self._publishers_of[topic] = self.create_publisher(message, topic, profile)

    def _tell_time(self, now_ns: int) -> None:
        if self._clock is not None and now_ns >= self._told_ns:
            self._told_ns = now_ns
            self._clock.publish(Clock(clock=to_time(now_ns * 1e-9)))

    def _on_pause(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._pacer.paused = True
        response.success, response.message = True, "paused"
        return response

    def _on_resume(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._pacer.paused = False
        response.success, response.message = True, "playing"
        return response


@contextmanager
def player_of(
    bag: Path, topics: str, speed: float, start_s: float, say: Callable[[str], None]
) -> Iterator[BagPlayer]:
    """A player that answers its services.

    :param bag: folder of a bag, or a file of one
    :param topics: pattern of the full names of the topics to play
    :param speed: recorded time per time
    :param start_s: time after the beginning of the bag at which to start [s]
    :param say: is told what the user should know
    :raises InputError: if the bag cannot be played
    """
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)
    ending = threading.Event()

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.2)

    thread = threading.Thread(target=spin, daemon=True)
    try:
        with BagReader(bag) as reader:
            playback = Playback(reader, topics, start_s)
            player = BagPlayer(playback, Pacer(playback.start_ns, speed), context, say)
            executor.add_node(player)
            thread.start()
            try:
                yield player
            finally:
                ending.set()
                thread.join(2.0)
                player.destroy_node()
    finally:
        executor.shutdown()
        context.try_shutdown()
