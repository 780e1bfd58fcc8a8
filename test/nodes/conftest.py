# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with real nodes."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))


@pytest.fixture
def ros(tmp_path):
    pytest.importorskip("rclpy")
    from ros_system import RosSystem

    with RosSystem(tmp_path) as system:
        yield system
