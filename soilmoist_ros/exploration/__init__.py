# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Map, travel graph and clock to the next stop and the time to count there.

A :class:`Mission` is a pure state machine that :class:`MissionControl` runs on a robot and the simulator on its
clock. An :class:`Explorer` answers its plan requests by a :class:`Strategy`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.exploration.control.explorer import Explorer
    from soilmoist_ros.exploration.control.mission_control import MissionControl
    from soilmoist_ros.exploration.mission.mission import Mission
    from soilmoist_ros.exploration.mission.types import MissionRules
    from soilmoist_ros.exploration.mission.visit import Visit
    from soilmoist_ros.exploration.planning.dwell import DwellRule, parse_dwell
    from soilmoist_ros.exploration.strategies.registry import STRATEGIES, make_strategy
    from soilmoist_ros.exploration.strategies.strategy import Choice, Situation, Strategy

__all__ = [
    "STRATEGIES",
    "Choice",
    "DwellRule",
    "Explorer",
    "Mission",
    "MissionControl",
    "MissionRules",
    "Situation",
    "Strategy",
    "Visit",
    "make_strategy",
    "parse_dwell",
]

__getattr__ = load_on_use(__name__, __file__)
