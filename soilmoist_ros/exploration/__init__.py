# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Map, travel graph and clock to the next stop and the time to count there.

A :class:`Mission` is a pure state machine that :class:`MissionControl` runs on a robot and the simulator on its
clock. An :class:`Explorer` answers its plan requests by a :class:`Strategy`.
"""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.exploration.control.explorer import STREAMS_PER_ROBOT as STREAMS_PER_ROBOT
    from soilmoist_ros.exploration.control.explorer import Explorer as Explorer
    from soilmoist_ros.exploration.control.explorer import ExplorerSettings as ExplorerSettings
    from soilmoist_ros.exploration.control.explorer import nominal_rate_cps as nominal_rate_cps
    from soilmoist_ros.exploration.control.explorer import planning_grid as planning_grid
    from soilmoist_ros.exploration.control.explorer import strategy_stream as strategy_stream
    from soilmoist_ros.exploration.control.field_access import PAST_M as PAST_M
    from soilmoist_ros.exploration.control.field_access import AccessRules as AccessRules
    from soilmoist_ros.exploration.control.field_access import FieldAccess as FieldAccess
    from soilmoist_ros.exploration.control.field_access import cell_stops as cell_stops
    from soilmoist_ros.exploration.control.mission_control import DATUM as DATUM
    from soilmoist_ros.exploration.control.mission_control import GUIDED as GUIDED
    from soilmoist_ros.exploration.control.mission_control import PLACE_TIME as PLACE_TIME
    from soilmoist_ros.exploration.control.mission_control import RECORD_STAMP as RECORD_STAMP
    from soilmoist_ros.exploration.control.mission_control import MissionControl as MissionControl
    from soilmoist_ros.exploration.control.mission_control import MissionSetup as MissionSetup
    from soilmoist_ros.exploration.control.mission_feed import MissionClock as MissionClock
    from soilmoist_ros.exploration.control.mission_feed import boot_id as boot_id
    from soilmoist_ros.exploration.control.operator_request import OperatorRequest as OperatorRequest
    from soilmoist_ros.exploration.control.operator_request import Reply as Reply
    from soilmoist_ros.exploration.control.operator_request import ReplyCode as ReplyCode
    from soilmoist_ros.exploration.control.team import PendingMeasurement as PendingMeasurement
    from soilmoist_ros.exploration.control.team import Team as Team
    from soilmoist_ros.exploration.control.team import keep_apart_m as keep_apart_m
    from soilmoist_ros.exploration.control.team import pending_measurement as pending_measurement
    from soilmoist_ros.exploration.guard.failsafes import FAILSAFES as FAILSAFES
    from soilmoist_ros.exploration.guard.failsafes import LIMITS as LIMITS
    from soilmoist_ros.exploration.guard.failsafes import Cause as Cause
    from soilmoist_ros.exploration.guard.failsafes import WatchLimits as WatchLimits
    from soilmoist_ros.exploration.guard.fence import ROBOT_RADIUS_M as ROBOT_RADIUS_M
    from soilmoist_ros.exploration.guard.fence import Fence as Fence
    from soilmoist_ros.exploration.guard.fence import KeepoutMask as KeepoutMask
    from soilmoist_ros.exploration.guard.fence import keepout_mask as keepout_mask
    from soilmoist_ros.exploration.guard.fence import unreachable as unreachable
    from soilmoist_ros.exploration.guard.fenced_graph import FencedGraph as FencedGraph
    from soilmoist_ros.exploration.guard.fenced_graph import Outside as Outside
    from soilmoist_ros.exploration.guard.robot_frames import ASKED_M as ASKED_M
    from soilmoist_ros.exploration.guard.robot_frames import ROBOT as ROBOT
    from soilmoist_ros.exploration.guard.robot_frames import FrameSettings as FrameSettings
    from soilmoist_ros.exploration.guard.robot_frames import RobotFrames as RobotFrames
    from soilmoist_ros.exploration.guard.robot_frames import Transform as Transform
    from soilmoist_ros.exploration.guard.robot_frames import yaw_rotation as yaw_rotation
    from soilmoist_ros.exploration.guard.signals import EmergencyTopic as EmergencyTopic
    from soilmoist_ros.exploration.guard.watch import POSES_FROZEN_S as POSES_FROZEN_S
    from soilmoist_ros.exploration.guard.watch import Watch as Watch
    from soilmoist_ros.exploration.mission.events import ANYBODYS as ANYBODYS
    from soilmoist_ros.exploration.mission.events import FORGOTTEN as FORGOTTEN
    from soilmoist_ros.exploration.mission.events import Action as Action
    from soilmoist_ros.exploration.mission.events import CancelGoal as CancelGoal
    from soilmoist_ros.exploration.mission.events import Command as Command
    from soilmoist_ros.exploration.mission.events import Event as Event
    from soilmoist_ros.exploration.mission.events import Finish as Finish
    from soilmoist_ros.exploration.mission.events import GoalFailed as GoalFailed
    from soilmoist_ros.exploration.mission.events import GoalReached as GoalReached
    from soilmoist_ros.exploration.mission.events import GoTo as GoTo
    from soilmoist_ros.exploration.mission.events import Moved as Moved
    from soilmoist_ros.exploration.mission.events import Publish as Publish
    from soilmoist_ros.exploration.mission.events import RecordArrived as RecordArrived
    from soilmoist_ros.exploration.mission.events import RequestPlan as RequestPlan
    from soilmoist_ros.exploration.mission.events import StartCounting as StartCounting
    from soilmoist_ros.exploration.mission.events import Tick as Tick
    from soilmoist_ros.exploration.mission.events import VisitDone as VisitDone
    from soilmoist_ros.exploration.mission.journal import EVENT as EVENT
    from soilmoist_ros.exploration.mission.journal import MissionJournal as MissionJournal
    from soilmoist_ros.exploration.mission.journal import interrupted_mission as interrupted_mission
    from soilmoist_ros.exploration.mission.journal import interrupted_records as interrupted_records
    from soilmoist_ros.exploration.mission.journal import is_under_way as is_under_way
    from soilmoist_ros.exploration.mission.mission import Mission as Mission
    from soilmoist_ros.exploration.mission.state import state_from_json as state_from_json
    from soilmoist_ros.exploration.mission.types import MAX_UNTIL_SD as MAX_UNTIL_SD
    from soilmoist_ros.exploration.mission.types import OTHER_ROBOT as OTHER_ROBOT
    from soilmoist_ros.exploration.mission.types import PUBLISHED_MIN_LAST_DWELL_S as PUBLISHED_MIN_LAST_DWELL_S
    from soilmoist_ros.exploration.mission.types import READY as READY
    from soilmoist_ros.exploration.mission.types import STATUS_COUNTS as STATUS_COUNTS
    from soilmoist_ros.exploration.mission.types import STATUS_FLAGS as STATUS_FLAGS
    from soilmoist_ros.exploration.mission.types import STATUS_FLOATS as STATUS_FLOATS
    from soilmoist_ros.exploration.mission.types import TRIGGERS as TRIGGERS
    from soilmoist_ros.exploration.mission.types import Alarm as Alarm
    from soilmoist_ros.exploration.mission.types import Changes as Changes
    from soilmoist_ros.exploration.mission.types import MissionEnd as MissionEnd
    from soilmoist_ros.exploration.mission.types import MissionRules as MissionRules
    from soilmoist_ros.exploration.mission.types import MissionStatus as MissionStatus
    from soilmoist_ros.exploration.mission.types import OnSilence as OnSilence
    from soilmoist_ros.exploration.mission.types import Phase as Phase
    from soilmoist_ros.exploration.mission.types import Polygons as Polygons
    from soilmoist_ros.exploration.mission.types import Response as Response
    from soilmoist_ros.exploration.mission.types import Verb as Verb
    from soilmoist_ros.exploration.mission.types import status_health as status_health
    from soilmoist_ros.exploration.mission.types import status_level as status_level
    from soilmoist_ros.exploration.mission.visit import Visit as Visit
    from soilmoist_ros.exploration.mission.visit import VisitEnd as VisitEnd
    from soilmoist_ros.exploration.navigation.goal_client import ACTIVE as ACTIVE
    from soilmoist_ros.exploration.navigation.goal_client import ENDED as ENDED
    from soilmoist_ros.exploration.navigation.goal_client import ActionStatus as ActionStatus
    from soilmoist_ros.exploration.navigation.goal_client import CancelSent as CancelSent
    from soilmoist_ros.exploration.navigation.goal_client import GoalClient as GoalClient
    from soilmoist_ros.exploration.navigation.goal_client import GoalLimits as GoalLimits
    from soilmoist_ros.exploration.navigation.goal_client import Listed as Listed
    from soilmoist_ros.exploration.navigation.goal_client import Request as Request
    from soilmoist_ros.exploration.navigation.goal_client import SendGoal as SendGoal
    from soilmoist_ros.exploration.navigation.goal_client import failure as failure
    from soilmoist_ros.exploration.navigation.goal_client import goal_mark as goal_mark
    from soilmoist_ros.exploration.navigation.goal_client import progress as progress
    from soilmoist_ros.exploration.navigation.navigator import Ended as Ended
    from soilmoist_ros.exploration.navigation.navigator import Navigator as Navigator
    from soilmoist_ros.exploration.navigation.person import PERSON_ENTRY_M as PERSON_ENTRY_M
    from soilmoist_ros.exploration.navigation.person import PersonNavigator as PersonNavigator
    from soilmoist_ros.exploration.navigation.person import person_rules as person_rules
    from soilmoist_ros.exploration.navigation.person import person_watch as person_watch
    from soilmoist_ros.exploration.navigation.pose_client import CancelAll as CancelAll
    from soilmoist_ros.exploration.navigation.pose_client import PoseClient as PoseClient
    from soilmoist_ros.exploration.navigation.pose_client import PoseRequest as PoseRequest
    from soilmoist_ros.exploration.navigation.pose_client import RobotTrack as RobotTrack
    from soilmoist_ros.exploration.navigation.pose_client import SendPose as SendPose
    from soilmoist_ros.exploration.navigation.pose_client import drivers as drivers
    from soilmoist_ros.exploration.planning.dwell import DWELL_RULES as DWELL_RULES
    from soilmoist_ros.exploration.planning.dwell import DwellRule as DwellRule
    from soilmoist_ros.exploration.planning.dwell import Optimal as Optimal
    from soilmoist_ros.exploration.planning.dwell import dwell_rule as dwell_rule
    from soilmoist_ros.exploration.planning.dwell import parse_dwell as parse_dwell
    from soilmoist_ros.exploration.planning.forecast import Forecast as Forecast
    from soilmoist_ros.exploration.planning.forecast import forecast_from_text as forecast_from_text
    from soilmoist_ros.exploration.planning.forecast import forecast_to_text as forecast_to_text
    from soilmoist_ros.exploration.planning.forecast import hundredths as hundredths
    from soilmoist_ros.exploration.planning.planning_model import MIN_RATE_CPS as MIN_RATE_CPS
    from soilmoist_ros.exploration.planning.planning_model import spread_cells as spread_cells
    from soilmoist_ros.exploration.planning.properties import Property as Property
    from soilmoist_ros.exploration.planning.properties import correction_factor as correction_factor
    from soilmoist_ros.exploration.planning.properties import property_name as property_name
    from soilmoist_ros.exploration.planning.properties import property_weights as property_weights
    from soilmoist_ros.exploration.planning.prospect import Counting as Counting
    from soilmoist_ros.exploration.strategies.registry import BUILT_IN as BUILT_IN
    from soilmoist_ros.exploration.strategies.registry import STRATEGIES as STRATEGIES
    from soilmoist_ros.exploration.strategies.registry import StrategyKind as StrategyKind
    from soilmoist_ros.exploration.strategies.registry import make_strategy as make_strategy
    from soilmoist_ros.exploration.strategies.registry import strategy_kind as strategy_kind
    from soilmoist_ros.exploration.strategies.registry import warm_up as warm_up
    from soilmoist_ros.exploration.strategies.strategy import Choice as Choice
    from soilmoist_ros.exploration.strategies.strategy import Situation as Situation
    from soilmoist_ros.exploration.strategies.strategy import Strategy as Strategy
    from soilmoist_ros.exploration.travel.stop import Stop as Stop
    from soilmoist_ros.exploration.travel.stop import Way as Way
    from soilmoist_ros.exploration.travel.stop import WayPoint as WayPoint
    from soilmoist_ros.exploration.travel.stop import stops_xy as stops_xy
    from soilmoist_ros.exploration.travel.stop import way_points as way_points
    from soilmoist_ros.exploration.travel.topological_map import KNOWN_ACTIONS as KNOWN_ACTIONS
    from soilmoist_ros.exploration.travel.topological_map import TopologicalMap as TopologicalMap
    from soilmoist_ros.exploration.travel.topological_map import make_topological_map as make_topological_map
    from soilmoist_ros.exploration.travel.topological_map import parse_topological_map as parse_topological_map
    from soilmoist_ros.exploration.travel.topological_map import read_topological_map as read_topological_map
    from soilmoist_ros.exploration.travel.topological_map import zone_radius_m as zone_radius_m
    from soilmoist_ros.exploration.travel.travel import FreeTravel as FreeTravel
    from soilmoist_ros.exploration.travel.travel import GraphTravel as GraphTravel
    from soilmoist_ros.exploration.travel.travel import LearnedMotion as LearnedMotion
    from soilmoist_ros.exploration.travel.travel import RobotMotion as RobotMotion
    from soilmoist_ros.exploration.travel.travel import TravelModel as TravelModel
    from soilmoist_ros.exploration.travel.travel import polyline_length_m as polyline_length_m
    from soilmoist_ros.exploration.travel.travel import polyline_turn_rad as polyline_turn_rad
    from soilmoist_ros.exploration.travel.travel_graph import TravelGraph as TravelGraph
    from soilmoist_ros.exploration.travel.travel_graph import crop_rows as crop_rows
    from soilmoist_ros.exploration.travel.travel_graph import open_lattice as open_lattice

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "control.explorer": "Explorer ExplorerSettings STREAMS_PER_ROBOT nominal_rate_cps planning_grid strategy_stream",
        "control.field_access": "AccessRules FieldAccess PAST_M cell_stops",
        "control.mission_control": "DATUM GUIDED MissionControl MissionSetup PLACE_TIME RECORD_STAMP",
        "control.mission_feed": "MissionClock boot_id",
        "control.operator_request": "OperatorRequest Reply ReplyCode",
        "control.team": "PendingMeasurement Team keep_apart_m pending_measurement",
        "guard.failsafes": "Cause FAILSAFES LIMITS WatchLimits",
        "guard.fence": "Fence KeepoutMask ROBOT_RADIUS_M keepout_mask unreachable",
        "guard.fenced_graph": "FencedGraph Outside",
        "guard.robot_frames": "ASKED_M FrameSettings ROBOT RobotFrames Transform yaw_rotation",
        "guard.signals": "EmergencyTopic",
        "guard.watch": "POSES_FROZEN_S Watch",
        "mission.events": "ANYBODYS Action CancelGoal Command Event FORGOTTEN Finish GoTo GoalFailed GoalReached Moved Publish RecordArrived RequestPlan StartCounting Tick VisitDone",
        "mission.journal": "EVENT MissionJournal interrupted_mission interrupted_records is_under_way",
        "mission.mission": "Mission",
        "mission.state": "state_from_json",
        "mission.types": "Alarm Changes MAX_UNTIL_SD MissionEnd MissionRules MissionStatus OTHER_ROBOT OnSilence PUBLISHED_MIN_LAST_DWELL_S Phase Polygons READY Response STATUS_COUNTS STATUS_FLAGS STATUS_FLOATS TRIGGERS Verb status_health status_level",
        "mission.visit": "Visit VisitEnd",
        "navigation.goal_client": "ACTIVE ActionStatus CancelSent ENDED GoalClient GoalLimits Listed Request SendGoal failure goal_mark progress",
        "navigation.navigator": "Ended Navigator",
        "navigation.person": "PERSON_ENTRY_M PersonNavigator person_rules person_watch",
        "navigation.pose_client": "CancelAll PoseClient PoseRequest RobotTrack SendPose drivers",
        "planning.dwell": "DWELL_RULES DwellRule Optimal dwell_rule parse_dwell",
        "planning.forecast": "Forecast forecast_from_text forecast_to_text hundredths",
        "planning.planning_model": "MIN_RATE_CPS spread_cells",
        "planning.properties": "Property correction_factor property_name property_weights",
        "planning.prospect": "Counting",
        "strategies.registry": "BUILT_IN STRATEGIES StrategyKind make_strategy strategy_kind warm_up",
        "strategies.strategy": "Choice Situation Strategy",
        "travel.stop": "Stop Way WayPoint stops_xy way_points",
        "travel.topological_map": "KNOWN_ACTIONS TopologicalMap make_topological_map parse_topological_map read_topological_map zone_radius_m",
        "travel.travel": "FreeTravel GraphTravel LearnedMotion RobotMotion TravelModel polyline_length_m polyline_turn_rad",
        "travel.travel_graph": "TravelGraph crop_rows open_lattice",
    },
)
