# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transforms and poses as messages."""

import math

import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import TransformStamped

from msg_adapters.transforms import pose_to_message, transforms_from_message
from soilmoist_ros.exploration.guard.robot_frames import Transform, TransformTree, yaw_rotation
from soilmoist_ros.sensing.gnss import UNKNOWN_COVARIANCE


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


def test_the_pose_has_the_covariance_of_the_fix():
    covariance = ((0.04, 0.01, 0.0), (0.01, 0.09, 0.0), (0.0, 0.0, 1.0))
    message = pose_to_message((3.0, 4.0), math.pi / 2, covariance, 7.5, "field")
    assert (message.header.frame_id, message.header.stamp.sec) == ("field", 7)
    pose = message.pose.pose
    assert (pose.position.x, pose.position.y) == (3.0, 4.0)
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    assert list(message.pose.covariance[[0, 1, 6, 7]]) == [0.04, 0.01, 0.01, 0.09]
    assert message.pose.covariance[35] < 0.1


def test_what_is_unknown_has_a_large_variance():
    message = pose_to_message((3.0, 4.0), math.nan, UNKNOWN_COVARIANCE, 7.5, "map")
    assert message.pose.pose.orientation.w == 1.0
    assert list(message.pose.covariance[[0, 1, 7]]) == [1e6, 0.0, 1e6]
    assert message.pose.covariance[35] > 30.0
