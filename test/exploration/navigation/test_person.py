# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A person as the navigation: arrivals, stops of their own choice, and a mission that fails nothing."""

import math

import numpy as np
import pytest
from mission_driver import EAST, NORTH, Command, Driver

from soilmoist_ros.exploration import CancelGoal, Cause, GoTo, Moved, Phase, Response, Stop, Verb, VisitDone, Way
from soilmoist_ros.exploration.guard.watch import Doing, RobotSurroundings
from soilmoist_ros.exploration.navigation.navigator import Outcome
from soilmoist_ros.exploration.navigation.person import CHOSEN_S, PersonNavigator, person_rules, person_watch

STOP = Stop("stop", 30.0, 0.0)
PERSON = {"by_person": True, "goal_time_margin_s": 1e9}


class Walk:
    """A person who walks and stands, seen with one fix each half second."""

    def __init__(self, sd_m=0.02, may_count=None):
        self.ended, self.now_s, self.place, self.sd_m = [], 0.0, (0.0, 0.0), sd_m
        self.noise = np.random.default_rng(1)
        self.navigator = PersonNavigator(self.ended.append, lambda: not may_count or may_count(self.place))

    def stand(self, for_s):
        end_s = self.now_s + for_s
        while self.now_s < end_s:
            self.now_s += 0.5
            x, y = np.array(self.place) + self.noise.normal(0.0, self.sd_m, 2)
            self.navigator.moved((float(x), float(y)), self.now_s, self.sd_m)
        return self

    def to(self, place, mps=1.2):
        while (away_m := math.dist(self.place, place)) > 1e-6:
            share = min(1.0, 0.5 * mps / away_m)
            self.place = tuple(a + share * (b - a) for a, b in zip(self.place, place, strict=True))
            self.stand(0.5)
        return self

    def go(self, goal_id=1, stop=STOP):
        self.navigator.go(goal_id, stop, Way(np.array([self.place, stop.xy])))
        return self

    @property
    def outcomes(self):
        return [(one.goal_id, one.outcome) for one in self.ended]


@pytest.mark.parametrize("sd_m", [0.02, 0.5])
def test_a_person_arrives_by_standing_at_the_stop_and_not_by_passing_it(sd_m):
    walk = Walk(sd_m).stand(3).go().to((60.0, 0.0))
    assert not walk.ended, "passed"
    walk.to(STOP.xy).stand(10)
    assert walk.outcomes == [(1, Outcome.SUCCEEDED)]


def test_who_stands_elsewhere_for_long_has_chosen_a_stop_but_not_where_the_advice_came():
    walk = Walk().stand(3).go().stand(2 * CHOSEN_S)
    assert not walk.ended, "the person has not set off yet"
    walk.to((0.0, 25.0)).stand(CHOSEN_S / 2)
    assert not walk.ended
    walk.stand(15)
    assert walk.outcomes == [(1, Outcome.SUCCEEDED)]


def test_nothing_is_chosen_outside_and_a_cancelled_advice_ends_at_once():
    walk = Walk(may_count=lambda place: place[1] < 20).stand(3).go().to((0.0, 25.0)).stand(60)
    assert not walk.ended
    assert walk.navigator.on_the_way == "39 m to stop"
    walk.navigator.cancel(1)
    assert walk.outcomes == [(1, Outcome.CANCELED)]
    lane = Walk().stand(3).go(2, Stop("near", 4.9, 0.0, 2.5)).stand(10)
    assert not lane.ended, "farther than half the way between two nodes"
    assert lane.to((3.0, 0.0)).stand(10).outcomes == [(2, Outcome.SUCCEEDED)]
    assert not walk.navigator.on_the_way


# The mission of a person


def test_a_stop_of_their_own_choice_is_measured_and_the_plan_goes_on_from_there():
    driver = Driver(**PERSON).travelling()
    driver.reach(Stop("", 5.0, 20.0))
    assert driver.phase is Phase.COUNTING
    assert driver.mission.state.target.stop == Stop("x5.0y20.0", 5.0, 20.0)
    for _ in range(6):
        driver.record()
    visit = driver.last(VisitDone).visit
    assert (visit.name, visit.raw_counts) == ("x5.0y20.0", 180)
    assert driver.phase is Phase.PLANNING
    assert not driver.mission.state.failures
    assert not driver.mission.state.blacklist, "the advice is not ruled out"


def test_who_leaves_a_stop_has_ended_it_and_keeps_its_counts():
    driver = Driver(**PERSON).counting()
    driver.record().record()
    for _ in range(5):
        driver.send(Moved, 60.0, 0.0, after=1.0)
    assert driver.last(VisitDone).visit.raw_counts == 60
    assert driver.phase is Phase.PLANNING
    assert not driver.mission.status.needs_operator


def test_measure_here_counts_at_once():
    driver = Driver(**PERSON).travelling(NORTH)
    driver.send(Moved, 0.0, 12.0, after=10.0)
    stop = Stop("x0.0y12.0", 0.0, 12.0)
    driver.send(Command, Verb.MEASURE, stop=stop, who="Anna")
    assert driver.answer.accepted
    assert driver.phase is Phase.COUNTING
    assert driver.mission.state.target.stop.name == "x0.0y12.0"
    assert CancelGoal in driver.kinds(), "the navigator and the learned speed hear of it"


def test_measure_at_the_stop_is_an_arrival():
    driver = Driver(**PERSON).travelling(EAST)
    driver.send(Moved, 28.0, 0.0, after=10.0)
    driver.send(Command, Verb.MEASURE, stop=Stop("x", 28.0, 0.0), who="Anna")
    assert driver.phase is Phase.COUNTING
    assert driver.mission.state.target.stop == EAST


def test_a_person_has_no_time_limit():
    driver = Driver(**PERSON).travelling()
    goals = driver.count_of(GoTo)
    for _ in range(60):
        driver.send(Moved, 1.0, 1.0, after=60.0)
    assert driver.phase is Phase.TRAVELLING
    assert driver.count_of(GoTo) == goals


def test_the_watch_of_a_person_stops_nobody_and_shows_what_matters():
    watch = person_watch()
    assert not any(response.stops for response in watch.responses.values())
    watch.moved(RobotSurroundings(outside_m=30.0, sd_m=0.02, off_route_m=50.0))
    watch.moved(RobotSurroundings(outside_m=30.0, sd_m=0.02, off_route_m=50.0))
    (alarm,) = watch.check(1.0, Doing(under_way=True, driving=True))
    assert (alarm.cause, alarm.response) == (Cause.OUTSIDE, Response.WARN)
    rules = person_rules(Driver().mission.rules)
    assert rules.by_person
    assert rules.standstill_s == 0
    assert rules.arrival_radius_m == 5.0
