"""Read bags of any recorder: MCAP or SQLite, split or compressed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.dataclass import dataclass
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.metadata import INFINITE_NS, Extent, Qos
from soilmoist_ros.recording.bag.point_cloud import count_records, quarantined_topic
from soilmoist_ros.recording.bag.visit import visit_of
from soilmoist_ros.sensing.records import CountRecord

VISIT = "soilmoist_msgs/msg/Visit"
"""Type of the topic ``visits``."""


@dataclass(frozen=True, slots=True)
class BagMessage:
    """A message of a bag.

    :param topic: full name of its topic
    :param type_name: name of its type, as in ``std_msgs/msg/String``
    :param log_ns: time at which it was received [ns since 1970-01-01 UTC]
    :param data: the message in CDR
    """

    topic: str
    type_name: str
    log_ns: int
    data: bytes


class BagReader:
    """Reader of a bag; use as a context manager.

    :param path: folder of a bag, or an MCAP or db3 file
    :raises InputError: if the path is not a bag, or the bag was not closed or cannot be read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reader = _open(path)

    @property
    def topics(self) -> Mapping[str, str]:
        """Names of topics, and their types."""
        return {connection.topic: connection.msgtype for connection in self._reader.connections}

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of messages of each topic."""
        return {name: info.msgcount for name, info in self._reader.topics.items()}

    @property
    def extent(self) -> Extent:
        """All messages."""
        if not self._reader.message_count:
            return Extent()
        return Extent(self._reader.message_count, self._reader.start_time, self._reader.end_time - 1)

    @property
    def offered(self) -> Mapping[str, tuple[Qos, ...]]:
        """Quality of service that the publishers of each topic offered, if the bag has it."""
        found: dict[str, tuple[Qos, ...]] = {}
        for connection in self._reader.connections:
            profiles = getattr(connection.ext, "offered_qos_profiles", ())
            found[connection.topic] = found.get(connection.topic, ()) + tuple(map(_qos, profiles))
        return found

    def messages(self, topics: Sequence[str] | None = None) -> Iterator[BagMessage]:
        """Messages in the order in which they were received.

        :param topics: full names; all topics if ``None``
        :raises InputError: if the bag is damaged
        """
        wanted = [c for c in self._reader.connections if topics is None or c.topic in topics]
        if not wanted:
            return
        try:
            for connection, log_ns, data in self._reader.messages(wanted):
                yield BagMessage(connection.topic, connection.msgtype, log_ns, bytes(data))
        except _FAULTS as error:
            raise _damaged(self.path, error) from None

    def decode(self, message: BagMessage) -> Any:
        """The message as an object with the fields of its type; arrays are numpy arrays.

        :raises InputError: if its data do not match its type
        """
        try:
            return self._reader.deserialize(message.data, message.type_name)
        except _FAULTS as error:
            raise _damaged(self.path, error) from None

    def find_topic(self, name: str, type_name: str) -> str:
        """Full name of a topic, in the outermost namespace that has it.

        :param name: full name, or one without namespace
        :param type_name: expected type
        :raises InputError: if there is no such topic, or more than one; lists the topics of the bag
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
        """Counted records in the order of recording, exactly as the nodes had them, with the quarantined ones.

        :param topic: full name, or one without namespace
        :raises InputError: if there is no such topic, or its messages are not counts
        """
        name = self.find_topic(topic, "sensor_msgs/msg/PointCloud2")
        return [record for _, record in self.read_counts_of([name])]

    def read_counts_of(self, topics: Sequence[str], frame: str = "") -> list[tuple[str, CountRecord]]:
        """Counted records of several topics in the order of recording, each with the name of its topic.

        Quarantined records are those of the topic ``quarantined_counts`` next to each.

        :param topics: full names
        :param frame: frame of the records; messages of others are left out; empty for any frame
        :raises InputError: if the messages of a topic are not counts
        """
        found = []
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
        """Visits in the order of recording, exactly as the planner had them.

        :param topic: full name, or one without namespace
        :param robot: number of the robot, from 1
        :raises InputError: if there is no such topic, or its messages are not visits
        """
        name = self.find_topic(topic, VISIT)
        try:
            return [visit_of(self.decode(m), robot) for m in self.messages([name])]
        except ValueError as error:
            raise InputError(f"{name}: {error}", "was it recorded by soilmoist_ros?", self.path) from None

    def read_texts(self, topic: str) -> list[str]:
        """Texts of a ``std_msgs/msg/String`` topic, such as the JSON of ``model``, in the order of recording.

        :param topic: full name, or one without namespace
        :raises InputError: if there is no such topic
        """
        name = self.find_topic(topic, "std_msgs/msg/String")
        return [str(self.decode(message).data) for message in self.messages([name])]

    def close(self) -> None:
        """Close the bag."""
        self._reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


_FAULTS = (AnyReaderError, OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, RuntimeError)
"""Errors while reading a damaged bag: rosbags does not check everything."""


def _qos(profile: Any) -> Qos:
    def nanoseconds(duration: Any) -> int:
        return min(INFINITE_NS, int(duration.sec) * 1_000_000_000 + int(duration.nsec))

    return Qos(
        profile.history.name.lower(),
        profile.depth,
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        nanoseconds(profile.deadline),
        nanoseconds(profile.lifespan),
        profile.liveliness.name.lower(),
        nanoseconds(profile.liveliness_lease_duration),
    )


def _open(path: Path) -> AnyReader:
    if not path.exists():
        raise InputError("there is no such bag", "give the folder of a bag, or an MCAP or db3 file", path)
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        if any(path.glob("*.mcap")):
            raise InputError("was not closed: its recorder was killed", "soilmoist bag recover", path)
        raise InputError("is not a bag: it has no metadata.yaml", "give the folder with metadata.yaml", path)
    if path.is_file() and path.suffix not in (".mcap", ".db3"):
        raise InputError("is not a bag", "give the folder of a bag, or an MCAP or db3 file", path)
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
        reader.open()
    except _FAULTS as error:
        raise _damaged(path, error) from None
    return reader


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(f"cannot be read as a bag: {error}", "try soilmoist bag recover", path)
