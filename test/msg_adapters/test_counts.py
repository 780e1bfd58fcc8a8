# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes of devices over the wire."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.counts import (
    counts_from_message,
    counts_to_message,
    line_to_message,
    quarantined_to_message,
    samples_from_message,
    samples_to_message,
)
from msg_adapters.point_cloud import OtherFrameError, require_frame, to_seconds
from soilmoist_ros.mapping import Samples
from soilmoist_ros.mapping.samples import path_spread
from soilmoist_ros.recording import line_bytes
from soilmoist_ros.recording.bag.messages import NUMBERS, UNKNOWN_REASON
from soilmoist_ros.sensing import CountRecord, Kind

coordinates = st.floats(-5e4, 5e4, width=32)
positive = st.floats(1e-3, 1e5)
records = st.builds(
    CountRecord, stamp_s=st.integers(0, 2**31 - 2).map(float), x_m=coordinates, y_m=coordinates, z_m=coordinates,
    raw_counts=st.integers(0, 2**32 - 1), exposure_s=positive, effective_exposure_s=positive, f_pressure=positive,
    f_humidity=positive, f_intensity=positive,
)  # fmt: skip


@given(st.lists(records, min_size=1, max_size=5))
def test_several_records_keep_their_stamps(many):
    message = counts_to_message(many)
    assert counts_from_message(message) == many
    assert to_seconds(message.header.stamp) == many[-1].stamp_s


def test_a_message_from_before_the_offsets_is_read():
    many = [CountRecord(stamp_s, 1.0, 2.0, 3.0, 4, 10.0, 9.0) for stamp_s in (1.78e9, 1.78e9 + 10.1)]
    message = counts_to_message(many)
    assert message.fields.pop().name == "stamp_offset_s"
    assert counts_from_message(message) == [replace(record, stamp_s=many[-1].stamp_s) for record in many]


def test_messages_of_another_kind_are_refused():
    record = CountRecord(0.0, 1.0, 2.0, 3.0, 4, 10.0, 9.0)
    with pytest.raises(ValueError, match="has no field 'x'"):
        counts_from_message(PointCloud2())
    message = counts_to_message([record])
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match="its data end early"):
        counts_from_message(message)
    message = counts_to_message([record])
    message.fields[3].datatype = 7
    with pytest.raises(ValueError, match="field 'raw_counts' is of datatype 7"):
        counts_from_message(message)
    with pytest.raises(ValueError, match="at least one record"):
        counts_to_message([])


def test_points_of_another_frame_are_refused():
    message = counts_to_message([CountRecord(0.0, 1.0, 2.0, 3.0, 4, 10.0, 9.0)], "/map")
    require_frame(message, "map")
    with pytest.raises(OtherFrameError, match="1 points in frame '/map' instead of 'odom'"):
        require_frame(message, "odom")
    message.header.frame_id = ""
    with pytest.raises(OtherFrameError, match="in frame '' instead"):
        require_frame(message, "map")


@given(st.lists(records, min_size=1, max_size=5), st.sampled_from(sorted(NUMBERS)))
def test_quarantined_records_keep_their_values_and_reasons(many, reason):
    bad = [replace(record, quarantine=reason) for record in many]
    message = quarantined_to_message(bad)
    assert counts_from_message(message) == bad
    assert to_seconds(message.header.stamp) == many[-1].stamp_s


def test_the_numbers_of_reasons_stay():
    assert NUMBERS == {
        "noisy_tube": 1, "dead_tube": 2, "stuck_tube": 3, "impossible_count": 4, "impossible_weather": 5,
        "frozen_pressure": 6, "place_jump": 7, "clock_drift": 8, "overdispersed": 9, "unexpected_count": 10,
        "rate_jump": 11, "place_doubt": 12,
    }  # fmt: skip
    kinds = list(Kind)
    assert set(NUMBERS) == set(kinds[kinds.index(Kind.NOISY_TUBE) :]), "each kind of bad record needs a number"


def test_unknown_reasons_and_impossible_counts_are_carried_too():
    bad = CountRecord(1.78e9, 1.0, 2.0, 3.0, 10**12, 10.0, 9.0, quarantine="of_a_later_release")
    [found] = counts_from_message(quarantined_to_message([bad]))
    assert found == replace(bad, raw_counts=2**32 - 1, quarantine=UNKNOWN_REASON)


# Samples --------------------------------------------------------------------------------------------------------

sample_coordinates = st.floats(-5e4, 5e4, width=32)
sample = st.tuples(sample_coordinates, sample_coordinates, st.integers(0, 2**53), st.floats(1e-3, 1e9))
ways = st.tuples(sample_coordinates, sample_coordinates).map(path_spread)


def columns(rows, spread=(0.0, 0.0, 0.0)):
    table = np.array(rows, float).reshape(-1, 4)
    return Samples(table[:, :2], table[:, 2], table[:, 3], np.asarray(spread, float))


@settings(deadline=None)
@given(st.lists(sample, max_size=5), ways, st.floats(1e8, 2e9))
def test_samples_come_back_exactly_over_the_wire(rows, spread, stamp_s):
    samples = columns(rows, spread.astype(np.float32))
    wire = serialize_message(samples_to_message(samples, stamp_s, "field"))
    message = deserialize_message(wire, PointCloud2)
    found = samples_from_message(message)
    for name in ("xy", "counts", "exposure_s", "spread"):
        np.testing.assert_array_equal(getattr(found, name), getattr(samples, name))
    assert to_seconds(message.header.stamp) == stamp_s
    assert (message.header.frame_id, message.height, message.width) == ("field", 1, len(rows))
    assert message.is_dense


def test_places_are_rounded_to_what_viewers_take():
    message = samples_to_message(columns([[5000.123456789, -0.1, 3, 10.0]]), 0.0)
    spread = ["spread_xx", "spread_xy", "spread_yy", "footprint_radius_m"]
    names = ["x", "y", "z", "raw_counts", "effective_exposure_s", *spread]
    assert [field.name for field in message.fields] == names
    np.testing.assert_allclose(samples_from_message(message).xy, [[5000.123456789, -0.1]], atol=3e-4, rtol=0)


def test_samples_of_another_kind_are_refused():
    message = samples_to_message(columns([[1, 2, 3, 10.0]]), 0.0)
    data = bytes(message.data)
    message.data = data[:-20] + np.float64(-1).tobytes() + data[-12:]
    with pytest.raises(ValueError, match="exposure_s must be > 0"):
        samples_from_message(message)
    message.data = data[:-4] + np.float32(-1).tobytes()
    with pytest.raises(ValueError, match="spread must be the second moments"):
        samples_from_message(message)


# Bytes of devices over the wire ---------------------------------------------------------------------------------


@given(st.binary())
def test_every_byte_comes_back(line):
    message = deserialize_message(serialize_message(line_to_message(line)), String)
    assert line_bytes(message.data) == line
