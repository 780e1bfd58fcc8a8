# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages that are made without ROS are those of the adapters, as ROS reads them."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import String

from msg_adapters import counts_to_message, fix_to_message, line_to_message, quarantined_to_message
from msg_adapters.environment import health_to_status
from msg_adapters.point_cloud import points_to_message
from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.recording import PlainTopics, count_records, find_definition
from soilmoist_ros.recording.bag.plain_topics import GNSS_FRAME
from soilmoist_ros.sensing import CountRecord, fix_from_message

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
