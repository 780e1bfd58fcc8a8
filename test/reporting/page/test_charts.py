# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.reporting.page.charts import (
    Area,
    Chart,
    Line,
    binned,
    factor_chart,
    rate_chart,
    round_ticks,
    time_axis,
)
from soilmoist_ros.reporting.page.variogram_chart import _sample_covariance, sample_variogram, variogram_chart
from soilmoist_ros.sensing import CountRecord


def chart(*marks, **changes):
    return Chart(
        "key", "Title", "a chart", marks, **{"x": (0, 10), "y": (-1, 1), "x_label": "m", "y_label": "-"} | changes
    )


def points(d):
    return [(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+) (-?[\d.]+)", d)]


def test_a_line_goes_through_its_points():
    (path,) = chart(Line([0, 5, 10], [-1, 0, 1])).paths
    assert points(path.d) == [(0, 1000), (500, 500), (1000, 0)]
    assert path.css == "s-line"


def test_an_area_is_closed_and_interrupted_where_it_is_undefined():
    (path,) = chart(Area([0, 5, 10], [0, np.nan, 0], [1, 1, 1])).paths
    assert path.d.count("Z") == 2
    assert points(path.d) == [(0, 0), (0, 500), (1000, 0), (1000, 500)]


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 10, ["0", "2", "4", "6", "8", "10"]),
        (-0.01, 0.02, ["\u22120.01", "0.00", "0.01", "0.02"]),
        (3, 7, ["3", "4", "5", "6", "7"]),
    ],
)
def test_ticks_are_round(low, high, expected):
    assert [text for _, text in round_ticks(low, high, 5)] == expected


# Charts of a survey: survey_charts.py ---------------------------------------------------------------------------


def records(n, step_s=10.0, first_s=1.6e9):
    return [
        CountRecord(first_s + i * step_s, 0.0, 0.0, 0.0, 40 + i % 7, step_s, step_s / 1.02, 1.02) for i in range(n)
    ]


def test_counts_are_kept_when_records_are_added_up():
    track = records(3000)
    time, counts, exposure, width_s = binned(track)
    assert width_s == 300
    assert len(time) <= 241
    assert counts.sum() == sum(record.raw_counts for record in track)
    assert np.nansum(exposure) == pytest.approx(sum(record.effective_exposure_s for record in track))


def test_no_line_is_drawn_where_nothing_was_counted():
    days = [*range(9), *range(107, 116)]
    track = [CountRecord(1.6e9 + 86_400 * day, 0.0, 0.0, 0.0, 10_000 + day, 86_400.0, 86_000.0) for day in days]
    for chart in (rate_chart(track), factor_chart(track)):
        assert {path.d.count("M") for path in chart.paths} == {2}


def test_lines_of_two_robots_have_no_gaps():
    for chart in (rate_chart, factor_chart):
        assert {path.d.count("M") for path in chart([one for one in records(20) for _ in range(2)]).paths} == {1}


def test_clock_times_or_minutes_on_the_time_axis():
    _, ticks, label = time_axis([1.6e9, 1.6e9 + 7000])
    assert ticks[0][1] == "12:30"
    assert "13 September 2020" in label
    _, ticks, label = time_axis([10.0, 3600.0])
    assert (ticks[0][1], label) == ("10", "Time [min]")
    assert "Day of 2020" in time_axis([1.6e9, 1.6e9 + 9 * 86400])[2]
    _, ticks, name = time_axis([1483137480.0, 1515779280.0])  # 2016-12-30 to 2018-01-12
    assert (name, ticks[0][1]) == ("Day", "2017-02-02")


# Variograms ----------------------------------------------------------------------------------------------------

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 60), (0, 60)], 10.0)
ISOTROPIC = Variogram("matern32", 0.02, 8.0, 0.5)
LONG_NORTH = Variogram("matern32", 0.02, 12.0, 0.5, 6.0, 90.0)


def survey(variogram, n=150, seed=3, exposure_s=60.0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 60, (n, 2))
    places = Samples(xy, np.zeros(n), np.full(n, exposure_s))
    rate = 5 + np.linalg.cholesky(_sample_covariance(variogram, places) + 1e-9 * np.eye(n)) @ rng.normal(size=n)
    samples = Samples(xy, rng.poisson(np.maximum(rate, 0.5) * exposure_s), np.full(n, exposure_s))
    return make_soil_map(samples, GRID, variogram)


@pytest.mark.slow
def test_without_support_circles_are_expected_on_the_model():
    found = sample_variogram(survey(ISOTROPIC))
    np.testing.assert_allclose(found.expected, ISOTROPIC(found.lag_m), rtol=0.05)
    assert (found.low < found.expected).all()
    assert (found.expected < found.high).all()
    np.testing.assert_array_equal(found.likely, found.expected)  # the model was given


@pytest.mark.slow
def test_circles_of_the_true_model_lie_in_the_band_nine_times_in_ten():
    for model in (ISOTROPIC, LONG_NORTH):
        inside = [sample_variogram(survey(model, 60, seed)).inside for seed in range(40)]
        assert 0.82 < np.mean(inside) < 0.97


@pytest.mark.slow
def test_supports_lower_the_expectation():
    soil_map = survey(ISOTROPIC)
    s = soil_map.samples
    spread = np.tile([12.0, 0.0, 0.0], (len(s), 1))  # stretches of 12 m from west to east
    moving = dataclasses.replace(soil_map, samples=Samples(s.xy, s.counts, s.exposure_s, spread))
    found, points = sample_variogram(moving), sample_variogram(soil_map)
    assert (found.expected < points.expected).all()
    assert "averages over a stretch" in variogram_chart(moving, found).caption
    assert sample_variogram(dataclasses.replace(soil_map, samples=s.some(slice(0, 2)))) is None


def test_covariance_of_samples_is_that_of_kriging():
    rng = np.random.default_rng(4)
    xy, spread = rng.uniform(0, 40, (8, 2)), np.array([6.0, 1.0, 3.0])
    places = Samples(xy, np.full(8, 50), np.full(8, 10.0), np.tile(spread, (8, 1)))
    covariance = _sample_covariance(LONG_NORTH, places)
    kriging = PoissonKriging(LONG_NORTH, mean_rate=5.0).fit(
        places.xy, places.counts, places.exposure_s, places.spread
    )
    weights, lagrange = kriging.weights(np.array([[20.0, 20.0]]))
    points = make_soil_map(places, GRID, LONG_NORTH)
    rhs = (covariance + np.diag(np.full(8, 0.5))) @ weights[:, 0] + lagrange[0]
    towards = _sample_covariance(
        LONG_NORTH,
        Samples(np.vstack([xy, [[20.0, 20.0]]]), np.ones(9), np.ones(9), np.vstack([places.spread, np.zeros(4)])),
    )[:-1, -1]
    np.testing.assert_allclose(rhs, towards, atol=1e-9)
    assert points.curve is None
