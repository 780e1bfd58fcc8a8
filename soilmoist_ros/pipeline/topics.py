# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Groups the topics of a bag by robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording import BagReader
from soilmoist_ros.sensing import FIX_TYPE

CLOUD: Final = "sensor_msgs/msg/PointCloud2"
TEXT: Final = "std_msgs/msg/String"
FIX: Final = FIX_TYPE
SENTENCE: Final = "nmea_msgs/msg/Sentence"
GPS_FIX: Final = ("gps_msgs/msg/GPSFix", "gps_common/msg/GPSFix")
STATUS: Final = "diagnostic_msgs/msg/DiagnosticStatus"


@dataclass(frozen=True)
class RunTopics:
    """The topics of one robot.

    :param reader: the bag
    :param counts: full name of the topic with the robot's records
    :param alone: whether the bag has no other robot
    """

    reader: BagReader
    counts: str
    alone: bool

    @classmethod
    def of_counts(cls, reader: BagReader, counts: str) -> Self:
        """The topics of the robot whose records have this full name."""
        last = counts.rsplit("/", 1)[-1]
        others = [
            name
            for name, kind in reader.topics.items()
            if name != counts and name.endswith(f"/{last}") and kind == CLOUD
        ]
        return cls(reader, counts, not others)

    @classmethod
    def of_raw_lines(cls, reader: BagReader, counts: str) -> Self:
        """The topics of the robot whose raw lines are in the bag; its records may be missing.

        :param counts: topic with the robot's records, if any; its namespace selects the robot
        :raises InputError: if there are no raw lines, or raw lines of several robots without a selection
        """
        named = counts if counts.startswith("/") else f"/{counts}"
        ending = "/raw/logger"
        spaces = [
            name.removesuffix(ending)
            for name, kind in reader.topics.items()
            if name.endswith(ending) and kind == TEXT
        ]
        meant = [space for space in spaces if space == named.rpartition("/")[0]] if counts[:1] == "/" else spaces
        if len(meant) == 1:
            return cls(reader, f"{meant[0]}/{named.rpartition('/')[2]}", len(spaces) == 1)
        if meant:
            names = ", ".join(f"{space}/{named[1:]}" for space in sorted(meant))
            raise InputError("has the raw lines of several robots", f"name one of: {names}", reader.path)
        raise InputError(
            f"has no raw lines of a logger (topic raw/logger of type {TEXT})",
            "map its counts instead, or record raw/logger and raw/gnss",
            reader.path,
        )

    @classmethod
    def of_team(cls, reader: BagReader, counts: str, namespaces: Sequence[str]) -> list[Self]:
        """The topics of several robots that share a mapper in the outermost namespace.

        :param reader: the bag
        :param counts: topic with the records of each robot, without its namespace
        :param namespaces: namespaces of the robots
        :returns: a robot each; empty if the bag is not of such a team
        """
        names = [f"/{namespace.strip('/')}/{counts}" for namespace in namespaces]
        found = [name for name in names if reader.topics.get(name) == CLOUD]
        shared = reader.topics.get("/soil_map") == CLOUD and f"/{counts}" not in reader.topics
        return [cls(reader, name, False) for name in found] if len(found) > 1 and shared else []

    @property
    def namespace(self) -> str:
        """Namespace of the robot with a slash at its end, for the names of its nodes; empty for none."""
        return f"{self.counts.rpartition('/')[0].strip('/')}/".lstrip("/")

    def find(self, name: str, kind: str) -> str | None:
        """Full name of a topic of this robot, ``None`` if it is not in the bag.

        :param name: name without its namespace
        :param kind: its type
        """
        topics = self.reader.topics
        own = f"{self.counts.rpartition('/')[0]}/{name}"
        if topics.get(own) == kind:
            return own
        named = [topic for topic, type_name in topics.items() if topic.endswith(f"/{name}") and type_name == kind]
        return named[0] if self.alone and len(named) == 1 else None
