# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interfaces that are imported at run time, and may be there in part only."""

from __future__ import annotations

import sys

import pytest

pytest.importorskip("rclpy")
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import String

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.action_navigator import action_class
from soilmoist_ros.nodes.topics import interface_class, other_type

# As rosidl generates a class, without the C library beside it.
GENERATED = """
class Meta(type):
    _TYPE_SUPPORT = None

    @classmethod
    def __import_type_support__(cls):
        try:
            {body}
        except ImportError:
            pass


class Drive(metaclass=Meta):
    class Goal:
        target = ""
"""
BODIES = {
    "no library": "from rosidl_generator_py import import_type_support; import_type_support('half_msgs')",
    "broken library": "raise ImportError('libhalf_msgs.so: cannot open shared object file')",
    "other version": "import sys; cls._TYPE_SUPPORT = sys.no_such_symbol",
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_type_without_type_support_is_a_message(tmp_path, monkeypatch, body):
    package = tmp_path / "half_msgs" / "action"
    package.mkdir(parents=True)
    (tmp_path / "half_msgs" / "__init__.py").touch()
    (package / "__init__.py").write_text(GENERATED.format(body=body))
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("half_msgs", "half_msgs.action"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(ImportError, match="its type support cannot be loaded"):
        interface_class("half_msgs/action/Drive")
    with pytest.raises(InputError, match=r"action/Drive' cannot be used: its type support .* source"):
        action_class("half_msgs/action/Drive", "target")


def test_a_type_that_is_there_and_one_that_is_not():
    assert interface_class("std_msgs/msg/String") is String
    with pytest.raises(ImportError, match="std_msgs has no msg 'Strin'"):
        interface_class("std_msgs/msg/Strin")
    with pytest.raises(ImportError, match="no_such_msgs"):
        interface_class("no_such_msgs/srv/Odd")


def test_positions_on_another_topic_are_found(ros):
    """A wrong namespace hears nothing, without a word."""
    expected = "sensor_msgs/msg/NavSatFix"
    assert other_type(ros.node, "fix", expected) == ""
    ros.node.create_publisher(NavSatFix, "/r1/gps/fix", 1)
    ros.wait_for(lambda: other_type(ros.node, "fix", expected))
    said = "nobody publishes /fix, but sensor_msgs/msg/NavSatFix is on /r1/gps/fix"
    assert other_type(ros.node, "fix", expected) == said
    ros.node.create_publisher(NavSatFix, "fix", 1)
    ros.wait_for(lambda: other_type(ros.node, "fix", expected) == "")
