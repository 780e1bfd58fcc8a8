# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records that a later map starts from."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration.mission.events import Command, Moved, RecordArrived
from soilmoist_ros.exploration.mission.journal import MissionJournal
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import MissionRules, Verb
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.journal import Journal
from soilmoist_ros.recording.stored_records import RECORDS, read_earlier, write_records
from soilmoist_ros.sensing.records import CountRecord

CLOUD = "sensor_msgs/msg/PointCloud2"
COLUMNS = (
    "x",
    "y",
    "z",
    "raw_counts",
    "exposure_s",
    "effective_exposure_s",
    "f_pressure",
    "f_humidity",
    "f_intensity",
)


def records(n=8):
    rng = np.random.default_rng(5)
    places = rng.uniform((2, 2), (58, 48), (n, 2)).astype(np.float32).tolist()
    return [
        CountRecord(1.78e9 + i, x, y, 30.0, int(rng.poisson(400)), 100.0, 95.0) for i, (x, y) in enumerate(places)
    ]


def write_bag(folder, many):
    """A bag with the records on the topic ``counts``."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    layout = np.dtype(
        [(name, "<f4" if name in "xyz" else "<u4" if name == "raw_counts" else "<f8") for name in COLUMNS]
    )
    datatype = {"<f4": 7, "<f8": 8, "<u4": 6}
    fields = [
        types["sensor_msgs/msg/PointField"](name, layout.fields[name][1], datatype[layout[name].str], 1)
        for name in COLUMNS
    ]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/counts", CLOUD, typestore=store)
        for one in many:
            stamp = types["builtin_interfaces/msg/Time"](int(one.stamp_s), 0)
            row = (
                one.x_m,
                one.y_m,
                one.z_m,
                one.raw_counts,
                one.exposure_s,
                one.effective_exposure_s,
                1.0,
                1.0,
                1.0,
            )
            data = np.frombuffer(np.array([row], layout).tobytes(), "u1")
            header = types["std_msgs/msg/Header"](stamp, "map")
            cloud = types[CLOUD](header, 1, 1, fields, False, layout.itemsize, layout.itemsize, data, True)
            writer.write(topic, int(one.stamp_s * 1e9), store.serialize_cdr(cloud, CLOUD))


def test_records_come_from_a_table_or_a_bag(tmp_path):
    write_records(tmp_path / RECORDS, records())
    write_bag(tmp_path / "bag", records())
    for source in (tmp_path, tmp_path / "bag"):
        assert read_earlier(source) == records()
    with pytest.raises(InputError, match=r"no topic '/salt/counts'.*/counts "):
        read_earlier(tmp_path / "bag", "salt")


def test_an_interrupted_mission_gives_its_records(tmp_path):
    mission = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60")))
    events = [Moved(1.77e9, 0.0, 0.0), Command(1.78e9, Verb.START)]
    events += [RecordArrived(r.stamp_s, r) for r in records()]
    with Journal.open(tmp_path) as pages:
        journal = MissionJournal(pages)
        for event in events:
            journal.note(mission, event)
            mission.step(event)
            journal.keep(mission)
        journal.note_record("/salt", 1.78e9 + 1.0, records()[2])
    assert read_earlier(tmp_path) == records()
    assert read_earlier(tmp_path, "/salt") == records()[2:3]
    assert read_earlier(tmp_path, "clay") == []


def test_other_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"neither records.csv nor a bag nor a journal.*saved, a bag"):
        read_earlier(tmp_path)
    with pytest.raises(InputError, match="there is no such bag"):
        read_earlier(tmp_path / "none")
