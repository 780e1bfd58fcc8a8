# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from count_records import drive, record, records
from soilmoist_ros.mapping import FieldGrid, Samples, estimate_variogram, make_soil_map
from soilmoist_ros.mapping.field_map import (
    RECENT,
    REFIT_GROWTH,
    SEARCH_GROWTH,
    FieldMap,
    FieldMapSettings,
    fits_footprint,
)
from soilmoist_ros.mapping.records import Skip
from soilmoist_ros.mapping.samples import footprint_spread, path_spread
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.records import NAN
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

CURVE = CalibrationCurve(6.0, 1.4)
GRID = FieldGrid.from_polygon(
    [(0, 0), (60, 0), (60, 50), (0, 50)], 5.0, [[(25, 20), (30, 20), (30, 26), (25, 26)]]
)


def field_map(**changes):
    return FieldMap(GRID, FieldMapSettings(**{"curve": CURVE, **changes}))


@pytest.mark.parametrize(
    ("bad", "reason", "why"),
    [
        (record(quarantine="noisy_tube"), Skip.QUARANTINED, "noisy_tube"),
        (record(NAN, NAN), Skip.NO_POSITION, "no position"),
        (record(10.0, math.inf), Skip.NO_POSITION, "no position"),
        (record(-12.0, 20.0), Skip.OUTSIDE, "at x = -12.0 m, y = 20.0 m, 2 m west of the field"),
        (record(exposure_s=0.0), Skip.IMPLAUSIBLE, "exposure of 0 s"),
        (record(effective_exposure_s=NAN), Skip.IMPLAUSIBLE, "effective exposure of nan s"),
        (record(exposure_s=math.inf), Skip.IMPLAUSIBLE, "exposure of inf s"),
        (record(exposure_s=1e5, effective_exposure_s=1e5), Skip.IMPLAUSIBLE, "exposure of 100000 s"),
        (record(effective_exposure_s=1e-3), Skip.IMPLAUSIBLE, "correction by a factor of 10000"),
        (record(effective_exposure_s=1e4), Skip.IMPLAUSIBLE, "correction by a factor of 0.001"),
        (record(raw_counts=-1), Skip.IMPLAUSIBLE, "-1 counts in 9 s"),
        (record(raw_counts=4_000_000_000), Skip.IMPLAUSIBLE, "4000000000 counts in 9 s"),
    ],
)
def test_what_cannot_be_used_is_left_out_and_counted(bad, reason, why):
    the_map = field_map()
    assert the_map.add(record()) is None
    before = the_map.state
    assert the_map.add(bad) is reason
    assert the_map.state is before
    assert (the_map.skipped[reason].count, the_map.skipped[reason].example) == (1, f"record at 7.0 s: {why}")
    assert len(the_map.track) == (2 if reason in (Skip.NO_POSITION, Skip.QUARANTINED) else 1)


@pytest.mark.parametrize("place", [(-9.0, 20.0), (69.0, 25.0), (27.0, 23.0), (0.0, 0.0)])
def test_the_margin_and_no_go_areas_count(place):
    assert field_map().add(record(*place)) is None


def test_trouble_is_what_hits_most_of_the_last_records():
    the_map = field_map()
    assert the_map.trouble is None
    the_map.add(record(NAN, NAN))
    assert the_map.trouble is Skip.NO_POSITION
    for _ in range(RECENT):
        the_map.add(record())
    assert the_map.trouble is None
    for _ in range(RECENT // 2 + 1):
        the_map.skip(Skip.UNREADABLE, "too short")
    assert the_map.trouble is Skip.UNREADABLE


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.lists(records, min_size=1, max_size=25), st.data())
def test_the_map_of_a_state_does_not_depend_on_which_maps_were_computed(many, data):
    looked_at = data.draw(st.sets(st.integers(0, len(many) - 1)))
    watched, replayed = field_map(), field_map()
    for number, one in enumerate(many):
        watched.add(one)
        replayed.add(one)
        if number in looked_at:
            watched.compute(watched.state)
    found, expected = watched.compute(watched.state), replayed.compute(replayed.state)
    for band, wanted in zip(found.bands, expected.bands, strict=True):
        assert band.tobytes() == wanted.tobytes()
    assert found.variogram == expected.variogram


def test_a_state_stays_as_it_was_while_records_come_in():
    the_map = field_map()
    the_map.add(record())
    state = the_map.state
    before = the_map.compute(state).rate
    for x_m in (30.0, 40.0, 50.0):
        the_map.add(record(x_m, raw_counts=90))
    assert (state.records, len(state.samples)) == (1, 1)
    np.testing.assert_array_equal(the_map.compute(state).rate, before)
    assert not np.array_equal(the_map.compute(the_map.state).rate, before, equal_nan=True)


def test_the_variogram_is_fitted_to_every_record_at_first_and_rarely_later():
    the_map = field_map()
    fits, searches = [], []
    for _ in range(1000):
        the_map.add(record())
        fits.append(the_map.state.fit_samples)
        searches.append(the_map.state.search_samples)
    assert len(set(fits[:10])) == 10
    assert len(set(fits[500:])) <= 1 + math.log(2) / math.log(1 + REFIT_GROWTH)
    assert len(set(searches[500:])) <= 2 + math.log(2) / math.log(1 + SEARCH_GROWTH)


@pytest.mark.slow
def test_between_searches_a_fit_has_the_direction_of_the_last_one():
    rng = np.random.default_rng(5)
    the_map, directions = field_map(merge_radius_m=0.0), {}
    for x_m, y_m in rng.uniform((0, 0), (60, 50), (60, 2)).tolist():
        the_map.add(record(x_m, y_m, raw_counts=int(rng.poisson(40 + 15 * math.sin(x_m / 5)))))
        variogram = the_map.fit(the_map.state).variogram
        found = directions.setdefault(the_map.state.search_samples, variogram)
        assert (variogram.anisotropy, variogram.angle_deg) == (found.anisotropy, found.angle_deg)
    assert variogram.anisotropy > 1
    samples = the_map.state.fit_samples
    alone = estimate_variogram(samples.xy, samples.counts, samples.exposure_s, extent_m=GRID.extent_m).variogram
    assert variogram.range_m == pytest.approx(alone.range_m, rel=0.2)


def test_soft_l1_waits_for_two_places():
    the_map = field_map(fit="soft_l1")
    for place in ((10.0, 20.0), (10.5, 20.0)):
        the_map.add(record(*place))
        assert the_map.compute(the_map.state) is None
    the_map.add(record(40.0, 20.0))
    assert np.isfinite(the_map.compute(the_map.state).rate[GRID.mask]).all()
    assert field_map().compute(field_map().state) is None


def test_reset_makes_it_new():
    the_map = field_map()
    for x_m in (10.0, 30.0, NAN):
        the_map.add(record(x_m))
    snapshot = the_map.snapshot()
    the_map.reset()
    assert the_map.state.records == 0
    assert (the_map.track, the_map.skipped, the_map.compute(the_map.state)) == ([], {}, None)
    assert (snapshot.state.records, len(snapshot.track), list(snapshot.skipped)) == (2, 3, [Skip.NO_POSITION])
    the_map.add(record(50.0))
    np.testing.assert_array_equal(the_map.state.samples.xy, [[50, 20]])


def test_settings_out_of_range_are_refused():
    for changes, message in (({"margin_m": -1.0}, "margin_m must be >= 0"), ({"merge_radius_m": NAN}, "radius_m")):
        with pytest.raises(ValueError, match=message):
            FieldMap(GRID, dataclasses.replace(FieldMapSettings(), **changes))


# -- counts gathered while driving, and over a footprint --------------------------------------------------


def test_records_of_a_drive_have_an_extent_and_those_of_a_stop_have_none():
    the_map = field_map(merge_radius_m=2.0)
    rng = np.random.default_rng(1)
    stop = [
        record(41 + dx, 20 + dy, stamp_s=160 + 10.0 * i) for i, (dx, dy) in enumerate(rng.normal(0, 0.3, (30, 2)))
    ]
    for one in drive(6) + stop:
        assert the_map.add(one) is None
    samples = the_map.state.samples
    np.testing.assert_array_equal(samples.counts, [40] * 6 + [1200])
    np.testing.assert_allclose(samples.spread[1:6], [path_spread([6.0, 0.0])] * 5)
    assert not samples.spread[[0, 6]].any()


def test_the_footprint_is_part_of_every_sample_when_it_is_to_be_deconvolved():
    plain, sharp = field_map(), field_map(footprint_radius_m=10.0)
    for one in [*drive(4), record(10.0, 40.0, stamp_s=500.0)]:
        plain.add(one)
        sharp.add(one)
    added = sharp.state.samples.spread - plain.state.samples.spread
    np.testing.assert_allclose(added, [footprint_spread(10.0)] * len(added))
    with pytest.raises(ValueError, match="radius of a footprint"):
        field_map(footprint_radius_m=-1.0)


PLANNING = FieldMapSettings()
RNG = np.random.default_rng(6)
SAMPLES = Samples(RNG.uniform(0, 50, (9, 2)), RNG.poisson(400, 9), np.full(9, 100.0))


def test_samples_and_variogram_from_elsewhere_give_the_same_map():
    own, given = FieldMap(GRID, PLANNING), FieldMap(GRID, PLANNING)
    for xy, counts, exposure_s in zip(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, strict=True):
        own.add_sample((xy[0], xy[1]), counts, exposure_s)
    soil_map = own.update()
    given.set_samples(SAMPLES, soil_map.fit)
    given.update()
    np.testing.assert_array_equal(given.rate, own.rate)
    np.testing.assert_array_equal(given.variance, own.variance)
    assert given.soil_map.fit is soil_map.fit


def test_a_whole_survey_is_mapped_as_by_kriging_to_the_last_digits():
    """Records of a file: merged as on line, and within rounding of an exact kriging."""
    many = [record(x, y, stamp_s=10.0 * n, raw_counts=30 + n % 7) for n, (x, y) in enumerate(GRID.cells[::3])]
    field_map = FieldMap(GRID, FieldMapSettings(merge_radius_m=6.0, footprint_radius_m=4.0, curve=CURVE))
    field_map.set_records(many)
    found = field_map.compute(field_map.state)
    on_line = FieldMap(GRID, FieldMapSettings(merge_radius_m=6.0, footprint_radius_m=4.0))
    for one in many:
        on_line.add(one)
    samples = on_line.samples
    np.testing.assert_array_equal(field_map.samples.xy, samples.xy)
    fit = estimate_variogram(
        samples.xy, samples.counts, samples.exposure_s, extent_m=GRID.extent_m, spread=samples.spread,
        local_noise=True,
    )  # fmt: skip
    assert (field_map.state.records, field_map.state.stamp_s) == (len(many), many[-1].stamp_s)
    for band, expected in zip(found.bands, make_soil_map(samples, GRID, fit, CURVE).bands, strict=True):
        np.testing.assert_allclose(band, expected, rtol=1e-10)


def test_a_quarantined_record_is_kept_in_the_track_and_out_of_the_map():
    good, bad = record(), record(x_m=30.0, raw_counts=4000, quarantine="impossible_count")
    the_map, whole = field_map(), field_map()
    assert (the_map.add(good), the_map.add(bad)) == (None, Skip.QUARANTINED)
    whole.set_records([good, bad])
    for one in (the_map, whole):
        assert one.track == [good, bad]
        assert one.samples.counts.tolist() == [40]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["strips", "smooth"])
def test_a_footprint_to_which_the_counts_object_is_not_deconvolved(name):
    """Strips of 5 m, counted by a sensor that sees its own place, are too sharp for a footprint of 20 m."""
    rng = np.random.default_rng(1)
    field = surrogate_field(name, rng)
    x, y = np.meshgrid(np.arange(2.5, 60, 5.0), np.arange(2.5, 50, 5.0))
    places = np.column_stack([x.ravel(), y.ravel()])
    counts, exposure_s = rng.poisson(600 * field.rate_at(places)), np.full(len(places), 600.0)
    samples = Samples(places, counts, exposure_s, footprint_spread(20.0))
    fits = name == "smooth"
    assert fits_footprint(samples, "matern32", 60.0) == fits
    for deconvolve, radius_m in ((None, 20.0 if fits else 0.0), (True, 20.0), (False, 0.0)):
        choices = FieldMapSettings(footprint_radius_m=20.0, deconvolve=deconvolve)
        the_map = FieldMap(field.field.grid(4.0), choices)
        the_map.set_samples(samples if choices.sample_radius_m else samples.without_footprint)
        assert the_map.update().deconvolved_m == radius_m
        assert the_map.soil_map.footprint_radius_m == 20
