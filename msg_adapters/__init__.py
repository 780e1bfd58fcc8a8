# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Core dataclasses <-> ROS messages."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from msg_adapters.counts import counts_from_message as counts_from_message, counts_to_message as counts_to_message, line_to_message as line_to_message, quarantined_to_message as quarantined_to_message, require_plane as require_plane, samples_from_message as samples_from_message, samples_to_message as samples_to_message
    from msg_adapters.environment import battery_from_message as battery_from_message, diagnostics_from_message as diagnostics_from_message, diagnostics_to_message as diagnostics_to_message, fix_to_message as fix_to_message, health_from_status as health_from_status, weather_to_messages as weather_to_messages
    from msg_adapters.mission import mission_from_message as mission_from_message, mission_to_message as mission_to_message
    from msg_adapters.model import Model as Model, model_from_message as model_from_message, model_to_message as model_to_message
    from msg_adapters.places import path_to_places as path_to_places, plan_to_markers as plan_to_markers, plan_to_path as plan_to_path, pose_stamped as pose_stamped, pose_to_message as pose_to_message, transforms_from_message as transforms_from_message
    from msg_adapters.point_cloud import FRAME as FRAME, OtherFrameError as OtherFrameError, require_frame as require_frame, to_seconds as to_seconds, to_time as to_time
    from msg_adapters.soil_map import filter_info as filter_info, mask_to_message as mask_to_message, soil_map_from_message as soil_map_from_message, soil_map_to_message as soil_map_to_message, uncertainty_to_message as uncertainty_to_message
    from msg_adapters.soilmoist_types import mission_state_to_message as mission_state_to_message, reply_from_message as reply_from_message, reply_to_message as reply_to_message, request_from_message as request_from_message, request_to_message as request_to_message, survey_from_message as survey_from_message, visit_from_message as visit_from_message, visit_to_message as visit_to_message
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "counts": "counts_from_message counts_to_message line_to_message quarantined_to_message require_plane samples_from_message samples_to_message",
        "environment": "battery_from_message diagnostics_from_message diagnostics_to_message fix_to_message health_from_status weather_to_messages",
        "mission": "mission_from_message mission_to_message",
        "model": "Model model_from_message model_to_message",
        "places": "path_to_places plan_to_markers plan_to_path pose_stamped pose_to_message transforms_from_message",
        "point_cloud": "FRAME OtherFrameError require_frame to_seconds to_time",
        "soil_map": "filter_info mask_to_message soil_map_from_message soil_map_to_message uncertainty_to_message",
        "soilmoist_types": "mission_state_to_message reply_from_message reply_to_message request_from_message request_to_message survey_from_message visit_from_message visit_to_message",
    },
)
