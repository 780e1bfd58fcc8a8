# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cancels the goals of a planner that is silent or stuck: a separate program, which outlives the planner."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Collection, Mapping, Set
from dataclasses import dataclass
from functools import partial
from typing import Final

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.client import Client
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from std_msgs.msg import Bool

from soilmoist_ros.exploration import ACTIVE, goal_mark
from soilmoist_ros.foundation import InputError
from soilmoist_ros.nodes.node_process import run
from soilmoist_ros.nodes.parameter_tables import WATCHDOG as PARAMETERS
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.nodes.topics import DEFAULT, HEARTBEAT, LATCHED, NO_EVENTS, SENSOR, every

__all__ = ["PARAMETERS", "Heartbeats", "Watchdog", "main"]

TICK_S, SHOW_S = 0.05, 1.0
FIRST_S: Final = 3.0  # who is there is heard this long after the start of the watchdog [s]
AGAIN_S: Final = 0.3  # a goal that has not ended is cancelled again after this time [s]
ALL_S: Final = 3.0  # where the planner's goals do not end, all of the navigation are cancelled after this time [s]
RELEASE_S: Final = 2.0  # the watchdog lets go after this time without a fault and without a goal [s]
ALL_GOALS: Final = bytes(16)  # identity that stands for all goals of an action, as action_msgs defines it
STATUS: Final = "/_action/status"
Goal = tuple[str, bytes]


@dataclass
class _Beat:
    silent_s: float
    heard_s: float
    good: bool = True
    known: bool = False

    def fault(self, now_s: float, first: str) -> str:
        if not self.good:
            return "says that something is wrong"
        silent_s = now_s - self.heard_s
        return f"is silent: {silent_s:.1f} s" if silent_s > self.silent_s else "" if self.known else first


class Heartbeats:
    """Decides from heartbeats and goals when to cancel, at times of a steady clock.

    It trips when a heartbeat is missing or bad while a goal drives the robot. Then it cancels every goal of the
    planner, until all are over and the heartbeats are good for :data:`RELEASE_S`. ``silent_s`` [s] is the longest
    time between two heartbeats of the planner, ``others`` has those of other heartbeats by topic.
    """

    def __init__(self, silent_s: float, others: Mapping[str, float], now_s: float) -> None:
        limits = {"": silent_s, **others}
        self._beats = {topic: _Beat(limit_s, now_s + FIRST_S) for topic, limit_s in limits.items()}
        self._tripped_s = self._quiet_since_s = self._asked_s = -math.inf
        self._ticked_s, self.tripped, self.reason, self.trips = now_s, False, "", 0

    def hear(self, topic: str, good: bool, now_s: float) -> None:
        """A heartbeat has come, with an empty topic for that of the planner."""
        beat = self._beats[topic]
        beat.heard_s, beat.good, beat.known = now_s, good, True

    def fault(self, now_s: float, of: Collection[str] | None = None, first: str = "") -> str:
        """Fault of heartbeats in words, by default of all; ``first`` is that of one that was never heard."""
        for topic in self._beats if of is None else of:
            if fault := self._beats[topic].fault(now_s, first):
                return f"{f'the heartbeat {topic}' if topic else 'the planner'} {fault}"
        return ""

    def tick(self, goals: Set[Goal], now_s: float) -> Set[Goal]:
        """The goals to cancel now, of the planner's goals that drive the robot; or all, if they do not end."""
        slept_s, self._ticked_s = now_s - self._ticked_s, now_s
        if slept_s > AGAIN_S:  # a busy computer: heartbeats wait to be read
            for beat in self._beats.values():
                beat.heard_s += slept_s
        fault = self.fault(now_s)
        if fault and goals and not self.tripped:
            self.tripped, self.reason, self.trips = True, fault, self.trips + 1
            self._tripped_s, self._asked_s = now_s, -math.inf
        if not self.tripped:
            return frozenset()
        if fault or goals:
            self._quiet_since_s = now_s
        elif now_s - self._quiet_since_s >= RELEASE_S:
            self.tripped = False
        if not goals or now_s - self._asked_s < AGAIN_S:
            return frozenset()
        self._asked_s = now_s
        if now_s - self._tripped_s < ALL_S:
            return goals
        return goals | {(action, ALL_GOALS) for action, _ in goals}


class Watchdog(Node):
    """Hears heartbeats and states of goals of any action, and cancels those that have the planner's mark."""

    def __init__(self) -> None:
        super().__init__("watchdog")
        values = Parameters(self, PARAMETERS)
        self._mark = goal_mark(f"{self.get_namespace().rstrip('/')}/planner")
        poses = values.text("pose_action")
        self._poses = self.resolve_service_name(poses) if poses else ""
        self._others = dict.fromkeys(values.texts("heartbeats"), values.number("heartbeat_silent_s"))
        self._beats = Heartbeats(values.number("silent_s"), self._others, time.monotonic())
        self._states: dict[str, dict[bytes, int]] = {}
        self._cancels: dict[str, Client] = {}
        self._seen, self._said = set[str](), False
        self._shown = self.create_publisher(DiagnosticStatus, "watchdog", LATCHED)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        self._out, out = None, values.text("heartbeat_out")
        self.create_subscription(Bool, HEARTBEAT, partial(self._on_beat, ""), DEFAULT)
        try:
            self._out = self.create_publisher(Bool, out, DEFAULT) if out else None
            for topic in self._others:  # best effort hears every publisher
                take = partial(self._on_beat, topic)
                self.create_subscription(Bool, topic, take, SENSOR, event_callbacks=NO_EVENTS)
        except NameValidationException as error:
            raise InputError(f"heartbeats, heartbeat_out: {error}", "names look like /safety/heartbeat") from None
        every(self, TICK_S, self._tick)
        every(self, SHOW_S, self._show)
        self._show()

    def _look(self) -> None:
        """Hear the goals of actions that have appeared, and forget those of a navigation that has died."""
        for topic, kinds in self.get_topic_names_and_types():
            action = topic.removesuffix(STATUS)
            if action == topic or "action_msgs/msg/GoalStatusArray" not in kinds:
                continue
            if not self.count_publishers(topic):
                self._states.pop(action, None)
            elif action not in self._seen:
                self._seen.add(action)
                with contextlib.suppress(RuntimeError):  # security permits the actions that its policy names
                    self._cancels[action] = self.create_client(CancelGoal, f"{action}/_action/cancel_goal")
                    take = partial(self._on_goals, action)
                    self.create_subscription(GoalStatusArray, topic, take, LATCHED, event_callbacks=NO_EVENTS)

    def _on_beat(self, topic: str, message: Bool) -> None:
        self._beats.hear(topic, message.data, time.monotonic())

    def _on_goals(self, action: str, message: GoalStatusArray) -> None:
        self._states[action] = {bytes(one.goal_info.goal_id.uuid): one.status for one in message.status_list}
        self._tick()

    def _tick(self) -> None:
        goals = {
            (action, goal)
            for action, states in self._states.items()
            for goal, state in states.items()
            if state in ACTIVE and (goal.startswith(self._mark) or action == self._poses)
        }
        for action, goal in self._beats.tick(goals, time.monotonic()):
            request = CancelGoal.Request()
            request.goal_info.goal_id.uuid = list(goal)
            self._cancels[action].call_async(request)
        if self._beats.tripped != self._said:
            self._said = self._beats.tripped
            self._show()
            said = f"{self._beats.reason}: the planner's goals are cancelled"
            self.get_logger().warning(said if self._said else "all is well again")

    def _show(self) -> None:
        self._look()
        beats, now_s = self._beats, time.monotonic()
        bad, fault = beats.fault(now_s, self._others), beats.fault(now_s, first="has not been heard yet")
        level = DiagnosticStatus.WARN if fault else DiagnosticStatus.OK
        said = f"{beats.reason}: the planner's goals are cancelled; look at the robot" if beats.tripped else bad
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if said else level,
            name=f"{self.get_fully_qualified_name()}: watchdog",
            message=said or fault or "the planner is heard",
            values=[KeyValue(key="trips", value=str(beats.trips)), KeyValue(key="last", value=beats.reason)],
        )
        self._shown.publish(status)
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)
        if self._out is not None:
            self._out.publish(Bool(data=not fault and not beats.tripped))


def main() -> None:
    """Run the watchdog."""
    run(Watchdog)


if __name__ == "__main__":
    main()
