# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated navigation servers and their faults: ``servers.py``."""

import numpy as np
import pytest

from rehearsal.cases import RECEIVERS, Fault, Faults, Ground, Span
from rehearsal.servers import (
    ActionServer,
    Answered,
    CancelAnswered,
    Driven,
    GoalOver,
    Misled,
    Status,
    straight_route,
)
from rehearsal.world import Receiver
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field


def drive(server, robot, from_s, to_s):
    said = []
    for now_s in range(from_s + 1, to_s + 1):
        robot.advance(1.0)
        said += server.step(float(now_s))
    return said


SQUARE = np.array([(0, 0), (60, 0), (60, 60), (0, 60)], float)
POND = np.array([(10, 20), (15, 20), (15, 26), (10, 26)], float)
GROUND = Ground("square", Field("square", LocalFrame(53.0, 0.0), SQUARE, (POND,)), None, (0.0, 0.0))


def served(*spans):
    robot, faults = Driven((0.0, 0.0), 1.0), Faults(spans)
    return robot, ActionServer(robot, straight_route, faults, Misled(GROUND, faults))


ACCEPTED, ENDED = Answered(1, True), GoalOver(1, Status.CANCELED, False)
NO_REPLY = []
COURSES = [  # a fault, what the server says of a goal that is cancelled after 5 s, and how far the robot comes [m]
    (None, [ACCEPTED, CancelAnswered(1, 0), ENDED], 5.0),
    (Fault.SERVER_DEAF, [ACCEPTED, CancelAnswered(1, 1)], 20.0),
    (Fault.RUNS_ON, [ACCEPTED, CancelAnswered(1, 0), ENDED], 13.0),
    (Fault.SERVER_ABORTS, [ACCEPTED, GoalOver(1, Status.ABORTED, False), CancelAnswered(1, 2)], 0.0),
    (Fault.SERVER_LIES, [ACCEPTED, GoalOver(1, Status.SUCCEEDED, True), CancelAnswered(1, 2)], 0.0),
    (Fault.SERVER_HANGS, [ACCEPTED, CancelAnswered(1, 0), ENDED], 0.0),
    (Fault.NO_RESULT, [ACCEPTED, CancelAnswered(1, 0)], 20.0),
    (Fault.SERVER_DEAD, NO_REPLY, 0.0),
]


@pytest.mark.parametrize(("fault", "said", "moved_m"), COURSES)
def test_what_a_server_says_and_does(fault, said, moved_m):
    robot, server = served(*([] if fault is None else [Span(fault, 0.0, 20.0, 0.0)]))
    goal = server.send((50.0, 0.0), 0.0)
    heard = drive(server, robot, 0, 5)
    server.cancel(goal, 5.0)
    heard += drive(server, robot, 5, 19)
    assert heard == said
    assert robot.place[0] == pytest.approx(moved_m, abs=1.0)
    assert server.present(10.0) == (fault is not Fault.SERVER_DEAD)


@pytest.mark.parametrize(("fault", "moved_m"), [(Fault.SERVER_DEAD, 5.0), (Fault.RUNAWAY, 20.0)])
def test_a_server_that_dies_on_the_way(fault, moved_m):
    robot, server = served(Span(fault, 5.0, 100.0, 0.0))
    server.send((50.0, 0.0), 0.0)
    drive(server, robot, 0, 4)
    assert drive(server, robot, 4, 20) == NO_REPLY
    assert robot.place[0] == pytest.approx(moved_m, abs=1.0)


@pytest.mark.parametrize("name", RECEIVERS)
def test_receivers_have_the_errors_that_they_say(name):
    noise, errors = RECEIVERS[name], []
    for seed in range(40):
        receiver = Receiver(noise, 1.0, np.random.default_rng(seed))
        errors += [receiver.measure((float(second // 200), 0.0))[1] for second in range(400)]
    assert np.std(errors) == pytest.approx(noise.sd_m, rel=0.25)
    if noise.holds:
        assert np.mean(np.diff(errors) == 0) > 0.9


def test_a_robot_slips_once_and_fixes_drift_away_from_one_that_stands():
    misled = Misled(GROUND, Faults([Span(Fault.SLIDE, 0.0, 50.0, 1.0), Span(Fault.FIX_DRIFT, 0.0, 100.0, 0.0)]))
    steps = [misled.push(float(second), float(second), 1.0) for second in range(60)]
    assert np.hypot(*np.sum(steps, axis=0)) == pytest.approx(8.0)
    assert misled.fix_error(11.0, 10.0) == (0.0, 0.0)
    misled.fix_error(12.0, 11.0)
    assert np.hypot(*misled.fix_error(0.0, 31.0)) == pytest.approx(2.0)
