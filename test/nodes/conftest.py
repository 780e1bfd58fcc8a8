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


def pytest_collection_modifyitems(items):
    """Run a test with real processes once more if it fails.

    They share the machine with whatever else runs there: a message that waits a second for a processor has waited
    minutes of a mission in simulated time. What is broken fails twice.
    """
    here = Path(__file__).resolve().parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.flaky(reruns=1))
