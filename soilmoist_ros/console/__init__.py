# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The operator's console: a web page that shows a survey while it runs, and steers the robots. Without ROS."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.console.board import Board as Board, RobotHistory as RobotHistory, VisitHistory as VisitHistory
    from soilmoist_ros.console.guide_page import BORDER as BORDER, FieldBorder as FieldBorder, GuidePage as GuidePage
    from soilmoist_ros.console.guided_survey import GuidedSurvey as GuidedSurvey, GuideSettings as GuideSettings
    from soilmoist_ros.console.map_layers import MapLayers as MapLayers, live_dose as live_dose
    from soilmoist_ros.console.plan_routes import SurveyFiles as SurveyFiles
    from soilmoist_ros.console.plan_work import Walk as Walk
    from soilmoist_ros.console.server import ConsoleServer as ConsoleServer, Steering as Steering
    from soilmoist_ros.console.views import battery_view as battery_view, choices_view as choices_view, field_view as field_view, graph_views as graph_views, health_view as health_view, mission_view as mission_view, place_views as place_views
    from soilmoist_ros.console.visitors import LOOPBACK as LOOPBACK, PORT as PORT, Access as Access, free_port as free_port, invitation as invitation, reachable as reachable
    from soilmoist_ros.console.watched_mission import WatchedMission as WatchedMission
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "board": "Board RobotHistory VisitHistory",
        "guide_page": "BORDER FieldBorder GuidePage",
        "guided_survey": "GuideSettings GuidedSurvey",
        "map_layers": "MapLayers live_dose",
        "plan_routes": "SurveyFiles",
        "plan_work": "Walk",
        "server": "ConsoleServer Steering",
        "views": "battery_view choices_view field_view graph_views health_view mission_view place_views",
        "visitors": "Access LOOPBACK PORT free_port invitation reachable",
        "watched_mission": "WatchedMission",
    },
)
