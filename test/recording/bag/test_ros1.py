# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 1, written by rosbags; whole and damaged."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import BagReader, bag_info
from soilmoist_ros.recording.bag.playback import Playback

STORE = get_typestore(Stores.ROS1_NOETIC)
TEXT, FIX, CAMERA = "std_msgs/msg/String", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/CameraInfo"
COMPRESSIONS = [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]


def text(words):
    return STORE.serialize_ros1(STORE.types[TEXT](data=words), TEXT)


def fix(seq, latitude):
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=12, nanosec=500_000_000)
    header = types["std_msgs/msg/Header"](seq=seq, stamp=stamp, frame_id="gps")
    status = types["sensor_msgs/msg/NavSatStatus"](status=2, service=1)
    return STORE.serialize_ros1(types[FIX](header, status, latitude, -0.5, 7.0, np.arange(9.0), 2), FIX)


def write(path, messages, compression=None, chunk_bytes=1 << 20):
    """A bag of messages (topic, type, time in s, data)."""
    writer = Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = chunk_bytes
    with writer:
        kinds = {topic: kind for topic, kind, _, _ in messages}
        made = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in kinds.items()}
        for topic, _, time_s, data in messages:
            writer.write(made[topic], int(time_s * 1e9), data)
    return path


@pytest.mark.parametrize("compression", COMPRESSIONS, ids=["none", "bz2", "lz4"])
def test_messages_are_those_of_ros_2_in_the_order_of_time(tmp_path, compression):
    messages = [("/a", TEXT, 10 + number % 7, text(f"{number}")) for number in range(40)]
    messages += [("/gps/fix", FIX, 12.5, fix(99, 53.25))]
    path = write(tmp_path / "run.bag", messages, compression, chunk_bytes=100)
    with BagReader(path) as bag:
        assert bag.topics == {"/a": TEXT, "/gps/fix": FIX}
        assert bag.counts == {"/a": 40, "/gps/fix": 1}
        assert (bag.extent.messages, bag.extent.start_ns, bag.extent.end_ns) == (41, 10 * 10**9, 16 * 10**9)
        found = list(bag.messages())
        times = [message.log_ns for message in found]
        assert times == sorted(times)
        assert {bag.decode(one).data for one in found if one.topic == "/a"} == {f"{n}" for n in range(40)}
        (position,) = (bag.decode(one) for one in bag.messages(["/gps/fix"]))
        assert (position.latitude, position.longitude, position.header.frame_id) == (53.25, -0.5, "gps")
        assert (position.header.stamp.sec, position.header.stamp.nanosec) == (12, 500_000_000)
        assert position.position_covariance.tolist() == list(range(9))


@pytest.mark.parametrize("fault", ["not closed", "cut off"])
def test_a_bag_without_its_index_is_refused_with_what_to_do(tmp_path, fault):
    path = write(tmp_path / "run.bag", [("/a", TEXT, 1, text("x" * 1000))])
    data = path.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(data[:at] + bytes(8) + data[at + 8 :] if fault == "not closed" else data[:4600])
    with pytest.raises(InputError, match="rosbag reindex"):
        BagReader(path)


def test_a_type_that_differs_in_ros_2_is_refused_and_others_are_read(tmp_path):
    other = get_typestore(Stores.EMPTY)
    other.register(get_types_from_msg("float64 wetness", "own_msgs/msg/Soil"))
    with Writer(tmp_path / "run.bag") as writer:
        text_topic = writer.add_connection("/a", TEXT, typestore=STORE)
        own = writer.add_connection("/own", "own_msgs/msg/Soil", typestore=other)
        camera = writer.add_connection("/camera/info", CAMERA, typestore=STORE)
        writer.write(text_topic, 1, text("x"))
        writer.write(own, 2, struct.pack("<d", 0.3))
        writer.write(camera, 3, b"never read")
    about = {one.name: (one.type_name, one.extent.messages) for one in bag_info(tmp_path / "run.bag").topics}
    assert about == {"/a": (TEXT, 1), "/own": ("own_msgs/msg/Soil", 1), "/camera/info": (CAMERA, 1)}
    with BagReader(tmp_path / "run.bag") as bag:
        assert bag.read_texts("/a") == ["x"]
        assert [bag.decode(message).wetness for message in bag.messages(["/own"])] == [0.3]
        (message,) = bag.messages(["/camera/info"])
        with pytest.raises(InputError, match="its definition of sensor_msgs/msg/CameraInfo is not that of ROS 2"):
            bag.decode(message)
        with pytest.raises(InputError, match="is a bag of ROS 1 -> convert it by rosbags-convert"):
            Playback(bag, ".*")
