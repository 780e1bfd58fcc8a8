# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps recorded runs and the logs of a survey."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.replay.bag_map import Replay, replay_bag
    from soilmoist_ros.replay.comparison import Comparison
    from soilmoist_ros.replay.log_map import MapSettings, map_logs
    from soilmoist_ros.replay.replay_settings import ReplaySettings

__all__ = ["Comparison", "MapSettings", "Replay", "ReplaySettings", "map_logs", "replay_bag"]

__getattr__ = load_on_use(__name__, __file__)
