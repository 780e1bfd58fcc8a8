# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Read bags of any recorder: MCAP, SQLite or ROS 1, split or compressed."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from heapq import merge
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.bag.messages import CLOUD, VISIT, count_records, quarantined_topic, visit_of
from soilmoist_ros.recording.bag.metadata import BagMessage, Qos, joined
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.bag.storage import (
    counts_of,
    extent_of,
    listed_files,
    messages_of,
    offered_of,
    open_file,
    remedy_of,
    scanned_messages,
    topic_name,
    unreadable,
)
from soilmoist_ros.recording.run_folder import BAG_FILES
from soilmoist_ros.sensing import CountRecord

if TYPE_CHECKING:
    from soilmoist_ros.recording.bag.storage import BagFileReader

_HEADER: Final = "std_msgs/msg/Header"
_SENTENCE: Final = "std_msgs/Header header\nstring sentence"
GIVE: Final = "give the folder of a bag, or an MCAP, db3 or ROS 1 .bag file"


class BagReader:
    """Reader of a bag; use as a context manager.

    :param path: folder of a bag, or an MCAP, db3 or ROS 1 bag file; or a folder of bags, whose messages are merged
        by time
    :raises InputError: if the path is not a bag, or the bag was not closed or cannot be read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._bags: list[list[BagFileReader]] = []
        with ExitStack() as stack:  # closes the files of a bag that cannot be read
            try:
                for bag in bags_of(path):
                    files = listed_files(bag) if bag.is_dir() else [bag]
                    self._bags.append([open_file(file, stack) for file in files])
                readers = [reader for bag in self._bags for reader in bag]
                self.extent = joined(list(map(extent_of, readers)))
                """All messages."""
            except Exception as error:  # a stranger's file: rosbags does not check everything
                raise _damaged(path, error) from None
            self._stack = stack.pop_all()
        from rosbags import rosbag1

        self.of_ros1 = any(isinstance(one, rosbag1.Reader) or getattr(one, "of_ros1", False) for one in readers)
        """True if the messages have the format of ROS 1, not CDR."""
        self.topics: dict[str, str] = {}
        """Names of topics, and their types."""
        self.offered: dict[str, tuple[Qos, ...]] = {}
        """Quality of service that the publishers of each topic offered, if the bag has it."""
        self.counts: Counter[str] = Counter()
        """Number of messages of each topic."""
        self._definitions: dict[str, MessageDefinition] = {}
        for reader in readers:
            self.counts.update(counts_of(reader))
            for one in reader.connections:
                name = topic_name(one.topic)
                self.topics[name], had = one.msgtype, self.offered.get(name, ())
                self.offered[name] = had + tuple(qos for qos in offered_of(reader, one) if qos not in had)
                if one.msgdef.data:
                    self._definitions[one.msgtype] = one.msgdef
        self.definition_texts = {kind: definition.data for kind, definition in self._definitions.items()}
        """Definitions of types, with those of the types in them, if the bag has them."""
        self._types = get_typestore(Stores.EMPTY if self._definitions else Stores.ROS2_JAZZY)
        if not self._definitions:  # SQLite before ROS 2 Iron has none
            self._types.register(get_types_from_msg(_SENTENCE, "nmea_msgs/msg/Sentence"))

    def messages(self, topics: Sequence[str] | None = None, by_time: bool = True) -> Iterator[BagMessage]:
        """Messages of topics by their full names, or all, in the order of the times at which they were received.

        Without ``by_time`` those of MCAP come as they were written: another order if the clock was set back.

        :raises InputError: if the bag is damaged
        """

        def of_bag(readers: list[BagFileReader]) -> Iterator[BagMessage]:
            for reader in readers:
                path = Path(str(reader.path))
                scan = not by_time and path.suffix == ".mcap"
                yield from scanned_messages(McapScan(path), topics) if scan else messages_of(reader, topics)

        try:
            yield from merge(*map(of_bag, self._bags), key=attrgetter("log_ns"))
        except Exception as error:  # a stranger's file: rosbags does not check everything
            raise _damaged(self.path, error) from None

    def decode(self, message: BagMessage) -> Any:
        """The message as an object with the fields of its type and numpy arrays; ``InputError`` if damaged."""
        try:
            self._learn(message.type_name)
            if message.type_name not in self._types.fielddefs:
                remedy = "convert it to MCAP by 'ros2 bag convert' where ROS has this type"
                raise InputError(f"has no definition of {message.type_name}", remedy, self.path)
            decoded = self._types.deserialize_ros1 if self.of_ros1 else self._types.deserialize_cdr
            return decoded(message.data, message.type_name)
        except Exception as error:  # a stranger's definition and data: rosbags does not check everything
            raise unreadable(self.path, error) from None

    def _learn(self, type_name: str) -> None:
        definition = self._definitions.pop(type_name, None)
        if definition is not None:
            new, known = _types_in(definition, type_name), get_typestore(Stores.ROS2_JAZZY).fielddefs
            for name in (new.keys() & known.keys()) - {_HEADER}:  # ROS 2 has dropped a number of the header
                if str(new[name][1]) != str(known[name][1]):  # who reads a message relies on its fields
                    raise ValueError(f"its definition of {name} is not that of ROS 2")
            self._types.register({name: new[name] for name in new if name not in self._types.fielddefs})

    def find_topic(self, name: str, type_name: str) -> str:
        """Full name of a topic of this type, from its full name or one without namespace, the outermost.

        :raises InputError: if there is none, or more than one; lists the topics of the bag
        """
        named = [t for t in self.topics if t == name or t.rsplit("/", 1)[-1] == name]
        found = [t for t in named if self.topics[t] == type_name]
        if len(found) == 1:
            return found[0]
        outermost = min(found, key=len, default="")
        if found and all(topic.startswith(outermost.removesuffix(name)) for topic in found):
            return outermost
        if found:
            raise InputError(f"has several topics {name!r}", f"name one of: {', '.join(sorted(found))}", self.path)
        there = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(self.topics.items()))
        raise InputError(f"has no topic {name!r} of type {type_name}", f"there are: {there or 'none'}", self.path)

    def read_counts(self, topic: str = "counts") -> list[CountRecord]:
        """Counted records of a topic in the order of recording, as the nodes had them, quarantined ones too."""
        name = self.find_topic(topic, CLOUD)
        return [record for _, record in self.read_counts_of([name])]

    def read_counts_of(self, topics: Sequence[str], frame: str = "") -> list[tuple[str, CountRecord]]:
        """Counted records of several topics in the order of recording, each with the name of its topic.

        Quarantined records are those of the topic ``quarantined_counts`` next to each.

        :param frame: frame of the records; messages of others are left out; empty for any frame
        :raises InputError: if the messages of a topic are not counts
        """
        found: list[tuple[str, CountRecord]] = []
        quarantined = {quarantined_topic(topic): topic for topic in topics}
        for message in self.messages([*topics, *quarantined]):
            name = quarantined.get(message.topic, message.topic)
            try:
                cloud = self.decode(message)
                if frame in ("", cloud.header.frame_id.lstrip("/")):
                    found += [(name, record) for record in count_records(cloud)]
            except ValueError as error:
                remedy = "was it recorded by soilmoist_ros?"
                raise InputError(f"{message.topic}: {error}", remedy, self.path) from None
        return found

    def read_visits(self, topic: str = "visits", robot: int = 1) -> list[Visit]:
        """Visits in the order of recording, exactly as the planner of a robot (from 1) had them."""
        name = self.find_topic(topic, VISIT)
        try:
            return [visit_of(self.decode(m), robot) for m in self.messages([name], by_time=False)]
        except ValueError as error:
            raise InputError(f"{name}: {error}", "was it recorded by soilmoist_ros?", self.path) from None

    def read_texts(self, topic: str) -> list[str]:
        """Texts of a ``std_msgs/msg/String`` topic, such as the JSON of ``model``, in the order of recording."""
        name = self.find_topic(topic, "std_msgs/msg/String")
        return [str(self.decode(message).data) for message in self.messages([name])]

    def close(self) -> None:
        """Close the bag."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def bags_of(path: Path) -> list[Path]:
    """The bags that a path names: itself, or those in it by name.

    :raises InputError: if there are none
    """
    if not path.exists():
        raise InputError("there is no such bag", GIVE, path)
    if path.name.endswith(".bag.active") or any(path.glob("*.bag.active")):
        raise InputError("was not closed: its recorder was killed", remedy_of(path), path)
    if path.is_file() and path.suffix not in BAG_FILES:
        raise InputError("is not a bag", GIVE, path)
    if path.is_file() or (path / "metadata.yaml").is_file():
        return [path]
    if any(path.glob("*.mcap")):
        raise InputError("was not closed: its recorder was killed", "soilmoist bag recover", path)
    if found := sorted(path.glob("*.bag")):
        return found
    found = sorted(one.parent for one in path.glob("*/metadata.yaml"))
    if unclosed := sorted({one.parent for one in path.glob("*/*.mcap")} - set(found)):
        raise InputError("was not closed: its recorder was killed", "soilmoist bag recover", unclosed[0])
    if not found:
        raise InputError("is not a bag: it has no metadata.yaml", "give the folder with metadata.yaml", path)
    return found


def _types_in(definition: MessageDefinition, type_name: str) -> dict[str, Any]:
    """The types of a definition, by name."""
    text = definition.data
    if definition.format is not MessageDefinitionFormat.IDL:
        return dict(get_types_from_msg(text, type_name))
    line = "=" * 80 + "\n"
    parts = text.split(line)[1:] if text.startswith(f"{line}IDL: ") else []
    texts = [part.partition("\n")[2] for part in parts] or [text]
    return {name: fields for text in texts for name, fields in get_types_from_idl(text).items()}


def _damaged(path: Path, error: Exception) -> InputError:
    """An error of a file; rosbags names a checksum or the magic, the scan of MCAP says what that means."""
    found: list[str] = []
    if not isinstance(error, InputError | OSError):
        for file in [path] if path.is_file() else sorted(path.glob("*.mcap")):
            if file.suffix == ".mcap":
                scan = McapScan(file)
                with suppress(OSError):
                    deque(scan.messages(), 0)
                found += scan.findings()
    return unreadable(path, ValueError("; ".join(found)) if found else error)
