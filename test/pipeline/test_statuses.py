# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The statuses of recorded missions: statuses.py."""

from __future__ import annotations

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.pipeline.bag_lines import STATUS, RunTopics
from soilmoist_ros.pipeline.mission import Status, last_mission, read_statuses
from soilmoist_ros.recording.bag.reader import BagReader

STORE = get_typestore(Stores.ROS2_JAZZY)
START_S = 1_780_000_000.0


def message_of(status):
    pair = STORE.types["diagnostic_msgs/msg/KeyValue"]
    values = [pair(name, str(value)) for name, value in status._asdict().items()]
    return STORE.serialize_cdr(STORE.types[STATUS](0, "mission", "", "", values), STATUS)


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("step_s", [-1.5, -3.0, -3600.0, 3600.0])
def test_a_clock_that_is_set_does_not_divide_a_mission(tmp_path, storage, step_s):
    def status(used_s):
        now_s = START_S + used_s + (step_s if used_s > 40 else 0.0)
        return Status("counting", "", "a", 0.0, 0.0, 0.0, used_s, 0.0, 0.0, 0, 0.0, 0, now_s)

    mission = [status(float(used_s)) for used_s in range(60)]
    with Writer(tmp_path / "bag", version=9, storage_plugin=storage) as writer:
        topic = writer.add_connection("/mission", STATUS, typestore=STORE)
        for one in mission:
            writer.write(topic, int(one.stamp_s * 1e9), message_of(one))
    with BagReader(tmp_path / "bag") as reader:
        found = last_mission(read_statuses(RunTopics(reader, "/counts", alone=True)))
    assert [one.time_used_s for one in found] == [one.time_used_s for one in mission]


def test_missions_one_after_the_other():
    def status(used, samples=0):
        return Status("planning", "", "", 0.0, 0.0, 0.0, used, 0.0, 0.0, samples, 0.0, 0, used)

    first, second = [status(0), status(0), status(40), status(90, 2)], [status(0), status(10)]
    assert last_mission([]) == []
    assert last_mission(first[:2]) == []
    assert last_mission(first) == first
    assert last_mission([*first, *second]) == second
    assert last_mission([*first, second[0]]) == first, "the second was not started"
