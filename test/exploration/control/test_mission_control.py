# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A mission and all around it, without ROS: a robot that jumps, and a clock that the test moves."""

import json
import math
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from stand_in import StandIn, square_setup

from soilmoist_ros.exploration import MissionClock, MissionControl, Stop, Watch, WatchLimits, Way, parse_dwell
from soilmoist_ros.exploration.mission.types import MissionEnd, Phase, Verb
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome, in_frame
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, Level, PlaneMove
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.sensing import CountRecord, PlaceLimits


class Around(StandIn):
    """Robot, navigation, sensor, mapper and displays in one."""

    def __init__(
        self,
        home="",
        dwell="fmi:30",
        strategy="greedy",
        steady=None,
        surveys=None,
        frames=None,
        delay_s=0.0,
        setup=None,
        **rules,
    ):
        self.time_s, self.goals, self.shown = 0.0, [], []
        self.visits, self.measured = [], []
        given = {"budget_s": 900.0, "warm_up_stops": 1, "min_last_dwell_s": 60.0, "standstill_s": 0.0, **rules}
        opening = surveys and (lambda changes: surveys(changes, setup.settings))
        setup = setup or square_setup(
            20, 2.0, strategy, settings={"seed": 0, "motion": RobotMotion()}, speed_mps=0.6, backoff_s=0.0,
            more={"home": home, "open_survey": opening, "start_delay_s": delay_s},
            dwell=parse_dwell(dwell), **given,
        )  # fmt: skip
        clock = MissionClock(self.now_s, steady, "boot")
        watch = Watch(WatchLimits(place=PlaceLimits(first_fixes=1)))  # one fix makes a place
        self.control = MissionControl(setup, self.navigator, self, clock=clock, watch=watch, frames=frames)

    # the navigator

    def go(self, goal_id, stop, way):
        self.goals.append((goal_id, stop))

    def cancel(self, goal_id):
        self.goals.append((goal_id, None))

    # the outputs

    def now_s(self):
        return self.time_s

    def show(self, status, ahead, more):
        self.shown.append((status, ahead))

    def visit(self, visit):
        self.visits.append(visit)

    # the test

    @property
    def status(self):
        self.control.show()
        return self.shown[-1][0]

    def planned(self):
        deadline = time.monotonic() + 60
        while self.status.phase is Phase.PLANNING and time.monotonic() < deadline:
            time.sleep(0.005)
            self.control.hand_on()
        assert self.status.phase is not Phase.PLANNING

    def arrive(self):
        goal_id, stop = self.goals[-1]
        self.time_s += 30.0
        self.control.fix((stop.x_m, stop.y_m))
        self.control.ended(Ended(goal_id, Outcome.SUCCEEDED, ""))

    def count(self, records=3):
        _, stop = self.goals[-1]
        for _ in range(records):
            self.time_s += 10.0
            record = CountRecord(self.time_s, stop.x_m, stop.y_m, 0.0, 40, 10.0, 10.0)
            self.control.records([record])

    def map(self):
        self.measured.append((self.goals[-1][1].x_m, self.goals[-1][1].y_m))
        n = len(self.measured)
        samples = as_samples(self.measured, [120 + i for i in range(n)], [30.0] * n)
        fit = estimate_variogram(samples.xy, samples.counts, samples.exposure_s, extent_m=20.0)
        self.control.samples(samples, self.time_s)
        self.control.fit(fit, self.time_s)

    def ready(self, graph=None):
        self.time_s = 1000.0
        self.control.use_graph(graph)
        self.control.fix((1.0, 1.0))
        return self

    def begin(self):
        self.ready()
        assert self.control.command(Verb.START).accepted
        self.planned()


def test_it_starts_only_when_all_is_there():
    around = Around()
    around.waiting_for = "the navigation"
    for what, give in [
        ("the time", lambda: setattr(around, "time_s", 1000.0)),
        ("the map of the navigation", lambda: around.control.use_graph(None)),
        ("a position", lambda: around.control.fix((1.0, 1.0))),
        ("the navigation", lambda: setattr(around, "waiting_for", "")),
    ]:
        answer = around.control.command(Verb.START)
        assert not answer.accepted
        assert what in answer.message
        assert what in around.status.reason
        give()
    assert around.control.missing() == ()
    assert around.control.command(Verb.START).accepted


@pytest.mark.parametrize("steady", [True, False], ids=["real time", "simulated time"])
@pytest.mark.parametrize("first", ["ended", "tick", "fix"])
def test_a_planner_that_was_stopped_on_the_way_waits_for_people_before_all_else(steady, first):
    around = Around()
    around.control._clock = MissionClock(around.now_s, around.now_s if steady else None, "", around.now_s)
    around.begin()
    (goal_id, _) = around.goals[-1]
    around.time_s += 22.0
    gone = Ended(goal_id, Outcome.FAILED, "the navigation has gone away")
    {
        "ended": lambda: around.control.ended(gone),
        "tick": around.control.tick,
        "fix": lambda: around.control.fix((2.0, 1.0)),
    }[first]()
    said = "the planner was silent for 22 s; check the robot, then resume or abort"
    assert [status.reason for status, _ in around.shown if "gone away" in status.reason] == []
    assert said in around.status.reason
    around.control.ended(gone)
    for _ in range(40):
        around.time_s += 0.2
        around.control.fix((2.0, 1.0))
        around.control.tick()
        around.control.check()
    assert (around.status.phase, around.goals[1:]) == (Phase.PAUSED, [(goal_id, None)])
    assert not around.control.command(Verb.RESUME).accepted, "the alarm is on"
    around.time_s += 4.0
    around.control.check()
    assert around.control.command(Verb.RESUME).accepted
    assert around.goals[-1][1] is not None


def test_goals_and_places_reach_the_navigation_in_its_own_frame():
    frames = SimpleNamespace(waiting_for="the navigation's datum", move=None)
    around, ways, places = Around(frames=frames), [], []
    around.go = lambda _, stop, way: ways.append((stop, way))
    around.moved = lambda place, *_: places.append(place)
    around.ready()
    assert "the navigation's datum" in around.control.command(Verb.START).message
    assert not places
    frames.waiting_for, frames.move = "", PlaneMove(math.pi / 2, (100.0, 0.0))
    around.begin()
    ((stop, way),), target = ways, around.status.target
    there = pytest.approx(frames.move.place((target.x_m, target.y_m)))
    assert (stop.x_m, stop.y_m) == tuple(way.corners[-1]) == there
    assert tuple(way.corners[0]) == places[-1] == pytest.approx(frames.move.place((1.0, 1.0)))
    (node,) = in_frame(target, Way(way.corners, (target,)), frames.move)[1].nodes
    assert (node.x_m, node.y_m) == there


def test_health_is_graver_in_mid_mission():
    around = Around()
    before = {part.name: part.level for part in around.control.health()}
    assert before == {"navigation": Level.OK, "position": Level.WARN, "records": Level.WARN, "guard": Level.OK}
    around.begin()
    around.time_s += 100.0
    after = {part.name: part.level for part in around.control.health()}
    assert after == {"navigation": Level.OK, "position": Level.ERROR, "records": Level.ERROR, "guard": Level.OK}


def test_closing_stops_the_robot_and_nothing_follows():
    around = Around()
    around.begin()
    goal_id, _ = around.goals[-1]
    around.control.close()
    assert around.goals[-1] == (goal_id, None)
    around.control.ended(Ended(goal_id, Outcome.CANCELED, ""))
    around.control.tick()
    assert not around.control.command(Verb.RESUME).accepted
    assert around.status.phase is Phase.TRAVELLING
    assert around.goals[-1] == (goal_id, None)


def warned(**more):
    around = Around(delay_s=5.0, budget_s=3600.0, **more)
    around.begin()
    assert (around.goals, around.control.about_to_move) == ([], True)
    return around


def after(around, seconds):
    """The goals that are sent until so much later."""
    around.time_s += seconds
    around.control.tick()
    return around.goals


def test_people_are_warned_before_a_robot_moves_that_stood_by_order():
    around = warned()
    assert after(around, 4.9) == []
    assert around.control.command(Verb.PAUSE).accepted
    assert (around.status.phase, around.control.about_to_move) == (Phase.PAUSED, False)
    assert after(around, 60.0) == [], "what was announced and cancelled is never sent"
    assert around.control.command(Verb.RESUME).accepted
    around.planned()
    [(_, stop)] = after(around, 5.0)
    assert (stop, around.control.about_to_move) == (around.status.target, False)
    around.arrive()
    around.count()
    around.map()
    around.planned()
    assert len(around.goals) == 2, "no warning between stops"
    assert around.goals[-1][1] is not None


@pytest.mark.parametrize("verb", [Verb.SKIP, Verb.RETURN])
def test_another_order_during_the_warning_waits_for_the_rest_of_it(verb):
    around = warned(home="r5c5")
    after(around, 3.0)
    assert around.control.command(verb).accepted
    around.planned()
    assert (after(around, 1.9), around.control.about_to_move) == ([], True)
    assert len(after(around, 0.1)) == 1


def test_a_resume_right_after_the_pause_is_warned_of():
    around = warned()
    ((goal_id, _),) = after(around, 5.0)
    assert around.control.command(Verb.PAUSE).accepted
    around.control.ended(Ended(goal_id, Outcome.CANCELED, ""))
    assert around.control.command(Verb.RESUME).accepted  # before any tick
    around.planned()
    assert (around.goals[-1], around.control.about_to_move) == ((goal_id, None), True)


def test_closing_sends_nothing_that_was_only_announced():
    around = warned()
    around.control.close()
    assert after(around, 10.0) == []


def test_of_two_robots_with_one_target_the_later_in_order_gives_way():
    around = Around(budget_s=3600.0)
    around.control.other("/robot_1", None)
    around.begin()
    assert any(part.name == "others" and "/robot_1" in part.message for part in around.control.health())
    target = around.goals[-1][1]
    there = replace(around.status, target=target, phase=Phase.TRAVELLING)
    around.control.other("/robot_1", there, goes_first=False)
    assert around.status.target == target
    around.control.other("/robot_1", there, goes_first=True)
    assert around.status.phase is Phase.CANCELLING
    assert "skipped because /robot_1 goes there" in around.status.reason
    around.control.ended(Ended(around.goals[-2][0], Outcome.CANCELED, ""))
    around.planned()
    assert around.status.phase is Phase.TRAVELLING
    assert around.status.target != target
    assert not any(part.name == "others" for part in around.control.health())


def test_the_planner_plans_on_the_cells_of_the_mappers_map():
    around = Around(budget_s=3600.0)
    around.control.fit(None, 0.0, cell_m=5.0)
    around.begin()
    stop = around.goals[-1][1]
    assert (stop.x_m % 5.0, stop.y_m % 5.0) == (2.5, 2.5), "the field's own cells have 2 m"
    around.arrive()
    around.count()
    around.control.fit(None, 1.0, cell_m=4.0)
    around.map()
    around.planned()
    stop = around.goals[-1][1]
    assert (stop.x_m % 4.0, stop.y_m % 4.0) == (2.0, 2.0), "the mapper was started again with other cells"
    with pytest.raises(InputError, match="cannot be gridded"):
        around.control.fit(None, 2.0, cell_m=1e-5)


def test_the_status_shows_places_of_the_last_seconds():
    """A simulated clock waits for it, so that places do not become stale on a busy computer."""
    around = Around()
    around.begin()
    shown = []
    around.show = lambda status, ahead, more: shown.append(float(more["place_s"]))
    for step in range(1, 9):
        around.time_s = 1000.0 + step
        around.control.fix((1.0 + 0.1 * step, 1.0))
    assert shown == pytest.approx([1002.0, 1004.0, 1006.0, 1008.0])


def test_a_person_on_the_way_is_led_to_the_next_bend():
    around, shown = Around(strategy="random", by_person=True), []
    corners = {"a": (1.0, 1.0), "b": (10.0, 1.0), "c": (10.0, 12.0)}
    stops = [Stop(name, *xy) for name, xy in corners.items()]
    around.ready(TravelGraph.from_edges(stops, ["ab", "ba", "bc", "cb"]))
    assert around.control.command(Verb.START).accepted
    around.planned()
    while around.status.target.name != "c":
        around.control.command(Verb.SKIP)
        around.control.ended(Ended(around.goals[-2][0], Outcome.CANCELED, ""))
        around.planned()
    around.show = lambda status, ahead, more: shown.append(json.loads(more["leads"]))
    around.control.show()
    around.time_s += 60.0
    around.control.fix((9.0, 1.0))
    assert shown == [pytest.approx([10.0, 1.0, 20.0]), pytest.approx([10.0, 12.0, 12.0])]


@pytest.mark.parametrize("step_s", [-3600.0, 21600.0])
def test_a_clock_that_is_set_changes_nothing_but_the_stamps(step_s):
    steady = [50.0]
    around = Around(budget_s=900.0, steady=lambda: steady[0])

    def pass_time(time_s, set_s=0.0):
        around.time_s += time_s + set_s
        steady[0] += time_s
        around.control.tick()

    around.begin()
    before = around.status
    pass_time(1.0, step_s)
    after = around.status
    assert (after.phase, after.reason, after.clock_offset_s) == (
        before.phase, before.reason, pytest.approx(step_s),
    )  # fmt: skip
    assert after.time_used_s == pytest.approx(before.time_used_s + 1.0)
    assert after.estimated_end_s == pytest.approx(before.estimated_end_s + step_s), "people see their own time"
    steady[0] += 30.0
    around.arrive()
    for _ in range(3):
        steady[0] += 10.0
        around.count(1)
    assert around.visits, "records that carry the new time count"
    assert around.visits[-1].end_stamp_s == pytest.approx(around.time_s)
    pass_time(1000.0)
    assert around.status.ended is MissionEnd.TIME_UP, "limits still work"


def test_it_learns_how_fast_the_robot_is():
    around = Around(strategy="random")
    around.begin()
    for _ in range(5):
        around.arrive()
        around.count()
        around.map()
        around.planned()
    control = around.control
    assert len(control._learned.legs) == 5
    assert control._learned.motion.stop_overhead_s != 12.0
    assert control._access.travel.motion.stop_overhead_s != 12.0
    assert control._mission.rules.stop_overhead_s >= 12.0
    assert "per stop, learned from 5 legs" in str(control._learned)
