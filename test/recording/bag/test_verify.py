# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags are verified: what is not as it was recorded is named."""

import random
import shutil
import struct

import pytest
import yaml
import zstandard
from bags import MODEL, NOTES, PRESSURE, START_NS, Sample, number_message, text_message, write_foreign
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.cli.bag import command
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import BagReader, BagWriter, bag_info, recover_bag
from soilmoist_ros.recording.bag.scan import McapScan

STORE = get_typestore(Stores.ROS2_JAZZY)


def test_what_the_metadata_say_is_compared(bag):
    path, whole = bag.folder / "metadata.yaml", bag.path.read_bytes()
    path.write_text(path.read_text().replace("message_count: 8", "message_count: 9", 1))
    with BagWriter(bag.folder.with_name("other")) as writer:
        writer.write(MODEL, START_NS, START_NS, text_message("model"))
    writer.path.rename(bag.folder / "whole_1.mcap")
    assert bag_info(bag.folder).problems == ("whole_1.mcap is not in metadata.yaml",)
    (bag.folder / "whole_1.mcap").unlink()
    assert bag_info(bag.folder).problems == ("/robot/model has 8 messages, and metadata.yaml says 9",)
    bag.path.unlink()
    assert bag_info(bag.folder).problems[0] == f"{bag.path.name} is missing"
    path.unlink()
    bag.path.write_bytes(whole)
    assert bag_info(bag.folder).problems == ("metadata.yaml is missing",)


def rosbag2(folder, storage, version, mode="", numbers=(4, 4, 4)):
    """A split bag as rosbag2 writes it, with ``metadata.yaml`` of a version."""
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    ending, names, at_ns = {"mcap": "mcap", "sqlite3": "db3"}[storage], [], START_NS
    folder.mkdir()
    for split, count in enumerate(numbers):
        part = folder.with_name(f"part_{split}")
        with Writer(part, version=9, storage_plugin=plugin) as writer:
            to = [writer.add_connection(name, "std_msgs/msg/String", typestore=STORE) for name in ("/a", "/b")]
            for number in range(count):
                writer.write(to[number % 2], at_ns, text_message(f"{number}"))
                at_ns += 10**9
        data = (part / f"part_{split}.{ending}").read_bytes()
        name = f"{folder.name}_{split}.{ending}"
        (folder / f"{name}{'.zstd' * (mode == 'FILE')}").write_bytes(
            zstandard.compress(data) if mode == "FILE" else data
        )
        names.append(name)
    listed = [f"{name}{'.zstd' * (mode == 'FILE')}" for name in names]
    if version < 5:  # the folder of the bag came first
        listed = [f"{folder.name}/{name}" for name in listed]
    said = {
        "version": version,
        "storage_identifier": storage,
        "relative_file_paths": listed,
        "duration": {"nanoseconds": max(numbers) * 10**9},  # Humble wrote that of one file
        "starting_time": {"nanoseconds_since_epoch": START_NS},
        "message_count": sum(numbers),
        "topics_with_message_count": [
            {
                "topic_metadata": {"name": name, "type": "std_msgs/msg/String", "serialization_format": "cdr"},
                "message_count": count,
            }
            for name, count in (
                ("/a", sum((n + 1) // 2 for n in numbers)), ("/b", sum(n // 2 for n in numbers)), ("/c", 0),
            )
        ],
        "compression_format": "zstd" if mode else "",
        "compression_mode": mode,
    }  # fmt: skip
    if version > 5:  # names without .zstd, and messages that were dropped in the cache are counted
        said["files"] = [{"path": name, "message_count": n + 1} for name, n in zip(names, numbers, strict=True)]
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": said}))
    return folder


def all_agree(path, tmp_path):
    """What the commands say is wrong: the same, with the exit codes for it."""
    info = bag_info(path)
    assert (info.remedy == "") == info.whole == (info.problems == ())
    for verb in ("info", "verify"):
        assert CliRunner().invoke(command, [verb, str(path)]).exit_code == (0 if info.whole else 1)
    if info.storage == "mcap" and not any(path.glob("*.zstd")):
        assert recover_bag(path, tmp_path / "recovered") == info.problems
    return info.problems


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["", "FILE"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("version", [4, 9])
def test_the_verbs_agree_on_bags_of_every_version_storage_and_compression(tmp_path, version, storage, mode):
    bag = rosbag2(tmp_path / "run", storage, version, mode)
    assert all_agree(bag, tmp_path) == ()
    assert bag_info(bag).extent.messages == 12
    missing = sorted(bag.glob("run_1*"))[0]
    data = missing.read_bytes()
    missing.unlink()
    shutil.rmtree(tmp_path / "recovered", ignore_errors=True)
    problems = all_agree(bag, tmp_path)
    assert problems[0] == f"{missing.name} is missing"
    assert "/a has 4 messages, and metadata.yaml says 6" in problems
    assert "copy the missing files" in bag_info(bag).remedy
    missing.write_bytes(data[: len(data) // 2])  # cut
    shutil.rmtree(tmp_path / "recovered", ignore_errors=True)
    problems = all_agree(bag, tmp_path)
    assert any(name in problems[0] for name in (missing.name, missing.stem))
    assert bag_info(bag).extent.messages >= 8
    missing.write_bytes(data)
    (bag / "metadata.yaml").unlink()
    shutil.rmtree(tmp_path / "recovered", ignore_errors=True)
    assert all_agree(bag, tmp_path) == ("metadata.yaml is missing",)


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        ("{}", "metadata.yaml cannot be read: metadata.yaml is not that of a bag"),
        (
            "rosbag2_bagfile_information: {version: 9}",
            "metadata.yaml cannot be read: metadata.yaml lists no files",
        ),
        (
            "rosbag2_bagfile_information: {relative_file_paths: []}",
            "metadata.yaml cannot be read: metadata.yaml lists no files",
        ),
        ("a: [", "metadata.yaml cannot be read: "),
    ],
)
def test_metadata_that_say_nothing_make_no_bag_whole(tmp_path, said, problem):
    bag = rosbag2(tmp_path / "run", "mcap", 9)
    (bag / "metadata.yaml").write_text(said)
    (found,) = all_agree(bag, tmp_path)
    assert found.startswith(problem)
    with pytest.raises(InputError), BagReader(bag):
        pass


def test_a_bag_of_ros_1_needs_no_metadata_and_is_compared_with_its_index(tmp_path):
    with Ros1Writer(tmp_path / "run.bag") as writer:
        to = writer.add_connection("/a", "std_msgs/msg/String", typestore=get_typestore(Stores.ROS1_NOETIC))
        for number in range(3):
            writer.write(to, START_NS + number, b"\1\0\0\0x")
    assert all_agree(tmp_path / "run.bag", tmp_path) == ()
    data = (tmp_path / "run.bag").read_bytes()
    (tmp_path / "run_1.bag.active").touch()
    assert all_agree(tmp_path, tmp_path) == ("run_1.bag.active was not closed",)
    with pytest.raises(InputError, match="was not closed"):
        BagReader(tmp_path)
    at = data.rindex(struct.pack("<II", 0, 3))
    (tmp_path / "run.bag").write_bytes(data[:at] + struct.pack("<II", 0, 4) + data[at + 8 :])
    assert all_agree(tmp_path / "run.bag", tmp_path) == ("/a has 3 messages, and the index of run.bag says 4",)


def test_a_file_that_was_closed_without_a_summary_is_whole(tmp_path):
    """As with the preset ``fastwrite`` of rosbag2."""
    path = tmp_path / "fast.mcap"
    with path.open("wb") as file:
        writer = McapWriter(
            file, use_chunking=False, use_statistics=False, use_summary_offsets=False, repeat_schemas=False,
            repeat_channels=False, index_types=IndexType.NONE,
        )  # fmt: skip
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/a", "cdr", schema)
        for number in range(3):
            writer.add_message(channel, START_NS + number, text_message("x"), START_NS + number)
        writer.finish()
    assert all_agree(path, tmp_path) == ()
    path.write_bytes(path.read_bytes()[:-60])
    shutil.rmtree(tmp_path / "recovered")
    assert all_agree(path, tmp_path)[0].startswith("fast.mcap was not closed")


@pytest.mark.parametrize("listed", [True, False])
def test_messages_that_were_packed_alone_are_unpacked(tmp_path, listed):
    """Without ``metadata.yaml``, as of a recorder that was killed, no word says that they are packed."""
    path = tmp_path / "run"
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        writer.write(
            writer.add_connection("/a", "std_msgs/msg/String", typestore=STORE), START_NS, text_message("x")
        )
    if not listed:
        (path / "metadata.yaml").unlink()
    recover_bag(path, tmp_path / "new")
    for bag in (tmp_path / "new", path / "run.mcap"):
        with BagReader(bag) as reader:
            assert reader.read_texts("a") == ["x"]


def test_a_database_that_was_cut_is_not_whole(tmp_path):
    bag = rosbag2(tmp_path / "run", "sqlite3", 9)
    file = bag / "run_1.db3"
    data = file.read_bytes()
    file.write_bytes(data[:-5])
    assert (
        f"run_1.db3 cannot be read: run_1.db3 was cut: it has {len(data) - 5} of {len(data)} bytes"
        in all_agree(bag, tmp_path)
    )


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("a.mcap", "soilmoist bag recover"), ("a.db3", "sqlite3"), ("a.db3.zstd", "unzstd"),
     ("a.bag", "rosbag reindex"), ("a.bag.active", "rosbag reindex")],
)  # fmt: skip
def test_the_remedy_is_one_for_this_kind_of_file(tmp_path, name, remedy):
    path = tmp_path / name
    path.write_bytes(b"#ROSBAG V2.0\n")
    for read in (bag_info, BagReader)[: 1 if name.endswith("zstd") else 2]:
        try:
            error = f"-> {read(path).remedy}"
        except InputError as failure:
            error = str(failure)
        assert remedy in error.rpartition("->")[2]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_files_that_people_have_unpacked_and_those_of_an_apple_are_no_fault(tmp_path, storage):
    bag = rosbag2(tmp_path / "run", storage, 9, "FILE")
    for file in list(bag.glob("*.zstd")):
        file.with_suffix("").write_bytes(zstandard.decompress(file.read_bytes(), max_output_size=1 << 20))
        file.with_name(f"._{file.stem}").write_bytes(b"\0\5\x16\7")
        if file.name.startswith("run_1"):
            file.unlink()
    assert bag_info(bag).problems == ()
    with BagReader(bag) as reader:
        assert len(list(reader.messages())) == 12


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
    problems = recover_bag(unclosed.folder, tmp_path / "recovered")
    assert read_by_rosbags(tmp_path / "recovered") == unclosed.messages
    assert problems == ("unclosed_0.mcap was not closed", "metadata.yaml is missing")
    assert unclosed.path.read_bytes() == before
    with AnyReader([tmp_path / "recovered"]) as reader:
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


def heads(data):
    """Places of the bytes outside of chunks that say what follows, and of those at the begin of chunks."""
    at = 8
    while at + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        end = at + 9 + length
        yield from range(at, min(end, at + 60) if opcode == 6 else end)
        at = end


@pytest.mark.slow
def test_a_flipped_bit_invents_nothing_and_costs_one_chunk(tmp_path):
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
    writer.close()
    whole = sample.path.read_bytes()
    path = tmp_path / "damaged_0.mcap"
    places = list(heads(whole))
    for number in range(400):
        damaged = bytearray(whole)
        place = random_.choice(places if number % 4 else range(len(whole)))
        damaged[place] ^= 1 << random_.randrange(8)
        path.write_bytes(damaged)
        found, scan = scanned(path)
        assert set(found) <= set(sample.messages), place
        assert len(found) >= len(sample.messages) - 3, place
        if found != sample.messages:
            assert scan.findings(), place


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


def test_all_files_of_a_split_bag_are_recovered_in_their_order(tmp_path):
    (tmp_path / "split").mkdir()
    for number in range(12):  # more than nine: file 10 comes after file 2
        write_foreign(tmp_path / "split" / f"split_{number}.mcap", [text_message("x")], [number + 1])
    recover_bag(tmp_path / "split", tmp_path / "recovered")
    scan = McapScan(tmp_path / "recovered" / "recovered_0.mcap")
    assert [message.log_ns for message in scan.messages()] == list(range(1, 13))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.db3", "holds no MCAP file, only .db3 -> ros2 bag reindex"),
        ("a.bag", "holds no MCAP file, only .bag -> rosbag fix"),
        ("a.mcap.zstd", "holds no MCAP file, only .zstd -> unpack its files with unzstd"),
        ("a.txt", "is not a bag"),
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
