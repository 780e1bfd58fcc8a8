# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps recorded runs and the logs of a survey."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.pipeline.bag_map import Replay as Replay
    from soilmoist_ros.pipeline.bag_map import replay_bag as replay_bag
    from soilmoist_ros.pipeline.comparison import Comparison as Comparison
    from soilmoist_ros.pipeline.file_facts import Finding as Finding
    from soilmoist_ros.pipeline.file_facts import contradictions as contradictions
    from soilmoist_ros.pipeline.file_facts import field_findings as field_findings
    from soilmoist_ros.pipeline.file_facts import graph_findings as graph_findings
    from soilmoist_ros.pipeline.file_facts import log_findings as log_findings
    from soilmoist_ros.pipeline.file_facts import logger_findings as logger_findings
    from soilmoist_ros.pipeline.file_facts import position_findings as position_findings
    from soilmoist_ros.pipeline.file_facts import site_findings as site_findings
    from soilmoist_ros.pipeline.file_facts import truth_findings as truth_findings
    from soilmoist_ros.pipeline.log_map import MapSettings as MapSettings
    from soilmoist_ros.pipeline.log_map import log_positions as log_positions
    from soilmoist_ros.pipeline.log_map import log_times as log_times
    from soilmoist_ros.pipeline.log_map import map_logs as map_logs
    from soilmoist_ros.pipeline.log_map import position_source as position_source
    from soilmoist_ros.pipeline.log_map import read_logs as read_logs
    from soilmoist_ros.pipeline.log_map import read_track as read_track
    from soilmoist_ros.pipeline.log_map import reading_of as reading_of
    from soilmoist_ros.pipeline.log_map import skipped_text as skipped_text
    from soilmoist_ros.pipeline.replay_settings import ReplaySettings as ReplaySettings

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "bag_map": "Replay replay_bag",
        "comparison": "Comparison",
        "file_facts": "Finding contradictions field_findings graph_findings log_findings logger_findings position_findings site_findings truth_findings",
        "log_map": "MapSettings log_positions log_times map_logs position_source read_logs read_track reading_of skipped_text",
        "replay_settings": "ReplaySettings",
    },
)
