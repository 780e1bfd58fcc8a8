# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import re

import numpy as np
import pytest

from soilmoist_ros.reporting.moisture_steps import moisture_series
from soilmoist_ros.reporting.page.charts import (
    Area,
    Chart,
    Line,
    binned,
    factor_chart,
    moisture_chart,
    rate_chart,
    round_ticks,
    time_axis,
)
from soilmoist_ros.sensing import CalibrationCurve, CountRecord


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
    series = moisture_series(track, CalibrationCurve(0.2, 1.4))
    for chart in (moisture_chart(series), rate_chart(track), factor_chart(track)):
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
