# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples: checked, merged exactly or one by one, never made of masked values, and pooled."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from count_records import drive, records
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Variogram
from soilmoist_ros.mapping.records import DrivenPaths, SampleMerger, StampLimits
from soilmoist_ros.mapping.samples import MIN_SPREAD_M2, Samples, merge_exactly, path_spread, pooled
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve

MODEL = Variogram("exponential", 0.0, 20.0, 0.1)


@pytest.mark.parametrize(
    ("xy", "counts", "exposure_s", "message"),
    [
        ([[0, 0], [1, np.nan]], [1, 1], [1, 1], r"xy must be finite, got \[ 1. nan\] at index 1"),
        ([[0, 0, 0]], [1], [1], r"xy must have shape \(n, 2\), got \(1, 3\)"),
        ([[0, 0], [1, 1]], [1], [1, 1], r"counts must have shape \(2,\) like xy, got \(1,\)"),
        ([[0, 0], [1, 1]], [1, 1], [[1, 1]], r"exposure_s must have shape \(2,\)"),
        ([[0, 0], [1, 1]], [1, -1], [1, 1], "counts must be whole numbers >= 0, got -1.0 at index 1"),
        ([[0, 0], [1, 1]], [1.5, 1], [1, 1], "whole numbers >= 0, got 1.5 at index 0"),
        ([[0, 0], [1, 1]], [np.inf, 1], [1, 1], "whole numbers >= 0, got inf at index 0"),
        ([[0, 0], [1, 1]], [1, 1], [1, 0], "exposure_s must be > 0 and finite, got 0.0 at index 1"),
        ([[0, 0], [1, 1]], [1, 1], [np.inf, 1], "exposure_s must be > 0 and finite, got inf at index 0"),
    ],
)
def test_samples_refuse_bad_input_and_name_the_first_offender(xy, counts, exposure_s, message):
    with pytest.raises(ValueError, match=message):
        Samples(xy, counts, exposure_s)


def test_merge_exactly_keeps_the_order_of_first_appearance():
    xy = [[5, 5], [0.0, 1], [5, 5], [-0.0, 1], [-9, 0]]
    places, place = merge_exactly(Samples(xy, [1, 2, 4, 8, 16], [1, 1, 2, 2, 3]))
    np.testing.assert_array_equal(places.xy, [[5, 5], [0, 1], [-9, 0]])
    np.testing.assert_array_equal(places.counts, [5, 10, 16])
    np.testing.assert_array_equal(places.exposure_s, [3, 3, 3])
    np.testing.assert_array_equal(place, [0, 1, 0, 1, 2])


# -- spreads -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "spread",
    [
        [[-1, 0, 1], [0, 0, 0]],
        [[1, 2, 1], [0, 0, 0]],
        [[0, 0, np.nan], [0, 0, 0]],
        np.zeros((3, 3)),
        0.0,
        [0, 0, 0, -1],
    ],
)
def test_impossible_spreads_are_refused(spread):
    with pytest.raises(ValueError, match="spread must"):
        Samples([[0, 0], [1, 0]], [1, 2], [10, 10], spread)


@pytest.mark.parametrize(
    ("masked", "message"), [(0, "xy must be finite"), (1, "counts must be whole"), (2, "exposure_s must be > 0")]
)
def test_masked_values_are_no_numbers(masked, message):
    data = [np.ma.masked_array(values, dtype=float) for values in ([(0, 0), (9, 0)], [300, 320], [100, 100])]
    assert len(Samples(*data)) == 2  # a mask that masks nothing is no fault
    data[masked] = np.ma.masked_equal(data[masked], data[masked].flat[0])
    with pytest.raises(ValueError, match=message):
        Samples(*data)


def test_masked_places_are_refused():
    corners = np.ma.masked_equal([(0.0, 0.0), (45.0, 0.0), (20.0, 30.0)], 45.0)
    with pytest.raises(ValueError, match="x_m must be a finite vector"):
        PoissonKriging(MODEL).predict_grid(np.ma.masked_equal([0.0, 5.0], 5.0), [0.0])
    with pytest.raises(ValueError, match="all finite"):
        FieldGrid.from_track(corners, 5.0)
    with pytest.raises(ValueError, match="is not finite"):
        FieldGrid.from_polygon(corners, 5.0)
    places = LocalFrame(50.0, 10.0).to_local(np.ma.masked_array([50.0, 50.1], mask=[False, True]), [10.0, 10.0])
    assert places[0].tolist() == [0.0, 0.0]
    assert np.isnan(places[1]).all()


@pytest.mark.parametrize("curve", [CalibrationCurve(6.0, 1.4), UniversalCurve(6.0, 1.4, humidity_gm3=5.0)])
def test_a_masked_rate_has_no_moisture(curve):
    rate = np.ma.masked_array([3.0, 3.5], mask=[False, True])
    vwc, (same, sd) = curve.vwc(rate), curve.vwc_and_sd(rate, np.full(2, 0.1))
    assert vwc[0] == same[0] == pytest.approx(float(curve.vwc(3.0)))
    assert np.isnan([vwc[1], same[1], sd[1], curve.rate_cps(np.ma.masked_array([0.2], mask=True))[0]]).all()


RNG = np.random.default_rng(3)
SAMPLES = Samples(RNG.uniform(0, 200, (700, 2)), RNG.poisson(60.0, 700), RNG.uniform(5, 30, 700))


@pytest.mark.parametrize("most", [1, 7, 100, 699])
def test_pools_have_the_counts_exposure_and_moments_of_their_samples(most):
    pools = pooled(SAMPLES, most)
    assert 0.25 * most <= len(pools) <= most
    assert pools.counts.sum() == SAMPLES.counts.sum()
    assert pools.exposure_s.sum() == pytest.approx(SAMPLES.exposure_s.sum())

    def moments(of):
        weight = of.exposure_s / of.exposure_s.sum()
        centre = weight @ of.xy
        x, y = (of.xy - centre).T
        return [*centre, *(weight @ (of.spread[:, :3] + np.column_stack([x * x, x * y, y * y])))]

    np.testing.assert_allclose(moments(pools), moments(SAMPLES), rtol=0.002)


# Records -------------------------------------------------------------------------------------------------------

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
