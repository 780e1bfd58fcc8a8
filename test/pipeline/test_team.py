# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs of several robots that share a mapper: a golden bag with its records on the topics of two robots."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters, write_parameters

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
    replay = replay_bag(run_of(list(ROBOTS)), ReplaySettings(truths={"": "half-wet"}))
    team = replay.run
    assert re.search("bit for bit|rounding", replay.comparisons[0])
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
def test_a_replay_of_one_robot_has_the_records_of_another_that_its_mapper_heard(tmp_path):
    run = tmp_path / "run"
    shutil.copytree(GOLDEN / CONFIGURATION, run / CONFIGURATION)
    write_parameters(run, "mapper", {**read_parameters(run / CONFIGURATION, "mapper"), "others": list(ROBOTS)})
    with (
        AnyReader([GOLDEN / "bag"]) as reader,
        Writer(run / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        kept = {one.topic: one for one in reader.connections if one.topic in ("/counts", "/samples", "/soil_map")}
        added = {
            name: writer.add_connection(name, kept[of].msgtype, typestore=reader.typestore)
            for name, of in (
                ("/robot_1/counts", "/counts"), ("/robot_2/counts", "/counts"), ("/robot_1/samples", "/samples"),
                ("/robot_1/soil_map", "/soil_map"),
            )
        }  # fmt: skip
        found = list(reader.messages([kept["/counts"]]))
        end_ns = found[-1][1]
        for number, (_, stamp_ns, data) in enumerate(found):
            writer.write(added[f"/{ROBOTS[number % 2]}/counts"], stamp_ns, data)
        for topic in ("/samples", "/soil_map"):
            *_, (_, stamp_ns, data) = reader.messages([kept[topic]])
            writer.write(added[f"/robot_1{topic}"], max(stamp_ns, end_ns), data)
    replay = replay_bag(run, ReplaySettings(counts_topic="/robot_1/counts"))
    assert len(replay.run.track) == len(found)
    assert re.search("bit for bit|rounding", replay.comparisons[0]), replay.comparisons
