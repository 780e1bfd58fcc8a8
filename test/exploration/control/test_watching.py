# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each cause of trouble in a mission that drives through a simulated world, without ROS."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stand_in import AtOnce, Driving, square_setup

from soilmoist_ros.exploration import ANYBODYS, FAILSAFES, Cause, Mission, MissionClock, MissionControl, Watch
from soilmoist_ros.exploration.control.operator_request import OperatorRequest, ReplyCode
from soilmoist_ros.exploration.mission.types import MissionEnd, Phase, Response, Verb
from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.sensing.gnss import Fix, FixStatus, NoPlace, Position
from soilmoist_ros.sensing.records import CountRecord

BEGIN_S = 1.78e9
STANDING = {Phase.PAUSED, Phase.IDLE, Phase.FINISHED}


class Farm(Driving):
    """A square field and a robot with all its devices."""

    def __init__(self, watch=None, no_go=(), **rules):
        super().__init__((50.0, 50.0))
        self.steady_s, self.stepped_s = 500.0, 0.0
        self.fix = self.stamp = lambda value: value
        self.sd_m, self.receiver_s = 0.02, 0.0
        self.stray = None  # metres east and north in a second, whatever the goal
        self.fixes = self.sensor = self.mapper = True
        self.quarantine = ""
        self.charge = math.nan
        self.moves, self.counted = [], []
        self.control = MissionControl(
            square_setup(100, 5.0, no_go=no_go, more={"home": "r0c0"}, **rules), self.navigator, self,
            executor=AtOnce(), clock=MissionClock(self.now_s, lambda: self.steady_s, "boot"),
            watch=watch or Watch(),
        )  # fmt: skip
        self.control.use_graph(None)

    def moved(self, place, now_s, sd_m):
        self.moves.append(place)

    # the outputs

    def now_s(self):
        return BEGIN_S + self.steady_s + self.stepped_s

    # the world

    @property
    def status(self):
        self.control.show()
        return self.shown

    @property
    def alarms(self):
        return {alarm.cause: alarm.response for alarm in self.status.alarms}

    @property
    def health(self):
        return next(part for part in self.control.health() if part.name == "guard")

    def second(self):
        self.steady_s += 1.0
        self.move()
        if self.fixes:
            self.control.fix(self.fix(self.place), self.sd_m, self.now_s() + self.receiver_s)
        self.arrive()
        if math.isfinite(self.charge):
            self.control.battery(self.charge, math.nan)
        if self.sensor and self.steady_s % 10 == 0:
            self.count()
        self.control.tick()
        self.control.check()
        self.control.hand_on()

    def move(self):
        if self.stray is not None:
            self.place = self.place[0] + self.stray[0], self.place[1] + self.stray[1]
        elif not self.waiting_for:
            super().move()

    def count(self):
        record = CountRecord(self.stamp(self.now_s()), *self.fix(self.place), 0.0, 40, 10.0, 10.0)
        self.control.records([replace(record, quarantine=self.quarantine)])
        if self.mapper and not self.quarantine:
            self.counted.append(self.place)
            places = list(dict.fromkeys(self.counted))
            samples = as_samples(places, [40.0] * len(places), [10.0] * len(places))
            self.control.samples(samples, record.stamp_s)
            self.control.fit(None, record.stamp_s)

    def run(self, condition, limit_s=3000):
        """Let time pass until a condition holds."""
        for _ in range(limit_s):
            if condition():
                return self
            self.second()
        raise AssertionError(f"not in {limit_s} s: {self.status}; {self.health}")

    def pass_by(self, seconds):
        for _ in range(seconds):
            self.second()
        return self

    def begin(self):
        """Until the robot drives to a stop some way off."""
        self.pass_by(3)
        assert self.control.command(Verb.START).accepted
        return self.run(lambda: self.status.phase is Phase.TRAVELLING and self.way_m > 15)

    @property
    def way_m(self):
        return math.dist(self.place, self.way[-1]) if self.way else 0.0


@pytest.fixture
def farm():
    return Farm().begin()


def stands_because_of(farm, cause):
    assert farm.alarms.get(cause) is FAILSAFES[cause].response
    farm.run(lambda: farm.status.phase in STANDING, 60)
    assert farm.goal_id is None
    assert (farm.health.level, farm.health.message.split(":")[0]) == (Level.ERROR, cause)
    refused = farm.control.command(Verb.RESUME)
    assert not refused.accepted
    return refused.message


def goes_on(farm):
    samples = farm.status.samples
    farm.run(lambda: farm.status.samples > samples + 1)
    assert farm.alarms == {}
    assert farm.health.level is Level.OK


def test_a_receiver_may_hold_the_place_of_a_robot_that_has_arrived(farm):
    farm.run(lambda: farm.way_m < 2)
    farm.move = lambda: None  # the navigation has not said so yet
    assert farm.pass_by(40).status.phase is Phase.TRAVELLING


def test_frozen_fixes_wait_for_an_operator(farm):
    frozen = farm.place
    farm.fix = lambda true: frozen
    farm.run(lambda: "fix_frozen" in farm.alarms, 30)
    assert farm.alarms["fix_frozen"] is Response.PAUSE
    began_s = farm.steady_s
    farm.run(lambda: farm.status.phase is Phase.PAUSED, 60)
    assert farm.steady_s - began_s >= 4, "what was repeated before does not show that the robot stands"
    assert farm.goal_id is None
    farm.fix = lambda true: true
    farm.run(lambda: not farm.alarms, 120)
    farm.run(lambda: farm.control.command(Verb.RESUME).accepted, 60)
    goes_on(farm)


@pytest.mark.slow
def test_the_way_home_is_reckoned_with_the_time_that_the_operator_gives():
    farm = Farm(budget_s=600.0).begin()
    assert farm.control.request(OperatorRequest(Verb.CHANGE, hours=1.0)).code is ReplyCode.ACCEPTED
    farm.pass_by(600)
    assert (farm.alarms, farm.finished) == ({}, None)
    assert farm.status.ended is None


@pytest.mark.parametrize("heard", [0, 25], ids=["the first ones", "after others"])
def test_records_of_long_ago_do_not_move_the_robot(farm, heard):
    """A driver that was killed sends what is missing of the way so far, before its receiver has its first fix."""
    farm.fixes = False
    farm.pass_by(heard)
    farm.sensor = False
    farm.pass_by(7)
    x_m, y_m = farm.place
    missing = [
        CountRecord(farm.now_s() - 900.0 + 10 * n, x_m + 7.0 * n, y_m, 0.0, 40, 10.0, 10.0) for n in range(1, 21)
    ]
    farm.control.records(missing)
    farm.fixes = farm.sensor = True
    alarms = set()
    for _ in range(30):
        farm.second()
        alarms |= set(farm.alarms)
    assert alarms <= {"fix_old"}, "the place is not another one"
    assert not farm.status.needs_operator
    assert int(farm.health.values["fixes past"]) >= len(missing)


@pytest.mark.parametrize("wrong_s", [4000.0, -90_000.0])
def test_records_with_an_impossible_stamp_do_not_count(farm, wrong_s):
    farm.stamp = lambda stamp_s: stamp_s + wrong_s
    farm.run(lambda: "counts_stamp" in farm.alarms, 20)
    farm.pass_by(300)
    assert farm.status.samples == 0
    assert farm.status.raw_counts == 0
    farm.stamp = lambda stamp_s: stamp_s
    farm.run(lambda: farm.status.samples >= 2)


def test_quarantined_records_do_not_count_and_too_many_of_them_wait_for_an_operator(farm):
    farm.quarantine = "impossible_count"
    counted = farm.status.raw_counts
    farm.run(lambda: "counts_bad" in farm.alarms, 70)
    stands_because_of(farm, Cause.COUNTS_BAD)
    assert "records are quarantined (impossible count)" in farm.health.message
    farm.pass_by(100)
    assert set(farm.alarms) == {"counts_bad"}, "the sensor is there, and the map has all that it should"
    assert farm.status.raw_counts == counted
    farm.quarantine = ""
    farm.run(lambda: not farm.alarms, 100)
    assert farm.control.command(Verb.RESUME).accepted
    goes_on(farm)


def test_the_first_place_needs_more_than_one_fix():
    farm = Farm()
    farm.fixes = False
    farm.control.fix((2000.0, 50.0))
    farm.steady_s += 1
    farm.control.fix((50.0, 50.0))
    assert "a position" in farm.control.missing()
    farm.control.heard.add(Fix(1.8e9, Position(53.0, 0.0), FixStatus.FIX))
    assert "a position (1 came, none plausible so far)" in farm.control.missing()
    farm.fixes = True
    farm.pass_by(3)
    assert farm.control.missing() == ()


def test_without_a_position_it_is_said_what_came_instead():
    farm = Farm()
    control = farm.control

    def health():
        return next(one for one in control.health() if one.name == "position")

    assert health().message == "none has come"
    control.heard.other_type = "the topic fix has gps_msgs/msg/GPSFix, not sensor_msgs/msg/NavSatFix"
    assert health().message == control.heard.other_type
    for _ in range(4):
        control.hear(Fix.without_place(math.nan, NoPlace.STATUS_UNKNOWN, "status -2"))
    why = "no position in 4 epochs: status -2: unknown whether there is a fix (4)"
    assert health().message == why
    assert f"a position ({why})" in control.missing()
    assert control.watch.fix_fault == "unknown whether there is a fix, status -2"


def test_alarms_of_a_mission_that_was_interrupted_end(farm):
    farm.fixes = farm.sensor = False
    farm.run(lambda: farm.alarms, 20)
    state = farm.control._mission.state
    again = Farm()
    again.steady_s = farm.steady_s
    again.control.take_up(Mission(again.control._mission.rules, state), auto=True)
    assert set(again.alarms) == {"fix_old"}
    goes_on(again)


@pytest.mark.parametrize("away_m", [0.0, 8.0])
def test_a_robot_that_is_elsewhere_after_a_restart_waits_for_people(farm, away_m):
    """The receiver jumped while it counted, and the planner that doubted it has died."""
    farm.run(lambda: farm.status.phase is Phase.COUNTING).pass_by(15)
    again = Farm()
    again.steady_s, again.place = farm.steady_s + 10.0, farm.place
    again.fix = lambda true: (true[0] + away_m, true[1])
    again.control.take_up(Mission(again.control._mission.rules, farm.control._mission.state), auto=True)
    again.pass_by(20)
    assert again.status.phase is (Phase.PAUSED if away_m else Phase.COUNTING)
    if away_m:
        assert "has moved by 8.0 m" in again.pass_by(60).status.reason
        assert len(again.control.doubts()) == 2
        assert again.control.command(Verb.RESUME).accepted
        assert again.control.doubts()[-1].outcome == "confirmed"


def pressed_and_released(control):
    control.emergency(True, "/emergency_stop")
    control.emergency(False, "/emergency_stop")


@pytest.mark.parametrize(
    ("people", "phase"),
    [
        (lambda control: None, Phase.COUNTING),
        (lambda control: control.command(Verb.PAUSE), Phase.PAUSED),
        (pressed_and_released, Phase.PAUSED),
        (lambda control: control.watch.note(Cause.MAP_CHANGED, "the navigation has another map"), Phase.PAUSED),
    ],
)
def test_an_interrupted_mission_that_people_stop_does_not_resume_by_itself(farm, people, phase):
    farm.run(lambda: farm.status.phase is Phase.COUNTING).pass_by(15)
    again = Farm()
    again.steady_s, again.place = farm.steady_s, farm.place
    again.control.take_up(Mission(again.control._mission.rules, farm.control._mission.state), auto=True)
    people(again.control)
    again.pass_by(20)
    assert again.status.phase is phase


@pytest.mark.parametrize("receiver_s", [0.0, -1024 * 604800.0, 3600.0])
@pytest.mark.parametrize("step_s", [0.0, 7200.0])
def test_doubts_have_the_clock_of_the_records(receiver_s, step_s):
    """A receiver may count weeks wrongly, and the clock of the computer may be set in a mission."""
    farm = Farm()
    farm.receiver_s = receiver_s
    farm.begin().run(lambda: farm.shown.phase is Phase.COUNTING, 200)
    farm.stepped_s = step_s
    farm.pass_by(10).control.doubts()
    began_s, farm.fix = farm.now_s(), lambda true: (true[0] + 8.0, true[1])
    farm.pass_by(20)
    farm.fix = lambda true: true
    first, last = farm.pass_by(10).control.doubts()
    assert first.since_s == last.since_s == pytest.approx(began_s, abs=2.0)
    assert last.until_s == pytest.approx(began_s + 20.0, abs=2.0)


# Motion


def strays(farm, mps, to=(50.0, 1e6), noise_m=0.02):
    """The robot moves towards a place, whatever it is asked for; its fixes have noise."""
    noise, away_m = np.random.default_rng(3), math.dist(farm.place, to)
    farm.fix = lambda true: tuple(noise.normal(true, noise_m).tolist())
    farm.stray = tuple(mps / away_m * (end - here) for here, end in zip(farm.place, to, strict=True))
    return farm


def test_a_robot_that_moves_while_its_place_is_not_believed_is_stopped(farm):
    farm.control.command(Verb.PAUSE)
    farm.run(lambda: farm.status.phase is Phase.PAUSED, 30).pass_by(20)
    strays(farm, 0.0)
    farm.fix, noisy = lambda true: noisy((true[0] + 8.0, true[1])), farm.fix
    assert set(farm.pass_by(15).alarms) == {"jump", "fix_old"}
    farm.stray = 0.4, 0.0
    before = farm.cancelled
    farm.run(lambda: "moving" in farm.alarms, 6)
    assert farm.pass_by(12).cancelled >= before + 2


def test_an_aborted_robot_that_moves_is_stopped_and_cannot_start(farm):
    farm.control.command(Verb.ABORT)
    farm.run(lambda: farm.status.phase is Phase.IDLE, 30)
    before = farm.cancelled
    strays(farm, 0.4).run(lambda: "moving" in farm.alarms, 8)
    assert farm.cancelled == before + 1
    assert "refused: the robot moves without a goal" in farm.status.reason
    farm.stray = None
    assert farm.pass_by(120).status.reason.endswith("waiting for start")
    assert strays(farm, 0.4).pass_by(30).alarms == {}, "people drive it away"
    answer = farm.control.command(Verb.ABORT)
    assert answer.message.endswith("it is not known to stand")
    farm.run(lambda: "moving" in farm.alarms, 8)


def test_a_robot_that_moves_after_an_emergency_stop_is_stopped_again_without_a_mission():
    farm = Farm().pass_by(3)
    farm.control.emergency(True, "button")
    strays(farm, 0.4).run(lambda: "moving" in farm.alarms, 8)


# Each cause stops the robot, and after it people resume


POND = np.array([[30.0, 60.0], [35.0, 60.0], [35.0, 66.0], [30.0, 66.0]])
MIDDLE = 32.5, 63.0


def off_route(farm):
    return strays(farm, 1.0, (0.0, 100.0) if farm.way[-1][1] < farm.place[1] else (0.0, 0.0))


def drifts(farm):
    """The receiver drifts slowly to the west, so that each fix is plausible."""
    for off_m in range(1, 116):
        farm.fix = lambda true, off_m=off_m: (true[0] - off_m, true[1])
        farm.second()


def comes_back(farm):
    for off_m in range(114, -1, -1):
        farm.fix = lambda true, off_m=off_m: (true[0] - off_m, true[1])
        farm.second()


def another_drives(farm):
    farm.other_client = "another client drives the robot with /nav"


def is_left(farm):
    farm.other_client = ""


def into_the_pond(noise_m, sd_m):
    def goes(farm):
        farm.run(lambda: farm.status.phase is Phase.COUNTING)
        farm.sd_m = sd_m
        strays(farm, 0.0, noise_m=noise_m).pass_by(60)  # a stop teaches what the receiver does not state
        strays(farm, 0.8, MIDDLE, noise_m)

    return goes


LOOPS = {  # what happens, the cause and what is said of it, and how it ends
    **{f"a pond, noise of {noise_m} m, stated {sd_m}": (
        into_the_pond(noise_m, sd_m), Cause.IN_NO_GO, "no-go area", None)
       for noise_m, sd_m in ((0.02, 0.02), (0.1, 0.1), (0.02, math.nan), (0.02, 0.0))},
    "far off its route": (off_route, Cause.FAR_OFF_ROUTE, "off its route", None),
    "outside the field": (drifts, Cause.OUTSIDE, "outside the field", comes_back),
    "another client": (another_drives, Cause.OTHER_CLIENT, "another client drives the robot with /nav", is_left),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_a_robot_in_trouble_stands_until_people_resume(name):
    happens, cause, text, ends = LOOPS[name]
    farm = Farm(no_go=(POND,)).begin()
    asked, cancel = [], farm.cancel
    farm.cancel = lambda goal_id: (asked.append(goal_id), cancel(goal_id))
    happens(farm)
    farm.run(lambda: cause in farm.alarms, 130)
    if cause is Cause.IN_NO_GO:
        left_m = 1.0 if farm.sd_m == 0.02 else 0.3  # what is not stated well is not known as well
        assert math.dist(farm.place, MIDDLE) > left_m, "it is 3 m from the middle to the border"
    farm.stray = None
    assert text in stands_because_of(farm, cause)
    assert farm.status.failures == 0
    assert cause is not Cause.OTHER_CLIENT or ANYBODYS not in asked, "another client's goal is not ours to cancel"
    if ends is None:
        return
    ends(farm)
    farm.run(lambda: not farm.alarms, 60)
    assert farm.status.phase is Phase.PAUSED, "people resume"
    assert farm.control.command(Verb.RESUME).accepted
    goes_on(farm)


def test_a_fix_far_outside_that_runs_away_stops_the_robot_and_is_not_its_place(farm):
    """2 km outside, at 200 m/s: the mission must not travel on."""
    place, distance_m, began_s = farm.place, farm.status.distance_m, farm.steady_s
    farm.fix = lambda true: (2000.0 + 200.0 * (farm.steady_s - began_s), 25.0)
    farm.run(lambda: farm.alarms, 10)
    assert farm.alarms == {"jump": Response.HOLD}
    farm.pass_by(120)
    assert farm.status.phase is Phase.CANCELLING, "its standstill cannot be confirmed"
    assert (farm.goal_id, farm.status.distance_m) == (None, distance_m)
    assert all(math.dist(each, place) < 20 for each in farm.moves[-5:])
    farm.fix = lambda true: true
    goes_on(farm)


def test_a_low_battery_sends_the_robot_home(farm):
    farm.charge = 0.2
    farm.run(lambda: farm.finished is not None, 400)
    assert farm.alarms == {"battery_low": Response.RETURN}
    assert farm.finished.code is MissionEnd.FAILSAFE
    assert math.dist(farm.place, (2.5, 2.5)) < 3
    assert "20%" in farm.control.command(Verb.START).message


@pytest.mark.parametrize("speed_mps", [0.05, 0.2])
def test_the_pause_of_a_creeping_robot_is_not_confirmed(farm, speed_mps):
    strays(farm, speed_mps)
    assert farm.control.command(Verb.PAUSE).accepted
    farm.pass_by(60)
    assert farm.status.phase is Phase.CANCELLING
    assert "it still moves" in farm.status.reason
    farm.stray = None
    farm.run(lambda: farm.status.phase is Phase.PAUSED, 20)


def test_a_paused_robot_that_moves_is_stopped_again_until_it_stands(farm):
    strays(farm, 0.0).control.command(Verb.PAUSE)
    farm.run(lambda: farm.status.phase is Phase.PAUSED, 30)
    assert farm.pass_by(60).alarms == {}
    before = farm.cancelled
    strays(farm, 0.4).run(lambda: "moving" in farm.alarms, 5)
    assert farm.cancelled == before + 1
    assert (farm.status.phase, farm.status.needs_operator) == (Phase.PAUSED, True)
    farm.pass_by(30)
    assert before + 3 <= farm.cancelled <= before + 4, "people may tow it"
    assert not farm.control.command(Verb.RESUME).accepted
    farm.stray = None
    farm.run(lambda: not farm.alarms, 60)
    assert farm.control.command(Verb.RESUME).accepted
    goes_on(farm)
