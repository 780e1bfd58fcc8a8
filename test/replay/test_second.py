"""Bags in which a second property was counted beside: made of a golden one, whose counts come twice."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters, write_parameters
from soilmoist_ros.replay import ReplaySettings, replay_bag

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "drive_and_stop"
TWICE = ("/counts", "/samples", "/soil_map")


@pytest.fixture
def run_with(tmp_path):
    """Make a run whose planner had these properties, and whose bag has the first one's counts again, as salt's."""

    def make(properties, mapper=True, mission=True):
        run = tmp_path / "run"
        shutil.copytree(GOLDEN / CONFIGURATION, run / CONFIGURATION)
        had = {name: read_parameters(run / CONFIGURATION, name) for name in ("planner", "mapper")}
        write_parameters(run, "planner", {**had["planner"], "properties": properties})
        if mapper:
            write_parameters(run, "salt/mapper", {**had["mapper"], "fit": "soft_l1"})
        with (
            AnyReader([GOLDEN / "bag"]) as reader,
            Writer(run / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer,
        ):

            def add(name, connection):
                return writer.add_connection(name, connection.msgtype, typestore=reader.typestore)

            connections = [one for one in reader.connections if mission or one.topic != "/mission"]
            topics = {one.id: [add(one.topic, one)] for one in connections}
            for one in connections:
                topics[one.id] += [add(f"/salt{one.topic}", one)] if one.topic in TWICE else []
            for connection, stamp_ns, data in reader.messages(connections):
                for topic in topics[connection.id]:
                    writer.write(topic, stamp_ns, data)
        return run

    return make


@pytest.mark.slow
def test_both_are_mapped_each_as_its_mapper_did(run_with):
    replay = replay_bag(run_with(["salt:0.5"]), ReplaySettings(truth="half-wet", also_truth="half-wet"))
    mission = replay.run.mission
    assert (mission.also.name, mission.settings.also, mission.settings.also_weight) == ("salt", "salt", 0.5)
    assert [record.raw_counts for record in mission.also.records] == [r.raw_counts for r in replay.run.track]
    assert (replay.run.soil_map.fit.method, mission.also.soil_map.fit.method) == ("reml", "soft_l1")
    np.testing.assert_array_equal(mission.also.truth_rate, replay.run.truth_rate)
    assert "differs from the robot's last one" in replay.also_comparison, "its mapper had another fit"
    errors = [(row.mse, row.also_mse) for row in mission.series if np.isfinite(row.mse)]
    assert errors
    assert all(np.isfinite(errors).all(axis=0))
    assert not any("not mapped" in warning for warning in replay.run.warnings)


def test_without_its_settings_it_is_mapped_like_the_first_but_without_the_calibration(run_with):
    replay = replay_bag(run_with(["salt"], mapper=False))
    also = replay.run.mission.also
    assert replay.run.soil_map.curve is not None
    assert also.soil_map.curve is None
    assert also.soil_map.fit.method == "reml"
    assert np.isnan(also.truth_rate).all()
    assert np.isnan([row.also_mse for row in replay.run.mission.series]).all()


@pytest.mark.parametrize(
    ("properties", "mission", "chosen"),
    [([], True, {}), (["clay"], True, {}), (["/elsewhere/salt"], True, {}), (["salt"], False, {})],
)
def test_what_is_left_out_is_told(run_with, properties, mission, chosen):
    run = run_with(properties, mission=mission)
    replay = replay_bag(run, ReplaySettings(**chosen))
    assert replay.run.mission is None or replay.run.mission.also is None
    (warning,) = [text for text in replay.run.warnings if "not mapped" in text]
    assert (
        warning
        == "/salt/counts is in the bag, too, and not mapped here; replay --counts-topic /salt/counts maps it."
    )
    with pytest.raises(InputError, match="has no second property to compare with"):
        replay_bag(run, ReplaySettings(also_truth="half-wet"))


def test_the_second_alone_is_a_replay_of_its_own(run_with):
    replay = replay_bag(run_with(["salt"]), ReplaySettings(counts_topic="/salt/counts"))
    assert replay.run.mission is None
    assert not any("not mapped" in warning for warning in replay.run.warnings)


@pytest.mark.slow
def test_the_command_writes_both_maps_and_says_so(run_with, tmp_path, capsys):
    main(["replay", str(run_with(["salt:2"])), "--out", str(tmp_path / "out")], standalone_mode=False)
    said = capsys.readouterr().out
    assert "beside     salt, " in said
    assert "map_salt.tif" in said
    about = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert about["mission"]["also"]["truth"] is None
    assert {"map_salt.tif", "samples_salt.geojson"} <= {path.name for path in (tmp_path / "out").iterdir()}
    report = (tmp_path / "out" / "report.html").read_text()
    assert 'id="also-rate-sd"' in report
    assert "planned for with the weight 2" in report
