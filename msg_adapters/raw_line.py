# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines of the devices <-> std_msgs/String, so that a replay can start from the bytes."""

from __future__ import annotations

from std_msgs.msg import String

# A ROS string ends at the first zero. Latin-1 lacks this character, so every line is restored exactly.
_ZERO = "\N{SYMBOL FOR NULL}"


def line_to_message(line: bytes) -> String:
    """Message of a line: each byte is one character."""
    return String(data=line.decode("latin-1").replace("\0", _ZERO))


def line_from_message(message: String) -> bytes:
    """Line of a message.

    :raises ValueError: if the message is not from :func:`line_to_message`
    """
    return str(message.data).replace(_ZERO, "\0").encode("latin-1")
