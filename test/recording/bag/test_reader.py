# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of all recorders are read: reader.py, storage.py and messages.py."""

import random
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from bags import CLOUD, COUNTS, MODEL, NOTES, START_NS, STORE, cloud, make_topic, text_message, write_foreign
from mcap.writer import IndexType
from numpy.lib.recfunctions import append_fields
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import BagReader, BagWriter, bag_info, count_records, points
from soilmoist_ros.recording.bag.metadata import Definition, Extent, Topic


def counts(number=2):
    table = np.zeros(number, COUNTS)
    for index, name in enumerate(COUNTS.names):
        table[name] = np.arange(number) + index + (0.1 if COUNTS[name].kind == "f" else 0)
    table["z"] = np.nan
    return table


@pytest.fixture(params=["mcap", "sqlite3", "mcap compressed", "sqlite3 file", "sqlite3 message"])
def foreign(request, tmp_path):
    storage, _, mode = request.param.partition(" ")
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    writer = Writer(tmp_path / "foreign", version=9, storage_plugin=plugin)
    modes = {
        "compressed": CompressionMode.STORAGE, "file": CompressionMode.FILE, "message": CompressionMode.MESSAGE,
    }  # fmt: skip
    if mode:
        writer.set_compression(modes[mode], CompressionFormat.ZSTD)
    with writer:
        notes = writer.add_connection("/r/notes", "std_msgs/msg/String", typestore=STORE)
        clouds = writer.add_connection("/r/counts", CLOUD, typestore=STORE)
        for number in range(4):
            writer.write(notes, START_NS + number, text_message(f"note {number}"))
            writer.write(clouds, START_NS + number, STORE.serialize_cdr(cloud(counts()), CLOUD))
    return tmp_path / "foreign"


def test_bags_of_others_are_read(foreign):
    with BagReader(foreign) as reader:
        assert reader.topics == {"/r/notes": "std_msgs/msg/String", "/r/counts": CLOUD}
        assert reader.counts == {"/r/notes": 4, "/r/counts": 4}
        assert reader.read_texts("notes") == [f"note {number}" for number in range(4)]
        assert len(reader.read_counts()) == 8
        assert list(reader.messages([])) == []
        assert [message.log_ns for message in reader.messages(["/r/notes"])] == [START_NS + n for n in range(4)]
    info = bag_info(foreign)
    assert info.extent.messages == 8
    assert info.whole


def sqlite(path, times):
    """A file of rosbag2's SQLite storage, in the mode of its preset ``resilient``; returns its open connection."""
    base = sqlite3.connect(path)
    base.execute("PRAGMA journal_mode=wal")
    topics = "id INTEGER, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
    base.execute(f"CREATE TABLE topics({topics})")
    base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    base.execute("INSERT INTO topics VALUES(1, '/notes', 'std_msgs/msg/String', 'cdr', '')")
    rows = [(time, text_message("note")) for time in times]
    base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", rows)
    base.commit()
    return base


def test_a_bag_whose_last_messages_are_in_another_file_is_refused_until_they_are_merged(tmp_path):
    path = tmp_path / "bag.db3"
    base = sqlite(path, [START_NS])
    base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    assert bag_info(path).extent.messages == 1
    base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, 5, x'00')")
    base.commit()
    with pytest.raises(InputError, match=r"bag.db3-wal has messages that it lacks.*sqlite3 COPY.db3"):
        bag_info(path)
    base.close()  # as the command does
    assert bag_info(path).extent.messages == 2


def test_quarantined_records_are_read_with_the_others_and_their_reasons(tmp_path):
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        good = writer.add_connection("/r/counts", CLOUD, typestore=STORE)
        bad = writer.add_connection("/r/quarantined_counts", CLOUD, typestore=STORE)
        points = counts()
        reasons = np.array([4, 77], np.uint32)
        writer.write(good, START_NS, STORE.serialize_cdr(cloud(points), CLOUD))
        with_reasons = append_fields(points, "reason", reasons, usemask=False)
        writer.write(bad, START_NS + 1, STORE.serialize_cdr(cloud(with_reasons), CLOUD))
    with BagReader(tmp_path / "bag") as reader:
        found = reader.read_counts_of(["/r/counts"])
    assert [name for name, _ in found] == ["/r/counts"] * 4
    assert [record.quarantine for _, record in found] == ["", "", "impossible_count", "unknown_reason"]


def test_bags_of_a_folder_are_merged_by_time_whatever_their_storage(foreign, tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        for number in range(4):
            writer.write(NOTES, START_NS + number, START_NS, text_message(f"ours {number}"))
    with BagReader(tmp_path) as reader:
        assert reader.counts == {"/r/notes": 4, "/r/counts": 4, "/notes": 4}
        times = [message.log_ns for message in reader.messages()]
        assert times == sorted(times)
        assert reader.extent == Extent(12, START_NS, START_NS + 3)
        assert reader.read_texts("/notes") == [f"ours {number}" for number in range(4)]
        assert len(reader.read_counts("/r/counts")) == 8


@pytest.mark.parametrize("how", [{"chunk_size": 500}, {"use_chunking": False}, {"index_types": IndexType.NONE}])
def test_messages_out_of_order_are_sorted_with_and_without_an_index(tmp_path, how):
    path, order = tmp_path / "mixed.mcap", random.Random(1)
    times = [order.randrange(1000) for _ in range(300)]
    write_foreign(path, [text_message(str(number)) for number in range(300)], times, **how)
    with BagReader(path) as reader:
        found = [(message.log_ns, int(reader.decode(message).data)) for message in reader.messages()]
        assert reader.offered == {"/notes": MODEL.offered}
    assert found == sorted(zip(times, range(300), strict=True))


def test_a_definition_that_is_not_that_of_its_type_is_refused(tmp_path):
    topic = Topic("/counts", Definition(CLOUD, "string data"))
    with BagWriter(tmp_path / "bag") as writer:
        writer.write(topic, START_NS, START_NS, text_message("no cloud"))
    with BagReader(tmp_path / "bag") as reader, pytest.raises(InputError, match="is not that of ROS 2"):
        reader.read_counts()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("padding", [0, 5])
def test_counted_records_keep_every_digit(order, padding):
    table = counts(6)
    found = count_records(cloud(table.reshape(2, 3), order, padding))
    assert [record.raw_counts for record in found] == table["raw_counts"].tolist()
    assert [record.effective_exposure_s for record in found] == table["effective_exposure_s"].tolist()
    assert [record.x_m for record in found] == [float(x) for x in table["x"]]
    assert {record.stamp_s for record in found} == {1_780_000_000.25}
    assert all(np.isnan(record.z_m) for record in found)


def test_points_keep_their_shape_and_need_all_their_data():
    message = cloud(counts(6).reshape(2, 3))
    assert points(message).shape == (2, 3)
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match="end early"):
        points(message)
    assert points(cloud(counts(0))).size == 0


def test_other_clouds_are_no_counts(tmp_path):
    topic = make_topic("/counts", CLOUD)
    with BagWriter(tmp_path / "bag") as writer:
        data = bytes(STORE.serialize_cdr(cloud(counts()[["x", "y"]].copy()), CLOUD))
        writer.write(topic, START_NS, START_NS, data)
    with BagReader(tmp_path / "bag") as reader, pytest.raises(InputError, match="have no field z, raw_counts"):
        reader.read_counts()


def test_a_name_in_several_namespaces_must_be_given_in_full(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for name in ("/a/model", "/b/model"):
            writer.write(make_topic(name, "std_msgs/msg/String"), START_NS, START_NS, text_message(name))
    with BagReader(tmp_path / "bag") as reader:
        with pytest.raises(InputError, match="name one of: /a/model, /b/model"):
            reader.read_texts("model")
        assert reader.read_texts("/b/model") == ["/b/model"]


@pytest.mark.parametrize("path", ["none", "empty", "text.txt", "text.mcap", "bad"])
def test_what_is_no_bag_is_reported(tmp_path, path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("text")
    (tmp_path / "text.mcap").write_text("text")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    with pytest.raises(InputError) as caught:
        BagReader(Path(tmp_path / path))
    assert caught.value.mistakes[0].remedy
