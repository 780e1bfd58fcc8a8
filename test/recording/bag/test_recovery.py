# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recovery of bags that are cut or damaged at any place: recovery.py and scan.py."""

import errno
import os
import random
import struct

import pytest
from bags import NOTES, PRESSURE, START_NS, Sample, number_message, text_message
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.info import bag_info
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.bag.verify import findings, recover_bag
from soilmoist_ros.recording.bag.writer import BagWriter

SAME_FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)


def scanned(path):
    scan = McapScan(path)
    return [(m.topic.name, m.log_ns, m.data) for m in scan.messages()], scan


def chunk_ends(path):
    """End of each chunk, and messages up to there, as the index of the whole file has it."""
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    ends = sorted(chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks)
    return [(end, 3 * number) for number, end in enumerate(ends, 1)]


def read_by_rosbags(folder):
    with AnyReader([folder]) as reader:
        return [(c.topic, time_ns, bytes(data)) for c, time_ns, data in reader.messages()]


def test_an_unclosed_bag_becomes_a_valid_one(unclosed, tmp_path):
    before = unclosed.path.read_bytes()
    bag = recover_bag(unclosed.folder, tmp_path / "recovered")
    assert read_by_rosbags(bag.folder) == unclosed.messages
    assert bag.counts == {"/robot/model": 8, "/notes": 8, "/pressure": 8}
    assert bag.problems == ("unclosed_0.mcap was not closed", "metadata.yaml is missing")
    assert unclosed.path.read_bytes() == before
    with AnyReader([bag.folder]) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
    assert offered["/robot/model"] == "TRANSIENT_LOCAL"


@pytest.mark.slow
def test_a_cut_at_any_byte_costs_only_the_chunk_it_hits(bag, tmp_path):
    whole = bag.path.read_bytes()
    ends = chunk_ends(bag.path)
    path = tmp_path / "cut_0.mcap"
    for cut in range(0, len(whole), 17):
        path.write_bytes(whole[:cut])
        found, scan = scanned(path)
        assert found == bag.messages[: max([count for end, count in ends if end <= cut], default=0)]
        assert not scan.finished
    path.write_bytes(whole)
    found, scan = scanned(path)
    assert scan.finished
    assert not scan.damaged


@pytest.mark.slow
def test_a_bag_cut_at_every_chunk_and_around_is_recovered(bag, tmp_path):
    whole = bag.path.read_bytes()
    for end, count in chunk_ends(bag.path):
        for cut, expected in ((end - 1, count - 3), (end, count), (end + 1, count)):
            folder = tmp_path / f"cut_{cut}"
            folder.mkdir()
            (folder / f"cut_{cut}_0.mcap").write_bytes(whole[:cut])
            if expected:
                recovered = recover_bag(folder, tmp_path / f"recovered_{cut}")
                assert read_by_rosbags(recovered.folder) == bag.messages[:expected]
            else:
                with pytest.raises(InputError, match="no complete message"):
                    recover_bag(folder, tmp_path / f"recovered_{cut}")
                assert not (tmp_path / f"recovered_{cut}").exists()


@pytest.mark.parametrize("opcode", [*range(17), 127, 128, 255])  # all that MCAP has, and some that it has not
def test_a_first_record_that_looks_like_another_one_costs_nothing(bag, tmp_path, opcode):
    whole = bytearray(bag.path.read_bytes())
    whole[8] = opcode  # 2 would be the footer, behind which nothing comes
    path = tmp_path / "damaged_0.mcap"
    path.write_bytes(whole)
    assert scanned(path)[0] == bag.messages


@pytest.mark.slow
@SAME_FOLDER
@given(data=st.data())
def test_a_damaged_byte_costs_at_most_its_chunk_and_gives_no_wrong_message(bag, tmp_path, data):
    whole = bytearray(bag.path.read_bytes())
    place = data.draw(st.integers(0, len(whole) - 1))
    whole[place] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "damaged_0.mcap"
    path.write_bytes(whole)
    found, _ = scanned(path)
    assert set(found) <= set(bag.messages)
    assert len(found) >= len(bag.messages) - 3


def heads(data):
    """Places of the bytes outside of chunks that say what follows, and of those in the heads of chunks."""
    at = 8
    while at + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        end = at + 9 + length
        yield from range(at, min(end, at + 60) if opcode == 6 else end)
        at = end


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_a_flipped_bit_outside_of_chunks_invents_nothing_and_costs_one_chunk(tmp_path, closed):
    # Unlike in small bags, a wrong length leads to a place within the file, and numbers of channels to channels.
    sample, random_ = Sample(tmp_path / "large"), random.Random(1)
    writer = BagWriter(sample.folder)
    for number in range(240):
        note = text_message(random_.randbytes(200).hex())
        topic, data = [(NOTES, note), (PRESSURE, number_message(number))][number % 2]
        writer.write(topic, START_NS + number, START_NS, data)
        sample.messages.append((topic.name, START_NS + number, data))
        if number % 3 == 2:
            writer.flush()
    if closed:
        writer.close()
    else:
        writer.abandon()
    whole = sample.path.read_bytes()
    path = tmp_path / "damaged_0.mcap"
    places = list(heads(whole))
    for _ in range(600):
        damaged = bytearray(whole)
        place = random_.choice(places)
        damaged[place] ^= 1 << random_.randrange(8)
        path.write_bytes(damaged)
        found, scan = scanned(path)
        assert set(found) <= set(sample.messages), place
        assert len(found) >= len(sample.messages) - 3, place
        if found != sample.messages:
            assert findings(scan), place


@pytest.fixture
def long_bag(tmp_path):
    """A bag of 150 kB."""
    sample, random_ = Sample(tmp_path / "long"), random.Random(1)
    with BagWriter(sample.folder) as writer:
        for number in range(120):
            data = text_message(random_.randbytes(1000).hex())
            writer.write(NOTES, START_NS + number, START_NS, data)
            sample.messages.append((NOTES.name, START_NS + number, data))
            writer.flush()
    return sample


def unreadable(monkeypatch, first, last):
    """A disk with a bad part: what lies before it in a request is read, and the next request fails."""
    real = os.pread

    def pread(number, size, at):
        if first <= at < last:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return real(number, min(size, first - at) if at < first else size, at)

    monkeypatch.setattr(os, "pread", pread)


def test_a_file_that_becomes_shorter_while_it_is_read_costs_its_end(long_bag):
    scan = McapScan(long_bag.path)
    messages = scan.messages()
    found = [next(messages)]
    os.truncate(long_bag.path, 50_000)
    found += messages
    assert [(m.topic.name, m.log_ns, m.data) for m in found] == long_bag.messages[: len(found)]
    assert 30 < len(found) < 60
    assert "long_0.mcap cannot be read everywhere: it became shorter while it was read" in findings(scan)


def test_a_bad_sector_costs_its_chunks(long_bag, tmp_path, monkeypatch):
    unreadable(monkeypatch, 40_960, 45_056)
    bag = recover_bag(long_bag.folder, tmp_path / "recovered")
    assert bag.problems[0] == "long_0.mcap cannot be read everywhere: Input/output error"
    monkeypatch.undo()
    found = scanned(bag.folder / "recovered_0.mcap")[0]
    assert set(found) < set(long_bag.messages)
    assert len(found) >= 120 - 6
    assert found[-1] == long_bag.messages[-1]


def write_foreign(path, messages, **options):
    """A file as another writer makes it."""
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/notes", "cdr", schema)
        for number, message in enumerate(messages):
            writer.add_message(channel, log_time=number, publish_time=number, data=message)
        writer.finish()


def test_a_bad_sector_gives_no_wrong_message_where_nothing_has_a_checksum(tmp_path, monkeypatch):
    path, messages = tmp_path / "plain.mcap", [bytes([number]) * 500 for number in range(1, 100)]
    write_foreign(path, messages, use_chunking=False)
    for first in range(8192, 8192 + 531, 3):
        with monkeypatch.context() as disk:
            unreadable(disk, first, 12_288)
            found, scan = scanned(path)
        assert {message for _, _, message in found} < set(messages)
        assert scan.damaged or scan.cut_bytes


def test_a_bag_that_cannot_be_read_leaves_no_half_written_one(bag, tmp_path):
    (bag.folder / "whole_1.mcap").mkdir()  # cannot be opened as a file
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        recover_bag(bag.folder, tmp_path / "recovered")
    assert not (tmp_path / "recovered").exists()


def test_a_recovered_bag_has_small_chunks(tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        for number in range(466):
            writer.write(NOTES, START_NS + number, START_NS, text_message("record " * 100))
    bag = recover_bag(tmp_path / "run", tmp_path / "recovered")
    data = bytearray((bag.folder / "recovered_0.mcap").read_bytes())
    data[data.index(b"zstd") + 30] ^= 1
    path = tmp_path / "damaged_0.mcap"
    path.write_bytes(data)
    assert 466 - 25 <= len(scanned(path)[0]) < 466


def test_a_message_among_indexes_is_not_believed(tmp_path):
    # One bit makes an index of messages a message: the first number is the channel, the next are times.
    with BagWriter(tmp_path / "run") as writer:
        for number in range(3):
            writer.write(NOTES, START_NS + number, START_NS, text_message("note"))
            writer.flush()
    data = bytearray(writer.path.read_bytes())
    (place,) = [place for place in [data.index(b"\x07\x16\0\0\0\0\0\0\0")] if place]
    data[place] ^= 2
    writer.path.write_bytes(data)
    found, scan = scanned(writer.path)
    assert [log_ns - START_NS for _, log_ns, _ in found] == [0, 1, 2]
    assert findings(scan) == ["run_0.mcap is damaged in 1 place"]
    with pytest.raises(InputError, match="damaged"), BagReader(tmp_path / "run") as reader:
        list(reader.messages())


def test_no_link_leads_out_of_a_bag(bag, tmp_path):
    folder = tmp_path / "stranger"
    folder.mkdir()
    (folder / "stranger_0.mcap").symlink_to(bag.path)
    for work in (bag_info, lambda path: recover_bag(path, tmp_path / "recovered")):
        with pytest.raises(InputError, match="outside of its bag"):
            work(folder)
    (folder / "metadata.yaml").symlink_to(bag.folder / "metadata.yaml")
    with pytest.raises(InputError, match="outside of its bag"):
        BagReader(folder)
    assert not (tmp_path / "recovered").exists()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_large_chunk_that_was_cut_gives_the_messages_before_the_cut(tmp_path, compression):
    # Other recorders write chunks of a megabyte or more: with luck, a part of the last one can be unpacked.
    path = tmp_path / "large.mcap"
    data = random.Random(1)
    messages = [data.randbytes(1000) for _ in range(1500)]
    write_foreign(path, messages, compression=compression, chunk_size=10 << 20)
    path.write_bytes(path.read_bytes()[:1_000_000])
    found, scan = scanned(path)
    assert [message for _, _, message in found] == messages[: len(found)]
    assert 500 < len(found) < 1000
    assert scan.cut_bytes > 0


def test_messages_outside_chunks_are_found(tmp_path):
    path = tmp_path / "plain.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/notes", "cdr", schema)
        for number in range(3):
            writer.add_message(channel, log_time=number, publish_time=number, data=b"x" * 10)
        file.flush()
    found, scan = scanned(path)
    assert len(found) == 3
    assert not scan.finished


def test_all_files_of_a_split_bag_are_recovered_in_their_order(unclosed, tmp_path):
    split = tmp_path / "split"
    split.mkdir()
    with BagWriter(tmp_path / "other") as writer:
        for number in range(12):  # more than nine: file 10 comes after file 2
            writer.write(unclosed_topic(unclosed), number + 1, number + 1, b"\0\1\0\0\1\0\0\0\0")
    for number in range(12):
        single = tmp_path / f"single_{number}"
        with BagWriter(single) as writer:
            writer.write(unclosed_topic(unclosed), number + 1, number + 1, b"\0\1\0\0\1\0\0\0\0")
        (single / f"{single.name}_0.mcap").rename(split / f"split_{number}.mcap")
    bag = recover_bag(split, tmp_path / "recovered")
    scan = McapScan(bag.folder / "recovered_0.mcap")
    assert [message.log_ns for message in scan.messages()] == list(range(1, 13))


def unclosed_topic(sample):
    return next(McapScan(sample.path).messages()).topic


def test_the_bag_of_a_recorder_that_loses_everything_says_so(tmp_path):
    # The writer of rosbags keeps everything in memory until its first megabyte.
    writer = RosbagsWriter(tmp_path / "lost", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.open()
    writer.abort()
    with pytest.raises(InputError, match="no complete message"):
        recover_bag(tmp_path / "lost", tmp_path / "recovered")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.db3", "SQLite"),
        ("a.db3.zstd", "SQLite"),
        ("a.bag", "ROS 1"),
        ("a.mcap.zstd", "files are compressed"),
        ("a.txt", "holds no MCAP file"),
        ("", "no such bag"),
    ],
)
def test_what_cannot_be_recovered_is_reported(tmp_path, name, message):
    folder = tmp_path / "bag"
    if name:
        folder.mkdir()
        (folder / name).write_text("")
    with pytest.raises(InputError, match=message):
        recover_bag(folder, tmp_path / "recovered")


def test_nothing_is_overwritten(bag, tmp_path):
    with pytest.raises(InputError, match="never overwrites"):
        recover_bag(bag.folder, bag.folder)
