# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The log of a recorded mission."""

from __future__ import annotations

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.pipeline.bag_lines import STATUS, RunTopics
from soilmoist_ros.pipeline.mission import (
    RobotMission,
    Status,
    estimate_visits,
    last_mission,
    mission_log,
    mission_visits,
    read_statuses,
)
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.sensing.records import CountRecord


def status(used_s, state, reason, command="", command_s=float("nan")):
    now_s = 1000.0 + used_s
    return Status(state, reason, "n1", 5.0, 6.0, 0.0, used_s, 100.0, 0.0, 0, 0.0, 0, now_s, command, command_s)


def test_the_log_says_who_did_what_when():
    start, pause = ("start by Ada: started", 1000.0), ("pause by Bo: paused by Bo", 1020.0)
    again = (pause[0], 1050.0)
    statuses = [
        status(0.0, "planning", "started", *start), status(5.0, "travelling", "going to n1", *start),
        status(6.0, "travelling", "going to n1", *start), status(20.0, "paused", "paused by Bo", *pause),
        status(40.0, "travelling", "resumed", *pause), status(50.0, "paused", "paused by Bo", *again),
    ]  # fmt: skip
    one, other = (RobotMission(number, {}, statuses[:count], (), ()) for number, count in ((1, 6), (2, 2)))
    assert mission_log([one], [0.0]) == [
        "       0 s  start by Ada: started", "       0 s  planning: started",
        "       5 s  travelling: going to n1", "      20 s  pause by Bo: paused by Bo",
        "      20 s  paused: paused by Bo", "      40 s  travelling: resumed",
        "      50 s  pause by Bo: paused by Bo", "      50 s  paused: paused by Bo",
    ]  # fmt: skip
    team = mission_log([one, other], [0.0, 7.0])
    assert team[3:6] == [
        "       7 s  robot 2: start by Ada: started",
        "       7 s  robot 2: planning: started",
        "      12 s  robot 2: travelling: going to n1",
    ]


STORE = get_typestore(Stores.ROS2_JAZZY)
START_S = 1_780_000_000.0


def message_of(status):
    pair = STORE.types["diagnostic_msgs/msg/KeyValue"]
    values = [pair(name, str(value)) for name, value in status._asdict().items()]
    return STORE.serialize_cdr(STORE.types[STATUS](0, "mission", "", "", values), STATUS)


@pytest.mark.parametrize("step_s", [-1.5, -3600.0, 3600.0])
def test_a_clock_that_is_set_does_not_divide_a_mission(tmp_path, step_s):
    def status(used_s):
        now_s = START_S + used_s + (step_s if used_s > 40 else 0.0)
        return Status("counting", "", "a", 0.0, 0.0, 0.0, used_s, 0.0, 0.0, 0, 0.0, 0, now_s)

    mission = [status(float(used_s)) for used_s in range(60)]
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/mission", STATUS, typestore=STORE)
        for one in mission:
            writer.write(topic, int(one.stamp_s * 1e9), message_of(one))
    with BagReader(tmp_path / "bag") as reader:
        found = last_mission(read_statuses(RunTopics(reader, "/counts", alone=True)))
    assert [one.time_used_s for one in found] == [one.time_used_s for one in mission]


def test_missions_one_after_the_other():
    first, second = ([status(used, "planning", "") for used in times] for times in ((0, 0, 40, 90), (0, 10)))
    assert last_mission([]) == []
    assert last_mission(first[:2]) == []
    assert last_mission(first) == first
    assert last_mission([*first, *second]) == second
    assert last_mission([*first, second[0]]) == first, "the second was not started"


def visit_status(now_s, state, counted_s=0.0, raw_counts=0, samples=0, counting_s=0.0, reason="", target="n1"):
    return Status(
        state, reason, target, 5.0, 6.0, counted_s, now_s, 100.0, 0.0, samples, counting_s, raw_counts, now_s
    )


def record(stamp_s, raw_counts):
    return CountRecord(stamp_s, 5.0, 6.0, 30.0, raw_counts, 10.0, 10.0)


def test_a_record_that_arrives_after_the_last_status_is_counted():
    """The status at 22 s is newer than the end of the record, but was published before the record arrived."""
    statuses = [
        visit_status(1.0, "travelling", reason="going to n1: largest variance"), visit_status(12.0, "counting"),
        visit_status(22.5, "counting", 10.5, counting_s=10.5),
        visit_status(22.8, "planning", samples=1, counting_s=10.8),
    ]  # fmt: skip
    (visit,) = estimate_visits(statuses, [record(11.0, 40), record(22.0, 27), record(33.0, 50)])
    assert (visit.name, visit.raw_counts, visit.reason) == ("n1", 27, "largest variance")
    assert (visit.arrived_s, visit.dwell_s) == (12.0, 10.8)


def test_the_records_of_a_pause_are_not_counted():
    statuses = [
        visit_status(1.0, "travelling", reason="going to n1"), visit_status(10.0, "counting"),
        visit_status(21.0, "counting", 11.0, 20, counting_s=11.0),
        visit_status(22.0, "paused", 12.0, 20, counting_s=12.0),
        visit_status(40.0, "counting", 12.0, 20, counting_s=12.0),
        visit_status(51.0, "counting", 23.0, 43, counting_s=23.0),
        visit_status(61.0, "planning", samples=1, counting_s=33.0),
    ]  # fmt: skip
    at_stop = [record(20.0, 20), record(30.0, 21), record(39.0, 22), record(50.0, 23), record(60.0, 24)]
    (visit,) = estimate_visits(statuses, at_stop)
    assert visit.raw_counts == 20 + 23 + 24


def test_published_visits_of_this_mission_are_taken_as_they_are():
    statuses = [
        visit_status(1.0, "travelling"), visit_status(12.0, "counting"), visit_status(22.8, "planning", samples=1),
    ]  # fmt: skip
    earlier = Visit("n0", 1.0, 1.0, 500.0, 60.0, 99, "", arrival_stamp_s=-500.0)
    own = Visit("n1", 5.1, 6.1, 12.0, 10.8, 27, "largest variance", arrival_stamp_s=12.0)
    records = [record(22.0, 40)]
    assert mission_visits(statuses, [earlier, own], records) == [own]
    assert mission_visits(statuses, [], records) == []
    assert [visit.raw_counts for visit in mission_visits(statuses, None, records)] == [40]


def test_a_clock_that_is_set_takes_no_visit_out_of_its_mission_and_brings_none_in():
    def counting(used_s, clock_s):
        return visit_status(used_s, "counting")._replace(stamp_s=used_s + clock_s)

    def visit(arrived_s, clock_s):
        return Visit("n1", 5.0, 6.0, arrived_s, 60.0, 27, "", arrival_stamp_s=arrived_s + clock_s)

    began_s = 1000.0  # the mission before began at 0, and its clock was set by an hour and back
    for step_s in (-3600.0, -3.0, 3600.0):
        set_s = began_s + step_s
        statuses = [
            counting(10.0, began_s), counting(90.0, began_s), counting(91.0, set_s), counting(200.0, set_s),
        ]  # fmt: skip
        own = [visit(5.0, began_s), visit(95.0, set_s)]
        assert mission_visits(statuses, [visit(5.0, 0.0), visit(500.0, 5400.0), *own], []) == own
