# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``metadata.yaml`` of a bag, version 9 (ROS 2 Jazzy), and the qualities of service in it."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import Any, Final, NamedTuple

from ruamel.yaml import YAML

from soilmoist_ros.foundation import InputError

_SEPARATOR: Final = "=" * 80
_PRIMITIVE: Final = re.compile(r"bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string")
_FIELD: Final = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*")
_TYPE: Final = re.compile(r"(\w+)/msg/(\w+)")
INFINITE_NS: Final = 2**63 - 1  # an infinite duration, as ROS writes it [ns]

_VERSION: Final = 9
_GIGA: Final = 1_000_000_000
_KEEP_AT_LEAST: Final = 500  # messages of a topic that wait for the recorder, which takes them ten times a second


@dataclass(frozen=True)
class Definition:
    """Definition of a message type (named as ``std_msgs/msg/String``), as a reader needs it."""

    type_name: str
    text: str  # definition, followed by the definitions of all types in it
    encoding: str = "ros2msg"  # ros2msg; bags of other recorders may have ros2idl
    type_hash: str = ""  # hash of the type (RIHS01_...), empty if unknown


def search_prefixes() -> list[Path]:
    """Folders in which ROS packages may be installed: those of ``AMENT_PREFIX_PATH``, then this Python's."""
    named = [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    return list(dict.fromkeys([*named, Path(sys.prefix)]))


def find_definition(type_name: str, prefixes: Sequence[Path] | None = None) -> Definition:
    """Definition of a message type, with the definitions of all types in it.

    :param prefixes: folders to search; :func:`search_prefixes` if ``None``
    :raises InputError: if the type, or a type in it, is not installed
    """
    where = search_prefixes() if prefixes is None else prefixes
    names, parts = [type_name], list[str]()
    for name in names:  # grows
        text = _find(name, where).read_text(encoding="utf-8")
        parts += [_SEPARATOR, f"MSG: {name.replace('/msg/', '/')}", text] if parts else [text]
        names += [used for used in _used_types(text, name) if used not in names]
    return Definition(type_name, "\n".join(parts), type_hash=_type_hash(_find(type_name, where), type_name))


def _find(type_name: str, prefixes: Sequence[Path]) -> Path:
    match = _TYPE.fullmatch(type_name)
    if match is None:
        raise InputError(f"{type_name!r} is not the name of a message type", "names look like std_msgs/msg/String")
    for prefix in prefixes:
        path = prefix / "share" / match[1] / "msg" / f"{match[2]}.msg"
        if path.is_file():
            return path
    raise InputError(
        f"the definition of {type_name} is not installed (looked in: {', '.join(map(str, prefixes))})",
        f"install the ROS package {match[1]}, or add its prefix to AMENT_PREFIX_PATH",
    )


def _used_types(text: str, type_name: str) -> list[str]:
    """Full names of the types of a definition's fields; names without a package get the definition's."""
    package = type_name.split("/")[0]
    found = dict[str, None]()
    for line in text.splitlines():
        match = _FIELD.match(line.partition("#")[0])
        if match is not None and not _PRIMITIVE.fullmatch(match[1]):
            *folders, kind = match[1].split("/")
            found[f"{folders[0] if folders else package}/msg/{kind}"] = None
    return list(found)


def _type_hash(path: Path, type_name: str) -> str:
    try:
        entries = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["type_hashes"]
        return next(str(entry["hash_string"]) for entry in entries if entry["type_name"] == type_name)
    except (OSError, ValueError, KeyError, TypeError, StopIteration):
        return ""  # distributions before Iron have none


@dataclass(frozen=True)
class Qos:
    """Quality of service, in the words of rosbag2; any word may also be ``system_default`` or ``unknown``.

    ``deadline_ns`` is the longest time between messages, ``lifespan_ns`` the age at which one expires,
    ``lease_ns`` the silence after which a publisher counts as gone [ns].
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
    """A topic of a bag by its full name, and the quality of service that its publishers offer."""

    name: str
    definition: Definition
    offered: tuple[Qos, ...] = ()


@dataclass(frozen=True)
class Extent:
    """Number of messages, and times of the earliest and the latest [ns since 1970-01-01 UTC], 0 without any."""

    messages: int = 0
    start_ns: int = 0
    end_ns: int = 0

    def with_message(self, time_ns: int) -> Extent:
        """The extent with one more message."""
        start_ns = min(self.start_ns, time_ns) if self.messages else time_ns
        return Extent(self.messages + 1, start_ns, max(self.end_ns, time_ns))

    @property
    def duration_ns(self) -> int:
        """Time between the first and the last message [ns]."""
        return self.end_ns - self.start_ns


class BagMessage(NamedTuple):
    """A message (CDR, or as in ROS 1) with topic, type, and the time of its receipt [ns since 1970-01-01 UTC]."""

    topic: str
    type_name: str
    log_ns: int
    data: bytes


class TimedMessage(NamedTuple):
    """A message in CDR, and when it was received and published [ns since 1970-01-01 UTC]."""

    topic: Topic
    log_ns: int
    publish_ns: int
    data: bytes


def joined(extents: Sequence[Extent]) -> Extent:
    """The extent of all messages."""
    some = [extent for extent in extents if extent.messages]
    first = min((one.start_ns for one in some), default=0)
    return Extent(sum(one.messages for one in some), first, max((one.end_ns for one in some), default=0))


def bag_metadata(
    name: str, extent: Extent, topics: Mapping[Topic, int], distribution: str, notes: Mapping[str, str]
) -> dict[str, Any]:
    """Content of ``metadata.yaml`` of a bag with one MCAP file of this name."""
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
        "relative_file_paths": [name],
        "files": [{"path": name, **_span(extent), "message_count": extent.messages}],
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


def qos_of(qos: Any) -> Qos:
    """A quality of service as rosbags has read it."""
    times = ((one.sec, one.nsec) for one in (qos.deadline, qos.lifespan, qos.liveliness_lease_duration))
    deadline, lifespan, lease = (min(INFINITE_NS, sec * _GIGA + nsec) for sec, nsec in times)
    words = (one.name.lower() for one in (qos.history, qos.reliability, qos.durability, qos.liveliness))
    history, reliability, durability, liveliness = words
    return Qos(history, qos.depth, reliability, durability, deadline, lifespan, liveliness, lease)


@lru_cache(maxsize=256)
def qos_from_yaml(text: str) -> tuple[Qos, ...]:
    """Qualities of service from the text in a bag, empty if it is damaged."""
    from rosbags.rosbag2.errors import ReaderError
    from rosbags.rosbag2.metadata import parse_qos

    try:
        return tuple(map(qos_of, parse_qos(text)))
    except (ReaderError, KeyError, TypeError, ValueError, AttributeError):
        return ()


class Request(NamedTuple):
    """Quality of service that a recorder requests for a topic; ``latched``: messages from before, too."""

    reliable: bool
    latched: bool
    depth: int

    def is_weaker(self, other: Request) -> bool:
        """True if the other requests more than this one."""
        return (other.reliable and not self.reliable) or (other.latched and not self.latched)

    def weakened(self, other: Request) -> Request:
        """The common part of both requests."""
        reliable, latched = self.reliable and other.reliable, self.latched and other.latched
        return Request(reliable, latched, max(self.depth, other.depth))


def request_for(offered: Sequence[Qos]) -> Request:
    """The strongest request that all publishers of a topic, one at least, fulfil; some do not connect to more."""
    return Request(
        all(qos.reliability == "reliable" for qos in offered),
        all(qos.durability == "transient_local" for qos in offered),
        max(_KEEP_AT_LEAST, sum(qos.depth for qos in offered)),
    )


def _duration(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // _GIGA, "nsec": time_ns % _GIGA}


def _span(extent: Extent) -> dict[str, dict[str, int]]:
    """Time span, made anew: YAML would write an anchor for a second occurrence."""
    return {
        "duration": {"nanoseconds": extent.duration_ns},
        "starting_time": {"nanoseconds_since_epoch": extent.start_ns},
    }
