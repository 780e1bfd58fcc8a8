# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The operator's console: a web page that shows a survey while it runs, and steers the robots. Without ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.console.access import Access
    from soilmoist_ros.console.board import Board
    from soilmoist_ros.console.maps.map_layers import MapLayers
    from soilmoist_ros.console.server import ConsoleServer, Steering

__all__ = ["Access", "Board", "ConsoleServer", "MapLayers", "Steering"]

__getattr__ = load_on_use(__name__, __file__)
