# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The visit stays open while the next stop is chosen, and the planner may choose to count on."""

import pytest
from mission_driver import EAST, HOME, NORTH, Driver

from soilmoist_ros.exploration import Stop, VisitEnd, parse_dwell
from soilmoist_ros.exploration.mission.events import (
    EmergencyStop,
    Finish,
    GoTo,
    PlanFailed,
    RequestPlan,
    Tick,
    VisitDone,
)
from soilmoist_ros.exploration.mission.types import MissionEnd, Phase, PlanKind


def done(records=6, **rules):
    """A mission whose dwell is over, while the next stop is being chosen."""
    driver = Driver(stays=True, **rules).counting()
    for _ in range(records):
        driver.record()
    return driver


def test_the_visit_is_open_while_the_next_stop_is_chosen():
    driver = done()
    assert driver.phase is Phase.PLANNING
    assert driver.count_of(VisitDone) == 0
    request = driver.last(RequestPlan)
    assert (request.staying, request.kind) == ("east", PlanKind.EXPLORE)
    assert driver.mission.status.target == EAST
    driver.record().plan(NORTH)
    visit = driver.last(VisitDone).visit
    assert (visit.records, visit.ended, visit.raw_counts, visit.dwell_s) == (7, VisitEnd.ENOUGH, 210, 70.0)
    assert driver.last(GoTo).stop == NORTH


def test_the_same_choice_counts_on_without_a_goal():
    driver = done().plan(EAST, "fmi:20")
    assert driver.phase is Phase.COUNTING
    assert driver.count_of(GoTo) == 1
    assert driver.count_of(VisitDone) == 0
    assert driver.record().phase is Phase.COUNTING
    assert driver.mission.status.progress == pytest.approx(0.5)
    assert driver.mission.status.planned_dwell_s == 80.0
    assert driver.record().phase is Phase.PLANNING, "the new rule judges only what came after the choice"
    driver.plan(NORTH)
    assert driver.count_of(VisitDone) == 1
    assert driver.last(VisitDone).visit.records == 8


@pytest.mark.parametrize(
    "act",
    [
        lambda driver: driver.command("pause"),
        lambda driver: driver.command("abort"),
        lambda driver: driver.command("skip"),
        lambda driver: driver.send(EmergencyStop, True, "button"),
        lambda driver: driver.send(PlanFailed, driver.last(RequestPlan).plan_id, "broken"),
        lambda driver: driver.send(Tick, after=130.0),
        lambda driver: driver.send(Tick, after=8000.0),
    ],
)
def test_what_ends_the_planning_closes_the_visit_once(act):
    driver = done()
    act(driver)
    assert driver.count_of(VisitDone) == 1
    assert driver.last(VisitDone).visit.ended is VisitEnd.ENOUGH
    state = driver.mission.state
    assert (state.counting, state.target, state.samples) == (None, None, 1)


def test_the_rest_of_the_time_is_counted_where_the_robot_stands():
    driver = done(budget_s=130.0)
    assert driver.phase is Phase.COUNTING
    assert "until the time is used up" in driver.reason
    assert driver.mission.status.planned_dwell_s == pytest.approx(110.0)
    for _ in range(5):
        driver.record(after=9.9)
    driver.send(Tick, after=20.0)
    assert driver.last(Finish).code is MissionEnd.TIME_UP
    visit = driver.last(VisitDone).visit
    assert (visit.records, visit.ended, driver.count_of(VisitDone)) == (11, VisitEnd.TIME_UP, 1)


def test_when_nothing_is_left_the_robot_counts_on():
    driver = done(home=HOME).plan(None)
    assert driver.phase is Phase.COUNTING
    driver.record()
    driver.send(Tick, after=7200.0)
    assert driver.last(GoTo).stop == HOME
    assert driver.last(VisitDone).visit.records == 7


@pytest.mark.parametrize("choice", [EAST, None], ids=["chosen again", "the rest of the time"])
def test_the_reserve_for_the_way_home_is_kept_where_the_real_way_is_long(choice):
    """300 s around a ditch, not 40 s: the robot sets off with the reserve of 60 s left."""
    driver = done(home=HOME, dwell=parse_dwell("fmi:60"), budget_s=1000.0)
    driver.plan(choice, "fmi:3000" if choice else "", home_s=300.0)
    leave_s = 1000.0 + 1000.0 - 300.0 - 60.0
    while driver.now_s + 10.0 < leave_s:
        driver.record()
    assert driver.phase is Phase.COUNTING
    driver.send(Tick, after=leave_s - driver.now_s)
    assert driver.last(GoTo).stop == HOME
    assert driver.reason == "going home: the time left is needed for the way home"


def test_a_stop_is_not_driven_to_if_the_real_way_home_from_it_is_too_long():
    driver = done(home=HOME, budget_s=500.0).plan(NORTH, home_s=300.0)
    assert (driver.phase, driver.mission.status.target) == (Phase.COUNTING, EAST)


def test_a_stop_without_a_count_is_a_visit_and_may_be_stayed_at():
    driver = Driver(stays=True, dwell=parse_dwell("optimal")).counting()
    for _ in range(6):
        driver.record(raw_counts=0)
    assert driver.phase is Phase.PLANNING
    driver.plan(EAST, "fmi:3000")
    assert driver.record(raw_counts=0).mission.status.planned_dwell_s < 3600.0
    driver.command("skip")
    visit = driver.last(VisitDone).visit
    assert (visit.raw_counts, visit.records, driver.mission.state.samples) == (0, 7, 1)


def test_no_goal_is_sent_to_the_node_under_the_wheels():
    driver = Driver(stays=True).start().plan(Stop("here", 0.05, 0.0))
    assert (driver.phase, driver.count_of(GoTo)) == (Phase.COUNTING, 0)
    for _ in range(6):
        driver.record()
    assert driver.plan(NORTH).last(VisitDone).visit.name == "here"
    published = Driver().start().plan(Stop("here", 0.05, 0.0))
    assert published.count_of(GoTo) == 1
