# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Core dataclasses <-> ROS messages."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from msg_adapters.counts import counts_from_message as counts_from_message
    from msg_adapters.counts import counts_to_message as counts_to_message
    from msg_adapters.counts import counts_to_messages as counts_to_messages
    from msg_adapters.counts import line_to_message as line_to_message
    from msg_adapters.counts import quarantined_to_message as quarantined_to_message
    from msg_adapters.counts import require_plane as require_plane
    from msg_adapters.counts import samples_from_message as samples_from_message
    from msg_adapters.counts import samples_to_message as samples_to_message
    from msg_adapters.environment import battery_from_message as battery_from_message
    from msg_adapters.environment import diagnostics_from_message as diagnostics_from_message
    from msg_adapters.environment import diagnostics_to_message as diagnostics_to_message
    from msg_adapters.environment import fix_to_message as fix_to_message
    from msg_adapters.environment import health_from_status as health_from_status
    from msg_adapters.environment import weather_to_messages as weather_to_messages
    from msg_adapters.mission import mission_from_message as mission_from_message
    from msg_adapters.mission import mission_to_message as mission_to_message
    from msg_adapters.model import Model as Model
    from msg_adapters.model import model_from_message as model_from_message
    from msg_adapters.model import model_to_message as model_to_message
    from msg_adapters.places import path_to_places as path_to_places
    from msg_adapters.places import plan_to_markers as plan_to_markers
    from msg_adapters.places import plan_to_path as plan_to_path
    from msg_adapters.places import pose_stamped as pose_stamped
    from msg_adapters.places import pose_to_message as pose_to_message
    from msg_adapters.places import transforms_from_message as transforms_from_message
    from msg_adapters.point_cloud import FRAME as FRAME
    from msg_adapters.point_cloud import OtherFrameError as OtherFrameError
    from msg_adapters.point_cloud import require_frame as require_frame
    from msg_adapters.point_cloud import to_seconds as to_seconds
    from msg_adapters.point_cloud import to_time as to_time
    from msg_adapters.soil_map import change_from_message as change_from_message
    from msg_adapters.soil_map import change_to_message as change_to_message
    from msg_adapters.soil_map import filter_info as filter_info
    from msg_adapters.soil_map import mask_to_message as mask_to_message
    from msg_adapters.soil_map import soil_map_from_message as soil_map_from_message
    from msg_adapters.soil_map import soil_map_to_message as soil_map_to_message
    from msg_adapters.soil_map import uncertainty_to_message as uncertainty_to_message
    from msg_adapters.soilmoist_types import map_summary_to_message as map_summary_to_message
    from msg_adapters.soilmoist_types import mission_state_to_message as mission_state_to_message
    from msg_adapters.soilmoist_types import reply_from_message as reply_from_message
    from msg_adapters.soilmoist_types import reply_to_message as reply_to_message
    from msg_adapters.soilmoist_types import request_from_message as request_from_message
    from msg_adapters.soilmoist_types import request_to_message as request_to_message
    from msg_adapters.soilmoist_types import survey_from_message as survey_from_message
    from msg_adapters.soilmoist_types import visit_from_message as visit_from_message
    from msg_adapters.soilmoist_types import visit_to_message as visit_to_message

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "counts": "counts_from_message counts_to_message counts_to_messages line_to_message quarantined_to_message require_plane samples_from_message samples_to_message",
        "environment": "battery_from_message diagnostics_from_message diagnostics_to_message fix_to_message health_from_status weather_to_messages",
        "mission": "mission_from_message mission_to_message",
        "model": "Model model_from_message model_to_message",
        "places": "path_to_places plan_to_markers plan_to_path pose_stamped pose_to_message transforms_from_message",
        "point_cloud": "FRAME OtherFrameError require_frame to_seconds to_time",
        "soil_map": "change_from_message change_to_message filter_info mask_to_message soil_map_from_message soil_map_to_message uncertainty_to_message",
        "soilmoist_types": "map_summary_to_message mission_state_to_message reply_from_message reply_to_message request_from_message request_to_message survey_from_message visit_from_message visit_to_message",
    },
)
