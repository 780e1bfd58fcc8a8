# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sensor driver as a real process, with devices as in the field."""

import contextlib
import itertools
import math
import os
import socket
import threading
import time
from datetime import UTC, datetime

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, NavSatFix, PointCloud2, RelativeHumidity, Temperature
from std_msgs.msg import String

from msg_adapters import counts_from_message, diagnostics_from_message, fix_to_message, to_seconds, to_time
from soilmoist_ros.foundation import Level, LocalFrame
from soilmoist_ros.nodes.sensor_driver import NAME, StoredHeader
from soilmoist_ros.nodes.topics import CLOCK, DEFAULT, RECORDS, SENSOR, VISITS
from soilmoist_ros.recording import line_bytes
from soilmoist_ros.recording.map_sources import DRIVER, RecordTail
from soilmoist_ros.sensing import Fix, FixStatus, LogHeader, fix_from_message, format_header, format_record
from soilmoist_ros.sensing.position.place_doubt import DOUBTS, Doubt, DoubtOutcome
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.simulation.robot.virtual_devices import nmea_sentences, sentences_without_fix

T0 = datetime(2026, 6, 1, 8, tzinfo=UTC).timestamp()
FRAME = LocalFrame(53.268, -0.5245)
FIELD = """
name: Test field
datum: {latitude_deg: 53.268, longitude_deg: -0.5245}
polygon: [[0, 0], [60, 0], [60, 50], [0, 50]]
"""
HEADER = [text.encode() for text in format_header("CRS-0007").splitlines()]


class Device:
    """A TCP server that a test controls; it sends to the currently connected client."""

    def __init__(self, greeting=()):
        self.greeting = greeting
        self.connections = 0
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.1)
        self.uri = "tcp://{}:{}".format(*self._server.getsockname())
        self._client = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._accept)
        self._thread.start()

    def _accept(self):
        while not self._done.is_set():
            with contextlib.suppress(TimeoutError):
                client, _ = self._server.accept()
                for line in self.greeting:
                    client.sendall(line + b"\r\n")
                self._client, old = client, self._client
                if old is not None:
                    old.close()
                self.connections += 1

    def send(self, *lines):
        for line in lines:
            self._client.sendall(line + b"\r\n")

    def close(self):
        self._done.set()
        self._thread.join()
        self._server.close()
        if self._client is not None:
            self._client.close()


@pytest.fixture
def logger():
    device = Device(HEADER)
    yield device
    device.close()


@pytest.fixture
def receiver():
    device = Device()
    yield device
    device.close()


@pytest.fixture
def field(tmp_path):
    path = tmp_path / "field.yaml"
    path.write_text(FIELD)
    return str(path)


class Outputs:
    """Messages of the driver."""

    def __init__(self, ros):
        self.counts = ros.collect(PointCloud2, "counts", RECORDS)
        self.quarantined = ros.collect(PointCloud2, "quarantined_counts", RECORDS)
        self.fix = ros.collect(NavSatFix, "fix", SENSOR)
        self.pressure = ros.collect(FluidPressure, "pressure", SENSOR)
        self.temperature = ros.collect(Temperature, "temperature", SENSOR)
        self.humidity = ros.collect(RelativeHumidity, "relative_humidity", SENSOR)
        self.raw_logger = ros.collect(String, "raw/logger", RECORDS)
        self.raw_gnss = ros.collect(String, "raw/gnss", RECORDS)
        self.diagnostics = ros.collect(DiagnosticArray, "/diagnostics", DEFAULT)

    @property
    def records(self):
        return [record for message in self.counts for record in counts_from_message(message)]

    @property
    def numbers(self):
        return [round((record.stamp_s - T0) / 10) for record in self.records]

    def health(self, name):
        found = [part for message in self.diagnostics for part in diagnostics_from_message(message)]
        return next((part for part in reversed(found) if part.name.endswith(f": {name}")), None)

    def diagnosed(self, name, key):
        """Value of a key in the last diagnostics of a part, empty without diagnostics."""
        part = self.health(name)
        return part.values.get(key, "") if part else ""


@pytest.fixture
def outputs(ros):
    return Outputs(ros)


@pytest.fixture
def start(ros, field, logger, outputs):
    """Starts a driver of the devices, and waits until it listens to them."""

    def make(receiver=None, **params):
        params = {"field": field, "logger_uri": logger.uri, **params}
        if receiver is not None:
            params["gnss_uri"] = receiver.uri
        process = ros.start("sensor_driver", params=params)
        if params["logger_uri"] == logger.uri:
            ros.wait_for(lambda: logger.connections, message="a connection to the logger")
            repeat_until(ros, lambda: logger.send(b"# hello"), lambda: outputs.raw_logger)
        if receiver is not None:
            ros.wait_for(lambda: receiver.connections, message="a connection to the receiver")
            seconds = itertools.count(-1000)
            repeat_until(
                ros, lambda: receiver.send(*no_fix(next(seconds))), lambda: outputs.fix and outputs.raw_gnss
            )
            receiver.send(*no_fix(-1))
            ros.wait_for(lambda: outputs.raw_gnss and line_bytes(outputs.raw_gnss[-1].data) == no_fix(-1)[-1])
        for received in (outputs.raw_logger, outputs.raw_gnss, outputs.fix):
            received.clear()
        return process

    return make


def repeat_until(ros, send, received):
    """Send until a message arrives: messages before discovery are lost."""

    def tried():
        send()
        time.sleep(0.05)
        return received()

    ros.wait_for(tried, message="an answer")


def no_fix(elapsed_s):
    return [text.encode() for text in sentences_without_fix(T0 + elapsed_s)]


def record(number, **values):
    weather = {"pressure_hpa": 1000.0, "temperature_degc": 20.0, "relative_humidity": 0.5}
    counts = {"tube_counts": (5.0,) * 12, "tube_live_s": (10.0,) * 12}
    return LoggerRecord(T0 + 10.0 * number, **{**counts, **weather, "record_number": number, **values})


def line(number, **values):
    return format_record(record(number, **values)).encode()


def place(x_m, y_m=20.0):
    latitude, longitude = FRAME.to_geographic((x_m, y_m))[0].tolist()
    return Position(latitude, longitude, 30.0, 0.02)


def epoch(elapsed_s, x_m):
    return [text.encode() for text in nmea_sentences(T0 + elapsed_s, place(x_m))]


def test_a_logger_that_does_not_repeat_its_header_is_read_again_after_a_kill(ros, field, logger, tmp_path):
    folder = tmp_path / "session" / DRIVER
    params = {"field": field, "logger_uri": logger.uri, "logger_format": "hydroinnova_crs1000"}
    params |= {"record_dir": str(tmp_path / "session"), "fix_wait_s": 0.0}
    logger.greeting = (b"//Recordperiod = 1 minutes.", b"//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N1ET_sec")
    for start in (1, 2):
        process = ros.start("sensor_driver", params=params)
        ros.wait_for(lambda: logger.connections == start)  # noqa: B023
        logger.send(f"{start},2026/06/01 08:0{start}:00,980,20,50,600,60".encode())
        ros.wait_for((folder / NAME).exists, message="a header")
        ros.wait_for(lambda: len(RecordTail(folder, "map").read().records) == start, message="a record")  # noqa: B023
        process.kill()
        logger.greeting = ()


def test_records_go_out_and_to_the_disk_with_all_that_belongs_to_them(
    ros, start, outputs, logger, receiver, tmp_path
):
    process = start(receiver, record_dir=str(tmp_path / "session"))
    logger.send(*HEADER)
    for second in range(23):
        receiver.send(*epoch(second, 10.0 + second))
        if second in (10, 20):
            logger.send(line(second // 10))
    ros.wait_for(lambda: len(outputs.counts) == 2, message="two records")
    first, second = outputs.records
    assert outputs.numbers == [1, 2]
    assert (first.x_m, first.y_m) == (pytest.approx(15.0, abs=1e-3), pytest.approx(20.0, abs=1e-3))
    assert second.x_m == pytest.approx(25.0, abs=1e-3)
    assert (first.raw_counts, first.exposure_s) == (60, 10.0)
    assert first.f_pressure == pytest.approx(math.exp(0.0077 * (1000 - 1013.25)))
    assert outputs.counts[0].header.frame_id == "map"
    ros.wait_for(lambda: outputs.fix and outputs.humidity and outputs.pressure and outputs.temperature)
    ros.wait_for(lambda: len(outputs.raw_logger) >= 2 + len(HEADER))
    received = [line_bytes(message.data) for message in outputs.raw_logger]
    assert [text for text in received if text != b"# hello"] == [*HEADER, line(1), line(2)]
    ros.wait_for(lambda: sum(b"GST" in line_bytes(message.data) for message in outputs.raw_gnss) == 23)
    assert outputs.pressure[-1].fluid_pressure == pytest.approx(100_000.0)
    assert outputs.temperature[-1].temperature == pytest.approx(20.0)
    assert outputs.humidity[-1].relative_humidity == pytest.approx(0.5)
    fix = fix_from_message(outputs.fix[-1])
    assert (fix.status, fix.covariance_m2[0][0]) == (FixStatus.RTK, pytest.approx(0.02**2))
    ros.wait_for(lambda: outputs.diagnosed("records", "records") == "2")
    assert outputs.diagnosed("records", "serial number") == "CRS-0007"
    assert "the logger's clock differs" in outputs.health("records").message
    assert {status.hardware_id for status in outputs.diagnostics[-1].status} == {"CRS-0007"}
    for link in ("logger link", "GNSS link"):
        assert outputs.health(link).level is Level.OK

    for elapsed_s in range(23, 44):
        receiver.send(*no_fix(elapsed_s))
    ros.wait_for(
        lambda: fix_from_message(outputs.fix[-1]).status is FixStatus.NO_FIX, message="a fix that is none"
    )
    logger.send(line(4))
    ros.wait_for(lambda: len(outputs.counts) == 3)
    placeless = outputs.records[-1]
    assert (math.isnan(placeless.x_m), math.isnan(placeless.y_m), placeless.raw_counts) == (True, True, 60)
    ros.wait_for(lambda: outputs.diagnosed("records", "records without a position") == "1")
    assert outputs.health("GNSS").level is Level.ERROR

    logger.send(line(5, tube_counts=(90_000.0,) * 12))
    ros.wait_for(lambda: outputs.quarantined, message="a quarantined record")
    process.kill()
    [bad] = counts_from_message(outputs.quarantined[0])
    assert (bad.quarantine, bad.raw_counts) == ("impossible_count", 1_080_000)
    stored = RecordTail(tmp_path / "session" / DRIVER, "map").read().records
    assert repr(stored) == repr([*outputs.records, bad]), "even after a kill"
    assert "Traceback" not in process.output()


def test_fixes_come_by_topic_if_no_receiver_is_given(ros, start, outputs, logger):
    publisher = ros.node.create_publisher(NavSatFix, "fix", SENSOR)
    start(fix_wait_s=30.0)
    ros.wait_for(publisher.get_subscription_count)
    logger.send(line(1))

    def placed():
        for second in (4.0, 6.0):
            fix = Fix(T0 + second, place(10 * second), FixStatus.FIX, geoid_separation_m=0.0)
            publisher.publish(fix_to_message(fix, "gnss"))
        return outputs.counts

    ros.wait_for(placed, message="a record with the place of the topic")
    assert outputs.records[0].x_m == pytest.approx(50.0, abs=10.0)  # a fix may be lost on its way
    assert outputs.records[0].y_m == pytest.approx(20.0, abs=1e-2)
    assert not outputs.raw_gnss


def test_records_of_a_place_that_the_planner_doubts_are_quarantined(ros, start, outputs, logger, receiver):
    start(receiver)
    doubts = ros.node.create_publisher(String, DOUBTS, VISITS)
    for doubt in (Doubt(T0 + 25.0), Doubt(T0 + 25.0, T0 + 45.0, DoubtOutcome.LOST)):
        doubts.publish(String(data=doubt.to_text()))
    doubts.publish(String(data="no doubt"))
    ros.wait_for(doubts.get_subscription_count)
    time.sleep(1.0)
    for number in range(1, 8):
        receiver.send(*epoch(10.0 * number - 5.0, 20.0))
        logger.send(line(number))
    ros.wait_for(lambda: len(outputs.records) + len(outputs.quarantined) == 7, message="all records")
    assert outputs.numbers == [1, 2, 6, 7]
    bad = [record for message in outputs.quarantined for record in counts_from_message(message)]
    assert [(round(record.stamp_s - T0), record.quarantine) for record in bad] == [
        (30, "place_doubt"), (40, "place_doubt"), (50, "place_doubt"),
    ]  # fmt: skip


def test_it_uses_simulated_time_and_names_another_type_on_the_topic_of_fixes(ros, start, outputs, logger):
    ros.start_publisher(String, "fix")
    clock = ros.node.create_publisher(Clock, "/clock", CLOCK)
    start(use_sim_time=True, fix_wait_s=0.0)
    ros.wait_for(clock.get_subscription_count)

    def diagnosed():
        clock.publish(Clock(clock=to_time(T0 + 17.0)))
        return outputs.diagnostics and to_seconds(outputs.diagnostics[-1].header.stamp) == T0 + 17.0

    ros.wait_for(diagnosed, message="diagnostics in simulated time")
    logger.send(line(1))
    ros.wait_for(lambda: outputs.diagnosed("records", "logger clock minus ours [s]") == "-7.0")
    assert outputs.health("records").level is Level.WARN
    said = "no fix yet: the topic fix has std_msgs/msg/String, not sensor_msgs/msg/NavSatFix"
    ros.wait_for(lambda: outputs.health("GNSS").message == said, message="the other type")


# The last header of a logger, for a driver that starts again ----------------------------------------------------

LOGGER = ("tcp://192.168.1.20:5000", "hydroinnova_rover")
STORED = LogHeader(("RecordNum", "Temp °C"), ("", "°C"), {"Recordperiod": "1 minutes."})


def test_a_header_comes_back_for_the_same_logger_only_and_is_written_once(tmp_path):
    stored = StoredHeader(tmp_path, *LOGGER)
    assert stored.header is None
    stored.update(STORED)
    assert StoredHeader(tmp_path, *LOGGER).header == STORED
    os.utime(tmp_path / NAME, (1.75e9, 1.75e9))
    assert StoredHeader(tmp_path, *LOGGER).header.stored_s == 1.75e9
    assert StoredHeader(tmp_path, "serial:///dev/ttyUSB0", LOGGER[1]).header is None
    assert StoredHeader(tmp_path, LOGGER[0], "toa5").header is None
    (tmp_path / NAME).unlink()
    stored.update(STORED)
    assert not (tmp_path / NAME).exists()
    stored.update(LogHeader(("RecordNum",)))
    assert StoredHeader(tmp_path, *LOGGER).header == LogHeader(("RecordNum",))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"1", b"\xff", b"[" * 100_000])
def test_a_damaged_file_is_ignored(content, tmp_path, caplog):
    (tmp_path / NAME).write_bytes(content)
    stored = StoredHeader(tmp_path, *LOGGER)
    assert stored.header is None
    assert NAME in caplog.text
    stored.update(STORED)
    assert StoredHeader(tmp_path, *LOGGER).header == STORED
