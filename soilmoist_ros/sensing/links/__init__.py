# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sources of lines: TCP, UDP, serial ports and recorded files behind one interface."""

from soilmoist_ros.sensing.links.line_source import LineSource, LinkState, LinkStatus
from soilmoist_ros.sensing.links.open_source import open_source

__all__ = ["LineSource", "LinkState", "LinkStatus", "open_source"]
