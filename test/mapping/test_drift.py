# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A drift of the mean rate: drift.py, and the maps that know of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import (
    Change,
    Changing,
    Drift,
    FieldGrid,
    FieldMap,
    FieldMapSettings,
    PoissonKriging,
    Samples,
    TimedSamples,
    Variogram,
    make_soil_map,
)
from soilmoist_ros.mapping.drift import MAX_SAMPLES, MIN_PROBABILITY, STILL, _drift, _Evidence, find_change
from soilmoist_ros.sensing.records import CountRecord

VARIOGRAM = Variogram("matern32", nugget=0.01, range_m=20.0, sill=0.4)
GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=5.0)
HOURS = 2.0


def survey(seed, change=0.0, passes=3, exposure_s=60.0, mean=4.0):
    """Passes over the same stops of a random field, whose rate changes by a share of the mean."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(5.0, 60, 10), np.arange(5.0, 50, 10))
    stops = np.column_stack([x.ravel(), y.ravel()])
    everywhere = np.concatenate([stops, GRID.cells])
    away = ((everywhere[:, None] - everywhere) ** 2).sum(axis=2)
    covariance = VARIOGRAM.structured_sill * VARIOGRAM.correlation_of_square(away / VARIOGRAM.range_m**2)
    field = mean + np.linalg.cholesky(covariance + 1e-9 * np.eye(len(away))) @ rng.normal(size=len(away))
    xy = np.concatenate([stops + rng.normal(0, 0.02, stops.shape) for _ in range(passes)])
    time_s = np.linspace(0, HOURS * 3600, len(xy))
    rate = np.tile(field[: len(stops)], passes) + change * mean * time_s / time_s[-1]
    counts = rng.poisson(rate * exposure_s)
    timed = TimedSamples(Samples(xy, counts, np.full(len(xy), exposure_s)), time_s)
    return timed, field[len(stops) :] + change * mean


def records(timed):
    one = timed.samples
    return [
        CountRecord(time_s, x, y, 0.0, int(counts), exposure_s, exposure_s)
        for time_s, (x, y), counts, exposure_s in zip(
            timed.time_s.tolist(), one.xy.tolist(), one.counts.tolist(), one.exposure_s.tolist(), strict=True
        )
    ]


def map_errors(surveys, *change):
    """Root mean squared errors of maps with the drift model and without."""
    errors = []
    for seed in range(surveys):
        timed, truth = survey(seed, *change)
        maps = []
        for drift in ("auto", "off"):
            field_map = FieldMap(GRID, FieldMapSettings(drift_model=drift))
            field_map.set_records(records(timed))
            field_map.update()
            maps.append(np.mean((field_map.rate - truth) ** 2))
        errors.append(maps)
    return np.sqrt(np.mean(errors, axis=0))


@pytest.mark.slow
def test_a_drift_is_found_and_nearly_never_where_there_is_none():
    found = [find_change(survey(seed, 0.1)[0], HOURS * 3600, VARIOGRAM).drift for seed in range(20)]
    false = [find_change(survey(seed)[0], HOURS * 3600, VARIOGRAM).drift for seed in range(30)]
    assert sum(drift is not None for drift in found) >= 18
    assert sum(drift is not None and drift.probability > 0.9 for drift in false) <= 2
    assert np.median([drift.change for drift in found if drift]) == pytest.approx(0.1, abs=0.02)
    inside = [abs(drift.change - 0.1) < 1.96 * drift.change_sd for drift in found if drift]
    assert np.mean(inside) >= 0.8


SURFACES = {
    "slope": lambda x, y: y / 50,
    "bowl": lambda x, y: ((x - 30) / 30) ** 2 + ((y - 25) / 25) ** 2,
    "wet end": lambda x, y: 1 / (1 + np.exp((y - 35) / 3)),
    "ridges": lambda x, y: 0.5 + np.sin(x / 5) * np.cos(y / 8) / 3 + y / 100,
    "hill": lambda x, y: np.exp(-((x - 40) ** 2 + (y - 15) ** 2) / 200),
}


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("exposure_s", [10.0, 60.0])
def test_the_pattern_of_a_field_is_no_drift(surface, exposure_s):
    """A single sweep from south to north, of 2.5 to 5.5 counts/s: each pattern is a change over time as well."""
    y, x = (axis.ravel() for axis in np.meshgrid(np.arange(2.5, 50, 5), np.arange(2.5, 60, 5), indexing="ij"))
    time_s = np.linspace(0, HOURS * 3600, len(x))
    of_cells = surface(*GRID.cells.T)
    rate = np.interp(surface(x, y), (of_cells.min(), of_cells.max()), (2.5, 5.5))
    for seed in range(4):
        counts = np.random.default_rng(seed).poisson(rate * exposure_s)
        timed = TimedSamples(Samples(np.column_stack([x, y]), counts, np.full(len(x), exposure_s)), time_s)
        field_map = FieldMap(GRID)
        field_map.set_records(records(timed))
        assert field_map.update().change == Change()


@pytest.mark.slow
@pytest.mark.parametrize("change", [0.1, -0.1, 0.3])
def test_a_drift_does_not_become_a_pattern(change):
    auto, off = map_errors(6, change)
    assert auto < 0.8 * off


def test_without_evidence_the_map_is_that_without_drift_bit_for_bit():
    timed, _ = survey(5)
    maps = []
    for drift in ("auto", "off"):
        field_map = FieldMap(GRID, FieldMapSettings(drift_model=drift))
        for record in records(timed):
            field_map.add(record)
        maps.append(field_map.update())
    assert maps[0].change.drift is None
    assert maps[0].rate.tobytes() == maps[1].rate.tobytes()
    assert maps[0].variance.tobytes() == maps[1].variance.tobytes()


@pytest.mark.parametrize("rain", [False, True])
def test_a_planner_that_is_told_the_drift_has_the_map_of_the_mapper(rain):
    timed, _ = survey(1, 0.0 if rain else 0.3)
    if rain:
        wet = timed.time_s > 0.8 * HOURS * 3600
        counts = np.where(wet, np.round(0.6 * timed.samples.counts), timed.samples.counts)
        timed = TimedSamples(Samples(timed.samples.xy, counts, timed.samples.exposure_s), timed.time_s)
    mapper = FieldMap(GRID)
    mapper.set_records(records(timed))
    soil_map = mapper.update()
    assert soil_map.change.drift.is_jump is rain
    planner, untold = (FieldMap(GRID, FieldMapSettings()) for _ in range(2))
    planner.set_samples(mapper.samples, soil_map.fit, mapper.changing)
    np.testing.assert_array_equal(planner.update().rate, soil_map.rate)
    np.testing.assert_array_equal(planner.soil_map.variance, soil_map.variance)
    untold.set_samples(mapper.samples, soil_map.fit)
    assert not np.allclose(untold.update().rate, soil_map.rate, atol=0.01, equal_nan=True)
    planner.set_samples(mapper.samples, soil_map.fit)
    np.testing.assert_array_equal(planner.update().rate, untold.soil_map.rate)
    assert planner.changing is None


def test_places_visited_long_ago_are_worth_a_return():
    timed, _ = survey(1, passes=1)
    drift = Drift(0.99, False, (0.0, HOURS * 3600), (0.0, 0.0), ((0.3, 0.0),))
    told, untold = (FieldMap(GRID, FieldMapSettings()) for _ in range(2))
    untold.set_samples(timed.samples)
    fit = untold.update().fit
    told.set_samples(timed.samples, fit, Changing(timed, Change(drift), HOURS * 3600))
    told.update()
    variance = [each.kriging.predict(timed.samples.xy)[1] for each in (told, untold)]
    lost = variance[0] / variance[1]
    assert lost[:6].mean() > 1.5 * lost[-6:].mean()
    assert lost[-1] < 1.1


def test_few_samples_one_time_and_many_samples():
    timed, _ = survey(1, 0.3)
    assert find_change(timed.thinned(8), HOURS * 3600, VARIOGRAM).drift is None
    assert find_change(TimedSamples(timed.samples, np.zeros(90)), 0.0, VARIOGRAM).drift is None
    many, _ = survey(1, 0.3, passes=40)
    assert len(many.samples) > MAX_SAMPLES >= len(many.thinned(MAX_SAMPLES).samples)
    assert find_change(many, HOURS * 3600, VARIOGRAM).drift is not None


@pytest.mark.slow
def test_rain_is_seen_and_nearly_never_where_there_is_none():
    rain, none = [], []
    for seed in range(20):
        timed, _ = survey(seed, exposure_s=120.0)
        none.append(find_change(timed, HOURS * 3600, VARIOGRAM))
        wet = timed.time_s > 1.7 * 3600
        counts = np.random.default_rng(seed).binomial(timed.samples.counts.astype(int), np.where(wet, 0.85, 1.0))
        wet_samples = Samples(timed.samples.xy, counts, timed.samples.exposure_s)
        rain.append(find_change(TimedSamples(wet_samples, timed.time_s), HOURS * 3600, VARIOGRAM))
    assert sum(bool(change.rain(HOURS * 3600)) for change in rain) >= 16
    assert not any(change.rain(HOURS * 3600) for change in none)
    seen = [change for change in rain if change.rain(HOURS * 3600)]
    assert np.median([change.jump.since_s for change in seen]) == pytest.approx(1.7 * 3600, abs=600)
    assert np.median([change.jump.share for change in seen]) == pytest.approx(-0.15, abs=0.04)
    assert not any(change.rain(4 * 3600) for change in rain)


@settings(max_examples=30)
@given(st.floats(0.01, 0.03), st.floats(-0.3, 0.3), st.integers(3, 49))
def test_a_drift_is_drawn_to_none_and_only_found_with_evidence(sd, change, knots):
    """What two hours ago was is measured with an error of known size."""
    times_s = np.linspace(0.0, 7200.0, knots)
    first = np.eye(knots)[0] / sd
    assert _drift(_Evidence(times_s, np.zeros((knots, knots)), np.zeros(knots))) is None
    drift = _drift(_Evidence(times_s, np.multiply.outer(first, first), first * change / sd))
    assert (drift is None) == (abs(change) < 2 * sd) or 1.5 < abs(change) / sd < 4
    if drift is not None:
        assert drift.probability >= MIN_PROBABILITY > 1 - STILL
        assert 0 < drift.shares[0] / change < 1
        assert drift.shares[-1] == pytest.approx(0, abs=1e-12)
        assert drift.factor(np.array([0.0, 7200.0, 9000.0])) == pytest.approx([1 + drift.shares[0], 1, 1])


@settings(max_examples=30)
@given(st.integers(0, 1000), st.booleans())
def test_kriging_with_uncertain_rates_is_the_mean_over_them(seed, repeated):
    """The rates have errors of a known covariance that the counts tell nothing of: the law of total variance."""
    rng = np.random.default_rng(seed)
    n, variogram = 12, Variogram("matern32", nugget=0.02, range_m=15.0, sill=0.5)
    xy, targets = rng.uniform(0, 50, (n, 2)), rng.uniform(0, 50, (5, 2))
    if repeated:
        xy[3] = xy[1]
    exposure_s, uncertain = rng.uniform(20, 100, n), rng.normal(0, 0.1, (n, 2))
    counts = rng.poisson(4 * exposure_s)
    plain = PoissonKriging(variogram, mean_rate=4.0).fit(xy, counts, exposure_s)
    kriging = PoissonKriging(variogram, mean_rate=4.0).fit(xy, counts, exposure_s, uncertain=uncertain)
    rate, variance = kriging.predict(targets)
    np.testing.assert_allclose(rate, plain.predict(targets)[0])
    moved = plain.weights(targets)[0].T @ uncertain
    np.testing.assert_allclose(variance, plain.predict(targets)[1] + (moved**2).sum(axis=1))
    smooth = kriging.covariance(targets) - plain.covariance(targets)
    np.testing.assert_allclose(smooth, moved @ moved.T, atol=1e-12)
    new = ([(1.0, 2.0)], [90], [30.0])
    extended = kriging.add(*new).predict(targets)[1] - plain.add(*new).predict(targets)[1]
    moved = plain.weights(targets)[0][:n].T @ uncertain
    np.testing.assert_allclose(extended, (moved**2).sum(axis=1))


def test_a_series_at_one_place_has_no_drift_in_space():
    timed = survey(3, 0.3)[0]
    one = timed.samples
    here = TimedSamples(Samples(np.zeros_like(one.xy), one.counts, one.exposure_s), timed.time_s)
    assert find_change(here, HOURS * 3600, VARIOGRAM) == Change()


@pytest.mark.parametrize("at_once", [False, True])
def test_a_map_with_a_drift_is_of_the_places_of_the_samples(at_once, monkeypatch):
    """A stop has one micro-scale variation, and the number of samples its limit."""
    monkeypatch.setattr("soilmoist_ros.mapping.field_map.MAX_EXACT_SAMPLES", 40)
    timed, _ = survey(1, 0.3)
    field_map = FieldMap(GRID)
    if at_once:
        field_map.set_records(records(timed))
    else:
        for record in records(timed):
            field_map.add(record)
    soil_map = field_map.update()
    assert soil_map.change.drift is not None
    assert (len(field_map.state.timed.samples), len(field_map.samples)) == (90, 30)
    mapped, given = soil_map.samples, field_map.samples
    np.testing.assert_array_equal(np.unique(mapped.xy, axis=0), np.unique(given.xy, axis=0))
    assert mapped.counts.sum() == given.counts.sum()
    inside = GRID.mask
    assert (soil_map.variance[inside] > make_soil_map(given, GRID, soil_map.fit).variance[inside]).all()


def test_visits_of_exactly_one_place_stay_apart():
    """A robot on a graph comes back to the very same node."""
    timed = survey(2, 0.1)[0]
    stops = np.tile(np.round(timed.samples.xy[:30]), (3, 1))
    nodes = TimedSamples(Samples(stops, timed.samples.counts, timed.samples.exposure_s), timed.time_s)
    beside = TimedSamples(
        Samples(stops + 1e-7 * np.arange(90)[:, None], timed.samples.counts, timed.samples.exposure_s),
        timed.time_s,
    )
    smooth = Variogram("matern32", nugget=0.0, range_m=20.0, sill=0.4)
    exact, near = (find_change(one, HOURS * 3600, smooth).drift for one in (nodes, beside))
    assert exact.probability == pytest.approx(near.probability, rel=1e-4)
    np.testing.assert_allclose(exact.shares, near.shares, rtol=1e-4, atol=1e-9)
    assert exact.change == pytest.approx(0.1, abs=0.04)
