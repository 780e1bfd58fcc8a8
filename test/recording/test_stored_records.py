# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records that a later map starts from."""

import csv

import numpy as np
import pytest
from bags import CLOUD, COUNTS, STORE, cloud
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer

from count_records import scattered
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording import COLUMNS, RECORDS, Journal, read_earlier, read_records, write_records
from soilmoist_ros.sensing.records import FIRST_STAMP_S, LAST_STAMP_S, CountRecord

numbers = st.floats(allow_nan=False, allow_infinity=False)
records = st.builds(
    CountRecord, **{name: numbers for name in COLUMNS if name not in ("stamp_s", "raw_counts", "quarantine")},
    stamp_s=st.floats(FIRST_STAMP_S, LAST_STAMP_S), raw_counts=st.integers(0, 2**32 - 1),
    quarantine=st.sampled_from(["", "noisy_tube"]),
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(records, max_size=4))
def test_records_come_back_exactly(tmp_path, many):
    write_records(tmp_path / "records.csv", many)
    assert read_records(tmp_path / "records.csv") == many
    assert [path.name for path in tmp_path.iterdir()] == ["records.csv"]


def test_tables_of_earlier_releases_have_no_quarantine(tmp_path):
    path = tmp_path / "records.csv"
    write_records(path, [CountRecord(1.0, 2.0, 3.0, 4.5, 7, 10.0, 9.0)])
    assert path.read_text().splitlines()[0].endswith(",quarantine")
    path.write_text("".join(line.rpartition(",")[0] + "\n" for line in path.read_text().splitlines()))
    assert read_records(path) == [CountRecord(1.0, 2.0, 3.0, 4.5, 7, 10.0, 9.0)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("raw_counts", "counts"), "has no column raw_counts"),
        (lambda text: text.replace(",4,", ",4.5,"), r"records.csv:3: is not a record: invalid literal.*'4.5'"),
        (lambda text: text[:-20], r"records.csv:3: is not a record"),
        (lambda text: "", "has no column stamp_s, x_m"),
        (lambda text: text.replace(",4,", ",-5,"), "records.csv:3: is not a record: raw_counts is -5"),
        (
            lambda text: text.replace(",4,", f",{'9' * 400},"),
            "records.csv:3: is not a record: raw_counts is 9{30} ",
        ),
        (lambda text: text.replace(",4,", f",{2**63 + 1},"), "records.csv:3: is not a record: raw_counts is 9223"),
        (lambda text: text.replace("2.0,2.0,", "nan,2.0,"), "records.csv:3: is not a record: stamp_s is nan"),
        (lambda text: text.replace("2.0,2.0,", "inf,2.0,"), "records.csv:3: is not a record: stamp_s is inf"),
        (lambda text: text.replace("2.0,2.0,", "1e300,2.0,"), "records.csv:3: is not a record: stamp_s is 1e"),
        (lambda text: text.replace("2.0,2.0,", "2.0,-inf,"), "records.csv:3: is not a record: x_m is -inf"),
        (lambda text: text.replace("4,10.0,", "4,inf,"), "records.csv:3: is not a record: exposure_s is inf"),
        (lambda text: text[:-1] + "x" * 140_000, "records.csv:3: is not a record: field larger than"),
        (lambda text: "x" * 140_000 + text, "records.csv:1: is not a record: field larger than"),
    ],
)
def test_a_damaged_table_is_refused_with_the_line(tmp_path, change, message):
    path = tmp_path / "records.csv"
    write_records(
        path, [CountRecord(1.0, 2.0, 3.0, 4.5, 7, 10.0, 9.0), CountRecord(2.0, 2.0, 3.0, 4.5, 4, 10.0, 9.0)]
    )
    path.write_text(change(path.read_text()))
    limit = csv.field_size_limit(131_072)  # Python's own; reverse_geocode sets another one for the whole process
    try:
        with pytest.raises(InputError, match=message):
            read_records(path)
    finally:
        csv.field_size_limit(limit)


def write_bag(folder, many):
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/counts", CLOUD, typestore=STORE)
        for one in many:
            stamp_ns = int(one.stamp_s) * 10**9
            row = (one.x_m, one.y_m, one.z_m, one.raw_counts, one.exposure_s, one.effective_exposure_s, 1, 1, 1)
            message = cloud(np.array([row], COUNTS), stamp_ns=stamp_ns)
            writer.write(topic, stamp_ns, STORE.serialize_cdr(message, CLOUD))


def test_records_come_from_a_table_or_a_bag(tmp_path):
    write_records(tmp_path / RECORDS, scattered())
    write_bag(tmp_path / "bag", scattered())
    for source in (tmp_path, tmp_path / "bag"):
        assert read_earlier(source) == scattered()
    with pytest.raises(InputError, match=r"no topic '/salt/counts'.*/counts "):
        read_earlier(tmp_path / "bag", "salt")


def test_a_journal_is_no_start_of_a_map(tmp_path):
    Journal.open(tmp_path).close()
    with pytest.raises(InputError, match=r"neither records.csv nor a bag.*record_dir continues the map"):
        read_earlier(tmp_path)
