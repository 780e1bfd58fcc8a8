# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an operator may ask for in mid-mission: the commands of Mission and what they change."""

import math

import pytest
from mission_driver import EAST, HOME, NORTH, Driver

from soilmoist_ros.exploration.mission.events import Command, GoTo, RequestPlan, VisitDone
from soilmoist_ros.exploration.mission.types import Changes, MissionEnd, Phase, Verb, VisitEnd
from soilmoist_ros.exploration.travel.stop import Stop

WELL = Stop("well", 5.0, 5.0)


def ask(driver, verb, **values):
    return driver.send(Command, Verb(verb), who="eve", **values)


def finish_stop(driver):
    while driver.phase is Phase.COUNTING:
        driver.record()
    return driver


def test_a_stop_that_was_asked_for_comes_next_with_its_own_dwell():
    driver = Driver().counting()
    assert ask(driver, "measure", stop=WELL, dwell_s=20.0).answer.accepted
    assert driver.mission.status.queue == ("well",)
    finish_stop(driver)
    assert (driver.phase, driver.last(GoTo).stop) == (Phase.TRAVELLING, WELL)
    assert "requested by eve" in driver.reason
    finish_stop(driver.reach())
    visit = driver.last(VisitDone).visit
    assert (visit.name, visit.reason, visit.exposure_s) == ("well", "requested by eve", 20.0)
    assert driver.phase is Phase.PLANNING


def test_a_stop_asked_for_while_planning_is_taken_at_once():
    driver = Driver().start()
    ask(driver, "measure", stop=WELL)
    assert driver.last(GoTo).stop == WELL
    goals = driver.count_of(GoTo)
    driver.plan(EAST)
    assert driver.count_of(GoTo) == goals, "the plan that comes late is not wanted any more"


def test_the_queue_is_put_in_order_and_shortened():
    driver = Driver().counting()
    for name in "abc":
        ask(driver, "measure", stop=Stop(name, 1.0, 1.0))
    assert ask(driver, "order", stops=("c", "a")).answer.accepted
    assert driver.mission.status.queue == ("c", "a")
    for stops in (("a", "x"), ("a", "a")):
        assert not ask(driver, "order", stops=stops).answer.accepted
    assert driver.mission.status.queue == ("c", "a")


def test_a_stop_that_does_not_fit_into_the_time_is_dropped():
    driver = Driver(budget_s=400.0).counting()
    ask(driver, "measure", stop=Stop("far", 5000.0, 0.0))
    finish_stop(driver)
    assert driver.phase is Phase.PLANNING
    assert "no time for far" in driver.reason


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"stop": None}, "no place"),
        ({"stop": Stop("x", math.nan, 0.0)}, "no place"),
        ({"stop": WELL, "dwell_s": -1.0}, "dwell"),
        ({"stop": WELL, "dwell_s": math.inf}, "dwell"),
    ],
)
def test_bad_places_are_refused(values, why):
    driver = ask(Driver().counting(), "measure", **values)
    assert not driver.answer.accepted
    assert why in driver.answer.message
    assert driver.mission.status.queue == ()


def test_an_area_is_ruled_out():
    driver = Driver().travelling(NORTH)
    area = ((-5.0, 25.0), (5.0, 25.0), (5.0, 35.0), (-5.0, 35.0))
    assert ask(driver, "rule_out", polygon=area).answer.accepted
    assert driver.phase is Phase.CANCELLING, "the target lies in it"
    driver.fail_goal()
    assert driver.last(RequestPlan).ruled_out == (area,)
    driver.plan(NORTH)
    assert "ruled out" in driver.reason
    crossing = (area[0], area[2], area[1], area[3])
    for bad in (area[:2], crossing, (area[0],) * 3, (*area[:3], (math.nan, 0.0))):
        assert not ask(driver, "rule_out", polygon=bad).answer.accepted
    assert not ask(driver, "measure", stop=NORTH).answer.accepted


def test_settings_change_while_it_runs():
    driver = Driver().counting()
    driver.record()
    changes = Changes(budget_s=9000.0, dwell="fmi:20", home=HOME, strategy="greedy")
    assert ask(driver, "change", changes=changes).answer.accepted
    status = driver.mission.status
    assert (status.time_left_s, status.strategy) == (9000.0 - status.time_used_s, "greedy")
    driver.record()
    assert driver.phase is Phase.PLANNING, "the new dwell counts at this stop already"
    driver.plan(None)
    assert driver.last(GoTo).stop == HOME
    restored = type(driver.mission).restore(driver.mission.rules, driver.mission.snapshot())
    assert restored.status == driver.mission.status


@pytest.mark.parametrize(
    "changes",
    [None, Changes(), Changes(budget_s=1.0), Changes(budget_s=math.nan), Changes(dwell="often")],
)
def test_settings_that_cannot_be_used_change_nothing(changes):
    driver = Driver().counting().record()
    before = driver.mission.current_rules
    assert not ask(driver, "change", changes=changes).answer.accepted
    assert driver.answer.message
    assert driver.mission.current_rules == before


def test_sent_home():
    driver = ask(Driver().counting().record(), "return_home")
    assert not driver.answer.accepted, "there is no home"
    ask(driver, "change", changes=Changes(home=HOME))
    ask(driver, "return_home")
    assert driver.answer.accepted
    assert driver.phase is Phase.RETURNING
    assert driver.last(VisitDone).visit.ended is VisitEnd.RETURNED
    driver.reach()
    assert driver.mission.status.ended is MissionEnd.RETURNED
    assert "sent home by eve" in driver.reason


def test_who_asks_is_said():
    driver = ask(Driver().counting(), "pause")
    assert driver.reason == "paused by eve"
    assert ask(driver, "abort").answer.message.startswith("aborted by eve")
