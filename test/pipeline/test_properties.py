# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags with several properties, and of robots that share a mapper: a golden bag, its counts on two topics."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from copied_bags import copy_bag

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.pipeline.bag_lines import CLOUD, RunTopics
from soilmoist_ros.pipeline.properties import property_topics
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters, write_parameters

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "drive_and_stop"
TWICE = ("/counts", "/samples", "/soil_map")


@pytest.fixture
def run_with(tmp_path):
    """Make a run with these properties in its planner; its bag repeats the counts as counts of salt."""

    def make(properties, mapper=True):
        run = tmp_path / "run"
        shutil.copytree(GOLDEN / CONFIGURATION, run / CONFIGURATION)
        had = {name: read_parameters(run / CONFIGURATION, name) for name in ("planner", "mapper")}
        write_parameters(run, "planner", {**had["planner"], "properties": properties})
        if mapper:
            write_parameters(run, "salt/mapper", {**had["mapper"], "fit": "soft_l1"})
        twice = lambda topic: [topic, f"/salt{topic}"] if topic in TWICE else [topic]  # noqa: E731
        copy_bag(GOLDEN / "bag", run / "bag", names=twice, mcap=True)
        return run

    return make


@pytest.mark.slow
def test_all_are_mapped_each_as_its_mapper_did(run_with):
    replay = replay_bag(run_with(["salt:0.5"]), ReplaySettings(truths={"": "half-wet", "salt": "half-wet"}))
    moisture, salt = replay.run.properties
    assert (moisture.name, salt.name) == ("moisture", "salt")
    assert [record.raw_counts for record in salt.track] == [record.raw_counts for record in moisture.track]
    assert (moisture.soil_map.fit.method, salt.soil_map.fit.method) == ("reml", "soft_l1")
    np.testing.assert_array_equal(salt.truth_rate, moisture.truth_rate)
    of_moisture, of_salt = replay.comparisons
    assert re.search("bit for bit|rounding", of_moisture)
    assert of_salt.startswith("differs from"), "its mapper had another fit"
    assert "rounding" not in of_salt


@pytest.mark.slow
def test_without_its_settings_it_is_mapped_like_the_first_but_without_the_calibration(run_with):
    moisture, salt = replay_bag(run_with(["salt"], mapper=False)).run.properties
    assert moisture.calibrated
    assert not salt.calibrated
    assert salt.soil_map.fit.method == "reml"
    assert salt.truth_rate is None


def test_a_truth_of_no_property_is_refused(run_with):
    with pytest.raises(InputError, match=r"has no property 'clay' -> there are: moisture, salt"):
        replay_bag(run_with(["salt"]), ReplaySettings(truths={"clay": "half-wet"}))


@pytest.mark.slow
def test_one_alone_is_a_replay_of_its_own(run_with):
    run = replay_bag(run_with(["salt"]), ReplaySettings(counts_topic="/salt/counts")).run
    assert run.mission is None
    assert [one.name for one in run.properties] == ["salt"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("hours", "two"),
        ("hours", float("inf")),
        ("seed", float("nan")),
        ("seed", 10**400),
        ("until_sd", [1]),
        ("until_gain", "much"),
        ("until", 1),
        ("preset", ["a"]),
    ],
)
def test_a_damaged_parameter_of_the_planner_is_named_before_the_work(tmp_path, name, value):
    run, steps = tmp_path / "run", []
    shutil.copytree(GOLDEN, run)
    had = read_parameters(run / CONFIGURATION, "planner")
    path = write_parameters(run, "planner", {**had, name: value})
    with pytest.raises(InputError, match=f"{name} must be") as error:
        replay_bag(run, ReplaySettings(), lambda step, share: steps.append(step))
    assert error.value.mistakes[0].path == path
    assert "mapping" not in steps


RECORDED = Path(__file__).resolve().parents[1] / "golden" / "one_stop"
FIELD = load_field(RECORDED / "configuration" / "field.yaml")


def field_file(folder, frame, polygon):
    path = folder / "field.yaml"
    datum = f"datum: {{latitude_deg: {frame.latitude_deg!r}, longitude_deg: {frame.longitude_deg!r}}}\n"
    path.write_text(f"name: other\n{datum}polygon: {np.asarray(polygon).tolist()}\n")
    return path


@pytest.mark.slow
def test_a_field_with_another_datum_is_mapped_where_the_robot_was(tmp_path):
    latitude, longitude = FIELD.frame.to_geographic([(400.0, -300.0)])[0]
    frame = LocalFrame(float(latitude), float(longitude))
    polygon = frame.to_local(*FIELD.frame.to_geographic(FIELD.polygon).T)
    moved = replay_bag(RECORDED, ReplaySettings(field=str(field_file(tmp_path, frame, polygon)), cell_m=4.0)).run
    there = replay_bag(RECORDED, ReplaySettings(cell_m=4.0)).run
    assert moved.inside == there.inside
    assert list(moved.track) == list(there.track)
    rates = moved.soil_map.rate, there.soil_map.rate
    both = np.isfinite(rates).all(axis=0)  # an edge may be on the other side of the centre of a cell
    assert both.mean() > 0.9
    np.testing.assert_allclose(rates[0][both], rates[1][both], rtol=1e-6)


def test_each_topic_is_a_property_with_a_name_of_its_own():
    spaces = ("", "/b", "/moisture", "/x/b", "/x_b")
    reader = SimpleNamespace(topics={f"{space}/counts": CLOUD for space in spaces})
    found = property_topics(RunTopics(reader, "/counts", True), None)
    assert [one.counts for one in found] == [(f"{space}/counts",) for space in spaces]
    assert [one.name for one in found] == ["moisture", "b", "moisture_2", "x_b", "x_b_2"]


def test_a_field_on_the_other_side_of_the_earth_is_refused(tmp_path):
    path = field_file(tmp_path, LocalFrame(-53.268, -0.5245), FIELD.polygon)
    with pytest.raises(InputError, match=r"another side of the earth .* correct the sign of latitude"):
        replay_bag(RECORDED, ReplaySettings(field=str(path)))


# Teams -----------------------------------------------------------------------------------------------------------

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
