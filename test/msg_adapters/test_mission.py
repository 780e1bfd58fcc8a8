# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a mission, and of places (places.py)."""

import pytest

pytest.importorskip("diagnostic_msgs")
pytest.importorskip("nav_msgs")
pytest.importorskip("rclpy")
import math
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.mission import mission_from_message, mission_to_message
from msg_adapters.places import (
    path_to_places,
    plan_to_markers,
    plan_to_path,
    pose_to_message,
    transforms_from_message,
)
from soilmoist_ros.exploration import Forecast, MissionEnd, MissionStatus, Phase, Stop, Transform, yaw_rotation
from soilmoist_ros.exploration.guard.robot_frames import TransformTree
from soilmoist_ros.foundation.plain_values import foreign_text
from soilmoist_ros.sensing.gnss import UNKNOWN_COVARIANCE

NUMBER = st.floats(0, 1e9)
WORD = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=20).map(foreign_text)
STATUS = st.builds(
    MissionStatus, now_s=NUMBER, phase=st.sampled_from(Phase), reason=WORD,
    target=st.none() | st.builds(Stop, WORD, NUMBER, NUMBER), planned_dwell_s=NUMBER, dwell_s=NUMBER,
    progress=NUMBER, time_used_s=NUMBER, time_left_s=NUMBER, distance_m=NUMBER, samples=st.integers(0, 99),
    counting_s=NUMBER, raw_counts=st.integers(0, 9999), failures=st.integers(0, 9),
    blacklisted=st.lists(WORD, max_size=3).map(tuple), estimated_end_s=st.none() | NUMBER,
    needs_operator=st.booleans(), silent=st.booleans(), hindered=st.booleans(),
    ended=st.none() | st.sampled_from(MissionEnd),
    forecast=st.none() | st.just(Forecast(0.03, (60.0, 600.0), (0.02, 0.01), (1.1, 1.2), 0.01, 4.0, wrong=0.06)),
)  # fmt: skip
QUIET = MissionStatus(
    now_s=math.nan, phase=Phase.IDLE, reason="waiting for start", target=None, planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0,
    failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip


@given(STATUS)
def test_a_status_comes_back(status):
    message = deserialize_message(serialize_message(mission_to_message(status, {"more": "x"})), DiagnosticStatus)
    assert mission_from_message(message) == status


@pytest.mark.parametrize(
    ("change", "level"),
    [
        ({}, 0),
        ({"phase": Phase.COUNTING, "reason": "counting at a (ami:0.03)"}, 0),
        ({"phase": Phase.TRAVELLING, "failures": 1}, 1),
        ({"phase": Phase.PAUSED, "reason": "paused by the operator"}, 1),
        ({"phase": Phase.PAUSED, "reason": "s3 skipped because robot_2 goes there; still paused"}, 1),
        ({"phase": Phase.COUNTING, "reason": "no record from this stop for 60 s", "silent": True}, 1),
        ({"phase": Phase.PAUSED, "reason": "5 failures: ask by the operator", "needs_operator": True}, 2),
    ],
)
def test_the_level_says_whether_somebody_is_needed(change, level):
    assert mission_to_message(replace(QUIET, **change)).level == bytes([level])


def test_what_people_read():
    status = replace(QUIET, phase=Phase.PLANNING, reason="started", estimated_end_s=1780300800.0)
    message = mission_to_message(status)
    values = {pair.key: pair.value for pair in message.values}
    assert (message.name, message.message) == ("mission", "planning: started")
    assert values["estimated_end"] == "2026-06-01T08:00:00+00:00"
    assert values["reason"] == "started"
    assert values["forecast"] == ""
    forecast = Forecast(0.03, (600.0,), (0.02,), (1.2,), 0.02, 4.0)
    values = {pair.key: pair.value for pair in mission_to_message(replace(status, forecast=forecast)).values}
    assert values["forecast"] == "±3.0 % of the rate now, ±2.0 % (1.7 to 2.4) in 10 min"


def test_alarms_of_another_form_say_nothing_and_control_characters_of_other_robots_do_not_come_in():
    for alarms in ("5", '"other_robot"', "null", '["other_robot"]'):
        paused = mission_to_message(replace(QUIET, phase=Phase.PAUSED), {"alarms": alarms})
        assert not mission_from_message(paused).yields
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    status = replace(QUIET, reason=odd, target=Stop(odd, 1.0, 2.0), blacklisted=(odd,), queue=(odd,))
    found = mission_from_message(mission_to_message(status))
    assert {found.reason, found.target.name, *found.blacklisted, *found.queue} == {"north 5"}


# Places ----------------------------------------------------------------------------------------------------------

METRES = st.floats(-1e4, 1e4)
STOPS = st.lists(st.builds(Stop, st.text("abc", min_size=1), METRES, METRES), max_size=6)
AREAS = st.lists(st.lists(st.tuples(METRES, METRES), min_size=3, max_size=5).map(tuple), max_size=2).map(tuple)


@given(STOPS)
def test_places_come_back_in_order(stops):
    path = plan_to_path(stops, 1e9)
    path = deserialize_message(serialize_message(path), type(path))
    assert path_to_places(path) == [(stop.x_m, stop.y_m) for stop in stops]
    assert (path.header.frame_id, path.header.stamp.sec) == ("map", 10**9)


@pytest.mark.slow
@given(STOPS, AREAS)
def test_markers_replace_all_before_and_name_each_stop_and_area(stops, areas):
    array = deserialize_message(serialize_message(plan_to_markers(stops, 400.4, areas, 1e9)), MarkerArray)
    assert array.markers[0].action == Marker.DELETEALL
    texts = [marker.text for marker in array.markers if marker.type == Marker.TEXT_VIEW_FACING and marker.text]
    assert texts == [f"{number}: {stop.name}, 400 s" for number, stop in enumerate(stops, 1)]
    keys = [(marker.ns, marker.id) for marker in array.markers[1:]]
    assert len(set(keys)) == len(keys), "no marker replaces another"
    assert all(marker.pose.orientation.w == 1.0 and marker.color.a > 0 for marker in array.markers[1:])
    lines = {marker.ns: [] for marker in array.markers}
    for marker in array.markers:
        if marker.type == Marker.LINE_STRIP:
            lines[marker.ns].append(len(marker.points))
    assert lines.get("way", []) == ([len(stops)] if len(stops) > 1 else [])
    assert lines.get("ruled_out", []) == [len(area) + 1 for area in areas], "closed lines"


# Transforms and poses as messages -------------------------------------------------------------------------------


class Message:
    """Like a tf2_msgs/TFMessage, which may not be built."""

    def __init__(self, *transforms):
        self.transforms = transforms


def stamped(parent, child, x, y, yaw):
    message = TransformStamped()
    message.header.frame_id, message.child_frame_id = parent, child
    message.header.stamp.sec, message.header.stamp.nanosec = 7, 500_000_000
    message.transform.translation.x, message.transform.translation.y = x, y
    rotation = message.transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = yaw_rotation(yaw)
    return message


def test_transforms_of_a_message():
    message = Message(stamped("/map", "odom", 1.0, 2.0, 0.5), stamped("odom", "base_link", 3.0, 0.0, 0.0))
    first, second = transforms_from_message(message, static=False)
    assert first == Transform("map", "odom", (1.0, 2.0, 0.0), yaw_rotation(0.5), 7.5)
    tree = TransformTree()
    tree.add([first, second], 8.0)
    assert tree.pose("base_link", "map", 8.0).yaw_rad == pytest.approx(0.5)
    assert transforms_from_message(Message(stamped("a", "b", 0.0, 0.0, 0.0)), static=True)[0].static


def test_the_pose_has_the_covariance_of_the_fix_and_what_is_unknown_a_large_variance():
    covariance = ((0.04, 0.01, 0.0), (0.01, 0.09, 0.0), (0.0, 0.0, 1.0))
    message = pose_to_message((3.0, 4.0), math.pi / 2, covariance, 7.5, "field")
    assert (message.header.frame_id, message.header.stamp.sec) == ("field", 7)
    pose, known = message.pose.pose, message.pose.covariance
    assert (pose.position.x, pose.position.y) == (3.0, 4.0)
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    unknown = pose_to_message((3.0, 4.0), math.nan, UNKNOWN_COVARIANCE, 7.5, "map").pose
    assert unknown.pose.orientation.w == 1.0
    assert list(known[[0, 1, 6, 7]]) == [0.04, 0.01, 0.01, 0.09]
    assert list(unknown.covariance[[0, 1, 6, 7]]) == [1e6, 0.0, 0.0, 1e6]
    assert known[35] < 0.1 < 30.0 < unknown.covariance[35]
