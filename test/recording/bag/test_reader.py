# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of all recorders are read: reader.py, storage.py and messages.py."""

import errno
import json
import os
import random
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from bags import (
    CLOUD,
    COUNTS,
    MODEL,
    NOTES,
    PRESSURE,
    START_NS,
    STORE,
    Sample,
    cloud,
    make_topic,
    text_message,
    write_foreign,
)
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import IndexType
from numpy.lib.recfunctions import append_fields
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore
from rosbags.typesys.stores import Stores
from ruamel.yaml import YAML

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import (
    BagReader,
    BagWriter,
    Qos,
    bag_info,
    count_records,
    find_definition,
    points,
    request_for,
)
from soilmoist_ros.recording.bag.metadata import (
    INFINITE_NS,
    Definition,
    Extent,
    Topic,
    qos_from_yaml,
    search_prefixes,
    to_yaml,
)


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


# What is written (writer.py) -------------------------------------------------------------------------------------


def test_mcap_reads_what_was_written(bag):
    with bag.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found = [(channel.topic, message.log_time, message.data) for _, channel, message in reader.iter_messages()]
        assert found == bag.messages
        assert all(m.publish_time == m.log_time - 1000 for _, _, m in reader.iter_messages())
        summary = reader.get_summary()
        assert {(c.topic, c.message_encoding) for c in summary.channels.values()} == {
            (topic.name, "cdr") for topic in (MODEL, NOTES, PRESSURE)
        }
        assert {s.encoding for s in summary.schemas.values()} == {"ros2msg"}
        for channel in summary.channels.values():
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
            assert YAML(typ="safe").load(channel.metadata["offered_qos_profiles"])[0]["depth"] > 0


def test_rosbags_reads_the_folder(bag):
    with AnyReader([bag.folder]) as reader:
        found = [(c.topic, time_ns, bytes(data)) for c, time_ns, data in reader.messages()]
        assert found == bag.messages
        assert reader.message_count == len(bag.messages)
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert offered["/robot/model"].durability.name == "TRANSIENT_LOCAL"
    assert offered["/pressure"].reliability.name == "BEST_EFFORT"


def test_metadata_say_what_rosbag2_expects(bag):
    text = (bag.folder / "metadata.yaml").read_text()
    content = YAML(typ="safe").load(text)["rosbag2_bagfile_information"]
    assert "&" not in text
    assert (content["version"], content["storage_identifier"]) == (9, "mcap")
    assert content["relative_file_paths"] == [bag.path.name]
    assert content["message_count"] == len(bag.messages)
    assert content["starting_time"]["nanoseconds_since_epoch"] == START_NS
    assert content["duration"]["nanoseconds"] == (len(bag.messages) - 1) * 1_000_000_000
    assert {t["topic_metadata"]["name"]: t["message_count"] for t in content["topics_with_message_count"]} == {
        "/robot/model": 8,
        "/notes": 8,
        "/pressure": 8,
    }
    qos = content["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"][0]
    assert qos["durability"] == "transient_local"
    assert qos["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    with bag.path.open("rb") as file:
        [record] = make_reader(file).iter_metadata()
    assert record.name == "rosbag2"
    assert YAML(typ="safe").load(record.metadata["serialized_metadata"]) == content


def test_a_bag_without_messages_is_a_bag(tmp_path):
    BagWriter(tmp_path / "empty").close()
    with AnyReader([tmp_path / "empty"]) as reader:
        assert reader.message_count == 0


def test_a_full_disk_loses_nothing_once_it_has_space(tmp_path, monkeypatch):
    # Every other write takes only a part, then the disk is full; then it has space again.
    sample = Sample(tmp_path / "run")
    writer = BagWriter(sample.folder)
    real, calls = os.write, []

    def nearly_full(descriptor, data):
        calls.append(len(data))
        if len(calls) % 2:
            return real(descriptor, bytes(data[: 1 + len(data) // 3]))
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("soilmoist_ros.recording.bag.writer.os.write", nearly_full)
    failures = 0
    for number in range(20):
        writer.write(NOTES, START_NS + number, START_NS, text_message(f"{number}" * 50))
        sample.messages.append((NOTES.name, START_NS + number, text_message(f"{number}" * 50)))
        try:
            writer.flush()
        except OSError:
            failures += 1
    monkeypatch.undo()
    assert failures > 5
    writer.close()
    with AnyReader([sample.folder]) as reader:
        assert [(c.topic, t, bytes(d)) for c, t, d in reader.messages()] == sample.messages


# Quality of service and definitions of types (metadata.py) -------------------------------------------------------


QOS = st.builds(
    Qos, st.sampled_from(["keep_last", "keep_all", "system_default", "unknown"]), st.integers(0, 1000),
    st.sampled_from(["reliable", "best_effort", "system_default", "unknown"]),
    st.sampled_from(["volatile", "transient_local", "system_default", "unknown"]), st.integers(0, INFINITE_NS),
    st.integers(0, INFINITE_NS), st.sampled_from(["automatic", "manual_by_topic", "system_default", "unknown"]),
    st.integers(0, INFINITE_NS),
)  # fmt: skip


@pytest.mark.slow
@given(st.lists(QOS, max_size=3))
def test_quality_of_service_comes_back_as_it_was(offered):
    assert qos_from_yaml(to_yaml([qos.to_dict() for qos in offered])) == tuple(offered)


@given(st.lists(QOS, min_size=1, max_size=4))
def test_a_request_is_one_that_every_publisher_can_meet(offered):
    request = request_for(offered)
    assert request.reliable == all(qos.reliability == "reliable" for qos in offered)
    assert request.latched == all(qos.durability == "transient_local" for qos in offered)
    assert request.depth >= max(qos.depth for qos in offered)


LINE = "=" * 80


@pytest.fixture
def prefix(tmp_path):
    def install(name, text, **type_hash):
        package, kind = name.split("/")
        path = tmp_path / "share" / package / "msg" / f"{kind}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        if type_hash:
            hashes = [{"type_name": f"{package}/msg/{kind}", "hash_string": type_hash["type_hash"]}]
            path.with_suffix(".json").write_text(json.dumps({"type_hashes": hashes}))

    install("far_msgs/Point", "float64 x\nfloat64 y")
    install("near_msgs/Part", "far_msgs/Point place # not far_msgs/Missing here\nstring<=10 name")
    install(
        "near_msgs/Whole",
        "# near_msgs/Comment\nint8 A=1\nstring TEXT='far_msgs/No x'\nPart[<=3] parts\nPart[] again\n"
        "bool[2] flags\nfar_msgs/Point[4] corners\nuint8 b 7",
        type_hash="RIHS01_abc",
    )
    install("near_msgs/Broken", "Missing x")
    return tmp_path


def test_types_within_a_type_come_after_it_once(prefix):
    definition = find_definition("near_msgs/msg/Whole", [prefix])
    first, *rest = definition.text.split(f"\n{LINE}\n")
    assert first.startswith("# near_msgs/Comment")
    assert [part.splitlines()[0] for part in rest] == ["MSG: near_msgs/Part", "MSG: far_msgs/Point"]
    assert definition.type_hash == "RIHS01_abc"
    assert definition.encoding == "ros2msg"
    assert "near_msgs/msg/Part" in get_types_from_msg(definition.text, "near_msgs/msg/Whole")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("near_msgs/msg/Nothing", "near_msgs/msg/Nothing is not installed"),
        ("near_msgs/msg/Broken", "near_msgs/msg/Missing is not installed"),
        ("near_msgs/srv/Trigger", "not the name of a message type"),
        ("../msg/x", "not the name of a message type"),
        ("String", "not the name of a message type"),
    ],
)
def test_a_type_that_is_not_there_is_named(prefix, name, message):
    with pytest.raises(InputError, match=message):
        find_definition(name, [prefix])


def test_the_environment_says_where_to_look(prefix, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{prefix}")
    assert search_prefixes()[:2] == [type(prefix)("/nowhere"), prefix]
    assert find_definition("far_msgs/msg/Point").text == "float64 x\nfloat64 y"


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/PointCloud2", "nav_msgs/msg/OccupancyGrid", "diagnostic_msgs/msg/DiagnosticArray",
     "visualization_msgs/msg/MarkerArray", "action_msgs/msg/GoalStatusArray", "rcl_interfaces/msg/ParameterEvent"],
)  # fmt: skip
def test_installed_types_have_the_hash_of_their_definition(name):
    # rosbags computes the hash from the definition; ROS stores it next to the definition.
    pytest.importorskip(name.split("/")[0])
    definition = find_definition(name)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition.text, name))
    assert store.hash_rihs01(name) == definition.type_hash == STORE.hash_rihs01(name)
