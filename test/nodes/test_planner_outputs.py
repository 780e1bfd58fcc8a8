# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A real planner publishes the fence for the costmaps of Nav2."""

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("nav2_msgs")
from nav2_msgs.msg import CostmapFilterInfo
from nav_msgs.msg import OccupancyGrid

from soilmoist_ros.nodes.topics import LATCHED

FIELD = """
datum: {latitude_deg: 53.0, longitude_deg: -0.5}
polygon: [[0, 0], [40, 0], [40, 30], [0, 30]]
no_go: [[[10, 10], [20, 10], [20, 20], [10, 20]]]
cell_m: 5
"""


def test_mask_and_filter_info_are_latched(ros, tmp_path):
    (tmp_path / "field.yaml").write_text(FIELD)
    given = {"field": str(tmp_path / "field.yaml"), "graph": "free", "navigator": "goal_pose"}
    ros.start("planner", params={**given, "keepout_topic": "keepout", "frame": "plane"}, namespace="/robot")
    masks = ros.collect(OccupancyGrid, "/robot/keepout", LATCHED)
    infos = ros.collect(CostmapFilterInfo, "/robot/costmap_filter_info", LATCHED)
    ros.wait_for(lambda: masks and infos)
    mask, info = masks[0], infos[0]
    assert (info.filter_mask_topic, info.type) == ("/robot/keepout", 0)
    assert (info.base, info.multiplier) == (0.0, 1.0)
    assert (mask.header.frame_id, info.header.frame_id) == ("plane", "plane")
    cells = np.array(mask.data).reshape(mask.info.height, mask.info.width)
    row, column = (
        round((at - low) / mask.info.resolution)
        for at, low in ((15.0, mask.info.origin.position.y), (15.0, mask.info.origin.position.x))
    )
    assert cells[row, column] == 100, "in the no-go area"
    assert cells[row, column + round(10 / mask.info.resolution)] == 0
    assert cells[0, 0] == 100
