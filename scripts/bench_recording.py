# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Benchmark of recording: speed, size and safety.

* messages/s without loss, for small and large messages
* bytes per mission hour
* speed of recovery
* messages lost by a kill, compared with two common writers: rosbags, and mcap with its default settings

usage: .venv/bin/python scripts/bench_recording.py [--quick] [--folder DIR] [--save]      needs no ROS
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import results
from mcap.writer import Writer as PlainMcapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.recording.bag.metadata import Definition, Topic
from soilmoist_ros.recording.bag.recorder import BagRecorder
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.bag.verify import recover_bag
from soilmoist_ros.recording.bag.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_780_000_000_000_000_000
RECORD_BYTES = 550
"""A message of ``counts`` with one record."""
HOUR = {
    # topic: (messages per hour, bytes of the message)
    "/counts": (360, RECORD_BYTES),
    "/fix": (3600 * 5, 120),
    "/pressure": (360, 44),
    "/temperature": (360, 44),
    "/relative_humidity": (360, 44),
    "/samples": (30, 4_000),
    "/soil_map": (30, 150_000),
    "/uncertainty": (30, 4_000),
    "/model": (30, 300),
    "/plan": (30, 1_500),
    "/mission": (3600, 700),
    "/diagnostics": (3600 * 4, 900),
}


def topic(name: str, type_name: str = "std_msgs/msg/String") -> Topic:
    text, _ = STORE.generate_msgdef(type_name, ros_version=2)
    return Topic(name, Definition(type_name, text, type_hash=STORE.hash_rihs01(type_name)))


def content(size: int, seed: int) -> bytes:
    """Bytes that compress about as well as messages with floating-point numbers."""
    numbers = np.cumsum(np.random.default_rng(seed).normal(size=size // 8 + 1))
    return (b"\0\1\0\0" + numbers.astype("<f4").astype("<f8").tobytes())[:size]


def throughput(folder: Path, size: int, seconds: float) -> dict[str, float]:
    """Highest rate without loss: the speed of the writer with a queue that is never full."""
    messages = [content(size, seed) for seed in range(50)]
    recorder = BagRecorder(lambda: BagWriter(folder), capacity_bytes=64 << 20)
    recorder.start()
    recorder.wait_open(10)
    notes = topic("/counts")
    started = time.perf_counter()
    sent = 0
    while time.perf_counter() - started < seconds:
        for message in messages:
            while not recorder.put(notes, START_NS + sent, START_NS + sent, message):
                time.sleep(0.001)  # full: the publisher is faster than the disk
            sent += 1
        while recorder.state.waiting_bytes > 32 << 20:
            time.sleep(0.001)
    state = recorder.stop()
    elapsed = time.perf_counter() - started
    found = sum(1 for _ in McapScan(folder / f"{folder.name}_0.mcap").messages())
    return {
        "message_bytes": size,
        "messages_per_s": sent / elapsed,
        "megabytes_per_s": sent * size / elapsed / 1e6,
        "refused_and_sent_again": state.dropped,
        "missing": sent - found,
    }


def mission_hour(folder: Path, fraction: float) -> dict[str, float]:
    """Size of a mission hour, flushed every half second as in the field."""
    events = sorted(
        (3600 * fraction * (k + 0.5) / count, name, size)
        for name, (per_hour, size) in HOUR.items()
        for count in [max(1, round(per_hour * fraction))]
        for k in range(count)
    )
    topics = {name: topic(name) for name in HOUR}
    raw, flushed_s = 0, 0.0
    with BagWriter(folder) as writer:
        for number, (time_s, name, size) in enumerate(events):
            if time_s >= flushed_s + 0.5:
                writer.flush()
                flushed_s = time_s
            stamp = START_NS + int(time_s * 1e9)
            writer.write(topics[name], stamp, stamp, content(size, number))
            raw += size
    size = writer.path.stat().st_size
    return {
        "messages": len(events) / fraction,
        "raw_megabytes": raw / fraction / 1e6,
        "megabytes": size / fraction / 1e6,
    }


def recovery(source: Path, out: Path) -> dict[str, float]:
    """Speed of recovering a bag that ends in the middle of its last chunk."""
    data = source.read_bytes()
    cut = source.with_name("cut_0.mcap")
    cut.write_bytes(data[: len(data) * 9 // 10])
    started = time.perf_counter()
    bag = recover_bag(cut, out)
    elapsed = time.perf_counter() - started
    return {
        "megabytes": cut.stat().st_size / 1e6,
        "messages": bag.extent.messages,
        "seconds": elapsed,
        "messages_per_s": bag.extent.messages / elapsed,
    }


def write_until_killed(kind: str, folder: Path, period_s: float) -> None:
    """Write small messages at a steady rate with one of the writers and print the number of each."""
    data = content(RECORD_BYTES, 0)
    stamp = START_NS
    if kind == "soilmoist_ros":
        recorder = BagRecorder(lambda: BagWriter(folder))
        recorder.start()
        recorder.wait_open(10)
        notes = topic("/counts")

        def write(stamp: int) -> None:
            recorder.put(notes, stamp, stamp, data)
    elif kind == "rosbags":
        bag = RosbagsWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        bag.open()
        connection = bag.add_connection("/counts", "std_msgs/msg/String", typestore=STORE)

        def write(stamp: int) -> None:
            bag.write(connection, stamp, data)
    else:
        folder.mkdir()
        plain = PlainMcapWriter(str(folder / f"{folder.name}_0.mcap"))
        plain.start(profile="ros2")
        schema = plain.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = plain.register_channel("/counts", "cdr", schema)

        def write(stamp: int) -> None:
            plain.add_message(channel, log_time=stamp, publish_time=stamp, data=data)

    while True:
        stamp += 1
        write(stamp)
        print(stamp - START_NS, flush=True)
        time.sleep(period_s)


def loss_by_kill(kind: str, folder: Path, kills: int, rate_hz: float) -> dict[str, float]:
    """Messages missing after kills at random moments of the first seconds."""
    dice = random.Random(7)
    missing, written = [], 0
    for number in range(kills):
        bag = folder / f"{kind}_{number}"
        command = [sys.executable, __file__, "--writer", kind, str(bag), str(1 / rate_hz)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(dice.uniform(1.0, 3.0))
            process.send_signal(signal.SIGKILL)
            last = int((process.stdout.read().splitlines() or [b"1"])[-1])
        [path] = bag.glob("*.mcap")
        found = sum(1 for _ in McapScan(path).messages())
        missing.append(max(0, last - found))
        written += last
    return {
        "rate_hz": rate_hz,
        "kills": kills,
        "written": written,
        "mean_missing": sum(missing) / kills,
        "most_missing": max(missing),
        "most_missing_s": max(missing) / rate_hz,
        "share_missing": sum(missing) / written,
    }


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller sizes")
    parser.add_argument("--folder", type=Path, help="disk to measure; a temporary folder by default")
    parser.add_argument("--writer", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.writer:
        kind, bag, period = given.writer
        write_until_killed(kind, Path(bag), float(period))
    seconds, fraction, kills = (1.0, 0.05, 2) if given.quick else (8.0, 1.0, 10)
    with tempfile.TemporaryDirectory(dir=given.folder) as temporary:
        folder = Path(temporary)
        sizes = (RECORD_BYTES, 20_000, 1_000_000)
        speeds = [throughput(folder / f"bag_{size}", size, seconds) for size in sizes]
        hour = mission_hour(folder / "hour", fraction)
        small = folder / f"bag_{RECORD_BYTES}" / f"bag_{RECORD_BYTES}_0.mcap"
        recoveries = [
            {"bag of": "small messages", **recovery(small, folder / "recovered_small")},
            {"bag of": "a mission", **recovery(folder / "hour" / "hour_0.mcap", folder / "recovered_hour")},
        ]
        kinds = ("soilmoist_ros", "rosbags", "mcap")
        lost = [{"writer": kind, **loss_by_kill(kind, folder, kills, 100.0)} for kind in kinds]
    about_hour = (
        f"{hour['messages']:.0f} messages, {hour['raw_megabytes']:.1f} MB, as a bag {hour['megabytes']:.1f} MB"
    )
    for name, rows, settings in (
        (
            "speed",
            speeds,
            f"{seconds:g} s each, as fast as the disk takes them; an hour of a mission: {about_hour}",
        ),
        ("recovery", recoveries, "bags that end in the middle of their last chunk"),
        ("kills", lost, "small messages, writers killed after 1 to 3 s; mcap with its default settings"),
    ):
        results.publish(f"recording_{name}", *results.columns_and_rows(rows), settings, given.save)


if __name__ == "__main__":
    main()
