"""Counted records of a bag in any condition: whole, interrupted, or still being written."""

from __future__ import annotations

import logging
from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import Any, Final

from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.recording.bag.mcap_scan import McapScan
from soilmoist_ros.recording.bag.point_cloud import count_records, quarantined_topic
from soilmoist_ros.recording.bag.recovery import mcap_files
from soilmoist_ros.sensing.records import CountRecord

CLOUD: Final = "sensor_msgs/msg/PointCloud2"

_log = logging.getLogger(__name__)


def stored_counts(bag: Path, topics: Collection[str], frame: str) -> list[CountRecord]:
    """Records of some topics, and the quarantined ones next to them, in the order of recording.

    What cannot be read is skipped.

    :param bag: folder of an MCAP bag; only read
    :param topics: full names of topics with counts
    :param frame: frame of the records; messages of others are skipped
    :raises InputError: if there is no MCAP file
    :raises OSError: if a file cannot be read
    """
    records: list[CountRecord] = []
    wanted = {*topics, *map(quarantined_topic, topics)}
    for path in mcap_files(bag):
        for message in McapScan(path).messages():
            if message.topic.name not in wanted or message.topic.definition.type_name != CLOUD:
                continue
            try:
                cloud = _store().deserialize_cdr(message.data, CLOUD)
                if cloud.header.frame_id == frame:
                    records += count_records(cloud)
            except ValueError as error:
                _log.warning("%s: a message of %s is skipped: %s", path, message.topic.name, error)
    return records


@cache
def _store() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)
