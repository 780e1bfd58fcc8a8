# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines of a logger and positions in bags of ROS 1, under names of a stranger's choice."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.pipeline import MapSettings, ReplaySettings, map_logs, replay_bag
from soilmoist_ros.pipeline.bag_lines import fix_topic, logger_topic, read_fixes
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.sensing.position.track_file import read_positions
from soilmoist_ros.sensing.records import CountRecord
from virtual_survey import write_survey

STORE = get_typestore(Stores.ROS1_NOETIC)
TYPES = STORE.types
TEXT, FIX = "std_msgs/msg/String", "sensor_msgs/msg/NavSatFix"


def text(words):
    return TEXT, STORE.serialize_ros1(TYPES[TEXT](data=words), TEXT)


def header(stamp_s):
    ns = round(stamp_s * 1e9)
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return TYPES["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="gps")


def position(fix):
    status = TYPES["sensor_msgs/msg/NavSatStatus"](status=int(fix.status), service=1)
    place = fix.position
    altitude = place.altitude_m + fix.geoid_separation_m
    covariance = np.array(fix.covariance_m2).ravel()
    values = (place.latitude_deg, place.longitude_deg, altitude, covariance, int(fix.covariance_kind))
    return FIX, STORE.serialize_ros1(TYPES[FIX](header(fix.stamp_s), status, *values), FIX)


def write(path, messages):
    """A bag of messages (topic, time in s, (type, data))."""
    with Writer(path) as writer:
        made = {}
        for topic, time_s, (kind, data) in messages:
            made[topic] = made.get(topic) or writer.add_connection(topic, kind, typestore=STORE)
            writer.write(made[topic], round(time_s * 1e9), data)
    return path


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """Logs of a survey, and the same as a bag with fixes and as one with NMEA."""
    folder = tmp_path_factory.mktemp("survey")
    write_survey(folder, seed=2, spacing_m=30.0, dwell_s=60.0)
    fixes, _ = read_positions(folder / "survey.nmea")
    lines = (folder / "survey.log").read_text().splitlines()
    begin_s = fixes[0].stamp_s
    spoken = [("/crns/line", begin_s + number, text(f"{line}\r\n")) for number, line in enumerate(lines)]
    write(folder / "fixes.bag", [*spoken, *(("/gps/fix", fix.stamp_s, position(fix)) for fix in fixes)])
    sentences = (folder / "survey.nmea").read_text().splitlines()
    heard = [("/gps/nmea", begin_s + 0.1 * number, text(line)) for number, line in enumerate(sentences)]
    write(folder / "nmea.bag", [*spoken, *heard])
    return folder


def settings(folder, **choices):
    return MapSettings(site=folder / "site.yaml", field=folder / "field.yaml", **choices)


@pytest.mark.slow
def test_a_bag_of_ros_1_gives_the_map_of_the_logs(survey):
    of_logs = map_logs([survey / "survey.log"], settings(survey, nmea=(survey / "survey.nmea",)))
    topics = {"logger_topic": "/crns/line", "fix_topic": "/gps/nmea"}
    of_sentences = map_logs([survey / "nmea.bag"], settings(survey, **topics))
    np.testing.assert_array_equal(of_sentences.soil_map.rate, of_logs.soil_map.rate)
    of_fixes = map_logs([survey / "fixes.bag"], settings(survey))
    np.testing.assert_allclose(of_fixes.soil_map.rate, of_logs.soil_map.rate, rtol=1e-6)
    assert len(of_fixes.track) == len(of_logs.track)
    assert of_fixes.inputs[0].name == "fixes.bag"


@pytest.mark.slow
def test_counts_in_a_bag_of_ros_1_are_replayed(survey, tmp_path):
    run = map_logs([survey / "fixes.bag"], settings(survey))
    names = (
        "x", "y", "z", "raw_counts", "exposure_s", "effective_exposure_s",
        "f_pressure", "f_humidity", "f_intensity",
    )  # fmt: skip
    field = TYPES["sensor_msgs/msg/PointField"]
    layout = [field(name=name, offset=8 * number, datatype=8, count=1) for number, name in enumerate(names)]
    kind, messages = "sensor_msgs/msg/PointCloud2", []
    for one in run.track:
        row = [getattr(one, {"x": "x_m", "y": "y_m", "z": "z_m"}.get(name, name)) for name in names]
        head = header(one.stamp_s)
        head.frame_id = "/map"  # ROS 1 had a slash before it
        data = np.frombuffer(np.array(row, "<f8").tobytes(), np.uint8)
        cloud = TYPES[kind](head, 1, 1, layout, False, 8 * len(names), 8 * len(names), data, True)
        messages.append(("/counts", one.stamp_s, (kind, STORE.serialize_ros1(cloud, kind))))
    path = write(tmp_path / "counts.bag", messages)
    fields = [name for name in CountRecord.__slots__ if name != "quarantine"]
    files = {"site": str(survey / "site.yaml"), "field": str(survey / "field.yaml")}
    replayed = replay_bag(path, ReplaySettings(**files))
    own, there = (
        [[getattr(one, f) for f in fields] for one in found] for found in (run.track, replayed.run.track)
    )
    np.testing.assert_allclose(there, own, rtol=1e-12)
    np.testing.assert_allclose(replayed.run.soil_map.rate, run.soil_map.rate, rtol=0.01)
    with pytest.raises(InputError, match="has no lines of a logger") as error:
        map_logs([path], settings(survey))
    assert "soilmoist replay" in str(error.value)


def test_topics_are_found_or_must_be_named(tmp_path):
    status = json.dumps({"a": 1})
    path = write(
        tmp_path / "two.bag",
        [("/b/raw/logger", 1, text("x")), ("/status", 2, text(status)), ("/gps/nmea", 3, text("$GPGGA,"))],
    )
    with BagReader(path) as bag:
        assert logger_topic(bag) == "/b/raw/logger"
        assert logger_topic(bag, "status") == "/status"
        assert fix_topic(bag) == fix_topic(bag, "nmea") == fix_topic(bag, "/gps/nmea") == "/gps/nmea"
        with pytest.raises(InputError, match="has no topic 'gps' with positions"):
            fix_topic(bag, "gps")
        with pytest.raises(InputError, match="no NMEA sentence"):
            read_fixes(bag, "/gps/nmea")
    path = write(tmp_path / "unclear.bag", [("/one", 1, text("x")), ("/two", 2, text("y"))])
    with BagReader(path) as bag, pytest.raises(InputError, match="several topics") as error:
        logger_topic(bag)
    assert "--logger-topic: /one, /two" in str(error.value)
