# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Causes of trouble, their alarms, and how they end: watch.py and failsafes.py."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import FAILSAFES, Alarm, Cause, Response, Watch, WatchLimits
from soilmoist_ros.exploration.guard.watch import AGAIN_S, Doing, RobotSurroundings
from soilmoist_ros.exploration.mission.events import AlarmOver
from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.sensing.position.place_judge import PlaceFix

IDLE, MISSION = Doing(), Doing(under_way=True)
LIMITS = WatchLimits()


class Observed:
    """A watch, a clock, and a robot that stands at home with all that it needs."""

    def __init__(self, limits=LIMITS, responses=None, doing=MISSION):
        self.watch, self.doing, self.now_s = Watch(limits, responses or {}), doing, 100.0
        self.alarms, self.overs, self.events = [], [], []
        self.fixes = self.records = self.maps = True
        self.place = (0.0, 0.0)
        self.frozen = False

    def run(self, seconds):
        for _ in range(seconds):
            self.now_s += 1.0
            if self.fixes:
                noise_m = 0.0 if self.frozen else 0.01 * (self.now_s % 2)
                self.watch.fix(PlaceFix(self.now_s, self.place[0] + noise_m, self.place[1]))
            if self.records and self.now_s % 10 == 0:
                self.watch.record(self.now_s, self.now_s, True)
                if self.maps:
                    self.watch.map(self.now_s, self.now_s)
            self.check()
        return self

    def check(self):
        for event in self.watch.check(self.now_s, self.doing):
            self.events.append(event)
            (self.alarms if isinstance(event, Alarm) else self.overs).append(event.cause)

    def on(self):
        return set(self.watch.on)


def test_nothing_is_wrong_while_all_is_there():
    observed = Observed().run(1000)
    assert observed.events == []
    health = observed.watch.health(observed.now_s)
    assert (health.name, health.level, health.message) == ("guard", Level.OK, "nothing is wrong")
    assert set(Cause) <= set(health.values)
    assert health.values["charge"].startswith("not watched")


def test_what_was_never_there_is_not_missed():
    observed = Observed(doing=IDLE)
    observed.fixes = observed.records = False
    observed.run(1000)
    assert observed.events == []


def test_each_cause_has_a_text_and_a_remedy():
    assert set(FAILSAFES) == set(Cause)
    assert all(row.about and row.remedy for row in FAILSAFES.values())


def test_an_ignored_cause_is_no_alarm():
    observed = Observed(responses={Cause.OUTSIDE: Response.IGNORE}).run(1)
    observed.watch.report(Cause.OUTSIDE, "wrong")
    assert observed.watch.check(observed.now_s, IDLE) == ()


@pytest.mark.parametrize("away_m", [16.0, 30.0, 60.0, 2000.0])
def test_fixes_that_agree_on_another_place(away_m):
    observed = Observed().run(20)
    observed.place = (away_m, 0.0)
    observed.run(13)
    assert observed.on() & {Cause.RELOCATED, Cause.SPEED}
    assert observed.watch.responses[Cause.RELOCATED] is Response.PAUSE
    observed.run(30)
    assert observed.on() == set()


@pytest.mark.parametrize("driving", [False, True])
def test_frozen_fixes_of_a_driving_robot(driving):
    observed = Observed(doing=Doing(under_way=True, driving=driving))
    observed.frozen = True
    observed.run(int(LIMITS.fix_frozen_s))
    assert observed.on() == set()
    observed.run(5)
    assert observed.on() == ({Cause.FIX_FROZEN} if driving else set())
    observed.frozen = False
    observed.run(30)
    assert observed.on() == set()


def test_a_wrong_place_does_not_end_a_mission_for_want_of_time():
    observed = Observed(doing=Doing(under_way=True, time_left_s=600.0, way_home_s=20.0)).run(20)
    observed.place = (-2000.0, 0.0)
    for _ in range(2):
        observed.watch.moved(RobotSurroundings(outside_m=2000.0))
    observed.doing = replace(observed.doing, way_home_s=2000.0)
    observed.run(20)
    assert observed.on() == {Cause.OUTSIDE}


def around(observed, times=2, sd_m=0.02, **where):
    """Let so many fixes show where the robot is, one a second."""
    for _ in range(times):
        observed.watch.moved(RobotSurroundings(sd_m=sd_m, leaving_m=1.0, **where))
        observed.run(1)
    return observed.on() - {Cause.FIX_OLD}


PLACES = [
    ("outside_m", 2.0, Cause.OUTSIDE, Response.PAUSE, "the robot is 3 m outside the field"),
    ("no_go_m", 0.5, Cause.IN_NO_GO, Response.PAUSE, "the robot is 0.7 m deep in a no-go area"),
    ("off_route_m", 5.0, Cause.OFF_ROUTE, Response.WARN, "the robot is 7 m off its route"),
    ("off_route_m", 10.0, Cause.FAR_OFF_ROUTE, Response.PAUSE, "the robot is 14 m off its route"),
]


@pytest.mark.parametrize(("name", "limit_m", "cause", "response", "text"), PLACES)
def test_where_the_robot_must_not_be(name, limit_m, cause, response, text):
    observed = Observed().run(5)
    assert around(observed, **{name: limit_m + 0.05}) - {Cause.OFF_ROUTE} == set(), "noise"
    assert cause not in around(observed, times=1, **{name: 1.4 * limit_m}), "one fix"
    assert around(observed, **{name: 1.4 * limit_m}) >= {cause}
    alarm = next(event for event in observed.events if event.cause == cause)
    assert (alarm.response, alarm.reason) == (response, text)
    around(observed, int(LIMITS.clear_s) + 1)
    assert cause in observed.overs


@given(st.floats(0.3, 3.0), st.sampled_from([row[:3] for row in PLACES]))
def test_a_noisy_receiver_widens_the_limits(sd_m, row):
    name, limit_m, cause = row
    observed = Observed().run(3)
    noise_m = min(4 * sd_m, 10.0)
    assert cause not in around(observed, 10, sd_m, **{name: limit_m + 0.95 * noise_m})
    assert cause in around(observed, 2, sd_m, **{name: limit_m + 1.05 * noise_m})


def test_a_mission_may_begin_outside_and_at_the_edge_of_a_no_go_area():
    observed = Observed(doing=IDLE).run(2)
    assert around(observed, outside_m=8.0, no_go_m=0.9) == set()
    observed.doing = MISSION
    for outside_m, no_go_m in ((8.0, 0.9), (9.5, 1.2), (5.0, 0.5)):
        assert around(observed, outside_m=outside_m, no_go_m=no_go_m) == set()
    assert around(observed, outside_m=7.5) == {Cause.OUTSIDE}, "it was at 5 m"
    assert around(observed, no_go_m=1.2) >= {Cause.IN_NO_GO}
    deep = Observed(doing=IDLE).run(2)
    around(deep, no_go_m=3.0)
    deep.doing = MISSION
    assert around(deep, 3, no_go_m=3.0) == {Cause.IN_NO_GO}


@pytest.mark.parametrize("ahead", ["ahead_no_go_m", "ahead_outside_m"])
def test_a_robot_off_its_route_that_heads_for_the_border_is_stopped_before_it(ahead):
    observed = Observed().run(3)
    assert around(observed, off_route_m=1.0, **{ahead: 4.0}) == set()
    assert around(observed, off_route_m=3.0, **{ahead: 0.2}) == set()
    assert around(observed, off_route_m=3.0, **{ahead: 4.0}) == {Cause.FAR_OFF_ROUTE}


class Creeping(Observed):
    """A robot with RTK that can move east; each of its fixes has noise."""

    speed_mps, sd_m, seed = 0.0, 0.02, 1

    def run(self, seconds):
        noise = np.random.default_rng(self.seed)
        for _ in range(seconds):
            self.now_s += 1.0
            self.place = (self.place[0] + self.speed_mps, 0.0)
            x_m, y_m = noise.normal(self.place, self.sd_m)
            self.watch.fix(PlaceFix(self.now_s, float(x_m), float(y_m), self.sd_m))
            self.check()
        return self


SHOULD_STAND = Doing(still=True)


@pytest.mark.parametrize(("speed_mps", "within_s"), [(0.05, 20), (0.1, 12), (0.3, 6), (0.8, 3)])
def test_a_robot_that_should_stand_and_moves(speed_mps, within_s):
    observed = Creeping(doing=SHOULD_STAND).run(30)
    assert observed.events == []
    observed.speed_mps = speed_mps
    observed.run(within_s)
    assert observed.alarms == [Cause.MOVING]
    assert observed.events[0].response is Response.PAUSE
    assert "moves without a goal" in observed.events[0].reason
    observed.run(3 * int(AGAIN_S))
    assert observed.alarms == [Cause.MOVING] * (3 + (len(observed.alarms) > 3)), (
        "it is stopped again, not all the time"
    )
    observed.speed_mps = 0.0
    observed.run(30)
    assert observed.on() == set(), "the place where it stands now is the right one"


@pytest.mark.parametrize(
    "doing", [Doing(), Doing(under_way=True, driving=True), Doing(still=True, other_client="another client")]
)
def test_a_robot_may_move_when_people_or_a_goal_drive_it(doing):
    observed = Creeping(doing=doing)
    observed.speed_mps = 0.8
    assert Cause.MOVING not in observed.run(60).alarms


def test_a_robot_may_roll_out_after_its_goal():
    observed = Creeping(doing=Doing(driving=True))
    observed.speed_mps = 0.8
    observed.run(20)
    observed.doing = SHOULD_STAND
    observed.run(1)
    observed.speed_mps = 0.0
    assert observed.run(60).alarms == []


def test_jump_and_speed_of_a_bad_receiver():
    observed = Observed().run(5)
    for second in range(1, 5):
        observed.place = (2000.0 + 200 * second, 0.0)
        observed.run(1)
    assert observed.alarms == ["jump"]
    assert observed.events[0].response is Response.HOLD
    assert (
        "the last 3 positions are wrong: the newest is 2600 m from where the sensor can be"
        in observed.events[0].reason
    )
    observed.run(3)
    assert observed.watch.places.fix.xy == pytest.approx((0.0, 0.0), abs=0.02)
    observed.place = (1.0, 0.0)
    observed.run(int(LIMITS.clear_s) - 1)
    assert observed.overs == []
    observed.run(3)
    assert observed.overs == ["jump"]


def test_speed():
    observed = Observed().run(5)
    for second in range(12):
        observed.place = (observed.place[0] + min(second, 5.0), 0.0)
        observed.run(1)
    assert observed.alarms == ["speed"]
    assert observed.events[0].reason.startswith("the robot moves at")
    assert observed.events[0].response is Response.PAUSE


def test_old_fix():
    observed = Observed().run(5)
    observed.fixes = False
    observed.run(10)
    assert observed.alarms == []
    observed.run(1)
    assert observed.alarms == ["fix_old"]
    assert observed.events[0].response is Response.HOLD
    observed.fixes = True
    observed.run(11)
    assert observed.overs == ["fix_old"]


def test_places_that_come_too_late_make_the_last_one_old():
    observed = Observed().run(5)
    observed.fixes = False
    for _ in range(12):
        observed.run(1)
        late = PlaceFix(observed.now_s, 0.0, 0.0, age_s=LIMITS.fix_old_s + 1.0)
        assert observed.watch.fix(late) is None
    assert observed.alarms == ["fix_old"]


def test_silence_needs_checks_and_not_only_time():
    """A process that stood still for a minute reads its messages before it complains."""
    observed = Observed().run(5)
    observed.now_s += 60.0
    observed.check()
    assert observed.alarms == []
    observed.watch.fix(PlaceFix(observed.now_s, 0.0, 0.0))
    observed.run(5)
    assert observed.alarms == []


def test_old_records_only_in_a_mission():
    observed = Observed(doing=IDLE).run(20)
    observed.records = False
    observed.run(100)
    assert observed.alarms == []
    observed.doing = MISSION
    observed.run(61)
    assert observed.alarms == []
    observed.run(1)
    assert observed.alarms == ["records_old"]
    assert observed.events[0].response is Response.WARN
    observed.doing = IDLE
    observed.run(12)
    assert observed.overs == ["records_old"]


def test_a_dead_mapper():
    observed = Observed().run(100)
    observed.maps = False
    observed.run(9 + 301)
    assert observed.alarms == []
    observed.run(10)
    assert observed.alarms == ["map_old"]
    observed.maps = True
    observed.run(21)
    assert observed.overs == ["map_old"]


@pytest.mark.parametrize(
    ("name", "cause", "response"),
    [("watchdog", "watchdog_silent", Response.WARN), ("operator", "operator_gone", Response.WARN)],
)
def test_who_was_there_is_missed_in_a_mission_only(name, cause, response):
    observed = Observed(doing=IDLE).run(30)
    observed.watch.hear(name, observed.now_s)
    observed.run(30)
    assert observed.alarms == []
    observed.doing = MISSION
    observed.watch.hear(name, observed.now_s)
    observed.run(10)
    assert observed.alarms == []
    observed.run(1)
    assert [(one.cause, one.response) for one in observed.events] == [(cause, response)]
    observed.watch.hear(name, observed.now_s)
    observed.run(9)
    observed.watch.hear(name, observed.now_s)
    observed.run(3)
    assert observed.overs == [cause]


def test_an_operator_who_is_demanded_is_missed_before_a_mission_and_if_none_ever_was():
    observed = Observed(doing=IDLE, responses={Cause.OPERATOR_GONE: Response.HOLD}).run(3)
    assert observed.alarms == ["operator_gone"]
    observed.watch.hear("operator", observed.now_s)
    observed.run(10)
    assert observed.overs == ["operator_gone"]
    observed.run(5)
    assert observed.alarms == ["operator_gone"] * 2
    unasked = Observed(doing=IDLE).run(3)
    unasked.watch.operator_absent(unasked.now_s)
    unasked.doing = MISSION
    unasked.run(12)
    assert unasked.alarms == ["operator_gone"], "a released switch is no absent one"


def test_navigation_that_goes_away_with_a_goal():
    observed = Observed(doing=replace(MISSION, waiting_for="the navigation /nav")).run(100)
    assert observed.alarms == [], "nothing drives the robot"
    observed.doing = replace(observed.doing, driving=True)
    observed.run(12)
    assert observed.alarms == ["navigation_silent"]
    assert "the navigation /nav" in observed.events[0].reason
    observed.doing = replace(observed.doing, driving=False)
    observed.run(100)
    assert observed.overs == [], "the goal was cancelled because of it, and it is still not there"
    observed.doing = replace(observed.doing, waiting_for="")
    observed.run(12)
    assert observed.overs == ["navigation_silent"]


def test_navigation_without_feedback():
    observed = Observed(doing=replace(MISSION, driving=True)).run(100)
    assert observed.alarms == [], "this one sends no feedback"
    observed.doing = replace(observed.doing, feedback_age_s=9.0)
    observed.run(1)
    assert observed.alarms == []
    observed.doing = replace(observed.doing, feedback_age_s=11.0)
    observed.run(1)
    assert observed.alarms == ["navigation_silent"]
    assert observed.events[0].reason == "no feedback of the navigation for 11 s"


def drain(observed, charge, volts=math.nan, times=3):
    for _ in range(times):
        observed.watch.battery(observed.now_s, charge, volts)
        observed.run(1)


def test_battery_low_and_empty():
    observed = Observed()
    drain(observed, 0.26)
    drain(observed, 0.24, times=2)
    drain(observed, 0.26)
    assert observed.alarms == [], "a peak load"
    drain(observed, 0.24)
    assert observed.alarms == ["battery_low"]
    assert observed.events[0].response is Response.RETURN
    assert observed.events[0].reason == "the battery is at 24%"
    drain(observed, 0.28, times=20)
    assert observed.overs == [], "not yet charged"
    drain(observed, 0.09)
    assert observed.alarms == ["battery_low", "battery_empty"]
    assert observed.events[1].response is Response.ABORT
    drain(observed, 0.9, times=20)
    assert observed.overs == ["battery_low", "battery_empty"]


def test_a_low_voltage_with_a_good_charge():
    observed = Observed(WatchLimits(battery_low_v=46.0))
    drain(observed, 0.8, 45.5)
    drain(observed, 0.8, times=30)
    assert (observed.alarms, observed.overs) == (["battery_low"], [])
    drain(observed, 0.8, 49.0, times=20)
    assert observed.overs == ["battery_low"]


@pytest.mark.parametrize("between", [1, 2, 5])
def test_messages_with_either_charge_or_voltage(between):
    """A charge comes now and then, with a voltage in between: that is no charged battery."""
    observed = Observed()
    for time in range(3):
        assert observed.alarms == [], f"{time} messages with a low charge"
        drain(observed, 0.24, times=1)
        drain(observed, math.nan, 48.0, times=between)
    assert observed.alarms == ["battery_low"]
    drain(observed, math.nan, 48.0, times=30)
    drain(observed, math.nan, times=30)
    assert observed.overs == []
    drain(observed, 0.9, times=20)
    assert observed.overs == ["battery_low"]


def test_a_limit_of_zero_ignores_the_battery():
    observed = Observed(WatchLimits(battery_low=0.0, battery_empty=0.0))
    drain(observed, 0.0)
    assert observed.alarms == []


@pytest.mark.slow
def test_reserve_of_charge():
    """10 % an hour: 40 % suffice for a way home of two hours, 30 % do not."""
    observed = Observed(WatchLimits(battery_silent_s=0.0), doing=replace(MISSION, way_home_s=7300.0))
    observed.run(1)
    drain(observed, 0.6)
    for hour in (1, 2):
        observed.run(3600 - 3)
        drain(observed, 0.6 - 0.1 * hour)
    assert observed.alarms == []
    observed.run(3600 - 3)
    drain(observed, 0.3)
    assert observed.alarms == ["reserve"]
    assert "the charge is 30%, and" in observed.events[0].reason


@pytest.mark.parametrize(("charge", "volts", "last"), [(0.43, 48.0, "43%"), (math.nan, 46.5, "46.5 V")])
def test_a_silent_battery(charge, volts, last):
    observed = Observed(doing=IDLE)
    drain(observed, charge, volts, times=1)
    observed.run(1000)
    assert observed.alarms == [], "there is no mission"
    observed.doing = MISSION
    drain(observed, charge, volts, times=1)
    drain(observed, math.nan, times=58)
    assert observed.alarms == []
    drain(observed, math.nan, times=3)
    assert observed.alarms == ["battery_silent"]
    assert observed.events[0].response is Response.WARN
    assert observed.events[0].reason == f"no state of the battery for 61 s; the last one was {last}"
    drain(observed, charge, volts, times=11)
    assert observed.overs == ["battery_silent"]


def test_reserve_of_time():
    observed = Observed(doing=replace(MISSION, way_home_s=300.0, time_left_s=301.0)).run(5)
    assert observed.alarms == []
    observed.doing = replace(observed.doing, time_left_s=299.0)
    observed.run(1)
    assert observed.alarms == ["reserve"]
    assert observed.events[0].response is Response.RETURN
    observed.doing = replace(observed.doing, going_home=True)
    observed.run(12)
    assert observed.overs == ["reserve"]


def test_a_cause_of_others_and_one_of_a_moment():
    observed = Observed().run(1)
    observed.watch.report(Cause.FRAME_MISMATCH, "3.1 m to the north")
    observed.watch.note(Cause.CLOCK_STEP, "the clock was set back by 3600 s")
    observed.run(100)
    assert observed.alarms == ["frame_mismatch", "clock_step"]
    assert observed.overs == ["clock_step"]
    health = observed.watch.health(observed.now_s)
    assert health.level is Level.ERROR
    assert health.message.startswith("frame_mismatch: 3.1 m to the north; check the datum")
    assert health.values["clock_step"] == "OK (warn, 1 so far)"


@pytest.mark.parametrize(
    "wrong",
    [
        {"fix_old_s": -1.0},
        {"clear_s": math.inf},
        {"battery_empty": 0.5},
        {"battery_empty_v": 2.0, "battery_low_v": 1.0},
    ],
)
def test_limits_out_of_range(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        WatchLimits(**wrong)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 20.0), st.sampled_from(Cause), st.sampled_from(["", "wrong", "a moment"])),
        max_size=60,
    ),
    st.dictionaries(st.sampled_from(Cause), st.sampled_from(Response)),
)
def test_whatever_happens_alarms_alternate_and_end_late(steps, responses):
    watch, now_s = Watch(WatchLimits(min_checks=1), responses), 0.0
    on, seen = set(), {}
    for step_s, cause, text in steps:
        now_s += step_s
        if text == "a moment":
            watch.note(cause, text)
        else:
            watch.report(cause, text)
        wrong = {each for each, state in watch._states.items() if state.text}
        for event in watch.check(now_s, MISSION):
            if isinstance(event, AlarmOver):
                on.remove(event.cause)
                assert now_s - seen[event.cause] >= watch.limits.clear_s
            else:
                assert event.cause not in on
                assert event.response is watch.responses[Cause(event.cause)] is not Response.IGNORE
                assert event.reason
                on.add(event.cause)
            assert event.now_s == now_s
        for each in wrong | {each for each, state in watch._states.items() if state.text}:
            seen[each] = now_s
        assert on == set(watch.on)
