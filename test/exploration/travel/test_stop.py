# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals along a route, and their headings."""

import math
import subprocess
import sys

import pytest

from soilmoist_ros.exploration.travel.stop import Stop, way_points

STOP = Stop("s", 10.0, 0.0)


@pytest.mark.parametrize(
    ("way", "goals"),
    [
        ([(10, -5), (10, 0)], [(10, 0, 90)]),
        ([(0, 5), (0, 0), (0, 0)], [(0, 0, -90), (10, 0, 0)]),  # the stop is no corner of the way
        ([(10, 0)], [(10, 0, 0)]),
        ([(10, 0), (10, 0)], [(10, 0, 0)]),
        ([(0, 0), (4, 4), (4, 0), (10, 0)], [(4, 4, 45), (4, 0, -90), (10, 0, 0)]),
        ([(0, 0), (2, 0), (4, 0), (10, 0)], [(10, 0, 0)]),  # nodes on a straight line are no goals
        ([(0, 0), (12, 0), (10, 0)], [(12, 0, 0), (10, 0, 180)]),  # a way back is kept
    ],
)
def test_goals_are_the_bends_of_a_way_and_its_stop_and_face_along_it(way, goals):
    found = way_points(way, STOP)
    assert [(one.stop.x_m, one.stop.y_m, round(math.degrees(one.heading_rad))) for one in found] == goals
    assert found[-1].stop == STOP
    assert all("s" in one.stop.name for one in found)


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
