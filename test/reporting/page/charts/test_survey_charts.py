# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Charts of a survey: survey_charts.py."""

from __future__ import annotations

import numpy as np
import pytest

from soilmoist_ros.reporting.moisture_steps import moisture_series
from soilmoist_ros.reporting.page.charts.survey_charts import (
    binned,
    cross_validation_chart,
    factor_chart,
    histogram_chart,
    moisture_chart,
    rate_chart,
    time_axis,
)
from soilmoist_ros.reporting.page.statistics import leave_one_out
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.sensing.records import CountRecord


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


def test_a_gap_interrupts_the_line():
    track = [*records(300), *records(300, first_s=1.6e9 + 90_000)]
    assert np.isnan(binned(track)[2]).any()
    assert rate_chart(track).paths[1].d.count("M") == 2


def test_no_line_is_drawn_where_nothing_was_counted():
    days = [*range(9), *range(107, 116)]
    track = [CountRecord(1.6e9 + 86_400 * day, 0.0, 0.0, 0.0, 10_000 + day, 86_400.0, 86_000.0) for day in days]
    series = moisture_series(track, CalibrationCurve(0.2, 1.4))
    for chart in (moisture_chart(series), rate_chart(track), factor_chart(track)):
        assert {path.d.count("M") for path in chart.paths} == {2}


def test_clock_times_or_minutes_on_the_time_axis():
    _, ticks, label = time_axis([1.6e9, 1.6e9 + 7000])
    assert ticks[0][1] == "12:30"
    assert "13 September 2020" in label
    _, ticks, label = time_axis([10.0, 3600.0])
    assert (ticks[0][1], label) == ("10", "Time [min]")
    assert "Day of 2020" in time_axis([1.6e9, 1.6e9 + 9 * 86400])[2]
    _, ticks, name = time_axis([1483137480.0, 1515779280.0])  # 2016-12-30 to 2018-01-12
    assert (name, ticks[0][1]) == ("Day", "2017-02-02")


def test_constant_factors_do_not_look_like_a_pattern():
    low, high = factor_chart(records(20)).y
    assert high - low >= 0.01


def test_histogram_and_cross_validation(make_run, the_map):
    chart = histogram_chart(make_run())
    assert chart.x[0] < np.nanmin(the_map.rate)
    assert np.asarray(chart.marks[1].y)[::2].sum() == pytest.approx(100)
    loo = leave_one_out(the_map)
    chart = cross_validation_chart(loo)
    assert chart.x == chart.y
    assert chart.x[0] < loo.observed.min()
    assert f"of the {len(loo.observed)} samples" in chart.caption
