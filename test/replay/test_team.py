# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs of several robots that share a mapper: a golden bag with its records on the topics of two robots."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters, write_parameters
from soilmoist_ros.replay import ReplaySettings, replay_bag

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "drive_and_stop"
ROBOTS = ("robot_1", "robot_2")


@pytest.fixture
def run_of(tmp_path):
    """Make a run whose mapper has these others; both robots have the mission, and every second record each."""

    def make(others):
        run = tmp_path / "run"
        shutil.copytree(GOLDEN / CONFIGURATION, run / CONFIGURATION)
        had = {name: read_parameters(run / CONFIGURATION, name) for name in ("planner", "mapper")}
        (run / CONFIGURATION / "planner.yaml").unlink()
        write_parameters(run, "mapper", {**had["mapper"], "others": others})
        for number, robot in enumerate(ROBOTS):
            write_parameters(run, f"{robot}/planner", {**had["planner"], "seed": number, "target": "vwc"})
        with (
            AnyReader([GOLDEN / "bag"]) as reader,
            Writer(run / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer,
        ):
            kept = [
                one for one in reader.connections if one.topic in ("/counts", "/mission", "/samples", "/soil_map")
            ]
            topics = {}
            for one in kept:
                shared = one.topic in ("/samples", "/soil_map")
                names = [one.topic] if shared else [f"/{robot}{one.topic}" for robot in ROBOTS]
                topics[one.id] = [
                    writer.add_connection(name, one.msgtype, typestore=reader.typestore) for name in names
                ]
            records = 0
            for connection, stamp_ns, data in reader.messages(kept):
                targets = topics[connection.id]
                if connection.topic == "/counts":
                    targets = [targets[records % 2]]
                    records += 1
                for topic in targets:
                    writer.write(topic, stamp_ns, data)
        return run

    return make


@pytest.mark.slow
def test_the_records_of_all_are_mapped_and_each_has_its_mission(run_of):
    alone = replay_bag(GOLDEN).run
    replay = replay_bag(run_of(list(ROBOTS)), ReplaySettings(truths={0: "half-wet"}))
    team = replay.run
    assert replay.comparisons[0].same or replay.comparisons[0].is_rounding
    np.testing.assert_array_equal(team.soil_map.rate, alone.soil_map.rate)
    assert len(team.track) == len(alone.track)
    mission, single = team.mission, alone.mission
    assert mission.settings.robots == 2
    assert (mission.settings.strategy, mission.settings.seed) == (single.settings.strategy, 0)
    assert mission.settings.target == "vwc"
    assert [visit.robot for visit in mission.visits] == [1, 2] * len(single.visits)
    assert sum(len(track) for track in mission.tracks) == len(alone.track)
    assert min(len(track) for track in mission.tracks) == len(alone.track) // 2
    assert mission.series[-1].samples == 2 * single.series[-1].samples
    assert mission.series[-1].distance_m == pytest.approx(2 * single.series[-1].distance_m)
    assert mission.series[-1].time_s == single.series[-1].time_s
    assert np.all(np.diff([row.time_s for row in mission.series]) >= 0)
    assert mission.ended == f"robot 1: {single.ended}; robot 2: {single.ended}"
    assert len(team.tracks_xy) == 2


@pytest.mark.slow
def test_one_of_them_can_be_mapped_alone(run_of):
    run = run_of(list(ROBOTS))
    (one, two) = (replay_bag(run, ReplaySettings(counts_topic=f"/{robot}/counts")).run.track for robot in ROBOTS)
    assert abs(len(one) - len(two)) <= 1
    assert {record.stamp_s for record in one}.isdisjoint({record.stamp_s for record in two})


def test_robots_whose_mapper_maps_one_of_them_are_no_team(run_of):
    with pytest.raises(InputError, match="has several topics 'counts'"):
        replay_bag(run_of([]))
