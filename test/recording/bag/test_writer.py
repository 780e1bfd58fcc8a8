# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import errno
import os
from pathlib import Path

from bags import MODEL, NOTES, PRESSURE, START_NS, Sample, text_message
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from ruamel.yaml import YAML

from soilmoist_ros.recording import BagWriter

HERE = str(Path(__file__).parents[1])


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
