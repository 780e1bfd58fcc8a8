# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io
import math

import numpy as np
import pytest
from rich.console import Console

from soilmoist_ros.reporting.files.strict_json import jsonable
from soilmoist_ros.reporting.live.live_mission import LiveMap, LiveMission
from soilmoist_ros.reporting.live.terminal import render

BANDS = ("x", "y", "z", "rate", "rate_sd", "vwc", "vwc_sd")
STATUS = {
    "state": "counting", "reason": "counting at s17 (ami:0.03)", "target": "s17", "target_x_m": "12.5",
    "target_y_m": "3.0", "planned_dwell_s": "251.0", "elapsed_dwell_s": "40.0", "time_used_s": "3600.0",
    "time_left_s": "1800.0", "distance_m": "812.4", "samples": "7",
}  # fmt: skip


def cells(mask=None, west=4.0, south=-8.0, cell=2.0, moist=True):
    """A map; cells outside the mask are all NaN."""
    mask = np.ones((3, 5), bool) if mask is None else np.asarray(mask, bool)
    table = np.full(mask.shape, np.nan, [(name, "<f4") for name in BANDS])
    row, column = np.nonzero(mask)
    table["x"][mask], table["y"][mask] = west + cell * column, south + cell * row
    for number, name in enumerate(BANDS[2:5] + (BANDS[5:] if moist else ())):
        table[name][mask] = number + column
    return table


def test_before_anything_has_come():
    view = LiveMission(" demo ").view()
    assert view.facts == {"state": "waiting for the planner"}
    assert view.bands == []
    assert (view.title, view.targets_xy) == (" demo ", [])


def test_what_is_told():
    live = LiveMission("")
    live.robots[0].status = STATUS
    live.samples_xy = np.zeros((31, 2))
    assert live.view().facts == {
        "state": "counting: counting at s17 (ami:0.03)",
        "target": "s17, counted 40 s of about 251 s",
        "mission": "1 h 00 min used, 30 min left; 812 m driven",
        "map": "7 stops, 31 samples with those on the way",
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
    assert live.view().facts["map"] == "4 stops, 0 samples with those on the way"
    live.robots[0].status = {**STATUS, "target": "", "target_x_m": "nan", "state": "planning", "reason": "next"}
    assert live.view().facts == {
        "robot 1": "planning: next",
        "robot 2": "counting: counting at s17 (ami:0.03)",
        "mission": "1 h 00 min used, 30 min left; 1625 m driven",
        "map": "11 stops, 0 samples with those on the way",
    }
    assert (live.view().robots_xy, live.view().targets_xy) == ([(1.0, 2.0)], [(12.5, 3.0)])
    live.robots[1].sensor_fault = "not used: tube 3 (tube counts too much)"
    assert live.view().facts["robot 2 sensor"] == live.robots[1].sensor_fault
    live.clock_waits_for = "the next plan of robot_1"
    assert live.view().facts["clock"] == "waits for the next plan of robot_1"


def test_every_property_with_a_map_is_shown():
    live = LiveMission("", [LiveMap(), LiveMap("salt", np.full((3, 5), 2.0)), LiveMap("clay")])
    live.robots[0].status = STATUS
    assert "error" not in live.view().facts["map"]
    live.maps[1].cells = cells(moist=False)
    assert live.view().facts["map"].endswith("; mean squared error salt 3.0000 (counts/s)²")
    assert [band.name for band in live.view().bands] == ["salt rate [counts/s]"]
    live.maps[0].cells = cells()
    assert [band.name for band in live.view().bands] == ["moisture [m³/m³]", "salt rate [counts/s]"]


def test_what_is_unknown_is_not_told():
    live = LiveMission("")
    live.robots[0].status = {**STATUS, "planned_dwell_s": "nan"}
    assert live.view().facts["target"] == "s17, counted 40 s"
    live.robots[0].status = {**STATUS, "target": "", "target_x_m": "nan", "target_y_m": "nan"}
    live.maps[0].cells = cells()
    assert "target" not in live.view().facts
    assert live.view().targets_xy == []


def test_moisture_is_shown_if_there_is_any():
    live = LiveMission("")
    live.maps[0].cells = cells()
    (band,) = live.view().bands
    assert band.name.startswith("moisture")
    assert band.wet_is_high
    np.testing.assert_array_equal(band.values[0], [3, 4, 5, 6, 7])
    live.maps[0].cells = cells(moist=False)
    (band,) = live.view().bands
    assert band.name.startswith("rate")
    assert not band.wet_is_high
    np.testing.assert_array_equal(band.values[0], [1, 2, 3, 4, 5])


def test_the_extent_is_that_of_the_field_whatever_lies_around_it():
    live = LiveMission("")
    mask = np.zeros((6, 9), bool)
    mask[1:4, 2:7] = True
    mask[2, 4] = mask[:, 5] = False  # a no-go area and a strip without cells do not matter
    live.maps[0].cells = cells(mask, west=0.0, south=0.0)
    (band,) = live.view().bands
    assert band.extent == (3.0, 13.0, 1.0, 7.0)
    assert band.values.shape == (3, 5)


@pytest.mark.parametrize(
    ("shape", "extent"),
    [((1, 1), (3.5, 4.5, -8.5, -7.5)), ((1, 4), (3.0, 11.0, -9.0, -7.0)), ((3, 1), (3.0, 5.0, -9.0, -3.0))],
)
def test_the_extent_of_small_fields(shape, extent):
    live = LiveMission("")
    live.maps[0].cells = cells(np.ones(shape))
    assert live.view().bands[0].extent == extent


def test_the_error_needs_a_truth_on_the_same_raster():
    table = cells()
    live = LiveMission("", [LiveMap("", table["rate"] - 0.5)])
    assert math.isnan(live.maps[0].mse)
    live.maps[0].cells = table
    assert live.maps[0].mse == pytest.approx(0.25)
    live.robots[0].status = STATUS
    assert live.view().facts["map"].endswith("; mean squared error 0.2500 (counts/s)²")
    assert math.isnan(other_raster(table).maps[0].mse)
    mask = np.ones((3, 5), bool)
    mask[0, 0] = False
    live.maps[0].cells = cells(mask)
    assert live.maps[0].mse == pytest.approx(0.25)


def other_raster(table):
    live = LiveMission("", [LiveMap("", np.ones((2, 2)))])
    live.maps[0].cells = table
    return live


@pytest.mark.parametrize("lost", ["rate", "x"])
def test_an_empty_map_is_none(lost):
    live = LiveMission("")
    table = cells()
    table[lost] = np.nan
    live.maps[0].cells = table
    assert live.view().bands == []


def test_it_can_be_drawn():
    live = LiveMission("demo")
    live.robots[0].status, live.robots[0].xy = STATUS, (math.nan, math.nan)
    live.maps[0].cells = cells()
    console = Console(file=io.StringIO(), width=90)
    console.print(render(live.view()))
    assert "7 stops" in console.file.getvalue()
