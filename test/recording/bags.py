# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags for the tests; messages are made by rosbags, so that no ROS is needed."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.recording.bag.metadata import Definition, Qos, Topic, to_yaml
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


CLOUD = "sensor_msgs/msg/PointCloud2"
COUNTS = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z")]
    + [("raw_counts", "<u4")]
    + [(n, "<f8") for n in ("exposure_s", "effective_exposure_s", "f_pressure", "f_humidity", "f_intensity")]
)
NUMBERS = {"f4": 7, "f8": 8, "u4": 6}


def cloud(table, order="<", padding=0, stamp_ns=1_780_000_000_250_000_000):
    """A PointCloud2 of a structured array, of shape (n,) or (rows, columns)."""
    types = STORE.types
    table = table.astype(table.dtype.newbyteorder(order))
    rows = table.reshape((1, -1)) if table.ndim == 1 else table
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9)), "map")
    fields = [
        types["sensor_msgs/msg/PointField"](n, table.dtype.fields[n][1], NUMBERS[table.dtype[n].str[1:]], 1)
        for n in table.dtype.names
    ]
    data = b"".join(row.tobytes() + b"\xff" * padding for row in rows)
    step = table.dtype.itemsize
    height, width = rows.shape
    return types[CLOUD](
        header, height, width, fields, order == ">", step, step * width + padding, np.frombuffer(data, "u1"), True
    )


def write_foreign(path, messages, times=None, **options):
    """An MCAP file of another recorder, with messages of one topic at times [ns], by default 0, 1, 2, ..."""
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        offered = {"offered_qos_profiles": to_yaml([MODEL.offered[0].to_dict()])}
        channel = writer.register_channel("/notes", "cdr", schema, offered)
        for message, time_ns in zip(messages, times or range(len(messages)), strict=True):
            writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=message)
        writer.finish()
