# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags for the tests; messages are made by rosbags, so that no ROS is needed."""

from dataclasses import dataclass, field
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.recording.bag.metadata import Definition, Qos, Topic
from soilmoist_ros.recording.bag.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_780_000_000_000_000_000


@dataclass
class Sample:
    """A bag and its messages."""

    folder: Path
    messages: list[tuple[str, int, bytes]] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)

    @property
    def path(self) -> Path:
        return self.folder / f"{self.folder.name}_0.mcap"


def make_topic(name: str, type_name: str, *offered: Qos) -> Topic:
    text, _ = STORE.generate_msgdef(type_name, ros_version=2)
    return Topic(name, Definition(type_name, text, type_hash=STORE.hash_rihs01(type_name)), offered or (Qos(),))


def text_message(text: str) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types["std_msgs/msg/String"](text), "std_msgs/msg/String"))


MODEL = make_topic("/robot/model", "std_msgs/msg/String", Qos(durability="transient_local", depth=1))
NOTES = make_topic("/notes", "std_msgs/msg/String")
PRESSURE = make_topic("/pressure", "std_msgs/msg/Float64", Qos(reliability="best_effort"))


def number_message(value: float) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types["std_msgs/msg/Float64"](value), "std_msgs/msg/Float64"))


def fill(writer: BagWriter, sample: Sample, count: int = 24, per_flush: int = 3) -> None:
    """Write messages of three topics, a flush after every few."""
    for number in range(count):
        topic, data = [
            (MODEL, text_message(f"model {number} " + "ä" * (number % 5))),
            (NOTES, text_message(f"{number} " * (number % 7))),
            (PRESSURE, number_message(0.1 * number)),
        ][number % 3]
        time_ns = START_NS + number * 1_000_000_000
        writer.write(topic, time_ns, time_ns - 1000, data)
        sample.messages.append((topic.name, time_ns, data))
        if number % per_flush == per_flush - 1:
            writer.flush()
            sample.sizes.append(writer.size_bytes)
