# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a keep-out mask."""

import numpy as np
import pytest

pytest.importorskip("nav_msgs")
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters.nav2.keepout import filter_info, mask_to_message
from soilmoist_ros.exploration.guard.fence import KeepoutMask


def test_a_mask_is_an_occupancy_grid():
    mask = KeepoutMask(np.array([[0, 100, 0], [100, 100, 0]], np.int8), 0.25, (-3.5, 7.25))
    message = deserialize_message(serialize_message(mask_to_message(mask, 4.5, "navigation")), OccupancyGrid)
    assert (message.info.width, message.info.height, message.info.resolution) == (3, 2, 0.25)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-3.5, 7.25)
    assert message.info.origin.orientation.w == 1.0
    assert list(message.data) == [0, 100, 0, 100, 100, 0], "row by row, the lowest y first"
    assert (message.header.frame_id, message.header.stamp.sec) == ("navigation", 4)


def test_the_filter_is_told_where_the_mask_is():
    kind = pytest.importorskip("nav2_msgs.msg").CostmapFilterInfo
    message = deserialize_message(serialize_message(filter_info(kind, "/robot/keepout", 4.5, "map")), kind)
    assert (message.type, message.filter_mask_topic) == (0, "/robot/keepout")
    assert (message.base, message.multiplier, message.header.frame_id) == (0.0, 1.0, "map")
