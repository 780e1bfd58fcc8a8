# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Poses along a tree of transforms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.robot_frames import Transform, TransformTree, yaw_rotation

NAN = math.nan
metres = st.floats(-1000, 1000)
turns = st.floats(-math.pi, math.pi)


def link(parent, child, x=0.0, y=0.0, yaw=0.0, **more):
    return Transform(parent, child, (x, y, 0.3), yaw_rotation(yaw), **more)


def tree(*links, now_s=100.0):
    grown = TransformTree()
    grown.add(links, now_s)
    return grown


def matrix(x, y, yaw):
    return np.array([(math.cos(yaw), -math.sin(yaw), x), (math.sin(yaw), math.cos(yaw), y), (0, 0, 1)])


@given(*(st.tuples(metres, metres, turns) for _ in range(3)))
def test_poses_follow_the_links_of_both_branches(first, second, third):
    """earth -> map -> odom -> base_link, and the same seen from map."""
    grown = tree(link("earth", "map", *first), link("map", "odom", *second), link("odom", "base_link", *third))
    wanted = matrix(*second) @ matrix(*third)
    pose = grown.pose("base_link", "map", 101.0)
    assert (pose.x_m, pose.y_m) == pytest.approx(tuple(wanted[:2, 2]), abs=1e-6)
    assert math.cos(pose.yaw_rad - second[2] - third[2]) == pytest.approx(1.0)
    back = grown.pose("map", "base_link", 101.0)
    assert (back.x_m, back.y_m) == pytest.approx(tuple(np.linalg.inv(wanted)[:2, 2]), abs=1e-6)


def test_siblings_meet_in_their_common_parent():
    grown = tree(link("root", "a", 10.0, 0.0, math.pi / 2), link("root", "b", 10.0, 5.0))
    pose = grown.pose("b", "a", 100.0)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((5.0, 0.0, -math.pi / 2))


def test_a_rotation_of_any_length_counts():
    scaled = Transform("map", "base_link", (1.0, 2.0, 0.0), (0.0, 0.0, 3.0, 3.0))
    assert tree(scaled).pose("base_link", "map", 0.0).yaw_rad == pytest.approx(math.pi / 2)


def test_the_age_is_that_of_the_oldest_link_that_is_not_static():
    grown = tree(link("odom", "base_link", stamp_s=102.0))  # stamped ahead of its arrival
    grown.add([link("map", "odom", stamp_s=101.0)], 103.0)
    grown.add([link("base_link", "gnss", stamp_s=40.0, static=True)], 50.0)
    assert grown.pose("gnss", "map", 104.0).age_s == pytest.approx(4.0)
    grown.add([link("odom", "base_link", stamp_s=103.5)], 103.6)
    assert grown.pose("gnss", "map", 104.0).age_s == pytest.approx(3.0)
    assert tree(link("map", "base_link", static=True)).pose("base_link", "map", 1e9).age_s == 0.0


def test_the_newest_counts_and_an_older_one_is_ignored_unless_the_clock_was_set_back():
    grown = tree(link("map", "base_link", 1.0, stamp_s=50.0))
    grown.add([link("map", "base_link", 2.0, stamp_s=49.0)], 101.0)
    assert grown.pose("base_link", "map", 101.0).x_m == 1.0
    grown.add([link("map", "base_link", 3.0, stamp_s=10.0)], 102.0)
    assert grown.pose("base_link", "map", 102.0).x_m == 3.0


@pytest.mark.parametrize(
    "bad",
    [
        Transform("map", "base_link", (NAN, 0.0, 0.0)),
        Transform("map", "base_link", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        Transform("base_link", "base_link", (0.0, 0.0, 0.0)),
    ],
)
def test_an_impossible_transform_is_ignored(bad):
    assert len(tree(bad)) == 0


def test_what_is_not_connected_is_named():
    grown = tree(link("odom", "base_link"), link("world", "map"))
    assert grown.pose("base_link", "map", 0.0) is None
    assert grown.gap("base_link", "map") == "TF does not connect base_link with map"
    assert grown.gap("base_footprint", "map") == "TF has no frame base_footprint"
    assert grown.gap("base_link", "utm") == "TF has no frame utm"


def test_a_circle_of_frames_ends():
    grown = tree(link("a", "b"), link("b", "c"), link("c", "a"))
    assert grown.pose("b", "map", 0.0) is None
