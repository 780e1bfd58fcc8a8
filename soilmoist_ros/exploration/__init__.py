# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Map, travel graph and clock to the next stop and the time to count there.

A :class:`Mission` is a pure state machine that :class:`MissionControl` runs on a robot and the simulator on its
clock. An :class:`Explorer` answers its plan requests by a :class:`Strategy`.
"""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.exploration.control.certified_stops import CertifiedStops as CertifiedStops, check_time as check_time
    from soilmoist_ros.exploration.control.explorer import STREAMS_PER_ROBOT as STREAMS_PER_ROBOT, Explorer as Explorer, ExplorerSettings as ExplorerSettings, nominal_rate_cps as nominal_rate_cps, planning_grid as planning_grid, strategy_stream as strategy_stream
    from soilmoist_ros.exploration.control.field_access import PAST_M as PAST_M, AccessRules as AccessRules, FieldAccess as FieldAccess, cell_stops as cell_stops
    from soilmoist_ros.exploration.control.mission_control import DATUM as DATUM, EXPOSURE as EXPOSURE, GUIDED as GUIDED, LEADS as LEADS, PLACE_TIME as PLACE_TIME, RECORD_STAMP as RECORD_STAMP, MissionControl as MissionControl, MissionSetup as MissionSetup
    from soilmoist_ros.exploration.control.mission_feed import MissionClock as MissionClock, boot_id as boot_id
    from soilmoist_ros.exploration.control.operator_request import OperatorRequest as OperatorRequest, Reply as Reply, ReplyCode as ReplyCode
    from soilmoist_ros.exploration.control.team import PendingMeasurement as PendingMeasurement, Team as Team, keep_apart_m as keep_apart_m, pending_measurement as pending_measurement
    from soilmoist_ros.exploration.guard.failsafes import FAILSAFES as FAILSAFES, LIMITS as LIMITS, Cause as Cause, WatchLimits as WatchLimits, chosen_response as chosen_response, consequence as consequence, find_cause as find_cause
    from soilmoist_ros.exploration.guard.fence import ROBOT_RADIUS_M as ROBOT_RADIUS_M, Fence as Fence, KeepoutMask as KeepoutMask, keepout_mask as keepout_mask, unreachable as unreachable
    from soilmoist_ros.exploration.guard.fenced_graph import FencedGraph as FencedGraph, Outside as Outside
    from soilmoist_ros.exploration.guard.robot_frames import FrameSettings as FrameSettings, RobotFrames as RobotFrames, Transform as Transform, yaw_rotation as yaw_rotation
    from soilmoist_ros.exploration.guard.signals import EmergencyTopic as EmergencyTopic, logger_fault as logger_fault
    from soilmoist_ros.exploration.guard.watch import POSES_FROZEN_S as POSES_FROZEN_S, Watch as Watch
    from soilmoist_ros.exploration.mission.events import ANYBODYS as ANYBODYS, FORGOTTEN as FORGOTTEN, Action as Action, CancelGoal as CancelGoal, Command as Command, Event as Event, Finish as Finish, GoalFailed as GoalFailed, GoalReached as GoalReached, GoTo as GoTo, Moved as Moved, Publish as Publish, RecordArrived as RecordArrived, RequestPlan as RequestPlan, StartCounting as StartCounting, Tick as Tick, VisitDone as VisitDone
    from soilmoist_ros.exploration.mission.journal import EVENT as EVENT, MissionJournal as MissionJournal, interrupted_mission as interrupted_mission, is_under_way as is_under_way
    from soilmoist_ros.exploration.mission.mission import Mission as Mission
    from soilmoist_ros.exploration.mission.state import state_from_json as state_from_json
    from soilmoist_ros.exploration.mission.types import MAX_UNTIL_SD as MAX_UNTIL_SD, OTHER_ROBOT as OTHER_ROBOT, PUBLISHED_MIN_LAST_DWELL_S as PUBLISHED_MIN_LAST_DWELL_S, STATUS_COUNTS as STATUS_COUNTS, STATUS_FLAGS as STATUS_FLAGS, STATUS_FLOATS as STATUS_FLOATS, TRIGGERS as TRIGGERS, Alarm as Alarm, Changes as Changes, MissionEnd as MissionEnd, MissionRules as MissionRules, MissionStatus as MissionStatus, Phase as Phase, Polygons as Polygons, Response as Response, Verb as Verb, status_health as status_health, status_level as status_level
    from soilmoist_ros.exploration.mission.visit import Visit as Visit, VisitEnd as VisitEnd
    from soilmoist_ros.exploration.navigation.goal_client import ACTIVE as ACTIVE, ENDED as ENDED, ActionStatus as ActionStatus, CancelSent as CancelSent, MAX_POSITIONS as MAX_POSITIONS, GoalClient as GoalClient, Listed as Listed, Request as Request, SendGoal as SendGoal, failure as failure, goal_mark as goal_mark, progress as progress
    from soilmoist_ros.exploration.navigation.navigator import Ended as Ended, Navigator as Navigator
    from soilmoist_ros.exploration.navigation.person import PERSON_ENTRY_M as PERSON_ENTRY_M, PersonNavigator as PersonNavigator, person_rules as person_rules, person_watch as person_watch
    from soilmoist_ros.exploration.navigation.pose_client import CancelAll as CancelAll, PoseClient as PoseClient, PoseRequest as PoseRequest, RobotTrack as RobotTrack, SendPose as SendPose, drivers as drivers
    from soilmoist_ros.exploration.planning.decision import OF_DOSE as OF_DOSE, Thresholds as Thresholds, check_target as check_target, check_thresholds as check_thresholds, parse_thresholds as parse_thresholds
    from soilmoist_ros.exploration.planning.dwell import DWELL_RULES as DWELL_RULES, DwellRule as DwellRule, Optimal as Optimal, dwell_rule as dwell_rule, parse_dwell as parse_dwell
    from soilmoist_ros.exploration.planning.forecast import Forecast as Forecast, forecast_from_text as forecast_from_text, forecast_to_text as forecast_to_text, hundredths as hundredths
    from soilmoist_ros.exploration.planning.planning_model import Counting as Counting, spread_cells as spread_cells
    from soilmoist_ros.exploration.planning.properties import Aim as Aim, Property as Property, correction_factor as correction_factor, property_name as property_name, property_weights as property_weights
    from soilmoist_ros.exploration.planning.sealed_sample import MIN_PLACES as MIN_PLACES, SealedSample as SealedSample, check_places as check_places, sample_from_text as sample_from_text
    from soilmoist_ros.exploration.strategies.registry import BUILT_IN as BUILT_IN, STRATEGIES as STRATEGIES, StrategyKind as StrategyKind, make_strategy as make_strategy, strategy_kind as strategy_kind, warm_up as warm_up
    from soilmoist_ros.exploration.strategies.strategy import Choice as Choice, Situation as Situation, Strategy as Strategy
    from soilmoist_ros.exploration.travel.lanes import LaneTravel as LaneTravel, read_travel_map as read_travel_map
    from soilmoist_ros.exploration.travel.stop import Stop as Stop, Way as Way, WayPoint as WayPoint, stops_xy as stops_xy, way_points as way_points
    from soilmoist_ros.exploration.travel.route_graph import route_graph_text as route_graph_text
    from soilmoist_ros.exploration.travel.swaths import swath_graph as swath_graph
    from soilmoist_ros.exploration.travel.topological_map import KNOWN_ACTIONS as KNOWN_ACTIONS, TopologicalMap as TopologicalMap, make_topological_map as make_topological_map, parse_topological_map as parse_topological_map, read_topological_map as read_topological_map, zone_radius_m as zone_radius_m
    from soilmoist_ros.exploration.travel.travel import FreeTravel as FreeTravel, GraphTravel as GraphTravel, LearnedMotion as LearnedMotion, RobotMotion as RobotMotion, TravelModel as TravelModel, polyline_length_m as polyline_length_m
    from soilmoist_ros.exploration.travel.travel_graph import TravelGraph as TravelGraph, crop_rows as crop_rows, open_lattice as open_lattice
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "control.certified_stops": "CertifiedStops check_time",
        "control.explorer": "Explorer ExplorerSettings STREAMS_PER_ROBOT nominal_rate_cps planning_grid strategy_stream",
        "control.field_access": "AccessRules FieldAccess PAST_M cell_stops",
        "control.mission_control": "DATUM EXPOSURE GUIDED LEADS MissionControl MissionSetup PLACE_TIME RECORD_STAMP",
        "control.mission_feed": "MissionClock boot_id",
        "control.operator_request": "OperatorRequest Reply ReplyCode",
        "control.team": "PendingMeasurement Team keep_apart_m pending_measurement",
        "guard.failsafes": "Cause FAILSAFES LIMITS WatchLimits chosen_response consequence find_cause",
        "guard.fence": "Fence KeepoutMask ROBOT_RADIUS_M keepout_mask unreachable",
        "guard.fenced_graph": "FencedGraph Outside",
        "guard.robot_frames": "FrameSettings RobotFrames Transform yaw_rotation",
        "guard.signals": "EmergencyTopic logger_fault",
        "guard.watch": "POSES_FROZEN_S Watch",
        "mission.events": "ANYBODYS Action CancelGoal Command Event FORGOTTEN Finish GoTo GoalFailed GoalReached Moved Publish RecordArrived RequestPlan StartCounting Tick VisitDone",
        "mission.journal": "EVENT MissionJournal interrupted_mission is_under_way",
        "mission.mission": "Mission",
        "mission.state": "state_from_json",
        "mission.types": "Alarm Changes MAX_UNTIL_SD MissionEnd MissionRules MissionStatus OTHER_ROBOT PUBLISHED_MIN_LAST_DWELL_S Phase Polygons Response STATUS_COUNTS STATUS_FLAGS STATUS_FLOATS TRIGGERS Verb status_health status_level",
        "mission.visit": "Visit VisitEnd",
        "navigation.goal_client": "ACTIVE ActionStatus CancelSent ENDED GoalClient Listed MAX_POSITIONS Request SendGoal failure goal_mark progress",
        "navigation.navigator": "Ended Navigator",
        "navigation.person": "PERSON_ENTRY_M PersonNavigator person_rules person_watch",
        "navigation.pose_client": "CancelAll PoseClient PoseRequest RobotTrack SendPose drivers",
        "planning.decision": "OF_DOSE Thresholds check_target check_thresholds parse_thresholds",
        "planning.dwell": "DWELL_RULES DwellRule Optimal dwell_rule parse_dwell",
        "planning.forecast": "Forecast forecast_from_text forecast_to_text hundredths",
        "planning.planning_model": "Counting spread_cells",
        "planning.properties": "Aim Property correction_factor property_name property_weights",
        "planning.sealed_sample": "MIN_PLACES SealedSample check_places sample_from_text",
        "strategies.registry": "BUILT_IN STRATEGIES StrategyKind make_strategy strategy_kind warm_up",
        "strategies.strategy": "Choice Situation Strategy",
        "travel.lanes": "LaneTravel read_travel_map",
        "travel.stop": "Stop Way WayPoint stops_xy way_points",
        "travel.route_graph": "route_graph_text",
        "travel.swaths": "swath_graph",
        "travel.topological_map": "KNOWN_ACTIONS TopologicalMap make_topological_map parse_topological_map read_topological_map zone_radius_m",
        "travel.travel": "FreeTravel GraphTravel LearnedMotion RobotMotion TravelModel polyline_length_m",
        "travel.travel_graph": "TravelGraph crop_rows open_lattice",
    },
)
