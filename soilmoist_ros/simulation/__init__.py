# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data with a known truth: surrogate fields, simulated missions, and virtual robots, loggers and receivers."""

from importlib import import_module
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.simulation.fields.catalogue import known_field as known_field
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field as surrogate_field
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names as surrogate_field_names
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField as SurrogateField
    from soilmoist_ros.simulation.fields.surrogate_field import simulated_site as simulated_site
    from soilmoist_ros.simulation.fields.surrogate_field import write_field_file as write_field_file
    from soilmoist_ros.simulation.fields.surrogate_field import write_site_file as write_site_file
    from soilmoist_ros.simulation.fields.surrogate_field import write_truth_file as write_truth_file
    from soilmoist_ros.simulation.fields.truth_file import has_truth as has_truth
    from soilmoist_ros.simulation.fields.truth_file import load_surrogate as load_surrogate
    from soilmoist_ros.simulation.mission.channel import mission_fields as mission_fields
    from soilmoist_ros.simulation.mission.channel import mission_properties as mission_properties
    from soilmoist_ros.simulation.mission.efficiency import mission_efficiency as mission_efficiency
    from soilmoist_ros.simulation.mission.mission_ground import mission_map as mission_map
    from soilmoist_ros.simulation.mission.mission_result import MapErrors as MapErrors
    from soilmoist_ros.simulation.mission.mission_result import MappedProperty as MappedProperty
    from soilmoist_ros.simulation.mission.mission_result import MissionResult as MissionResult
    from soilmoist_ros.simulation.mission.mission_result import Moment as Moment
    from soilmoist_ros.simulation.mission.mission_result import SeriesRow as SeriesRow
    from soilmoist_ros.simulation.mission.mission_result import TimedForecast as TimedForecast
    from soilmoist_ros.simulation.mission.mission_result import achieved as achieved
    from soilmoist_ros.simulation.mission.mission_result import forecast_text as forecast_text
    from soilmoist_ros.simulation.mission.mission_result import map_errors as map_errors
    from soilmoist_ros.simulation.mission.mission_result import reported as reported
    from soilmoist_ros.simulation.mission.mission_result import series_columns as series_columns
    from soilmoist_ros.simulation.mission.settings import PRESETS as PRESETS
    from soilmoist_ros.simulation.mission.settings import SETTINGS as SETTINGS
    from soilmoist_ros.simulation.mission.settings import MissionSettings as MissionSettings
    from soilmoist_ros.simulation.mission.settings import PropertySettings as PropertySettings
    from soilmoist_ros.simulation.mission.settings import Setting as Setting
    from soilmoist_ros.simulation.mission.simulator import simulate_mission as simulate_mission
    from soilmoist_ros.simulation.robot.scenario import load_scenario as load_scenario
    from soilmoist_ros.simulation.robot.simulated_links import LineServer as LineServer
    from soilmoist_ros.simulation.robot.simulated_links import Reachable as Reachable
    from soilmoist_ros.simulation.robot.simulated_links import Sent as Sent
    from soilmoist_ros.simulation.robot.simulated_links import write_ports_file as write_ports_file
    from soilmoist_ros.simulation.robot.simulated_time import CLOCK_PART as CLOCK_PART
    from soilmoist_ros.simulation.robot.simulated_time import MAX_STEP_S as MAX_STEP_S
    from soilmoist_ros.simulation.robot.simulated_time import WAITS_FOR as WAITS_FOR
    from soilmoist_ros.simulation.robot.simulated_time import RobotProgress as RobotProgress
    from soilmoist_ros.simulation.robot.simulated_time import SimulatedTime as SimulatedTime
    from soilmoist_ros.simulation.robot.simulated_time import WaitingClock as WaitingClock
    from soilmoist_ros.simulation.robot.simulated_time import end_to_react_to as end_to_react_to
    from soilmoist_ros.simulation.robot.simulated_time import read_start_time as read_start_time
    from soilmoist_ros.simulation.robot.virtual_navigation import NO_VALID_PATH as NO_VALID_PATH
    from soilmoist_ros.simulation.robot.virtual_navigation import GoalEnded as GoalEnded
    from soilmoist_ros.simulation.robot.virtual_navigation import GoalOutcome as GoalOutcome
    from soilmoist_ros.simulation.robot.virtual_navigation import Localised as Localised
    from soilmoist_ros.simulation.robot.virtual_navigation import OnRoute as OnRoute
    from soilmoist_ros.simulation.robot.virtual_navigation import Remaining as Remaining
    from soilmoist_ros.simulation.robot.virtual_navigation import ServerPresent as ServerPresent
    from soilmoist_ros.simulation.system import GNSS as GNSS
    from soilmoist_ros.simulation.system import LOGGER as LOGGER
    from soilmoist_ros.simulation.system import Output as Output
    from soilmoist_ros.simulation.system import PropertyCounted as PropertyCounted
    from soilmoist_ros.simulation.system import SimulatedRobot as SimulatedRobot
    from soilmoist_ros.simulation.system import VirtualSystem as VirtualSystem
    from soilmoist_ros.simulation.system import robot_namespaces as robot_namespaces

_open, __dir__, __all__ = open_door(
    __name__,
    {
        "fields.catalogue": "known_field surrogate_field surrogate_field_names",
        "fields.surrogate_field": "SurrogateField simulated_site write_field_file write_site_file write_truth_file",
        "fields.truth_file": "has_truth load_surrogate",
        "mission.channel": "mission_fields mission_properties",
        "mission.efficiency": "mission_efficiency",
        "mission.mission_ground": "mission_map",
        "mission.mission_result": "MapErrors MappedProperty MissionResult Moment SeriesRow TimedForecast achieved forecast_text map_errors reported series_columns",
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
