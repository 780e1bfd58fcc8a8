# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counted records of a bag in any condition: whole, interrupted, or still being written."""

from __future__ import annotations

import logging
import struct
from collections import Counter
from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import Any, Final

from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.recording.bag.info import BagInfo
from soilmoist_ros.recording.bag.point_cloud import QUARANTINED, count_records, quarantined_topic
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.bag.storage import TOO_MUCH
from soilmoist_ros.recording.bag.verify import mcap_files
from soilmoist_ros.recording.mcap.chunks import Allowance, TooMuchError
from soilmoist_ros.recording.mcap.scan import McapScan
from soilmoist_ros.sensing import CountRecord

CLOUD: Final = "sensor_msgs/msg/PointCloud2"

_log = logging.getLogger(__name__)


def stored_counts(bag: Path, topics: Collection[str], frame: str) -> list[CountRecord]:
    """Records of some topics, and the quarantined ones next to them, in the order of recording.

    What cannot be read is skipped.

    :param bag: folder of an MCAP bag; only read
    :param topics: full names of topics with counts
    :param frame: frame of the records; messages of others are skipped; empty for any frame
    :raises InputError: if there is no MCAP file
    :raises OSError: if a file cannot be read
    """
    records: list[CountRecord] = []
    wanted = {*topics, *map(quarantined_topic, topics)}
    files = mcap_files(bag)
    allowance = Allowance(sum(path.stat().st_size for path in files))
    for path in files:
        for message in McapScan(path).messages():
            if message.topic.name not in wanted or message.topic.definition.type_name != CLOUD:
                continue
            try:
                cloud = _store().deserialize_cdr(message.data, CLOUD)
                if frame in ("", cloud.header.frame_id):
                    found = count_records(cloud)
                    allowance.take_records(len(found))
                    records += found
            except TooMuchError:
                _log.warning("%s %s; the rest of it is skipped", bag, TOO_MUCH)
                return records
            except (ValueError, LookupError, TypeError, struct.error) as error:
                _log.warning("%s: a message of %s is skipped: %s", path, message.topic.name, error)
    return records


def quarantine_reasons(info: BagInfo) -> dict[str, dict[str, int]]:
    """Number of quarantined records of a bag, by topic and code of the reason, the most frequent first.

    :raises InputError: as :func:`stored_counts`
    """
    names = [
        topic.name
        for topic in info.topics
        if topic.name.rpartition("/")[2] == QUARANTINED and topic.type_name == CLOUD
    ]
    return {
        name: dict(Counter(record.quarantine for record in _all_counts(info, name)).most_common())
        for name in names
    }


def _all_counts(info: BagInfo, topic: str) -> list[CountRecord]:
    if info.storage == "mcap":
        return stored_counts(info.path, [topic], frame="")
    with BagReader(info.path) as reader:
        return [record for _, record in reader.read_counts_of([topic])]


@cache
def _store() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)
