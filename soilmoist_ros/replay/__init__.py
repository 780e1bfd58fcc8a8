# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Old name of :mod:`soilmoist_ros.pipeline`, kept for one release."""

import warnings

from soilmoist_ros.pipeline import MapSettings, ReplaySettings, map_logs, replay_bag

__all__ = ["MapSettings", "ReplaySettings", "map_logs", "replay_bag"]

warnings.warn("soilmoist_ros.replay is now soilmoist_ros.pipeline", DeprecationWarning, stacklevel=2)
