# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pending measurements of other robots count as done, and no robot goes where another one is."""

import math
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stand_in import AtOnce, Driving, square_setup

from soilmoist_ros.exploration import AccessRules, Explorer, Mission, MissionClock, Property, Stop, Way, cell_stops
from soilmoist_ros.exploration.control.mission_control import MissionControl
from soilmoist_ros.exploration.control.operator_request import OperatorRequest
from soilmoist_ros.exploration.control.team import PendingMeasurement, Team, foreseen, pending_measurement
from soilmoist_ros.exploration.mission.events import RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, Phase, PlanKind, Verb
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.strategies.registry import STRATEGIES, make_strategy, warm_up
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.mapping import FieldGrid, FieldMap, PoissonKriging, estimate_variogram
from soilmoist_ros.mapping.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.sensing.records import CountRecord

pytest.importorskip("diagnostic_msgs")
from msg_adapters.mission import mission_from_message, mission_to_message

GRID = FieldGrid.from_polygon(np.array([[0, 0], [30, 0], [30, 20], [0, 20]], float), 2.5)
STOPS = cell_stops(GRID)
SAMPLES = as_samples([(1.25, 1.25), (26.25, 6.25), (11.25, 16.25)], [250, 500, 300], [100.0, 100.0, 100.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=30.0)


def field_map(known=True):
    found = FieldMap(GRID)
    if known:
        found.set_samples(SAMPLES, FIT)
        found.update()
    return found


def explorer(strategy, known=True, dwell="fmi:120", seed=0):
    return Explorer(
        [Property(field_map(known))], STOPS, FreeTravel(RobotMotion()), make_strategy(strategy),
        warm_up(strategy, "paper")[1], MissionRules(budget_s=7200, dwell=parse_dwell(dwell)),
        np.random.default_rng(seed),
    )  # fmt: skip


def request(kind=PlanKind.EXPLORE, blacklisted=()):
    return RequestPlan(1, kind, blacklisted, 7200.0, 7200.0)


def test_counts_to_come_lower_the_variance_as_if_they_had_come():
    before = field_map()
    after = foreseen(before, [PendingMeasurement(16.25, 6.25, 400.0)])
    rate = before.kriging.predict([(16.25, 6.25)])[0][0]
    come = PoissonKriging(FIT.variogram, mean_rate=FIT.mean_rate).fit(
        [*SAMPLES.xy, (16.25, 6.25)], [*SAMPLES.counts, round(rate * 400)], [*SAMPLES.exposure_s, 400.0]
    )
    np.testing.assert_allclose(after.variance, come.predict(GRID.cells)[1], rtol=1e-9)
    assert (after.variance < before.variance).all()
    assert after.variance.mean() < 0.9 * before.variance.mean()
    np.testing.assert_allclose(after.rate, before.rate, atol=0.01)
    assert len(before.samples) == 3
    for exposure_s in (0.0, 1e-308, 1e-13):  # a difference of times is rounded
        assert foreseen(before, [PendingMeasurement(16.25, 6.25, exposure_s)]) is before, "nothing will be counted"


def test_the_drift_of_the_map_is_that_of_what_is_to_come():
    before = field_map()
    timed = TimedSamples(SAMPLES, np.array([0.0, 1800.0, 3600.0]))
    before.set_samples(
        SAMPLES, FIT, Changing(timed, Change(Drift(0.9, False, (0.0, 3600.0), (-0.1, 0.0), ((0.1, 0.0),))), 3600.0)
    )
    before.update()
    after = foreseen(before, [PendingMeasurement(16.25, 6.25, 400.0)])
    assert after.soil_map.change == before.soil_map.change
    np.testing.assert_array_equal(after.changing.timed.time_s, [0.0, 1800.0, 3600.0, 3600.0])
    assert (after.variance < before.variance).all()


def test_a_pending_measurement_is_what_a_status_leaves_to_count():
    idle = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:300"))).status
    assert pending_measurement(idle) is None
    counting = replace(idle, target=Stop("a", 3.0, 4.0), planned_dwell_s=300.0, dwell_s=100.0)
    assert pending_measurement(counting) == PendingMeasurement(3.0, 4.0, 200.0)
    assert pending_measurement(counting, mapped_at_once=False) == PendingMeasurement(3.0, 4.0, 300.0)
    assert pending_measurement(replace(counting, dwell_s=400.0)) == PendingMeasurement(3.0, 4.0, 0.0)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    strategy=st.sampled_from([name for name in STRATEGIES.names() if name not in ("lattice", "two_pass")]),
    kind=st.sampled_from(PlanKind),
    targets=st.lists(st.sampled_from(STOPS), min_size=1, max_size=len(STOPS) - 1, unique=True),
    exposure_s=st.floats(0.0, 4000.0),
    dwell=st.sampled_from(["fmi:120", "optimal"]),
    data=st.data(),
)
def test_no_strategy_goes_where_another_robot_is(strategy, kind, targets, exposure_s, dwell, data):
    out = data.draw(st.sampled_from(["", STOPS[0].name]))
    others = [PendingMeasurement(stop.x_m, stop.y_m, exposure_s) for stop in targets]
    chooses = explorer(strategy, known=kind is PlanKind.EXPLORE, dwell=dwell)
    plan = chooses.plan(request(kind, (out,)), (2.5, 2.5), others)
    free = {stop.name for stop in STOPS} - {stop.name for stop in targets} - {out}
    if plan.choice is None:
        assert not free
    else:
        assert {plan.choice.stop.name, *(stop.name for stop in plan.choice.ahead)} <= free


@pytest.mark.parametrize("strategy", ["greedy", "gcb"])
def test_a_second_robot_keeps_away_from_what_the_first_will_know(strategy):
    first = explorer(strategy).plan(request(), (15.0, 10.0)).choice.stop
    there = PendingMeasurement(first.x_m, first.y_m, 600.0)
    alone, with_others = (
        explorer(strategy).plan(request(blacklisted=(first.name,)), (15.0, 10.0), others).choice.stop
        for others in ((), (there,))
    )
    nearness = [np.hypot(stop.x_m - first.x_m, stop.y_m - first.y_m) for stop in (alone, with_others)]
    assert nearness[1] >= nearness[0]
    assert nearness[1] > 4.0


BEGIN_S = 1.78e9
APART_M = 2.0
Y_M = 32.5


class Robot(Driving):
    """A robot of a team with its planner."""

    def __init__(self, name, place, graph=None, by_name=False):
        super().__init__(place)
        self.name, self.heard, self.time_s, self.visits = name, True, BEGIN_S, []
        access = AccessRules(robot_radius_m=0.5, by_name=by_name)
        clock = MissionClock(self.now_s, self.now_s, "boot")
        setup = square_setup(60, 5.0, settings={"access": access}, more={"map_wait_s": 0.0})
        team = Team(APART_M)
        self.control = MissionControl(setup, self.navigator, self, clock=clock, team=team, executor=AtOnce())
        self.control.use_graph(graph)

    def now_s(self):
        return self.time_s

    def visit(self, visit):
        self.visits.append(visit)

    def second(self):
        self.time_s += 1.0
        self.move()
        self.control.fix(self.place, 0.02, self.time_s)
        self.arrive()
        if self.time_s % 10 == 0:
            self.control.records([CountRecord(self.time_s, *self.place, 0.0, 40, 10.0, 10.0)])
        self.control.second()
        self.control.tick()
        self.control.check()
        self.control.hand_on()
        self.control.show()

    def asked(self, where):
        there = {"stops": (where,)} if isinstance(where, str) else {"place": where}
        assert self.control.request(OperatorRequest(Verb.MEASURE, dwell="60", **there)).code == "accepted"
        if self.goal_id is not None and "requested" not in self.shown.reason:
            assert self.control.command(Verb.SKIP).accepted

    @property
    def others(self):
        return next((part for part in self.control.health() if part.name == "others"), None)


def together(robots, condition, limit_s=600, nearest_m=0.9 * APART_M):
    """Let time pass until a condition holds: robots tell each other how they are, and keep apart."""
    for _ in range(limit_s):
        if condition():
            return
        for robot in robots:
            robot.second()
        for robot, other in permutations(robots, 2):
            if other.heard:
                said = mission_from_message(mission_to_message(other.shown))
                robot.control.other(other.name, said, other.name < robot.name)
        for robot, other in combinations(robots, 2):
            assert math.dist(robot.place, other.place) >= nearest_m, (robot.shown, other.shown)
    raise AssertionError([(robot.name, robot.place, robot.shown.reason) for robot in robots])


def begun(*robots):
    for robot in robots:
        for _ in range(3):
            robot.second()
        assert robot.control.command(Verb.START).accepted
    return robots


AISLE = TravelGraph(
    tuple(f"n{i}" for i in range(12)),
    np.array([(2.5 + 5.0 * i, Y_M) for i in range(12)]),
    np.array([(i, j) for i in range(12) for j in (i - 1, i + 1) if 0 <= j < 12]),
    np.full(22, 5.0),
)


@pytest.mark.slow
@pytest.mark.parametrize("graph", [None, AISLE], ids=["free", "aisle"])
def test_robots_that_meet_head_on_keep_apart_and_both_go_on(graph):
    robots = one, two = begun(Robot("/robot_1", (12.5, Y_M), graph), Robot("/robot_2", (47.5, Y_M), graph))
    one.asked((57.5, Y_M) if graph is None else "n11")
    two.asked((2.5, Y_M) if graph is None else "n0")
    met = []

    def both_have_met():
        met.append([alarm.cause for robot in robots for alarm in robot.shown.alarms])
        return met[-1]

    together(robots, both_have_met, 100)
    together(robots, lambda: not one.shown.alarms and one.goal_id is not None, 100)
    assert two.goal_id is None, "the second one in order waits"
    visits = [len(robot.visits) for robot in robots]
    together(robots, lambda: all(len(r.visits) > v + 1 for r, v in zip(robots, visits, strict=True)), 3000)
    assert not any(robot.shown.needs_operator for robot in robots)


@pytest.mark.slow
@pytest.mark.parametrize("graph", [None, AISLE], ids=["free", "aisle"])
def test_three_robots_keep_apart_and_none_waits_for_ever(graph):
    """In an aisle the one in the middle is shut in again and again."""
    robots = begun(*(Robot(f"/robot_{n}", (x, Y_M), graph) for n, x in enumerate((27.5, 57.5, 42.5))))
    together(robots, lambda: min(len(robot.visits) for robot in robots) >= 6, 1500, nearest_m=APART_M)
    assert not any(robot.shown.needs_operator for robot in robots)


def started_beside_each_other(graph, by_name=False):
    """Two robots that stand 1.6 m apart, between two nodes, when both are started."""
    robots = [Robot(f"/robot_{n}", (x, Y_M), graph, by_name) for n, x in enumerate((31.2, 32.8))]
    together(robots, lambda: robots[0].time_s > BEGIN_S + 4, nearest_m=1.5)
    assert all(robot.control.command(Verb.START).accepted for robot in robots)
    return robots


@pytest.mark.slow
@pytest.mark.parametrize("graph", [None, AISLE], ids=["free", "aisle"])
def test_robots_that_start_beside_each_other_come_no_nearer_and_both_leave(graph):
    robots = started_beside_each_other(graph)
    together(robots, lambda: min(len(robot.visits) for robot in robots) >= 2, nearest_m=1.59)
    assert not any(robot.shown.needs_operator for robot in robots)


@pytest.mark.slow
def test_robots_beside_each_other_are_to_be_driven_apart_where_the_navigation_may_plan_from_one_node():
    robots = started_beside_each_other(AISLE, by_name=True)
    together(robots, lambda: all("going on when" in robot.shown.reason for robot in robots), 60, nearest_m=1.59)
    together(robots, lambda: all(robot.shown.needs_operator for robot in robots), nearest_m=1.59)
    assert "drive one of them to another stop, 2.5 m from the others" in robots[0].shown.reason
    robots[0].way = [(12.5, Y_M)]  # somebody does
    together(robots, lambda: len(robots[1].visits) > 1)
    assert not robots[1].shown.needs_operator


@pytest.mark.slow
def test_a_stop_too_near_to_another_robot_is_not_chosen_and_a_way_leads_past_it():
    one, two = Robot("/robot_1", (2.5, 30.0)), Robot("/robot_2", (30.0, 30.0))
    together([one, two], lambda: one.time_s > BEGIN_S + 5)
    begun(one)
    one.asked((57.5, 30.0))
    way = [(2.5, 30.0), *one.way]
    assert one.way[-1][0] == 57.5
    assert Way(np.array(way)).passes_m(two.place) >= APART_M
    together([one, two], lambda: one.visits)
    assert one.control.request(OperatorRequest(Verb.MEASURE, place=(31.0, 30.0), dwell="60")).code == "accepted"
    together([one, two], lambda: "/robot_2 is 1.0 m from it" in one.shown.reason, 100)
    assert one.shown.failures == 1


def test_a_robot_does_not_start_before_it_knows_where_the_others_are_unless_they_stay_silent():
    one = Robot("/robot_1", (2.5, 30.0))
    one.control.other("/robot_2", None)
    together([one], lambda: one.time_s > BEGIN_S + 4)
    reply = one.control.command(Verb.START)
    assert not reply.accepted
    assert "the place of /robot_2 (30 s at most)" in reply.message
    together([one], lambda: one.time_s > BEGIN_S + 35)
    assert one.control.command(Verb.START).accepted, "it is not there today"


def test_a_robot_that_falls_silent_is_lost_and_its_place_stays_taken_until_somebody_releases_it():
    one, two = Robot("/robot_1", (2.5, 30.0)), Robot("/robot_2", (30.0, 30.0))
    begun(one, two)
    two.asked((47.5, 32.5))
    together([one, two], lambda: two.place[0] > 38)
    two.heard, died = False, two.place
    together([one], lambda: one.time_s > two.time_s + 25)
    assert one.others is None
    together([one], lambda: one.others is not None, 10)
    assert one.others.level is Level.ERROR
    assert "/robot_2 is lost: last heard 3" in one.others.message
    assert f"({died[0]:.1f}, {died[1]:.1f})" in one.others.message
    places = dict(one.control.team.standing()), list(one.control.team.standing())
    assert [there for _, there in places[1]] == [pytest.approx(died, abs=0.1), (47.5, 32.5)]
    assert one.control.team.near(died)
    # What it was to count there is released when it would have been counted.
    job = lambda: one.control._queue._others  # noqa: E731
    assert job()
    together([one], lambda: not job(), 120)
    assert one.control.team.near(died), "a dead robot does not move away"
    assert one.control.team.release_lost() == ["/robot_2"]
    assert not one.control.team.near(died)
    assert one.control.team.release_lost() == []


STATUS = Mission(MissionRules(budget_s=7200.0, dwell=parse_dwell("fmi:60"))).status


@pytest.mark.parametrize(
    ("own", "after_s", "wrong"),
    [
        ((12.5, 30.0), 5.0, True),  # it may have stopped where it was heard last
        ((15.0, 30.0), 5.0, True),
        ((20.0, 30.0), 5.0, True),  # or still drive
        ((40.0, 30.0), 5.0, False),
        ((15.0, 30.0), 1.2, False),  # it has driven on
        ((39.5, 30.0), 40.0, True),  # it is lost, and may have driven on to its stop
        ((10.0, 31.0), 40.0, True),  # or not
        ((25.0, 30.0), 40.0, False),
    ],
)
def test_a_silent_robot_is_anywhere_between_its_last_place_and_where_it_may_be(own, after_s, wrong):
    team, start = Team(APART_M), replace(STATUS, phase=Phase.TRAVELLING, target=Stop("there", 40.0, 30.0))
    for place, time_s in [((9.0, 30.0), 0.0), ((10.0, 30.0), 1.0), ((10.1, 30.0), 1.1)]:
        team.robot("/other").hear(replace(start, place=place), time_s, True)
    team.fault((own[0], own[1] - 20.0), False, False, 1.1)  # it was farther away when this one set off
    team.pass_time(after_s)
    assert bool(team.fault(own, True, False, 1.1 + after_s)) == wrong


@pytest.mark.parametrize(("under_way", "level"), [(False, Level.WARN), (True, Level.ERROR)])
def test_a_robot_about_another_datum_is_no_small_matter(under_way, level):
    one = Robot("/robot_1", (2.5, 30.0))
    one.control.other("/robot_2", STATUS, datum=(53.001, 0.0))
    health = one.control.team.health(under_way)
    assert (health.level, "/robot_2 is not heard" in health.message) == (level, True)
    assert not list(one.control.team.standing())
