"""A drift of the mean rate: drift.py, and the maps that know of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.drift import (
    MAX_SAMPLES,
    WINDOW_S,
    Change,
    Changing,
    Drift,
    TimedSamples,
    find_change,
)
from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
from soilmoist_ros.mapping.samples.merging import SampleMerger
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.mapping.variogram.model import Variogram
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


def test_a_drift_is_found_and_nearly_never_where_there_is_none():
    found = [find_change(survey(seed, 0.1)[0], HOURS * 3600, VARIOGRAM).drift for seed in range(20)]
    false = [find_change(survey(seed)[0], HOURS * 3600, VARIOGRAM).drift for seed in range(40)]
    assert sum(drift is not None for drift in found) >= 18
    assert sum(drift is not None for drift in false) <= 2
    # 10 % of 4 counts/s in two hours
    assert np.median([drift.per_hour for drift in found if drift]) == pytest.approx(0.2, rel=0.5)


@pytest.mark.parametrize("change", [0.1, -0.1, 0.3])
def test_a_drift_does_not_become_a_pattern(change):
    errors = []
    for seed in range(6):
        timed, truth = survey(seed, change)
        maps = []
        for drift in ("auto", "off"):
            field_map = FieldMap(GRID, FieldMapSettings(local="off", drift_model=drift))
            field_map.set_records(records(timed))
            field_map.update()
            maps.append(np.mean((field_map.rate - truth) ** 2))
        errors.append(maps)
    auto, off = np.sqrt(np.mean(errors, axis=0))
    assert auto < 0.8 * off


def test_without_evidence_the_map_is_that_without_drift_bit_for_bit():
    timed, _ = survey(3)
    maps = []
    for drift in ("auto", "off"):
        field_map = FieldMap(GRID, FieldMapSettings(drift_model=drift))
        for record in records(timed):
            field_map.add(record)
        maps.append(field_map.update())
    assert maps[0].change.drift is None
    assert maps[0].rate.tobytes() == maps[1].rate.tobytes()
    assert maps[0].variance.tobytes() == maps[1].variance.tobytes()


def test_the_map_of_a_state_does_not_depend_on_the_maps_before():
    timed, _ = survey(1, 0.3)
    often, once = (FieldMap(GRID, FieldMapSettings(local="off")) for _ in range(2))
    for number, record in enumerate(records(timed)):
        often.add(record)
        once.add(record)
        if number % 20 == 5:
            often.update()
    assert often.update().change.drift is not None
    np.testing.assert_array_equal(often.soil_map.rate, once.update().rate)


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
    assert (soil_map.change.drift.jump_s is not None) is rain
    planner, untold = (FieldMap(GRID, FieldMapSettings(for_planning=True)) for _ in range(2))
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
    drift = Drift(per_hour=1.0, evidence=5.0)
    told, untold = (FieldMap(GRID, FieldMapSettings(for_planning=True)) for _ in range(2))
    untold.set_samples(timed.samples)
    fit = untold.update().fit
    told.set_samples(timed.samples, fit, Changing(timed, Change(drift), HOURS * 3600))
    told.update()
    variance = [each.kriging.predict(timed.samples.xy)[1] for each in (told, untold)]
    lost = variance[0] / variance[1]
    assert lost[:6].mean() > 1.5 * lost[-6:].mean()
    assert lost[-1] < 1.1


def test_soft_l1_knows_no_drift():
    field_map = FieldMap(GRID, FieldMapSettings(fit="soft_l1"))
    field_map.set_records(records(survey(1, 0.3)[0]))
    assert field_map.update().change.drift is None


def test_few_samples_one_time_and_many_samples():
    timed, _ = survey(1, 0.3)
    assert find_change(timed.thinned(8), HOURS * 3600, VARIOGRAM).drift is None
    assert find_change(TimedSamples(timed.samples, np.zeros(90)), 0.0, VARIOGRAM).drift is None
    many, _ = survey(1, 0.3, passes=40)
    assert len(many.samples) > MAX_SAMPLES >= len(many.thinned(MAX_SAMPLES).samples)
    assert find_change(many, HOURS * 3600, VARIOGRAM).drift is not None


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


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=12), st.floats(0, 1e4))
def test_the_covariance_is_one_and_does_not_concern_the_present(times, later_s):
    time_s = np.array(times)
    samples = Samples(np.zeros((len(times), 2)), np.ones(len(times)), np.ones(len(times)))
    now_s = time_s.max() + later_s
    covariance = Drift(0.2, 3.0).covariance(TimedSamples(samples, time_s), now_s)
    assert np.linalg.eigvalsh(covariance).min() >= -1e-9 * max(covariance.max(), 1)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert not covariance[time_s == now_s].any()


@settings(max_examples=30)
@given(st.integers(0, 1000), st.booleans())
def test_kriging_with_something_shared_solves_the_whole_system(seed, repeated):
    rng = np.random.default_rng(seed)
    n = 12
    xy = rng.uniform(0, 50, (n, 2))
    if repeated:
        xy[3] = xy[1]
    exposure_s = rng.uniform(20, 100, n)
    counts = rng.poisson(4 * exposure_s)
    age = rng.uniform(0, 2, n)
    if repeated:
        age[3] = age[1]  # then merging loses nothing
    shared = 0.3 * np.minimum.outer(age, age)
    targets = rng.uniform(0, 50, (5, 2))
    variogram = Variogram("matern32", nugget=0.0, range_m=15.0, sill=0.5)
    rate, variance = (
        PoissonKriging(variogram, mean_rate=4.0).fit(xy, counts, exposure_s, shared=shared).predict(targets)
    )

    def covariance(a, b):
        away = ((a[:, None] - b) ** 2).sum(axis=2)
        return 0.5 * variogram.correlation_of_square(away / 15.0**2)

    matrix = np.ones((n + 1, n + 1))
    matrix[:n, :n] = covariance(xy, xy) + shared + np.diag(4.0 / exposure_s)
    matrix[n, n] = 0
    right = np.vstack([covariance(xy, targets), np.ones(5)])
    weights = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(rate, (counts / exposure_s) @ weights[:n], rtol=1e-8)
    np.testing.assert_allclose(variance, 0.5 - (weights * right).sum(axis=0), rtol=1e-6, atol=1e-9)


def test_samples_that_share_something_cannot_be_extended():
    kriging = PoissonKriging(VARIOGRAM).fit([(0, 0), (9, 0)], [30, 40], [10.0, 10.0], shared=np.eye(2))
    with pytest.raises(ValueError, match="fit all of them anew"):
        kriging.add((5, 5), 30, 10.0)


def test_records_of_far_times_are_not_merged():
    merger = SampleMerger(2.0, window_s=WINDOW_S)
    for time_s in (0.0, 10.0, WINDOW_S - 1, WINDOW_S, WINDOW_S + 90):
        merger.add(1.0, 1.0, 30, 10.0, time_s=time_s)
    assert merger.samples.counts.tolist() == [90, 60]
    np.testing.assert_allclose(merger.time_s, [(10 + WINDOW_S - 1) / 3, WINDOW_S + 45])


def test_a_series_at_one_place_has_no_drift_in_space():
    timed = survey(3, 0.3)[0]
    one = timed.samples
    here = TimedSamples(Samples(np.zeros_like(one.xy), one.counts, one.exposure_s), timed.time_s)
    assert find_change(here, HOURS * 3600, VARIOGRAM) == Change()


def test_places_that_were_all_visited_alike_before_and_after_tell_no_jump_and_raise_no_warning():
    """Counts at exactly one place are merged, so the share before a time may be the same everywhere."""
    xy = np.repeat(GRID.cells[::5], 2, axis=0)
    time_s = np.tile([0.0, 7000.0], len(xy) // 2)
    counts = np.tile([200.0, 300.0], len(xy) // 2)
    timed = TimedSamples(Samples(xy, counts, np.full(len(xy), 60.0)), time_s)
    assert find_change(timed, 7200.0, VARIOGRAM).jump is None
