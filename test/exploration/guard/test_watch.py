# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Causes of trouble, their alarms, and how they end: watch.py and failsafes.py."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration import Alarm, Cause, Response, Watch, WatchLimits
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
        self.frozen, self.battery, self.quarantine = False, (), ""

    def run(self, seconds):
        for _ in range(seconds):
            self.now_s += 1.0
            if self.fixes:
                noise_m = 0.0 if self.frozen else 0.01 * (self.now_s % 2)
                self.watch.fix(PlaceFix(self.now_s, self.place[0] + noise_m, self.place[1]))
            if self.records and self.now_s % 10 == 0:
                self.watch.record(self.now_s, self.now_s, True, self.quarantine)
                if self.maps:
                    self.watch.map(self.now_s, self.now_s)
            if self.battery:
                self.watch.battery(self.now_s, *self.battery)
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


@pytest.mark.parametrize("away_m", [16.0, 30.0, 60.0, 2000.0])
def test_fixes_that_agree_on_another_place(away_m):
    observed = Observed().run(20)
    observed.place = (away_m, 0.0)
    observed.run(13)
    assert observed.on() & {Cause.RELOCATED, Cause.SPEED}
    assert observed.watch.responses[Cause.RELOCATED] is Response.PAUSE
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


# Courses: what changes, the seconds that pass then, and the alarms that begin (+, with response) and end (-)


def now(**values):
    """A change of what the robot has; of its activity where that has the name."""

    def change(observed):
        does = {name: value for name, value in values.items() if hasattr(observed.doing, name)}
        observed.doing = replace(observed.doing, **does)
        vars(observed).update({name: value for name, value in values.items() if name not in does})

    return change


def heard(name, **values):
    return lambda observed: (observed.watch.hear(name, observed.now_s), now(**values)(observed))


def absent(observed):
    observed.watch.operator_absent(observed.now_s)
    observed.doing = MISSION


NAN, NOTHING = math.nan, now()
DEMANDED = {"responses": {Cause.OPERATOR_GONE: Response.HOLD}}
COURSES = {
    "what was never there is not missed": ({"doing": IDLE}, [(now(fixes=False, records=False), 1000, "")]),
    "fixes": ({}, [(NOTHING, 5, ""), (now(fixes=False), 10, ""), (NOTHING, 1, "+fix_old:hold"),
                   (now(fixes=True), 11, "-fix_old")]),
    "frozen fixes": ({}, [(now(frozen=True, driving=True), 12, ""), (NOTHING, 5, "+fix_frozen:pause"),
                          (now(frozen=False), 30, "-fix_frozen")]),
    "frozen fixes in one short goal after the other": ({}, [
        (now(frozen=True, driving=True), 9, ""), (now(driving=False), 2, ""),
        (now(driving=True), 9, "+fix_frozen:pause")]),
    "frozen fixes of a robot that stands": ({}, [(now(frozen=True), 60, "")]),
    "records, only in a mission": ({"doing": IDLE}, [
        (NOTHING, 20, ""), (now(records=False), 100, ""), (now(under_way=True), 61, ""),
        (NOTHING, 1, "+records_old:warn"), (now(under_way=False), 12, "-records_old")]),
    "a dead mapper": ({}, [(NOTHING, 100, ""), (now(maps=False), 310, ""), (NOTHING, 10, "+map_old:warn"),
                           (now(maps=True), 21, "-map_old")]),
    **{name: ({"doing": IDLE}, [
        (NOTHING, 30, ""), (heard(name), 30, ""), (heard(name, under_way=True), 10, ""),
        (NOTHING, 1, f"+{cause}:warn"), (heard(name), 9, ""), (heard(name), 3, f"-{cause}")])
       for name, cause in (("watchdog", "watchdog_silent"), ("operator", "operator_gone"))},
    "an operator who is demanded": ({"doing": IDLE, **DEMANDED}, [
        (NOTHING, 3, "+operator_gone:hold"), (heard("operator"), 10, "-operator_gone"),
        (NOTHING, 5, "+operator_gone:hold")]),
    "quarantined records, which no map has": ({}, [
        (now(quarantine="dead_tube", maps=False), 400, "+counts_bad:pause")]),
    "a released switch is no absent one": ({"doing": IDLE}, [
        (NOTHING, 3, ""), (absent, 12, "+operator_gone:warn")]),
    "a navigation that goes away with a goal": ({"doing": replace(MISSION, waiting_for="the navigation /nav")}, [
        (NOTHING, 100, ""), (now(driving=True), 12, "+navigation_silent:hold"), (now(driving=False), 100, ""),
        (now(waiting_for=""), 12, "-navigation_silent")]),
    "feedback": ({"doing": replace(MISSION, driving=True)}, [
        (NOTHING, 100, ""), (now(feedback_age_s=9.0), 1, ""),
        (now(feedback_age_s=11.0), 1, "+navigation_silent:hold")]),
    "charge": ({}, [
        (now(battery=(0.26, NAN)), 3, ""), (now(battery=(0.24, NAN)), 2, ""), (now(battery=(0.26, NAN)), 3, ""),
        (now(battery=(0.24, NAN)), 3, "+battery_low:return_home"), (now(battery=(0.28, NAN)), 20, ""),
        (now(battery=(0.09, NAN)), 3, "+battery_empty:abort"),
        (now(battery=(0.9, NAN)), 20, "-battery_low -battery_empty")]),
    "a low voltage with a good charge": ({"limits": WatchLimits(battery_low_v=46.0)}, [
        (now(battery=(0.8, 45.5)), 3, "+battery_low:return_home"), (now(battery=(0.8, NAN)), 30, ""),
        (now(battery=(0.8, 49.0)), 20, "-battery_low")]),
    **{f"a low charge between {seconds} messages with a voltage": ({}, [
        *((now(battery=(0.24, NAN)), 1, ""), (now(battery=(NAN, 48.0)), seconds, "")) * 2,
        (now(battery=(0.24, NAN)), 1, "+battery_low:return_home"), (now(battery=(NAN, 48.0)), 30, ""),
        (now(battery=(0.9, NAN)), 20, "-battery_low")]) for seconds in (1, 5)},
    "no limits of the battery": ({"limits": WatchLimits(battery_low=0.0, battery_empty=0.0)}, [
        (now(battery=(0.0, NAN)), 3, "")]),
    "a silent battery": ({"doing": IDLE}, [
        (now(battery=(0.43, 48.0)), 1, ""), (now(battery=()), 1000, ""),
        (now(under_way=True, battery=(NAN, 46.5)), 1, ""), (now(battery=(NAN, NAN)), 60, ""),
        (NOTHING, 1, "+battery_silent:warn"), (now(battery=(NAN, 46.5)), 11, "-battery_silent")]),
    "reserve of time": ({"doing": replace(MISSION, way_home_s=300.0, time_left_s=301.0)}, [
        (NOTHING, 5, ""), (now(time_left_s=299.0), 1, "+reserve:return_home"),
        (now(going_home=True), 12, "-reserve")]),
    "reserve of charge": ({
        "limits": WatchLimits(battery_silent_s=0.0), "doing": replace(MISSION, way_home_s=7300.0),
    }, [
        (NOTHING, 1, ""), (now(battery=(0.6, NAN)), 3, ""), (now(battery=()), 3597, ""),
        (now(battery=(0.5, NAN)), 3, ""), (now(battery=()), 3597, ""), (now(battery=(0.4, NAN)), 3, ""),
        (now(battery=()), 3597, "+reserve:return_home")]),
}  # fmt: skip
TEXTS = {"reserve of charge": "the charge is 30%, and", "charge": "the battery is at 24%",
         "feedback": "no feedback of the navigation for 11 s",
         "a silent battery": "no state of the battery for 61 s; the last one was 43%"}  # fmt: skip


def said(event):
    return f"-{event.cause}" if isinstance(event, AlarmOver) else f"+{event.cause}:{event.response}"


@pytest.mark.parametrize("name", COURSES)
def test_what_is_missing_or_low_is_an_alarm_until_it_is_over_for_some_time(name):
    given, steps = COURSES[name]
    observed = Observed(**given)
    for change, seconds, expected in steps:
        change(observed)
        before = len(observed.events)
        observed.run(seconds)
        assert " ".join(map(said, observed.events[before:])) == expected
    assert not observed.events or observed.events[0].reason.startswith(TEXTS.get(name, ""))


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
