# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs of several robots that share a mapper: a golden bag with its records on the topics of two robots."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from copied_bags import copy_bag

from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters, write_parameters

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "drive_and_stop"
ROBOTS = ("robot_1", "robot_2")


def names(topic):
    if topic in ("/samples", "/soil_map"):
        return [topic]
    return [f"/{robot}{topic}" for robot in ROBOTS] if topic in ("/counts", "/mission") else []


def every_second(name, number):
    return not name.endswith("/counts") or name == f"/{ROBOTS[number % 2]}/counts"


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
        copy_bag(GOLDEN / "bag", run / "bag", every_second, names, mcap=True)
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
    heard = lambda topic: names(topic) if topic == "/counts" else [f"/robot_1{one}" for one in names(topic)]  # noqa: E731
    copy_bag(GOLDEN / "bag", run / "bag", every_second, heard, mcap=True)
    replay = replay_bag(run, ReplaySettings(counts_topic="/robot_1/counts"))
    assert len(replay.run.track) == len(replay_bag(GOLDEN).run.track)
    assert re.search("bit for bit|rounding", replay.comparisons[0]), replay.comparisons
