# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with real nodes."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))


def ros_system(folder):
    pytest.importorskip("rclpy")
    from ros_system import RosSystem

    return RosSystem(folder)


@pytest.fixture
def ros(tmp_path):
    """An isolated ROS system."""
    with ros_system(tmp_path) as system:
        yield system


@pytest.fixture(scope="module")
def shared_ros(tmp_path_factory):
    """An isolated ROS system of all tests of a file."""
    with ros_system(tmp_path_factory.mktemp("ros")) as system:
        yield system
