# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings without a map have a report: no_map.py."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.pipeline import bag_map as no_map
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.pipeline.properties import ReplayedProperty
from soilmoist_ros.pipeline.run import NoMapError
from soilmoist_ros.reporting.failed_outputs import write_failed
from soilmoist_ros.sensing.records import CountRecord

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


def failure(bag, settings=None):
    with pytest.raises(NoMapError) as caught:
        replay_bag(bag, settings or ReplaySettings())
    return caught.value.failed


@pytest.fixture(scope="module")
def silent(tmp_path_factory):
    """A mission whose sensor never sent a record."""
    run = tmp_path_factory.mktemp("silent")
    shutil.copytree(GOLDEN / "drive_and_stop" / "configuration", run / "configuration")
    storage = StoragePlugin.MCAP
    with (
        AnyReader([GOLDEN / "drive_and_stop" / "bag"]) as reader,
        Writer(run / "bag", version=9, storage_plugin=storage) as writer,
    ):
        topics = {
            one.id: writer.add_connection(one.topic, one.msgtype, typestore=reader.typestore)
            for one in reader.connections
        }
        for one, stamp_ns, data in reader.messages():
            if one.topic != "/counts":
                writer.write(topics[one.id], stamp_ns, data)
    return run


def test_a_mission_whose_sensor_was_silent(silent, tmp_path):
    failed = failure(silent)
    assert failed.why.startswith("The sensor sent no record that could be used")
    assert "The mission ended after" in failed.why
    assert "soilmoist check --logger" in failed.todo[0]
    assert failed.mission is not None
    assert failed.mission.log
    assert not failed.track
    names = [path.name for path in write_failed(tmp_path, failed)]
    assert names == ["summary.json", "report.html", "records.csv", "series.csv", "visits.csv"]
    assert "Log of the mission" in (tmp_path / "report.html").read_text()


def test_too_few_samples_are_the_cause():
    failed = failure(GOLDEN / "one_stop", ReplaySettings(fit="soft_l1"))
    assert failed.why == "14 records at 1 place: there are too few samples for a map."
    assert len(failed.track) == 14


def test_quarantined_records_are_the_cause():
    bad = dataclasses.replace(CountRecord(1.78e9, 1.0, 2.0, 0.0, 900, 10.0, 9.0), quarantine="noisy_tube")
    worse = dataclasses.replace(bad, quarantine="impossible_count")
    survey = open_survey(str(GOLDEN / "one_stop" / "configuration" / "field.yaml"))
    first = ReplayedProperty("moisture", 1.0, survey, [bad, worse, bad], [], None, None)
    failed = no_map.no_map(GOLDEN / "one_stop" / "bag", [], first, [], None).failed
    assert failed.why == "All 3 records are quarantined: tube counts too much (2), impossible count (1)."
    assert failed.quarantined == {"noisy_tube": 2, "impossible_count": 1}


def test_records_of_another_place_are_the_cause(tmp_path):
    path = tmp_path / "field.yaml"
    path.write_text("name: east\npolygon_lonlat: [[0.52, 53.26], [0.53, 53.26], [0.53, 53.27], [0.52, 53.27]]\n")
    failed = failure(GOLDEN / "one_stop", ReplaySettings(field=str(path)))
    assert failed.why.startswith("All 14 records lie at least 70 km west")
    assert "sign of the longitude" in failed.todo[0]
    (loss,) = failed.losses
    assert (loss.kind, loss.count) == ("outside the field", 14)
    assert "70 km west of the field" in loss.example


def test_faults_that_nodes_reported_are_counted_errors_first(monkeypatch):
    def status(name, level, message):
        return SimpleNamespace(name=name, level=level, message=message)

    messages = [
        SimpleNamespace(status=[status("driver", b"\x01", "old"), status("mapper", 0, "fine")]),
        SimpleNamespace(status=[status("driver", b"\x01", "old"), status("logger", 2, "wrong checksum")]),
    ]

    class Reader:
        topics = {"/diagnostics": no_map.DIAGNOSTICS, "/other": "std_msgs/msg/String"}  # noqa: RUF012

        def __init__(self, path):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def messages(self, topics):
            assert topics == ["/diagnostics"]
            return messages

        def decode(self, message):
            return message

    monkeypatch.setattr(no_map, "BagReader", Reader)
    found = no_map.read_troubles(GOLDEN)
    assert [(one.name, one.message, one.count, one.error) for one in found] == [
        ("logger", "wrong checksum", 1, True),
        ("driver", "old", 2, False),
    ]


def test_a_bag_that_cannot_be_read_has_no_report(tmp_path):
    with pytest.raises(InputError) as caught:
        replay_bag(tmp_path / "none")
    assert not isinstance(caught.value, NoMapError)
