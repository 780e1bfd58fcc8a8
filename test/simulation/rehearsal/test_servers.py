# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated navigation servers and their faults: ``servers.py``."""

import pytest

from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, Span
from soilmoist_ros.simulation.rehearsal.servers import (
    ActionServer,
    Answered,
    CancelAnswered,
    Driven,
    GoalOver,
    PoseListener,
    Status,
    graph_route,
    straight_route,
)


def drive(server, robot, from_s, to_s):
    """Everything that the server says in some seconds."""
    said = []
    for now_s in range(from_s + 1, to_s + 1):
        robot.advance(1.0)
        said += server.step(float(now_s))
    return said


def served(*spans):
    robot = Driven((0.0, 0.0), 1.0)
    return robot, ActionServer(robot, straight_route, Faults(spans))


def test_a_goal_is_driven_to():
    robot, server = served()
    goal = server.send((10.0, 0.0), 0.0)
    assert drive(server, robot, 0, 12) == [Answered(goal, True), GoalOver(goal, Status.SUCCEEDED, True)]
    assert robot.place == (10.0, 0.0)
    assert robot.odometer_m == pytest.approx(10.0)


def test_a_cancelled_goal_stops_the_robot():
    robot, server = served()
    goal = server.send((50.0, 0.0), 0.0)
    drive(server, robot, 0, 5)
    server.cancel(goal, 5.0)
    assert drive(server, robot, 5, 8) == [CancelAnswered(goal, 0), GoalOver(goal, Status.CANCELED, False)]
    assert robot.place[0] <= 6.0
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


def test_a_new_goal_replaces_the_old():
    robot, server = served()
    server.send((50.0, 0.0), 0.0)
    server.send((0.0, 10.0), 3.0)
    assert server.replaced == 1
    assert GoalOver(1, Status.ABORTED, False) in drive(server, robot, 3, 20)
    assert robot.place == (0.0, 10.0)


def test_routes_on_a_graph():
    stops = [Stop("a", 0, 0), Stop("b", 10, 0), Stop("c", 10, 10)]
    graph = TravelGraph.from_edges(stops, [("a", "b"), ("b", "c"), ("c", "b"), ("b", "a")])
    route = graph_route(graph)
    assert route((0.0, 1.0), "c") == [(0, 0), (10, 0), (10, 10)]
    assert route((3.0, 0.0), "c") == [(10, 0), (10, 10)]
    assert route((0.0, 0.0), "a") is None
    assert route((0.0, 0.0), "nowhere") is None


def test_poses_are_obeyed_without_an_answer():
    robot = Driven((0.0, 0.0), 1.0)
    listener = PoseListener(robot, Faults([Span(Fault.SERVER_DEAD, 5.0, 5.0, 0.0)]))
    listener.send((20.0, 0.0), 0.0)
    robot.advance(3.0)
    listener.step(6.0)
    assert (robot.place, robot.drives) == ((3.0, 0.0), False)
    listener.send((20.0, 0.0), 7.0)
    assert not robot.drives
