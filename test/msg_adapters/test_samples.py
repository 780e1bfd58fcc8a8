# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.point_cloud import points_to_message
from msg_adapters.samples import samples_from_message, samples_to_message
from msg_adapters.stamps import to_seconds
from soilmoist_ros.mapping import Samples
from soilmoist_ros.mapping.samples import path_spread

coordinates = st.floats(-5e4, 5e4, width=32)
sample = st.tuples(coordinates, coordinates, st.integers(0, 2**53), st.floats(1e-3, 1e9))
ways = st.tuples(coordinates, coordinates).map(path_spread)


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


def test_the_time_comes_back_exactly():
    none = columns([])
    for stamp_s in np.random.default_rng(1).uniform(1e9, 2e9, 200).tolist():
        assert to_seconds(samples_to_message(none, stamp_s).header.stamp) == stamp_s


def test_places_are_rounded_to_what_viewers_take():
    message = samples_to_message(columns([[5000.123456789, -0.1, 3, 10.0]]), 0.0)
    spread = ["spread_xx", "spread_xy", "spread_yy", "footprint_radius_m"]
    names = ["x", "y", "z", "raw_counts", "effective_exposure_s", *spread]
    assert [field.name for field in message.fields] == names
    np.testing.assert_allclose(samples_from_message(message).xy, [[5000.123456789, -0.1]], atol=3e-4, rtol=0)


def test_messages_of_another_kind_are_refused():
    with pytest.raises(ValueError, match="has no field 'x'"):
        samples_from_message(PointCloud2())
    message = samples_to_message(columns([[1, 2, 3, 10.0], [4, 5, 6, 10.0]]), 0.0)
    message.width = 3
    message.row_step = 3 * message.point_step
    with pytest.raises(ValueError, match="its data end early"):
        samples_from_message(message)
    message = samples_to_message(columns([[1, 2, 3, 10.0]]), 0.0)
    data = bytes(message.data)
    message.data = data[:-20] + np.float64(-1).tobytes() + data[-12:]
    with pytest.raises(ValueError, match="exposure_s must be > 0"):
        samples_from_message(message)
    message.data = data[:-4] + np.float32(-1).tobytes()
    with pytest.raises(ValueError, match="spread must be the second moments"):
        samples_from_message(message)


def test_samples_without_spreads_are_points():
    samples = columns([[1, 2, 3, 10.0], [4, 5, 6, 10.0]], [4.0, 1.0, 2.0])
    counted = [("raw_counts", "<f8"), ("effective_exposure_s", "<f8")]
    points = np.zeros(2, [*((name, "<f4") for name in "xyz"), *counted])
    points["x"], points["y"] = samples.xy.T
    points["raw_counts"], points["effective_exposure_s"] = samples.counts, samples.exposure_s
    found = samples_from_message(points_to_message(points, 0.0))
    np.testing.assert_array_equal(found.xy, samples.xy)
    np.testing.assert_array_equal(found.counts, samples.counts)
    np.testing.assert_array_equal(found.spread, np.zeros((2, 4)))
