# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The plan as path and markers."""

import pytest

pytest.importorskip("nav_msgs")
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.plan import path_to_places, plan_to_markers, plan_to_path, pose_stamped
from soilmoist_ros.exploration.travel.stop import Stop

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


def test_a_pose_takes_numbers_of_any_kind():
    import numpy as np

    pose = pose_stamped(np.float32(1.5), 2, 0.0)
    assert (pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w) == (1.5, 2.0, 1.0)
