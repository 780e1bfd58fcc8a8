# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps that a record can have."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from count_records import drive, records
from soilmoist_ros.mapping.records import DrivenPaths, SampleMerger, StampLimits
from soilmoist_ros.mapping.samples import MIN_SPREAD_M2, path_spread

HOUR_S, DAY_S = 3600.0, 86400.0
NOW_S = 1.78e9


@pytest.mark.parametrize(
    ("stamp_s", "clock_s", "fault"),
    [
        (NOW_S, NOW_S, ""),
        (NOW_S + HOUR_S, NOW_S, ""),
        (NOW_S + HOUR_S + 1, NOW_S, "a record stamped 3601 s ahead of the clock"),
        (NOW_S - DAY_S, NOW_S, ""),
        (NOW_S - DAY_S - 1, NOW_S, "a record stamped 86401 s behind the clock"),
        (NOW_S, 0.0, ""),
        (math.nan, NOW_S, "a record without a stamp"),
        (0.0, 10.0, "a record without a stamp"),
        (math.inf, 0.0, "a record without a stamp"),
    ],
)
def test_stamps(stamp_s, clock_s, fault):
    assert StampLimits().fault(stamp_s, clock_s) == fault


def merged(places, radius_m):
    merger = SampleMerger(radius_m)
    for x_m, y_m in places:
        merger.add(x_m, y_m, 40, 10.0)
    return merger.samples


@pytest.mark.slow
@given(
    st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
    st.lists(st.tuples(st.floats(0, 1.25), st.floats(0, 2 * math.pi)), min_size=1, max_size=300),
)
def test_a_robot_that_stands_still_takes_one_sample_however_long_it_stands(stop, jitter):
    places = [(stop[0] + d * math.cos(angle), stop[1] + d * math.sin(angle)) for d, angle in jitter]
    assert len(merged(places, radius_m=2.5 + 1e-9)) == 1


def test_a_record_joins_the_nearest_sample_and_moves_it_by_its_share_of_the_exposure():
    merger = SampleMerger(4.0)
    merger.add(0.0, 0.0, 10, 30.0)
    merger.add(7.0, 0.0, 20, 10.0)
    merger.add(4.0, 0.0, 1, 10.0)  # within reach of both
    np.testing.assert_array_equal(merger.samples.xy, [[0, 0], [5.5, 0]])
    np.testing.assert_array_equal(merger.samples.counts, [10, 21])
    merger.add(4.0, 0.0, 5, 10.0)
    merger.add(-4.0, 0.0, 5, 10.0)  # at the very edge
    np.testing.assert_array_equal(merger.samples.xy, [[-1, 0], [5, 0]])
    merger.add(0.0, 4.2, 5, 10.0)
    assert len(merger) == 3


def test_a_drive_becomes_a_chain_of_samples_about_two_radii_apart():
    samples = merged([(0.5 * i, 0.0) for i in range(1000)], radius_m=2.5)
    np.testing.assert_allclose(np.diff(samples.xy[:, 0]), 5.0)


def spreads(many):
    ways = DrivenPaths()
    return np.array([ways.spread(one) for one in many])


def test_a_record_has_the_path_since_the_one_before():
    found = spreads(drive(4, (3.0, -5.0)))
    np.testing.assert_allclose(found[1:], [path_spread([3.0, -5.0])] * 3)
    assert not found[0].any()


def test_paths_of_records_with_a_lost_one_between_are_halved():
    many = drive(5)
    found = spreads(many[:2] + many[3:])
    np.testing.assert_allclose(found[1:], [path_spread([6.0, 0.0])] * 3)


@pytest.mark.parametrize("gap_s", [0.0, 5.0, 60.0, -30.0])
def test_records_that_do_not_follow_each_other_have_no_path(gap_s):
    first, second = drive(2)
    assert not spreads([first, dataclasses.replace(second, stamp_s=first.stamp_s + gap_s)]).any()


def test_robots_that_share_a_map_keep_their_paths_apart():
    east, north = drive(6), drive(6, (0.0, 4.0), (50.0, 10.0))
    both = spreads([one for pair in zip(east, north, strict=True) for one in pair])
    np.testing.assert_allclose(both[2::2], [path_spread([6.0, 0.0])] * 5)
    np.testing.assert_allclose(both[3::2], [path_spread([0.0, 4.0])] * 5)


@pytest.mark.slow
@given(
    st.lists(st.tuples(records, st.floats(-40, 40), st.floats(-40, 40)), min_size=1, max_size=30),
    st.floats(0, 30),
    st.sampled_from([0.0, 10.0]),
)
def test_merging_conserves_the_second_moments(many, radius_m, footprint_m):
    merger = SampleMerger(radius_m, footprint_m)
    total = np.zeros(3)
    for one, east, north in many:
        way = path_spread([east, north])
        merger.add(one.x_m, one.y_m, one.raw_counts, one.effective_exposure_s, way)
        at = np.array([one.x_m**2, one.x_m * one.y_m, one.y_m**2])
        total += one.effective_exposure_s * (at + way[:3])
    samples = merger.samples
    x, y = samples.xy.T
    found = samples.exposure_s @ (np.column_stack([x * x, x * y, y * y]) + samples.spread[:, :3])
    np.testing.assert_allclose(found, total, rtol=1e-9, atol=MIN_SPREAD_M2 * samples.exposure_s.sum())
    np.testing.assert_array_equal(samples.spread[:, 3], footprint_m)
