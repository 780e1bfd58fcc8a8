# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of receivers for the records of a log: which are found, which are not, and why."""

from __future__ import annotations

import json
import math
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from soilmoist_ros.cli.main import main
from soilmoist_ros.sensing import LoggerRecord, format_header, format_record
from soilmoist_ros.sensing.formats.log_values import nmea_checksum

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
T0 = 1_778_749_200.0  # 2026-05-14 09:00 UTC
RECORDS, SECONDS = 12, 121
TEXT, FIX = "std_msgs/msg/String", "sensor_msgs/msg/NavSatFix"
SENTENCE, GPS_FIX, PVT = "nmea_msgs/msg/Sentence", "gps_msgs/msg/GPSFix", "ublox_msgs/msg/NavPVT"
OWN = {
    SENTENCE: "std_msgs/Header header\nstring sentence",
    "gps_msgs/msg/GPSStatus": "std_msgs/Header header\nint16 status",
    GPS_FIX: "std_msgs/Header header\ngps_msgs/GPSStatus status\nfloat64 latitude\nfloat64 longitude\n"
    "float64 altitude\nfloat64 err_horz\nfloat64[9] position_covariance\nuint8 position_covariance_type",
    PVT: "int32 lon\nint32 lat",
}


def log_lines():
    records = [
        LoggerRecord(
            T0 + 10 * n, tuple(3 + n * tube % 7 for tube in range(1, 13)), (10.0,) * 12, 1013.0, 18.0, 0.5,
            record_number=n,
        )
        for n in range(1, RECORDS + 1)
    ]  # fmt: skip
    return [*format_header().splitlines(), *map(format_record, records)]


def sentence(body):
    return f"${body}*{nmea_checksum(body.encode()):02X}"


def place(number):
    return 53.268, -0.5245 + 1e-5 * number


def gga(number, quality=4):
    latitude, longitude = place(number)
    clock = f"{9 + number // 3600:02d}{number // 60:02d}{number % 60:02d}.00"
    north, west = (f"{int(a) * 100 + (a - int(a)) * 60:.7f}" for a in (latitude, -longitude))
    return sentence(f"GNGGA,{clock},{north},N,{west.zfill(13)},W,{quality},18,0.6,31.2,M,47.6,M,,")


def rmc(number, date="140526"):
    clock = f"{9 + number // 3600:02d}{number // 60:02d}{number % 60:02d}.00"
    return sentence(f"GNRMC,{clock},A,5316.0816180,N,00031.4654940,W,1.1,90.0,{date},,,R,V")


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("\n".join(log_lines()) + "\n")
    return path


def run(command, *options):
    result = CliRunner().invoke(main, [command, *map(str, options)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output.replace("\n", " ")


class Types:
    """Messages of ROS 1 or ROS 2."""

    def __init__(self, ros):
        self.ros = ros
        self.store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_JAZZY)
        for name, text in OWN.items():
            self.store.register(get_types_from_msg(text, name))

    def make(self, name, *values):
        return self.store.types[name](*values)

    def header(self, stamp_s):
        stamp = self.make("builtin_interfaces/msg/Time", int(stamp_s), round(stamp_s % 1 * 1e9))
        return self.make("std_msgs/msg/Header", *([0] if self.ros == 1 else []), stamp, "gps")

    def fix(self, number, stamp_s, status=2, where=None):
        latitude, longitude = where or place(number)
        covariance = np.diag([4e-4, 4e-4, 1.6e-3]).ravel()
        about = self.make("sensor_msgs/msg/NavSatStatus", status, 1)
        return self.make(FIX, self.header(stamp_s), about, latitude, longitude, 78.8, covariance, 2)

    def gps_fix(self, number, stamp_s, status=18):
        about = self.make("gps_msgs/msg/GPSStatus", self.header(stamp_s), status)
        covariance = np.diag([4e-4, 4e-4, 1.6e-3]).ravel()
        return self.make(GPS_FIX, self.header(stamp_s), about, *place(number), 78.8, 0.02, covariance, 2)

    def data(self, message):
        name = message.__msgtype__
        store = self.store
        return bytes(store.serialize_ros1(message, name) if self.ros == 1 else store.serialize_cdr(message, name))


def bag(path, types, topics, packed=True, **how):
    """A file with the lines of a logger, and topics with a message a second."""
    spoken = [("/crns/line", T0 + n, types.make(TEXT, line)) for n, line in enumerate(log_lines())]
    heard = [(topic, T0 + n + 0.1, make(n)) for topic, make in topics.items() for n in range(SECONDS)]
    messages = sorted([*spoken, *heard], key=lambda one: one[1])
    if path.suffix in (".bag", ""):
        if path.suffix:
            writer = Ros1Writer(path)
        else:
            writer = FolderWriter(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        if packed and not path.suffix:
            writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
        with writer:
            made = {}
            for topic, time_s, message in messages:
                kind = message.__msgtype__
                made[topic] = made.get(topic) or writer.add_connection(topic, kind, typestore=types.store)
                writer.write(made[topic], round(time_s * 1e9), types.data(message))
        return path
    with path.open("wb") as file:
        writer = McapWriter(file, **how)
        writer.start({"ros1.mcap": "ros1", "plain.mcap": ""}.get(path.name, "ros2"))
        made = {}
        for topic, time_s, message in messages:
            kind = message.__msgtype__
            if topic not in made:
                text, _ = types.store.generate_msgdef(kind, ros_version=types.ros)
                name = kind.replace("/msg/", "/") if types.ros == 1 else kind
                schema = writer.register_schema(name, f"ros{types.ros}msg", text.encode())
                made[topic] = writer.register_channel(topic, "ros1" if types.ros == 1 else "cdr", schema)
            ns = round(time_s * 1e9)
            writer.add_message(made[topic], ns, types.data(message), ns)
        writer.finish()
    return path


def sentences(types):
    return lambda n: types.make(SENTENCE, types.header(T0 + n), f"{gga(n)}\r\n{rmc(n)}")


KINDS = {
    "fix": lambda types: lambda n: types.fix(n, T0 + n),
    "GPSFix": lambda types: lambda n: types.gps_fix(n, T0 + n), "Sentence": sentences,
    "NMEA text": lambda types: lambda n: types.make(TEXT, f"{gga(n)}\n{rmc(n)}\n"),
}  # fmt: skip
NO_INDEX = {"use_chunking": False, "index_types": IndexType.NONE, "use_statistics": False}
FILES = {
    "a.mcap": (2, {}), "lz4.mcap": (2, {"compression": CompressionType.LZ4}), "noindex.mcap": (2, NO_INDEX),
    "ros1.mcap": (1, {}), "plain.mcap": (2, {}), "a.bag": (1, {}), "folder": (2, {}),
}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "file"), [*((kind, "a.mcap") for kind in KINDS), *(("Sentence", file) for file in [*FILES][1:])]
)
def test_positions_of_each_type_are_read_from_each_kind_of_file(tmp_path, kind, file):
    ros, how = FILES[file]
    types = Types(ros)
    code, said = run("check", "--log", bag(tmp_path / file, types, {"/rover/gnss": KINDS[kind](types)}, **how))
    assert code == 0, said
    assert "12 records at 53.27 N, 0.52 W" in said
    assert "doubt" not in said


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda t, n: t.fix(n, T0 + n, status=-2),
            "in 121 epochs: status -2: unknown whether there is a fix (121)",
        ),
        (lambda t, n: t.fix(n, T0 + n, status=-1), "in 121 epochs: status -1: no fix (121)"),
        (lambda t, n: t.gps_fix(n, T0 + n, status=-1), "status -1: no fix (121)"),
        (lambda t, n: t.fix(n, T0 + n, where=(0.0, 0.0)), "latitude 0, longitude 0: no possible latitude"),
        (lambda t, n: t.fix(n, T0 + n, where=(math.nan, 1.0)), "latitude nan, longitude 1: no possible latitude"),
    ],
    ids=["status -2", "status -1", "GPSFix", "0, 0", "NaN"],
)
def test_epochs_without_a_position_say_why(tmp_path, make, message):
    types = Types(2)
    code, said = run("check", "--log", bag(tmp_path / "a.mcap", types, {"/fix": lambda n: make(types, n)}))
    assert code == 2
    assert message in said


@pytest.mark.parametrize(("stamp_s", "words"), [(0.0, "have no stamp"), (T0, "all have the same stamp")])
def test_without_stamps_the_time_of_receipt_is_used_and_said_once(tmp_path, stamp_s, words):
    types = Types(2)
    code, said = run("check", "--log", bag(tmp_path / "a.mcap", types, {"/fix": lambda n: types.fix(n, stamp_s)}))
    assert code == 0
    assert "12 records at 53.27 N" in said
    assert said.count(f"the 121 positions {words}: the time of their receipt is used") == 1


@pytest.mark.parametrize(
    ("shift_s", "words", "option"),
    [
        (-T0, "1970-01-01 00:00:01 to 1970-01-01 00:02:00", "--gnss-shift 1778749200s"),
        (
            18.0,
            "+18 s from the times of receipt, as GPS time is ahead of UTC by its leap seconds",
            "--gnss-shift -18s",
        ),
        (-7200.0, "-7200 s from the times of receipt, -2 h: local time instead of UTC", "--gnss-shift 7200s"),
    ],
    ids=["simulated", "GPS time", "local time"],
)
def test_stamps_of_another_clock_are_compared_with_the_times_of_receipt(tmp_path, shift_s, words, option):
    types = Types(2)
    path = bag(tmp_path / "a.mcap", types, {"/fix": lambda n: types.fix(n, T0 + n + shift_s)})
    _, said = run("check", "--log", path)
    assert words in said
    assert option in said


def test_which_topic_has_the_positions_is_shown_or_asked_for(tmp_path):
    types = Types(2)
    topics = {"/gps/fix": KINDS["fix"](types), "/nmea": sentences(types), "/ext": KINDS["GPSFix"](types)}
    _, said = run("check", "--log", bag(tmp_path / "a.mcap", types, topics))
    assert "the positions are those of /gps/fix; not used: /ext, /nmea -> choose with --fix-topic" in said
    topics = {"/a/fix": KINDS["fix"](types), "/b/fix": KINDS["fix"](types)}
    code, said = run("check", "--log", bag(tmp_path / "b.mcap", types, topics))
    assert code == 2
    assert "name one with --fix-topic: /a/fix, /b/fix" in said
    code, said = run("check", "--log", tmp_path / "b.mcap", "--fix-topic", "/a/fix")
    assert (code, "12 records at 53.27 N" in said) == (0, True)


@pytest.mark.slow
def test_records_that_are_lost_have_their_reason(tmp_path):
    types = Types(2)
    path = bag(tmp_path / "a.mcap", types, {"/fix": lambda n: types.fix(n, T0 + n, status=-1 if n > 60 else 2)})
    field = GOLDEN / "one_stop" / "configuration" / "field.yaml"
    named = ("--field", field, "--logger-topic", "/crns/line", "--out", tmp_path / "out")
    code, said = run("map", path, *named)
    assert code == 0, said
    assert "lost       5 by no position, such as " in said
    assert "60 of 121 epochs have none, 60 by status -1: no fix" in said


def test_files_of_two_receivers_are_not_mixed(tmp_path, log):
    for name, south_deg in (("a", 0.0), ("b", 5e-5)):
        rows = [f"{T0 + n:.0f},{place(n)[0] - south_deg},{place(n)[1]}" for n in range(SECONDS)]
        (tmp_path / name).write_text("\n".join(["time,lat,lon", *rows]))
    code, said = run("check", "--log", log, "--nmea", tmp_path / "a", "--nmea", tmp_path / "b")
    assert (code, "its positions are 6 m from those of a at the same times (median)" in said) == (2, True)
    assert run("check", "--log", log, "--nmea", tmp_path / "a", "--nmea", tmp_path / "a")[0] == 0
    types = Types(2)
    both = bag(
        tmp_path / "a.mcap", types, {"/fix": lambda n: types.fix(n, T0 + n - n % 2, where=(53 + n % 2, 0.1))}
    )
    code, said = run("check", "--log", both)
    assert (code, "has 60 times with several positions, 111 km apart (median)" in said) == (2, True)
    some = bag(tmp_path / "b.mcap", types, {"/fix": lambda n: types.fix(n, T0 + n if n > 60 else 0.0)})
    assert run("check", "--log", some)[0] == 0, "without a stamp they are not of one time"


def test_positions_of_a_type_that_cannot_be_read_are_named(tmp_path):
    types = Types(2)
    path = bag(tmp_path / "a.mcap", types, {"/ublox/navpvt": lambda n: types.make(PVT, n, n)})
    code, said = run("map", path, "--out", tmp_path / "out")
    assert code == 2
    assert "positions of types that cannot be read: /ublox/navpvt (ublox_msgs/msg/NavPVT)" in said
    assert "sensor_msgs/NavSatFix" in said


@pytest.mark.slow
def test_a_date_that_rolled_over_is_named_and_corrected_only_on_demand(tmp_path, log):
    nmea = tmp_path / "old.nmea"
    nmea.write_text("\n".join(f"{gga(n)}\n{rmc(n, '280906')}" for n in range(SECONDS)))
    code, said = run("map", log, "--nmea", nmea, "--out", tmp_path / "no")
    assert (code, "exactly 1024 weeks earlier: the receiver's date has rolled over" in said) == (2, True)
    options = ("--gnss-shift", "1024w", "--from", "2026-05-14T11:00:30+02:00", "--to", "2026-05-14T09:01:30")
    code, said = run("map", log, "--track", nmea, "--out", tmp_path / "yes", *options)
    assert code == 0, said
    assert "records    6 used" in said
    assert "2026-05-14 09:00:40 to 2026-05-14 09:01:30 UTC, by --from and --to" in said
    assert "shifted by +619315200 s (--gnss-shift)" in said
    found = json.loads((tmp_path / "yes" / "summary.json").read_text())
    assert "positions" in found["warning_codes"]


def test_quality_9_and_a_part_of_the_track_and_no_date(tmp_path, log):
    nmea = tmp_path / "a.nmea"
    nmea.write_text("\n".join(gga(n, quality=9) for n in range(62)))
    code, said = run("check", "--log", log, "--nmea", nmea)
    assert code == 0
    assert "place       6 of 12 records at 53.27 N" in said
    assert "no position at the time of 6 records: its positions are from 2026-05-14 09:00:00 to" in said
    assert "no date (neither RMC nor ZDA): the day is that of the log, 2026-05-14" in said
    code, said = run("map", log, "--nmea", nmea, "--out", tmp_path / "out")
    assert code == 0, said
    page = (tmp_path / "out" / "report.html").read_text()
    assert "the receiver has no position at the time of this record" in page
    assert "its positions are from 2026-05-14 09:00:00 to 2026-05-14 09:01:01 UTC" in page


@pytest.mark.parametrize(("kind", "code"), [("Sentence", 0), ("GPSFix", 2)])
def test_older_bags_have_no_definitions(tmp_path, kind, code):
    types = Types(2)
    folder = bag(tmp_path / "folder", types, {"/gnss": KINDS[kind](types)}, packed=False)
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as base, base:
        base.execute("DROP TABLE message_definitions")
        base.execute("UPDATE schema SET schema_version = 3")
    found, said = run("check", "--log", file)
    assert found == code
    assert ("12 records at 53.27 N" if code == 0 else "has no definition of gps_msgs/msg/GPSFix") in said
