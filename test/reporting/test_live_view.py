# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from rich.console import Console

from soilmoist_ros.reporting import DRY_TO_WET, LiveMap, LiveMission, jsonable, render
from soilmoist_ros.reporting.live_view import LiveBand, LiveView, map_picture

RAMP = np.linspace(0.1, 0.4, 8)[None, :] * np.ones((8, 1))


def view(band=RAMP, **changes):
    ny, nx = band.shape
    of = {name: changes.pop(name) for name in ("extent", "wet_is_high") if name in changes}
    shown = LiveBand("moisture", band, **{"extent": (0.0, float(nx), 0.0, float(ny)), **of})
    return LiveView("a mission", {"state": "counting"}, [shown], **changes)


def lines(text):
    return text.plain.split("\n")


def pixels(of, columns=8, rows=4):
    """Colours of a picture's pixels, north first: ``None`` where there is nothing."""
    text = map_picture(of, of.bands[0], columns, rows)
    styles = {}
    for span in text.spans:
        for place in range(span.start, span.end):
            styles[place] = str(span.style).split(" on ")
    picture, place = [], 0
    for line in lines(text):
        upper, lower = [], []
        for character in line:
            colours = styles.get(place, [])
            assert len(colours) == {" ": 0, "▀": len(colours), "▄": 1}[character]
            upper.append(colours[0] if character == "▀" else None)
            lower.append(colours[-1] if character == "▄" or len(colours) == 2 else None)
            place += 1
        picture += [upper, lower]
        place += 1
    return picture


def shown(of, width=80, **options):
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system="truecolor")
    console.print(render(of, **options))
    return re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue())


def lightness(colour):
    linear = [((c / 255 + 0.055) / 1.055) ** 2.4 if c > 10 else c / 255 / 12.92 for c in colour]
    return 116 * np.cbrt(np.dot([0.2126, 0.7152, 0.0722], linear)) - 16


def test_it_is_dark_where_it_is_wet():
    steps = [lightness(colour) for colour in DRY_TO_WET]
    assert (np.diff(steps) < -5).all()
    for wet_is_high in (True, False):
        row = pixels(view(wet_is_high=wet_is_high))[0]
        light = [lightness([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) for colour in row]
        assert (np.diff(light[1:-1]) * (-1 if wet_is_high else 1) > 0).all()


def test_the_robot_is_seen_above_target_and_samples():
    here = (2.5, 2.5)
    samples = np.array([here, (6.5, 6.5), (np.nan, 1.0), (np.inf, 1.0)])
    picture = pixels(view(robots_xy=[(-99.0, 9.0), here], targets_xy=[here], samples_xy=samples))
    assert picture[5][2] == "#e61e3c"
    assert picture[1][6] == "#141414"
    assert sum(colour == "#141414" for line in picture for colour in line) == 1
    assert pixels(view(targets_xy=[here], samples_xy=samples))[5][2] == "#ff8c00"


BANDS = ("x", "y", "z", "rate", "rate_sd", "vwc", "vwc_sd")
STATUS = {
    "state": "counting", "reason": "counting at s17 (ami:0.03)", "target": "s17", "target_x_m": "12.5",
    "target_y_m": "3.0", "planned_dwell_s": "251.0", "elapsed_dwell_s": "40.0", "time_used_s": "3600.0",
    "time_left_s": "1800.0", "distance_m": "812.4", "samples": "7",
}  # fmt: skip


def cells(mask=None, west=4.0, south=-8.0, cell=2.0, moist=True):
    mask = np.ones((3, 5), bool) if mask is None else np.asarray(mask, bool)
    table = np.full(mask.shape, np.nan, [(name, "<f4") for name in BANDS])
    row, column = np.nonzero(mask)
    table["x"][mask], table["y"][mask] = west + cell * column, south + cell * row
    for number, name in enumerate(BANDS[2:5] + (BANDS[5:] if moist else ())):
        table[name][mask] = number + column
    return table


def test_what_is_told():
    live = LiveMission("")
    live.robots[0].status = STATUS
    live.samples_xy = np.zeros((31, 2))
    assert live.view().facts == {
        "state": "counting: counting at s17 (ami:0.03)",
        "target": "s17, counted 40 s of about 251 s",
        "mission": "1 h 00 min used, 30 min left; 812 m driven",
        "map": "stops: 7, samples with those on the way: 31",
    }
    live.rain = "rain is likely"
    assert live.view().facts["weather"] == "rain is likely"
    live.maps[0].cells = cells()
    assert live.view().targets_xy == [(12.5, 3.0)]
    live.robots[0].status = {**STATUS, "forecast": "±3.0 % of the rate now"}
    assert live.view().facts["forecast"] == "±3.0 % of the rate now"


def test_values_for_programs_are_numbers_texts_and_flags():
    live = LiveMission(" demo ", [LiveMap("", np.full((3, 5), 2.0))], ("", "robot_2"))
    live.robots[0].status = {**STATUS, "silent": "False", "emergency": "True", "estimated_end_s": "nan"}
    live.robots[0].xy = (1.0, 2.0)
    live.maps[0].cells = cells()
    robot, silent = jsonable(live.values)["robots"]
    assert (robot["state"], robot["target"], robot["x_m"], robot["samples"]) == ("counting", "s17", 1.0, 7)
    assert (robot["silent"], robot["emergency"], robot["estimated_end_s"]) == (False, True, None)
    assert {value for key, value in silent.items() if key != "name"} == {None}
    (one,) = live.values["maps"]
    assert (one["quantity"], one["cells"], one["mean"]) == ("vwc", 15, 5.0)
    assert one["mse"] == pytest.approx(live.maps[0].mse)
    live.maps[0].cells = None
    assert jsonable(live.values)["maps"] == [
        {"name": "", "quantity": None, "cells": 0, "mean": None, "spread": None, "mse": None}
    ]


def test_several_robots_have_a_line_each():
    live = LiveMission("", namespaces=("robot_1", "robot_2"))
    assert live.view().facts == {"robot 1": "waiting for the planner", "robot 2": "waiting for the planner"}
    live.robots[1].status, live.robots[1].xy = {**STATUS, "samples": "4", "time_used_s": "3540.0"}, (1.0, 2.0)
    assert live.view().facts["map"] == "stops: 4, samples with those on the way: 0"
    live.robots[0].status = {**STATUS, "target": "", "target_x_m": "nan", "state": "planning", "reason": "next"}
    assert live.view().facts == {
        "robot 1": "planning: next",
        "robot 2": "counting: counting at s17 (ami:0.03)",
        "mission": "1 h 00 min used, 30 min left; 1625 m driven",
        "map": "stops: 11, samples with those on the way: 0",
    }
    assert (live.view().robots_xy, live.view().targets_xy) == ([(1.0, 2.0)], [(12.5, 3.0)])
    live.robots[1].sensor_fault = "not used: tube 3 (tube counts too much)"
    assert live.view().facts["robot 2 sensor"] == live.robots[1].sensor_fault
    live.clock_waits_for = "the next plan of robot_1"
    assert live.view().facts["clock"] == "waits for the next plan of robot_1"


def test_the_extent_is_that_of_the_field_whatever_lies_around_it():
    live = LiveMission("")
    mask = np.zeros((6, 9), bool)
    mask[1:4, 2:7] = True
    mask[2, 4] = mask[:, 5] = False  # a no-go area and a strip without cells do not matter
    live.maps[0].cells = cells(mask, west=0.0, south=0.0)
    (band,) = live.view().bands
    assert band.extent == (3.0, 13.0, 1.0, 7.0)
    assert band.values.shape == (3, 5)


@pytest.mark.parametrize("lost", ["rate", "x"])
def test_an_empty_map_is_none(lost):
    live = LiveMission("")
    table = cells()
    table[lost] = np.nan
    live.maps[0].cells = table
    assert live.view().bands == []
