# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The log of a recorded mission."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration import sample_from_text
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.planning.sealed_sample import drawn
from soilmoist_ros.pipeline import map_certificate
from soilmoist_ros.pipeline.bag_lines import STATUS, RunTopics
from soilmoist_ros.pipeline.map_certificate import error_bound, state
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
from soilmoist_ros.simulation import MissionSettings, simulate_mission, simulated_site, surrogate_field


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


# Certificate of a map (map_certificate.py) -----------------------------------------------------------------------


MASK = np.ones((25, 30), bool)


def field(skewed):
    """A true rate, and a map of it: errors of one size, or large ones in a tenth of the field [counts/s]."""
    rng = np.random.default_rng(3)
    truth = 3.6 + 0.5 * np.sin(np.arange(750) / 90)
    error = rng.normal(0, 0.15, 750)
    return truth, truth + 0.1 + (error * np.where(np.arange(750) % 300 < 30, 3, 0.6) if skewed else error)


@pytest.mark.parametrize("skewed", [False, True])
@pytest.mark.parametrize("moist", [False, True])
def test_intervals_cover_what_they_say_whatever_the_map(skewed, moist):
    truth, p = field(skewed)
    curve = simulated_site(surrogate_field("synthetic-low")).curve if moist else None
    of_truth = truth if curve is None else curve.vwc(truth)
    mse = np.mean((p - truth) ** 2 * (1 if curve is None else curve.slope(p) ** 2))
    rng, exposure_s = np.random.default_rng(4), np.full(12, 80.0)
    covered, below = [], []
    for seed in range(400):
        at = drawn(MASK, 12, seed)
        made = state(p, at, rng.poisson(truth[at] * exposure_s).astype(float), exposure_s, curve)
        covered.append(abs(made.mean - of_truth.mean()) <= made.half_width)
        below.append(made.rmse_below is None or made.rmse_below**2 >= mse)
    assert 0.92 <= np.mean(covered) <= 0.985
    assert np.mean(below) >= 0.93


def test_the_bound_falls_with_exposure_and_rises_with_kurtosis():
    bounds = [error_bound(np.full(12, 0.06 + noise), np.full(12, noise)) for noise in (0.06, 0.03, 0.01)]
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[-1] > 0.06
    square = np.full(12, 0.09)
    assert error_bound(square, np.full(12, 0.03), 3.0) < bounds[1] < error_bound(square, np.full(12, 0.03), 20.0)
    assert error_bound(np.full(8, 5e-3), np.full(8, 4e-3), 4590.0) == np.inf  # of soil so wet that all is possible
    assert error_bound(0 * square, np.full(12, 0.03)) == error_bound(np.full(12, 0.03), np.full(12, 0.03))


def test_the_map_to_compare_with_has_nothing_of_the_sample():
    settings = MissionSettings(field="synthetic-low", hours=0.6, cell_m=5.0, series_every_s=1e9, certify=5)
    result = simulate_mission(settings)
    sample, visits = sample_from_text(result.certificate), sorted(result.visits, key=lambda one: one.arrived_s)
    others = map_certificate._without_sample(result.records, visits, sample, stops_only=False)
    stamps = np.array([record.stamp_s for record in others])
    assert 0.5 < len(others) / len(result.records) < 0.95
    for before, visit in zip([None, *visits], visits, strict=False):
        if visit.name in sample.names:
            since_s = 0.0 if before is None else before.end_stamp_s
            assert not ((stamps > since_s + 1) & (stamps < visit.end_stamp_s + 1)).any()
    only = map_certificate._without_sample(result.records, visits, sample, stops_only=True)
    assert 0 < len(only) < len(others)
