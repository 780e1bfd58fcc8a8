# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data with a known truth: surrogate fields, simulated missions, and virtual robots, loggers and receivers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.simulation.campaign.campaign import load_campaign, run_campaign
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field, surrogate_field_names
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
    from soilmoist_ros.simulation.mission.result import MappedProperty, MissionResult
    from soilmoist_ros.simulation.mission.settings import MissionSettings, PropertySettings
    from soilmoist_ros.simulation.mission.simulator import simulate_mission
    from soilmoist_ros.simulation.system import VirtualSystem

__all__ = [
    "MappedProperty",
    "MissionResult",
    "MissionSettings",
    "PropertySettings",
    "SurrogateField",
    "VirtualSystem",
    "load_campaign",
    "run_campaign",
    "simulate_mission",
    "surrogate_field",
    "surrogate_field_names",
]

__getattr__ = load_on_use(__name__, __file__)
