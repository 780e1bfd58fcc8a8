# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
TEXT = "std_msgs/msg/String"


def copy_bag(source, target, keep=lambda name, number: True, names=lambda topic: [topic], texts=(), mcap=False):
    """Copy a bag message by message with another writer.

    :param keep: which messages, by their new topic and the number within the old one
    :param names: new topics of a topic; none leaves it out
    :param texts: further messages at the end, each the name of its topic and its text
    :param mcap: as MCAP, otherwise as SQLite
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    storage = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with AnyReader([source]) as reader, Writer(target, version=9, storage_plugin=storage) as writer:
        store = reader.typestore
        topics = {
            c.id: {name: writer.add_connection(name, c.msgtype, typestore=store) for name in names(c.topic)}
            for c in reader.connections
        }
        seen = dict.fromkeys(topics, 0)
        for connection, stamp_ns, data in reader.messages():
            for name, topic in topics[connection.id].items():
                if keep(name, seen[connection.id]):
                    writer.write(topic, stamp_ns, data)
            seen[connection.id] += 1
        further = {name: writer.add_connection(name, TEXT, typestore=STORE) for name in dict(texts)}
        for name, text in texts:
            writer.write(further[name], stamp_ns, STORE.serialize_cdr(STORE.types[TEXT](text), TEXT))
    return target
