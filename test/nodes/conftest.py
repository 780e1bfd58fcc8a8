# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with real nodes."""

import contextlib
import fcntl
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))


@contextlib.contextmanager
def turn(places: int) -> Iterator[None]:
    """Wait until fewer than so many tests of this user, in whatever process, have nodes."""
    stem = Path(tempfile.gettempdir(), f"soilmoist_ros-nodes-{os.getuid()}")
    names = [stem.with_suffix(f".{number}") for number in range(places)]
    while True:
        for name in names:
            with name.open("w") as file:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    continue
                yield
                return
        time.sleep(0.1)


@pytest.fixture(autouse=True)
def a_core_for_the_nodes():
    """At most one test with nodes for each core: three systems at a multiple of real time starve each other."""
    with turn(os.cpu_count() or 1):
        yield


@pytest.fixture
def ros(tmp_path):
    """An isolated ROS system."""
    pytest.importorskip("rclpy")
    from ros_system import RosSystem

    with RosSystem(tmp_path) as system:
        yield system
