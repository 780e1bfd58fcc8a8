"""Data of known truth: surrogate fields, simulated missions, and virtual robots, loggers and receivers."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from soilmoist_ros.simulation.campaign.campaign import load_campaign as load_campaign
    from soilmoist_ros.simulation.campaign.campaign import run_campaign as run_campaign
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field as surrogate_field
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names as surrogate_field_names
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField as SurrogateField
    from soilmoist_ros.simulation.mission.result import MappedProperty as MappedProperty
    from soilmoist_ros.simulation.mission.result import MissionResult as MissionResult
    from soilmoist_ros.simulation.mission.settings import MissionSettings as MissionSettings
    from soilmoist_ros.simulation.mission.settings import PropertySettings as PropertySettings
    from soilmoist_ros.simulation.mission.simulator import simulate_mission as simulate_mission
    from soilmoist_ros.simulation.system import VirtualSystem as VirtualSystem

_HOMES = {
    "MappedProperty": "mission.result",
    "MissionResult": "mission.result",
    "MissionSettings": "mission.settings",
    "PropertySettings": "mission.settings",
    "SurrogateField": "fields.surrogate_field",
    "VirtualSystem": "system",
    "load_campaign": "campaign.campaign",
    "run_campaign": "campaign.campaign",
    "simulate_mission": "mission.simulator",
    "surrogate_field": "fields.catalogue",
    "surrogate_field_names": "fields.catalogue",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used: they need scipy and more."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
