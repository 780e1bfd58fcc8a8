# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The log of a recorded mission."""

from __future__ import annotations

from soilmoist_ros.pipeline.mission import RobotMission, Status, mission_log


def status(used_s, state, reason, command="", command_s=float("nan")):
    now_s = 1000.0 + used_s
    return Status(state, reason, "n1", 5.0, 6.0, 0.0, used_s, 100.0, 0.0, 0, 0.0, 0, now_s, command, command_s)


def test_the_log_says_who_did_what_when():
    start, pause = ("start by Ada: started", 1000.0), ("pause by Bo: paused by Bo", 1020.0)
    again = (pause[0], 1050.0)
    statuses = [
        status(0.0, "planning", "started", *start),
        status(5.0, "travelling", "going to n1", *start),
        status(6.0, "travelling", "going to n1", *start),
        status(20.0, "paused", "paused by Bo", *pause),
        status(40.0, "travelling", "resumed", *pause),
        status(50.0, "paused", "paused by Bo", *again),
    ]
    one, other = (RobotMission(number, {}, statuses[:count], (), ()) for number, count in ((1, 6), (2, 2)))
    assert mission_log([one], [0.0]) == [
        "       0 s  start by Ada: started",
        "       0 s  planning: started",
        "       5 s  travelling: going to n1",
        "      20 s  pause by Bo: paused by Bo",
        "      20 s  paused: paused by Bo",
        "      40 s  travelling: resumed",
        "      50 s  pause by Bo: paused by Bo",
        "      50 s  paused: paused by Bo",
    ]
    team = mission_log([one, other], [0.0, 7.0])
    assert team[3:6] == [
        "       7 s  robot 2: start by Ada: started",
        "       7 s  robot 2: planning: started",
        "      12 s  robot 2: travelling: going to n1",
    ]
