# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``metadata.yaml`` of a bag, version 9 (ROS 2 Jazzy), and the qualities of service in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from io import StringIO
from typing import Any, Final

from ruamel.yaml import YAML

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.mcap.definitions import Definition

INFINITE_NS: Final = 2**63 - 1
"""An infinite duration, as ROS writes it [ns]."""

_VERSION: Final = 9
_GIGA: Final = 1_000_000_000
_KEEP_AT_LEAST: Final = 500
"""Messages of a topic that wait for the recorder, which takes them ten times a second."""


@dataclass(frozen=True)
class Qos:
    """Quality of service, in the words of rosbag2.

    :param history: ``keep_last``, ``keep_all``, ``system_default`` or ``unknown``
    :param depth: messages kept
    :param reliability: ``reliable``, ``best_effort``, ``system_default`` or ``unknown``
    :param durability: ``volatile``, ``transient_local``, ``system_default`` or ``unknown``
    :param deadline_ns: longest time between messages [ns]
    :param lifespan_ns: age at which a message expires [ns]
    :param liveliness: ``automatic``, ``manual_by_topic``, ``system_default`` or ``unknown``
    :param lease_ns: silence after which a publisher counts as gone [ns]
    """

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: str = "automatic"
    lease_ns: int = INFINITE_NS

    def to_dict(self) -> dict[str, Any]:
        """Plain data in the layout of rosbag2."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": _duration(self.deadline_ns),
            "lifespan": _duration(self.lifespan_ns),
            "liveliness": self.liveliness,
            "liveliness_lease_duration": _duration(self.lease_ns),
            "avoid_ros_namespace_conventions": False,
        }


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    :param name: full name
    :param definition: definition of its type
    :param offered: quality of service that its publishers offer
    """

    name: str
    definition: Definition
    offered: tuple[Qos, ...] = ()


@dataclass(frozen=True)
class Extent:
    """Number of messages, and their time span.

    :param messages: number of messages
    :param start_ns: time of the earliest [ns since 1970-01-01 UTC], 0 without messages
    :param end_ns: time of the latest [ns]
    """

    messages: int = 0
    start_ns: int = 0
    end_ns: int = 0

    def with_message(self, time_ns: int) -> Extent:
        """The extent with one more message."""
        if not self.messages:
            return Extent(1, time_ns, time_ns)
        return Extent(self.messages + 1, min(self.start_ns, time_ns), max(self.end_ns, time_ns))

    @property
    def duration_ns(self) -> int:
        """Time between the first and the last message [ns]."""
        return self.end_ns - self.start_ns


@dataclass(frozen=True)
class BagFile:
    """A file of a bag.

    :param name: name of the file
    :param extent: its messages
    """

    name: str
    extent: Extent


def joined(extents: Sequence[Extent]) -> Extent:
    """The extent of all messages."""
    some = [extent for extent in extents if extent.messages]
    if not some:
        return Extent()
    first, last = min(one.start_ns for one in some), max(one.end_ns for one in some)
    return Extent(sum(one.messages for one in some), first, last)


def bag_metadata(
    files: Sequence[BagFile], topics: Mapping[Topic, int], distribution: str, notes: Mapping[str, str]
) -> dict[str, Any]:
    """Content of ``metadata.yaml`` of a bag of MCAP files.

    :param files: its files in the order of recording
    :param topics: topics, and number of messages of each
    :param distribution: name of the ROS distribution of the recorder
    :param notes: custom data
    """
    extent = joined([file.extent for file in files])
    return {
        "version": _VERSION,
        "storage_identifier": "mcap",
        **_span(extent),
        "message_count": extent.messages,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.definition.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [qos.to_dict() for qos in topic.offered],
                    "type_description_hash": topic.definition.type_hash,
                },
                "message_count": count,
            }
            for topic, count in topics.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {"path": file.name, **_span(file.extent), "message_count": file.extent.messages} for file in files
        ],
        "custom_data": dict(notes) or None,
        "ros_distro": distribution,
    }


def to_yaml(content: object) -> str:
    """Plain data as YAML, without anchors if no part occurs twice."""
    yaml = YAML(typ="safe")
    yaml.default_flow_style = False
    yaml.width = 1000
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]  # keeps the order given
    stream = StringIO()
    yaml.dump(content, stream)
    return stream.getvalue()


@lru_cache(maxsize=256)
def qos_from_yaml(text: str) -> tuple[Qos, ...]:
    """Qualities of service from the text in a bag; numbers of older versions become words."""
    from soilmoist_ros.foundation import parse_yaml

    try:
        return tuple(_qos(entry) for entry in parse_yaml(text) or ())
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return ()


@dataclass(frozen=True)
class Request:
    """Quality of service that a recorder requests for a topic.

    :param reliable: whether lost messages are sent again
    :param latched: whether messages from before the subscription are requested
    :param depth: messages kept for a receiver that is busy
    """

    reliable: bool
    latched: bool
    depth: int

    def is_weaker(self, other: Request) -> bool:
        """Whether the other requests more than this one."""
        return (other.reliable and not self.reliable) or (other.latched and not self.latched)

    def weakened(self, other: Request) -> Request:
        """The common part of both requests."""
        return replace(
            self,
            reliable=self.reliable and other.reliable,
            latched=self.latched and other.latched,
            depth=max(self.depth, other.depth),
        )


def request_for(offered: Sequence[Qos]) -> Request:
    """The strongest request that all publishers of a topic fulfil; with a stronger one, some do not connect.

    :param offered: quality of service of each publisher, at least one
    """
    return Request(
        reliable=all(qos.reliability == "reliable" for qos in offered),
        latched=all(qos.durability == "transient_local" for qos in offered),
        depth=max(_KEEP_AT_LEAST, sum(qos.depth for qos in offered)),
    )


_WORDS: Final = {
    "history": {0: "system_default", 1: "keep_last", 2: "keep_all"},
    "reliability": {0: "system_default", 1: "reliable", 2: "best_effort"},
    "durability": {0: "system_default", 1: "transient_local", 2: "volatile"},
    "liveliness": {0: "system_default", 1: "automatic", 3: "manual_by_topic"},
}


def _qos(entry: Mapping[str, Any]) -> Qos:
    def word(key: str) -> str:
        value = entry[key]
        return value if isinstance(value, str) else _WORDS[key].get(value, "unknown")

    return Qos(
        word("history"),
        int(entry["depth"]),
        word("reliability"),
        word("durability"),
        _nanoseconds(entry["deadline"]),
        _nanoseconds(entry["lifespan"]),
        word("liveliness"),
        _nanoseconds(entry["liveliness_lease_duration"]),
    )


def _duration(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // _GIGA, "nsec": time_ns % _GIGA}


def _nanoseconds(duration: Mapping[str, int]) -> int:
    return min(INFINITE_NS, duration["sec"] * _GIGA + duration["nsec"])


def _span(extent: Extent) -> dict[str, dict[str, int]]:
    """Time span, made anew: YAML would write an anchor for a second occurrence."""
    return {
        "duration": {"nanoseconds": extent.duration_ns},
        "starting_time": {"nanoseconds_since_epoch": extent.start_ns},
    }
