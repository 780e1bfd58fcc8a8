# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import numpy as np

from soilmoist_ros.reporting import DRY_TO_WET, LiveMission


def lightness(colour):
    linear = [((c / 255 + 0.055) / 1.055) ** 2.4 if c > 10 else c / 255 / 12.92 for c in colour]
    return 116 * np.cbrt(np.dot([0.2126, 0.7152, 0.0722], linear)) - 16


def test_colours_are_dark_where_it_is_wet():
    steps = [lightness(colour) for colour in DRY_TO_WET]
    assert (np.diff(steps) < -5).all()


STATUS = {
    "state": "counting", "reason": "counting at s17 (ami:0.03)", "target": "s17", "target_x_m": "12.5",
    "target_y_m": "3.0", "planned_dwell_s": "251.0", "elapsed_dwell_s": "40.0", "time_used_s": "3600.0",
    "time_left_s": "1800.0", "distance_m": "812.4", "samples": "7",
}  # fmt: skip


def test_what_is_told():
    live = LiveMission("")
    live.robots[0].status = STATUS
    assert live.facts == {
        "state": "counting: counting at s17 (ami:0.03)",
        "target": "s17, counted 40 s of about 251 s",
        "mission": "1 h 00 min used, 30 min left; 812 m driven, 7 stops",
    }
    live.rain = "rain is likely"
    assert live.facts["weather"] == "rain is likely"
    live.robots[0].status = {**STATUS, "forecast": "±3.0 % of the rate now"}
    assert live.facts["forecast"] == "±3.0 % of the rate now"


def test_several_robots_have_a_line_each():
    live = LiveMission("", namespaces=("robot_1", "robot_2"))
    assert live.facts == {"robot 1": "waiting for the planner", "robot 2": "waiting for the planner"}
    live.robots[1].status = {**STATUS, "samples": "4", "time_used_s": "3540.0", "time_left_s": "60.0"}
    live.robots[0].status = {**STATUS, "target": "", "target_x_m": "nan", "state": "planning", "reason": "next"}
    assert live.facts == {
        "robot 1": "planning: next",
        "robot 2": "counting: counting at s17 (ami:0.03)",
        "mission": "1 h 00 min used, 30 min left; 1625 m driven, 11 stops",
    }
    live.robots[1].sensor_fault = "not used: tube 3 (tube counts too much)"
    assert live.facts["robot 2 sensor"] == live.robots[1].sensor_fault
    live.clock_waits_for = "the next plan of robot_1"
    assert live.facts["clock"] == "waits for the next plan of robot_1"
