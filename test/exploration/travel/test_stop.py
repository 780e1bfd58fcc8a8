# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals along a route, and their headings."""

import math
import subprocess
import sys

import pytest

from soilmoist_ros.exploration.travel.stop import Stop, WayPoint, way_points

STOP = Stop("s", 10.0, 0.0)


def test_a_straight_way_is_one_goal_that_faces_along_it():
    assert way_points([(10.0, -5.0), (10.0, 0.0)], STOP) == (WayPoint(STOP, math.pi / 2),)


def test_a_stop_that_is_no_corner_of_the_way_is_its_end():
    first, last = way_points([(0.0, 0.0), (0.0, 5.0), (0.0, 5.0)], Stop("s", 5.0, 5.0))
    assert (first.stop.x_m, first.stop.y_m, first.heading_rad) == (0.0, 5.0, math.pi / 2)
    assert last.heading_rad == 0.0
    assert "s" in first.stop.name


@pytest.mark.parametrize("way", [[(10.0, 0.0)], [(10.0, 0.0), (10.0, 0.0)]])
def test_without_a_way_there_is_no_heading(way):
    assert way_points(way, STOP) == (WayPoint(STOP, 0.0),)


def test_each_heading_comes_from_the_corner_before():
    way = [(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (10.0, 0.0)]
    headings = [round(math.degrees(point.heading_rad)) for point in way_points(way, STOP)]
    assert headings == [45, -90, 0]


def test_nodes_on_a_straight_line_are_no_goals():
    way = [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (10.0, 0.0)]
    assert way_points(way, STOP) == (WayPoint(STOP, 0.0),)


def test_a_way_back_is_kept():
    way = [(0.0, 0.0), (12.0, 0.0), (10.0, 0.0)]
    assert [(point.stop.x_m, round(point.heading_rad, 3)) for point in way_points(way, STOP)] == [
        (12.0, 0.0), (10.0, 3.142),
    ]  # fmt: skip


ASK_AT_ONCE = """
from threading import Thread
import numpy as np
from soilmoist_ros.exploration.travel.stop import DrivableArea

outline, pond = [(0, 0), (50, 0), (50, 50), (0, 50)], [(20, 20), (30, 20), (30, 30), (20, 30)]

def ask(area, seed):
    rng = np.random.default_rng(seed)
    for _ in range(100):
        start, end = rng.uniform(0, 50, (2, 20, 2))
        area.contains(start)
        area.allows(start, end)

for _ in range(30):
    area = DrivableArea([outline], [pond], 0.5)
    threads = [Thread(target=ask, args=(area, seed)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
"""


@pytest.mark.slow
def test_planning_and_guard_may_ask_at_once():
    """In a process that may crash: two threads that use one prepared geometry crash it."""
    assert subprocess.run([sys.executable, "-c", ASK_AT_ONCE], check=False).returncode == 0
