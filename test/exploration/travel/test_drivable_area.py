# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the robot may drive, asked by several threads at once (drivable_area.py; see test_travel.py too)."""

import subprocess
import sys

import pytest

ASK_AT_ONCE = """
from threading import Thread
import numpy as np
from soilmoist_ros.exploration.travel.drivable_area import DrivableArea

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
