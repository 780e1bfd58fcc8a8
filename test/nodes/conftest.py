# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with real nodes."""

import platform
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

try:
    from ros_system import RosSystem
except ImportError:
    if platform.machine() == "x86_64":
        raise  # there the wheels are part of the set-up: these tests are never skipped
    RosSystem = None


@pytest.fixture
def ros(tmp_path):
    """An isolated ROS system."""
    if RosSystem is None:
        pytest.skip("rclpy is not installed, and there are no wheels of it for this machine")
    with RosSystem(tmp_path) as system:
        yield system
