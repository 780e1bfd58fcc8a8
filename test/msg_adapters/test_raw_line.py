# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes of devices over the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from msg_adapters.raw_line import line_from_message, line_to_message


@given(st.binary())
def test_every_byte_comes_back(line):
    message = deserialize_message(serialize_message(line_to_message(line)), String)
    assert line_from_message(message) == line


def test_another_text_is_refused():
    with pytest.raises(ValueError, match="latin-1"):
        line_from_message(String(data="\N{SNOWMAN}"))
