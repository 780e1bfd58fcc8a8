# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data with a known truth: surrogate fields, simulated missions, and virtual robots, loggers and receivers."""

from importlib import import_module
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.simulation.fields.catalogue import known_field as known_field, surrogate_field as surrogate_field, surrogate_field_names as surrogate_field_names
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField as SurrogateField, simulated_site as simulated_site, write_field_file as write_field_file, write_site_file as write_site_file
    from soilmoist_ros.simulation.fields.truth_file import load_surrogate as load_surrogate
    from soilmoist_ros.simulation.mission.channel import mission_fields as mission_fields, mission_properties as mission_properties
    from soilmoist_ros.simulation.mission.mission_ground import mission_map as mission_map
    from soilmoist_ros.simulation.mission.mission_result import MapErrors as MapErrors, MappedProperty as MappedProperty, MissionResult as MissionResult, Moment as Moment, SeriesRow as SeriesRow, TimedForecast as TimedForecast, achieved as achieved, forecast_texts as forecast_texts, map_errors as map_errors, reported as reported, series_columns as series_columns
    from soilmoist_ros.simulation.mission.settings import PRESETS as PRESETS, SETTINGS as SETTINGS, MissionSettings as MissionSettings, PropertySettings as PropertySettings, Setting as Setting
    from soilmoist_ros.simulation.mission.simulator import simulate_mission as simulate_mission
    from soilmoist_ros.simulation.robot.scenario import load_scenario as load_scenario
    from soilmoist_ros.simulation.robot.simulated_links import LineServer as LineServer, Reachable as Reachable, Sent as Sent, write_ports_file as write_ports_file
    from soilmoist_ros.simulation.robot.simulated_time import CLOCK_PART as CLOCK_PART, MAX_STEP_S as MAX_STEP_S, WAITS_FOR as WAITS_FOR, RobotProgress as RobotProgress, SimulatedTime as SimulatedTime, WaitingClock as WaitingClock, end_to_react_to as end_to_react_to, read_start_time as read_start_time
    from soilmoist_ros.simulation.robot.virtual_navigation import NO_VALID_PATH as NO_VALID_PATH, GoalEnded as GoalEnded, GoalOutcome as GoalOutcome, Localised as Localised, OnRoute as OnRoute, Remaining as Remaining, ServerPresent as ServerPresent
    from soilmoist_ros.simulation.system import GNSS as GNSS, LOGGER as LOGGER, Output as Output, PropertyCounted as PropertyCounted, SimulatedRobot as SimulatedRobot, VirtualSystem as VirtualSystem, robot_namespaces as robot_namespaces
    # fmt: on

_open, __dir__, __all__ = open_door(
    __name__,
    {
        "fields.catalogue": "known_field surrogate_field surrogate_field_names",
        "fields.surrogate_field": "SurrogateField simulated_site write_field_file write_site_file",
        "fields.truth_file": "load_surrogate",
        "mission.channel": "mission_fields mission_properties",
        "mission.mission_ground": "mission_map",
        "mission.mission_result": "MapErrors MappedProperty MissionResult Moment SeriesRow TimedForecast achieved forecast_texts map_errors reported series_columns",
        "mission.settings": "MissionSettings PRESETS PropertySettings SETTINGS Setting",
        "mission.simulator": "simulate_mission",
        "robot.scenario": "load_scenario",
        "robot.simulated_links": "LineServer Reachable Sent write_ports_file",
        "robot.simulated_time": "CLOCK_PART MAX_STEP_S RobotProgress SimulatedTime WAITS_FOR WaitingClock end_to_react_to read_start_time",
        "robot.virtual_navigation": "GoalEnded GoalOutcome Localised NO_VALID_PATH OnRoute Remaining ServerPresent",
        "system": "GNSS LOGGER Output PropertyCounted SimulatedRobot VirtualSystem robot_namespaces",
    },
)


def __getattr__(name: str) -> object:
    """Name of this door; campaigns have moved to ``soilmoist_ros.lab``, and are found here for one release."""
    if name in ("load_campaign", "run_campaign"):
        return getattr(import_module("soilmoist_ros.lab"), name)
    return _open(name)
