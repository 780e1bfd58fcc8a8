# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re

import numpy as np
import pytest

from soilmoist_ros.reporting.page.charts.chart import Area, Chart, Dots, Line, limits_of, round_step, round_ticks


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


def test_nan_interrupts_a_line():
    (path,) = chart(Line([0, 1, 2, 3, 4], [0, 0, np.nan, 0, 0])).paths
    assert path.d.count("M") == 2
    assert len(points(path.d)) == 4


def test_dots_keep_their_sizes_and_their_bars():
    paths = chart(Dots([1, 2, 3], [0, 0, 0], size_px=[5, 9, 5], hollow=True, error=[0.5] * 3)).paths
    assert paths[0].d.count("M") == 3
    assert points(paths[0].d)[:2] == [(100, 750), (100, 250)]
    assert [(p.d.count("h0"), p.width_px) for p in paths[1:]] == [(2, 5), (2, 2), (1, 9), (1, 6)]


def test_an_area_is_closed_and_interrupted_where_it_is_undefined():
    (path,) = chart(Area([0, 5, 10], [0, np.nan, 0], [1, 1, 1])).paths
    assert path.d.count("Z") == 2
    assert points(path.d) == [(0, 0), (0, 500), (1000, 0), (1000, 500)]


def test_legend_has_the_marks_with_names():
    assert chart(Line([0], [0], name="a", dashed=True), Area([0], [0], [1])).names == [("k-line b-line dash", "a")]


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


def test_ticks_outside_the_limits_are_left_out_and_many_are_thinned_on_phones():
    found = chart(x_ticks=[(-1, "a"), *((i, str(i)) for i in range(8))]).across
    assert [tick.text for tick in found] == list("01234567")
    assert [tick.minor for tick in found[:3]] == [False, True, False]


def test_limits_include_zero_without_a_margin_below():
    assert limits_of([1.0, 2.0], zero=True, margin=0.1) == (0.0, pytest.approx(2.2))
    assert limits_of([np.nan]) == (0.0, 1.0)
    low, high = limits_of([3.0, 3.0])
    assert low < 3 < high
    assert limits_of([3.0, 3.0 + 1e-15]) == pytest.approx((low, high))
    assert round_step(0.3) == 0.5
