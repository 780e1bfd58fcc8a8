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


def test_a_goal_is_driven_to_and_another_one_cancelled():
    robot, server = served()
    goal = server.send((10.0, 0.0), 0.0)
    assert drive(server, robot, 0, 12) == [Answered(goal, True), GoalOver(goal, Status.SUCCEEDED, True)]
    assert (robot.place, robot.odometer_m) == ((10.0, 0.0), pytest.approx(10.0))
    goal = server.send((50.0, 0.0), 12.0)
    drive(server, robot, 12, 17)
    server.cancel(goal, 17.0)
    assert drive(server, robot, 17, 20) == [CancelAnswered(goal, 0), GoalOver(goal, Status.CANCELED, False)]
    assert robot.place[0] <= 16.0
    assert not robot.drives


@pytest.mark.parametrize(
    ("fault", "moved_m", "said"),
    [
        (Fault.SERVER_DEAF, 20.0, CancelAnswered(1, 1)),
        (Fault.RUNS_ON, 13.0, GoalOver(1, Status.CANCELED, False)),
        (Fault.SERVER_ABORTS, 0.0, GoalOver(1, Status.ABORTED, False)),
        (Fault.SERVER_LIES, 0.0, GoalOver(1, Status.SUCCEEDED, True)),
        (Fault.SERVER_HANGS, 0.0, GoalOver(1, Status.CANCELED, False)),
    ],
)
def test_faults(fault, moved_m, said):
    robot, server = served(Span(fault, 0.0, 100.0, 0.0))
    goal = server.send((50.0, 0.0), 0.0)
    heard = drive(server, robot, 0, 5)
    server.cancel(goal, 5.0)
    heard += drive(server, robot, 5, 20)
    assert said in heard
    assert robot.place[0] == pytest.approx(moved_m, abs=1.0)


@pytest.mark.parametrize(("fault", "moved_m"), [(Fault.SERVER_DEAD, 5.0), (Fault.RUNAWAY, 20.0)])
def test_a_dead_server_says_nothing(fault, moved_m):
    robot, server = served(Span(fault, 5.0, 100.0, 0.0))
    server.send((50.0, 0.0), 0.0)
    drive(server, robot, 0, 4)
    assert drive(server, robot, 4, 20) == []
    assert not server.present(10.0)
    assert robot.place[0] == pytest.approx(moved_m, abs=1.0)


def test_a_confirmed_cancellation_without_a_result_is_not_the_end():
    robot, server = served(Span(Fault.NO_RESULT, 0.0, 20.0, 0.0))
    goal = server.send((50.0, 0.0), 0.0)
    drive(server, robot, 0, 5)
    server.cancel(goal, 5.0)
    assert drive(server, robot, 5, 18) == [CancelAnswered(goal, 0)]
    assert (robot.drives, server.active) == (True, True)
    assert GoalOver(goal, Status.CANCELED, False) in drive(server, robot, 18, 25)


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
