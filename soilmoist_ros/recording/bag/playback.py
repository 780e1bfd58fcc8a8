# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Playback of a bag: selection, order and time of its messages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.metadata import BagMessage, Qos

if TYPE_CHECKING:  # the recorder chooses topics by this module, and reads no bag
    from soilmoist_ros.recording.bag.reader import BagReader

_ACTION_STATUS = "/_action/status"
INPUTS: Final = (
    ".*/(counts|quarantined_counts|place_doubts|fix|pressure|temperature|relative_humidity|raw/logger"
    "|raw/gnss|topological_map_2|closest_node|current_node)"
)
"""Inputs of mapper and planner, and the raw lines; without the topics that the nodes publish."""
CLOCK: Final = "rosgraph_msgs/msg/Clock"
_MAX_STEP_S: Final = 0.1


class TopicChoice:
    """Topics by regular expressions: ``include`` must match the full name, ``exclude``, if there is one, must not.

    Hidden topics, with a part of the name that begins with ``_``, are excluded. The states of actions are
    included, since they show the outcome of the goals.

    >>> TopicChoice(exclude="/camera/.*").wanted("/camera/image")
    False

    :raises InputError: if one is not a regular expression
    """

    def __init__(self, include: str = ".*", exclude: str = "") -> None:
        self._include = _compiled("include", include)
        self._exclude = _compiled("exclude", exclude) if exclude else None

    def wanted(self, name: str) -> bool:
        """True if a topic of this full name is to be recorded."""
        hidden = "/_" in name and not name.endswith(_ACTION_STATUS)
        excluded = self._exclude is not None and self._exclude.fullmatch(name)
        return not hidden and not excluded and self._include.fullmatch(name) is not None


def _compiled(what: str, pattern: str) -> re.Pattern[str]:
    try:
        return re.compile(pattern)
    except re.error as error:
        message = f"{what}: {pattern!r} is not a regular expression: {error}"
        raise InputError(message, "an example is '/robot1/.*|/diagnostics'") from None


class Playback:
    """Messages of a bag whose topics match an expression, from a time after its beginning on [s].

    :raises InputError: for a bag of ROS 1, an invalid expression, one that no topic matches, or a start after the
        end
    """

    def __init__(self, reader: BagReader, topics: str = INPUTS, start_s: float = 0.0) -> None:
        if reader.of_ros1:
            raise InputError("is a bag of ROS 1", "convert it by rosbags-convert --src BAG --dst DIR", reader.path)
        self._reader = reader
        choice = TopicChoice(topics)
        chosen = {name: kind for name, kind in reader.topics.items() if kind != CLOCK and choice.wanted(name)}
        extent = reader.extent
        self.start_ns = extent.start_ns + round(start_s * 1e9)
        """Time of the start [ns since 1970-01-01 UTC]."""
        self.end_ns = extent.end_ns
        """Time of the last message of the bag [ns]."""
        if not chosen:
            there = ", ".join(sorted(reader.topics)) or "none"
            raise InputError(f"no topic matches {topics!r}", f"there are: {there}", reader.path)
        if self.start_ns > self.end_ns:
            lasts = f"the bag lasts {extent.duration_ns * 1e-9:.1f} s"
            raise InputError(f"there is nothing after {start_s:g} s", lasts, reader.path)
        clocks = {name: kind for name, kind in reader.topics.items() if kind == CLOCK}
        self.topics: dict[str, str] = chosen | clocks
        """Names of the topics, and their types; recorded clocks are always among them."""
        self._offered = reader.offered
        self.has_clock = bool(clocks)
        """True if the bag has simulated time; otherwise time comes from the messages."""

    def leave_out(self, topic: str) -> None:
        """Skip a topic."""
        del self.topics[topic]

    def offered(self, topic: str) -> tuple[Qos, ...]:
        """Quality of service that the publishers of a topic offered."""
        return self._offered[topic]

    def share(self, now_ns: int) -> float:
        """Share of the time that has passed at a recorded time [ns since 1970-01-01 UTC], from 0 to 1."""
        return min(1.0, max(0.0, (now_ns - self.start_ns) / max(1, self.end_ns - self.start_ns)))

    def messages(self) -> Iterator[BagMessage]:
        """Messages in the order of recording. The last messages of latched topics before the start come first."""
        latched = {
            name for name in self.topics if any(qos.durability == "transient_local" for qos in self.offered(name))
        }
        before: dict[str, BagMessage] = {}
        for message in self._reader.messages(list(self.topics)):
            if message.log_ns < self.start_ns:
                if message.topic in latched:
                    before[message.topic] = message
                continue
            yield from before.values()
            before.clear()
            yield message
        yield from before.values()


class Pacer:
    """Recorded time while a bag is played.

    It does not catch up after a delay, because the receivers would get too many messages at once.

    >>> pacer = Pacer(0, speed=10.0)
    >>> pacer.step(0.05)
    >>> pacer.now_ns
    500000000
    >>> pacer.wait_s(1_500_000_000)
    0.1
    """

    def __init__(self, start_ns: int, speed: float) -> None:
        self.now_ns = start_ns
        self._speed = speed

    def wait_s(self, due_ns: int) -> float:
        """Time until a message of a recorded time is due [s]."""
        return max(0.0, (due_ns - self.now_ns) * 1e-9 / self._speed)

    def step(self, elapsed_s: float) -> None:
        """Advance the recorded time by the time that has passed [s]."""
        self.now_ns += round(min(elapsed_s, _MAX_STEP_S) * self._speed * 1e9)
