# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags: what is in them (info.py), playback.py and plain_topics.py."""

import pytest

pytest.importorskip("rclpy")
import io
import math
from dataclasses import replace

import numpy as np
from bags import MODEL, NOTES, PRESSURE, START_NS, number_message, text_message
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from rich.console import Console
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import String

from msg_adapters import counts_to_message, fix_to_message, line_to_message, quarantined_to_message
from msg_adapters.environment import health_to_status
from msg_adapters.point_cloud import points_to_message
from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.recording import BagReader, BagWriter, PlainTopics, count_records, find_definition
from soilmoist_ros.recording.bag.info import info_table, print_plain
from soilmoist_ros.recording.bag.plain_topics import GNSS_FRAME
from soilmoist_ros.recording.bag.playback import INPUTS, Pacer, Playback, TopicChoice
from soilmoist_ros.recording.bag.verify import bag_info
from soilmoist_ros.sensing import CountRecord, fix_from_message


def shown(content):
    console = Console(file=io.StringIO(), width=60)
    print_plain(console, content)
    return console.file.getvalue()


def test_a_whole_bag(bag):
    info = bag_info(bag.folder)
    assert info.whole
    assert (info.storage, info.remedy, info.recording) == ("mcap", "", False)
    assert info.extent.messages == 24
    assert info.size_bytes == bag.path.stat().st_size
    assert [(topic.name, topic.extent.messages, topic.interval_s) for topic in info.topics] == [
        ("/notes", 8, 3.0),
        ("/pressure", 8, 3.0),
        ("/robot/model", 8, 3.0),
    ]
    assert info.topics[1].size_bytes == 8 * len(number_message(0.0))
    text = shown(info_table(info))
    assert "24 messages in 23 s from 2026-05-28 20:26:40Z" in text
    assert "/robot/model" in text
    assert "whole" in text


@pytest.mark.parametrize("name", ["/a[/b]", "/a[link=http://evil.example]b", "/a\x1b]0;title\x07"])
def test_a_terminal_shows_names_of_topics_and_obeys_nothing_in_them(tmp_path, name):
    with BagWriter(tmp_path / "bag") as writer:
        topic = replace(NOTES, name=name, definition=replace(NOTES.definition, type_name=f"std_msgs/msg/{name}"))
        writer.write(topic, START_NS, START_NS, text_message("x"))
    console = Console(file=io.StringIO(), width=200, force_terminal=True, color_system=None)
    print_plain(console, info_table(bag_info(tmp_path / "bag")))
    text = console.file.getvalue()
    assert name.encode("unicode_escape").decode() in text
    assert "\x1b]" not in text


def test_a_bag_that_is_being_recorded_is_left_alone(tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        writer.write(NOTES, START_NS, START_NS, text_message("x"))
        writer.flush()
        info = bag_info(tmp_path / "run")
    assert info.recording
    assert info.extent.messages == 1
    assert "being recorded now" in shown(info_table(info))


def test_the_longest_silence_of_a_topic_is_found(tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        writer.write(NOTES, START_NS, START_NS, text_message("once"))
        for second in [*range(500, 700, 10), *range(0, 200, 10)]:  # the clock was set back
            writer.write(PRESSURE, START_NS + second * 10**9, START_NS, number_message(1.0))
    once, topic = bag_info(tmp_path / "run").topics
    assert (topic.interval_s, topic.silent_s) == (pytest.approx(10), pytest.approx(310))
    assert topic.silent_from_s == pytest.approx(START_NS * 1e-9 + 190)
    assert (once.interval_s, once.silent_s, once.silent_from_s) == (None, None, None)
    assert "5 min from 20:29:50Z" in shown(info_table(bag_info(tmp_path / "run")))


# Playback --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("start", range(24))
def test_all_from_the_start_on_after_the_last_that_is_latched(bag, start):
    with BagReader(bag.folder) as reader:
        playback = Playback(reader, ".*", float(start))
        found = [(message.topic, message.log_ns, message.data) for message in playback.messages()]
    before = [one for one in bag.messages[:start] if one[0] == MODEL.name]
    assert found == [*before[-1:], *bag.messages[start:]]


def test_only_what_is_chosen_and_how_it_was_offered(bag):
    with BagReader(bag.folder) as reader:
        playback = Playback(reader, "/notes|/robot/.*")
        playback.leave_out(MODEL.name)
        assert {message.topic for message in playback.messages()} == {NOTES.name}
        assert playback.offered(MODEL.name) == MODEL.offered
        assert not playback.has_clock
        assert (playback.share(START_NS), playback.share(playback.end_ns)) == (0.0, 1.0)


def test_inputs_are_what_the_nodes_take_in_whatever_their_namespace():
    choice = TopicChoice(INPUTS)
    assert all(choice.wanted(name) for name in ("/counts", "/r1/counts", "/fix", "/a/b/raw/logger"))
    assert not any(choice.wanted(name) for name in ("/samples", "/model", "/r1/mission", "/discounts", "/rosout"))


@given(speed=st.floats(0.01, 200), steps=st.lists(st.floats(0, 10), max_size=30))
def test_time_passes_at_its_speed_but_not_to_make_up_for_lost_time(speed, steps):
    pacer, passed_s = Pacer(START_NS, speed), 0.0
    for elapsed_s in steps:
        pacer.step(elapsed_s)
        passed_s += min(elapsed_s, 0.1)
    assert (pacer.now_ns - START_NS) * 1e-9 == pytest.approx(passed_s * speed, abs=1e-7)
    assert pacer.wait_s(pacer.now_ns + 10**9) == pytest.approx(1 / speed)
    assert pacer.wait_s(pacer.now_ns) == pacer.wait_s(START_NS) == 0


# Plain topics ----------------------------------------------------------------------------------------------------

RECORD = CountRecord(1795780684.415, 10.1, -20.2, 30.0, 41, 10.0, 9.7, 0.97, 1.05, 1.0)
DATUM = (53.25, 10.5)
TOPICS = PlainTopics()


def as_ros(made, kind):
    topic, message = made
    name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
    assert topic.definition.type_name == name
    assert topic.definition.type_hash == find_definition(name).type_hash
    return deserialize_message(TOPICS.data(topic, message), kind)


def test_records():
    made = TOPICS.counts(RECORD, DATUM)
    assert made[0].name == "/counts"
    assert as_ros(made, PointCloud2) == counts_to_message([RECORD], datum=DATUM)
    unplaced = replace(RECORD, x_m=math.nan)
    assert not as_ros(TOPICS.counts(unplaced, DATUM), PointCloud2).is_dense
    (read,) = count_records(made[1])
    assert (read.stamp_s, read.raw_counts, read.f_humidity) == (RECORD.stamp_s, 41, 1.05)


def test_quarantined_records():
    bad = replace(RECORD, quarantine="place_jump", raw_counts=2**40)
    made = TOPICS.counts(bad, DATUM)
    assert made[0].name == "/quarantined_counts"
    assert as_ros(made, PointCloud2) == quarantined_to_message([bad])


def test_maps_lines_fixes_and_states_of_health():
    cells = np.zeros((2, 3), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rate", "<f4")])
    made = TOPICS.topic("/soil_map", "sensor_msgs/msg/PointCloud2"), TOPICS.cloud(cells, 7.5)
    assert as_ros(made, PointCloud2) == points_to_message(cells, 7.5)
    line = bytes(range(1, 256)) + b"\0"
    assert as_ros(TOPICS.line("/raw/logger", line), String) == line_to_message(line)
    message = NavSatFix(latitude=53.2, longitude=10.4, altitude=70.0, position_covariance_type=2)
    message.header.stamp.sec, message.status.status = 12, 0
    message.position_covariance = [0.04, 0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.2]
    fix = fix_from_message(message)
    assert as_ros(TOPICS.fix(fix), NavSatFix) == fix_to_message(fix, GNSS_FRAME)
    health = Health("mission", Level.WARN, "paused: by Anna", {"state": "paused"})
    assert as_ros(TOPICS.health("/mission", health), DiagnosticStatus) == health_to_status(health)


def test_visits():
    pytest.importorskip("soilmoist_msgs")
    from soilmoist_msgs.msg import Visit as VisitMessage

    from msg_adapters.soilmoist_types import visit_to_message

    visit = Visit(
        "r1c2", 1.0, 2.0, 30.0, 60.0, 180, "far", records=6, exposure_s=60.0, effective_exposure_s=58.0,
        ended=VisitEnd.ENOUGH, outcome="180 counts", dwell="fmi:60", arrival_stamp_s=1e9, end_stamp_s=1e9 + 60,
        stop_x_m=1.5, stop_y_m=2.5,
    )  # fmt: skip
    assert as_ros(TOPICS.visit(visit), VisitMessage) == visit_to_message(visit)
