# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How a mission stops: standstill, waits after failures, alarms, emergency stop (moves.py, dangers.py)."""

import pytest
from mission_driver import EAST, HOME, Driver

from soilmoist_ros.exploration import Alarm, MissionEnd, Phase, Response, Stop, VisitEnd, parse_dwell
from soilmoist_ros.exploration.mission.events import (
    ANYBODYS,
    AlarmOver,
    CancelGoal,
    EmergencyStop,
    Finish,
    GoalFailed,
    GoalReached,
    GoTo,
    Moved,
    RequestPlan,
    Tick,
    VisitDone,
)


def seen_at(driver, *places, every_s=2.0):
    for place in places:
        driver.send(Moved, *place, after=every_s)
    return driver


# Standstill


def test_what_follows_waits_until_the_robot_stands():
    driver = Driver(standstill_s=4.0).travelling().command("pause")
    assert driver.last(CancelGoal).goal_id == 1
    driver.send(GoalFailed, 1, "cancelled")
    assert driver.phase is Phase.CANCELLING, "the end of the goal does not prove that the robot stands"
    seen_at(driver, (5.0, 0.0), (8.0, 0.0), (9.0, 0.0))
    assert driver.phase is Phase.CANCELLING
    seen_at(driver, (9.1, 0.0), (9.0, 0.1), (9.1, 0.0))
    assert driver.phase is Phase.PAUSED


def test_a_robot_that_does_not_stop_is_asked_again_and_it_is_said():
    driver = Driver(standstill_s=4.0, cancel_limit_s=10.0).travelling().command("abort")
    for number in range(2, 5):
        seen_at(driver, *((10.0 * number + step, 0.0) for step in range(0, 10, 2)))
        assert driver.count_of(CancelGoal) == number
        assert driver.phase is Phase.CANCELLING
        assert f"asked {number} times to stop" in driver.reason
        assert driver.mission.status.needs_operator
        assert "it still moves" in driver.reason
    assert driver.count_of(Finish) == 0
    driver.send(GoalFailed, 1, "cancelled")
    seen_at(driver, *[(50.0, 0.0)] * 4)
    assert driver.phase is Phase.IDLE


def test_without_places_nobody_knows_whether_the_robot_stands():
    driver = Driver(standstill_s=4.0, cancel_limit_s=10.0).travelling().command("pause")
    driver.send(GoalFailed, 1, "cancelled").send(Tick, after=100.0)
    assert driver.phase is Phase.CANCELLING
    assert "its place is not known" in driver.reason


def test_a_dead_navigation_and_a_robot_that_stands():
    driver = Driver(standstill_s=4.0, cancel_limit_s=10.0).travelling().command("pause")
    seen_at(driver, *[(3.0, 0.0)] * 4)
    assert driver.phase is Phase.CANCELLING, "the navigation may still send it on"
    driver.send(Tick, after=2.0)
    assert driver.phase is Phase.PAUSED
    assert "was not reported" in driver.reason


def test_the_noise_of_the_fixes_decides_whether_the_robot_stands_and_what_it_hides_is_said():
    driver = Driver(standstill_s=4.0).travelling().command("pause").send(GoalFailed, 1, "cancelled")
    for _ in range(5):
        driver.send(Moved, 5.0, 0.0, 0.0, after=2.0)
    assert driver.phase is Phase.CANCELLING, "it creeps"
    driver.send(Moved, 5.3, 0.0, 16.0, 0.47, after=2.0)
    assert driver.phase is Phase.PAUSED
    assert "a motion below 0.5 m/s would not show in the noise" in driver.reason


def test_a_robot_that_moves_without_a_goal_is_stopped_again_with_each_alarm():
    driver = Driver(standstill_s=4.0).counting().record()
    for number in range(1, 4):
        driver.send(Alarm, "moving", Response.PAUSE, "the robot moves without a goal", after=10.0)
        assert (driver.phase, driver.count_of(CancelGoal)) == (Phase.PAUSED, number)
        assert driver.last(CancelGoal).goal_id == ANYBODYS
    driver.send(Alarm, "moving", Response.WARN, "the robot moves without a goal")
    assert driver.count_of(CancelGoal) == 3


def test_an_abort_does_not_say_that_a_robot_stands_that_was_seen_moving():
    driver = Driver(standstill_s=4.0)
    seen_at(driver, (0.0, 0.0), (0.3, 0.0), (0.6, 0.0), (0.9, 0.0)).command("abort")
    assert "waiting for start" not in driver.answer.message
    seen_at(driver, *[(1.0, 0.0)] * 4).command("abort")
    assert "waiting for start" in driver.answer.message


def test_a_goal_that_another_client_has_replaced_is_no_failure():
    driver = Driver(retries=0).travelling().send(GoalFailed, 1, "another client drives the robot", superseded=True)
    assert (driver.phase, driver.mission.state.failures, driver.count_of(GoTo)) == (Phase.PAUSED, 0, 1)
    assert "wait until the other goal is over, then resume or abort" in driver.reason
    assert driver.mission.status.needs_operator
    assert driver.command("resume").last(GoTo).stop == EAST


def test_a_goal_that_the_watchdog_has_cancelled_is_a_stop_until_the_robot_stands():
    driver = Driver(standstill_s=4.0).travelling()
    seen_at(driver, (1.0, 0.0), (2.0, 0.0))
    driver.send(GoalFailed, 1, "the watchdog or another client has cancelled the goal", stopped=True)
    assert (driver.phase, driver.count_of(CancelGoal)) == (Phase.CANCELLING, 0)
    assert "waiting for the robot to stop" in driver.reason
    driver.send(Alarm, "watchdog", Response.PAUSE, "the planner is silent: 1.2 s")
    seen_at(driver, (3.0, 0.0), (4.0, 0.0))
    assert driver.phase is Phase.CANCELLING
    assert "the planner is silent" in driver.reason
    seen_at(driver, *[(4.5, 0.0)] * 7)
    assert (driver.phase, driver.mission.state.failures, driver.count_of(GoTo)) == (Phase.PAUSED, 0, 1)
    assert driver.mission.status.needs_operator


# Moved while counting


def test_a_robot_that_is_moved_while_it_counts_ends_its_visit_and_waits_for_people():
    driver = Driver().counting().record().record()
    seen_at(driver, (34.0, 0.0), (30.0, 0.0), (34.0, 0.0), (34.0, 0.5))
    assert driver.phase is Phase.COUNTING, "two fixes may be bad"
    seen_at(driver, (34.5, 1.0))
    assert driver.phase is Phase.PAUSED
    visit = driver.last(VisitDone).visit
    assert (visit.ended, visit.records, visit.x_m) == (VisitEnd.MOVED, 2, 30.0)
    assert driver.reason.startswith(
        "the robot was moved by 4.6 m while it counted at east, and not by the planner"
    )
    assert driver.mission.status.needs_operator
    assert driver.command("resume").phase is Phase.PLANNING


@pytest.mark.parametrize(("sd_m", "away_m", "moved"), [(0.02, 3.5, True), (1.5, 9.0, False), (1.5, 9.5, True)])
def test_what_the_noise_of_the_fixes_explains_is_no_move(sd_m, away_m, moved):
    driver = Driver().travelling().send(Moved, 29.0, 0.0, sd_m=sd_m).reach()
    for _ in range(4):
        driver.send(Moved, 30.0, away_m, sd_m=sd_m, after=1.0)
    assert (driver.phase is Phase.PAUSED) is moved


def test_a_robot_that_is_moved_while_the_next_stop_is_chosen_has_its_whole_visit():
    driver = Driver(stays=True, dwell=parse_dwell("fmi:20")).counting().record().record()
    assert driver.phase is Phase.PLANNING
    seen_at(driver, *[(38.0, 0.0)] * 3)
    assert driver.phase is Phase.PAUSED
    assert driver.last(VisitDone).visit.ended is VisitEnd.ENOUGH
    assert driver.plan(EAST).count_of(GoTo) == 1, "a plan that comes late moves nothing"


NEAR = Stop("near", 30.0, 0.0, reach_m=0.5)


@pytest.mark.parametrize(("at_m", "sd_m", "there"), [(1.0, 0.02, False), (0.4, 0.02, True), (1.0, 0.4, True)])
def test_a_stop_with_near_neighbours_is_reached_by_driving(at_m, sd_m, there):
    driver = Driver().travelling(NEAR).send(Moved, 30.0, at_m, sd_m=sd_m)
    driver.send(GoalReached, 1, 30.0, at_m)
    assert (driver.phase is Phase.COUNTING) is there
    if there:
        driver.record(place=(30.0, at_m)).record(place=(30.0, at_m + 2.0))
        assert driver.mission.state.counting.records == 1, "what was counted at the neighbour is none of this stop"


def test_records_at_an_antenna_count_for_the_stop_at_which_the_base_stands():
    for antenna_m, records in ((1.6, 1), (0.0, 0)):
        driver = Driver(antenna_m=antenna_m).counting(NEAR).record(place=(31.6, 0.0))
        assert driver.mission.state.counting.records == records


# Waits after failures


def test_waits_double_with_each_failure_in_a_row():
    driver = Driver(backoff_s=2.0, backoff_limit_s=6.0, failures_to_pause=5, retries=9).travelling()
    waits_s = []
    for _ in range(4):
        driver.fail_goal()
        assert driver.phase is Phase.WAITING
        assert "trying again in" in driver.reason
        waits_s.append(driver.mission.next_deadline_s - driver.now_s)
        goals = driver.count_of(GoTo)
        driver.send(Tick, after=waits_s[-1] - 0.1)
        assert driver.count_of(GoTo) == goals
        driver.send(Tick, after=0.1)
        assert driver.count_of(GoTo) == goals + 1
    assert waits_s == [2.0, 4.0, 6.0, 6.0]
    driver.fail_goal()
    assert driver.phase is Phase.PAUSED
    assert driver.mission.status.needs_operator


# Dangers


def danger(response, cause="place", reason="the robot is 12 m outside the field"):
    return Alarm, cause, response, reason


PHASES = {
    Phase.PLANNING: lambda driver: driver.start(),
    Phase.TRAVELLING: lambda driver: driver.travelling(),
    Phase.COUNTING: lambda driver: driver.counting().record(),
    Phase.WAITING: lambda driver: driver.travelling().fail_goal(),
    Phase.RETURNING: lambda driver: driver.counting().record().plan_home(),
}


class Careful(Driver):
    def plan_home(self):
        self.record(raw_counts=30)
        for _ in range(4):
            self.record()
        return self.plan(None)

    def settle(self):
        """The navigation reports the end of the goal, if one is cancelled."""
        goal = self.mission.state.goal if self.phase is Phase.CANCELLING else None
        return self.send(GoalFailed, goal.goal_id, "cancelled") if goal else self


def in_phase(phase):
    driver = PHASES[phase](Careful(home=HOME, backoff_s=30.0))
    assert driver.phase is phase
    return driver


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("response", [Response.PAUSE, Response.HOLD])
def test_a_danger_stops_the_robot_in_every_phase(phase, response):
    driver = in_phase(phase)
    goals = driver.count_of(GoTo)
    driver.send(*danger(response)).settle()
    assert driver.phase is Phase.PAUSED
    assert "12 m outside" in driver.reason
    assert driver.mission.status.needs_operator == (response is Response.PAUSE)
    assert not driver.command("resume").answer.accepted, "not while it lasts"
    assert "12 m outside" in driver.answer.message
    driver.send(AlarmOver, "place", after=5.0)
    assert (driver.phase is Phase.PAUSED) == (response is Response.PAUSE)
    if response is Response.PAUSE:
        assert driver.count_of(GoTo) == goals
        assert driver.command("resume").answer.accepted
    expected = {Phase.WAITING: Phase.TRAVELLING}.get(phase, phase)
    assert driver.phase is expected


@pytest.mark.parametrize("phase", PHASES)
def test_a_danger_sends_the_robot_home(phase):
    driver = in_phase(phase)
    driver.send(*danger(Response.RETURN, reason="the battery is at 14 %")).settle()
    assert driver.phase is Phase.RETURNING or driver.mission.state.phase is Phase.FINISHED
    if phase not in (Phase.RETURNING,):
        assert driver.mission.state.ended is MissionEnd.FAILSAFE
    if phase is Phase.COUNTING:
        assert driver.last(VisitDone).visit.ended is VisitEnd.FAILSAFE


@pytest.mark.parametrize("phase", PHASES)
def test_a_danger_ends_the_mission_where_it_is(phase):
    driver = in_phase(phase)
    driver.send(*danger(Response.ABORT)).settle()
    assert driver.phase is Phase.IDLE
    assert driver.last(Finish).code is MissionEnd.FAILSAFE
    assert not driver.command("start").answer.accepted


def test_a_paused_robot_is_not_sent_home_but_goes_there_when_it_is_resumed():
    driver = Driver(home=HOME).counting().command("pause")
    driver.send(*danger(Response.RETURN, reason="the battery is at 14 %"))
    assert driver.phase is Phase.PAUSED
    assert driver.command("resume").phase is Phase.RETURNING
    assert "14 %" in driver.reason


def test_an_operator_takes_a_hold_over():
    driver = Driver().counting().send(*danger(Response.HOLD))
    driver.command("pause").send(AlarmOver, "place")
    assert driver.phase is Phase.PAUSED


def test_two_dangers_hold_until_both_are_over():
    driver = Driver().counting().send(*danger(Response.HOLD)).send(*danger(Response.HOLD, cause="fix"))
    assert driver.send(AlarmOver, "place").phase is Phase.PAUSED
    assert driver.send(AlarmOver, "fix").phase is Phase.COUNTING


# Emergency stop


@pytest.mark.parametrize("phase", PHASES)
def test_an_emergency_stop_holds_until_an_operator_resumes(phase):
    driver = in_phase(phase)
    goals = driver.count_of(GoTo)
    driver.send(EmergencyStop, True, "button").settle()
    stops = [action.goal_id for action in driver.all_actions if isinstance(action, CancelGoal)]
    assert ANYBODYS in stops, "whatever the navigation is doing for whomever, it is asked to stop"
    assert driver.phase is Phase.PAUSED
    assert driver.mission.status.emergency
    assert not driver.command("resume").answer.accepted
    assert "button" in driver.answer.message
    driver.send(EmergencyStop, False, "button").send(Tick, after=600.0)
    assert driver.phase is Phase.PAUSED, "a release moves nothing"
    assert "stop is released; resume" in driver.reason
    assert driver.count_of(GoTo) == goals
    assert driver.command("resume").answer.accepted


def test_every_emergency_stop_must_be_released():
    driver = Driver().counting().send(EmergencyStop, True, "left").send(EmergencyStop, True, "right")
    driver.send(EmergencyStop, False, "left").command("resume")
    assert not driver.answer.accepted
    assert driver.send(EmergencyStop, False, "right").command("resume").answer.accepted


@pytest.mark.parametrize("missions", [0, 1])
def test_without_a_mission_a_stop_and_an_abort_stop_whatever_drives_the_robot(missions):
    driver = Driver().send(Moved, 0.0, 0.0)
    for _ in range(missions):
        driver.command("start").plan(EAST).command("abort").send(GoalFailed, 1, "cancelled")
    before = driver.count_of(CancelGoal)
    driver.send(EmergencyStop, True, "button")
    assert (driver.count_of(CancelGoal), driver.last(CancelGoal).goal_id) == (before + 1, ANYBODYS)
    driver.command("abort")
    assert (driver.count_of(CancelGoal), driver.answer.accepted) == (before + 2, True)
    assert driver.phase is Phase.IDLE


def test_a_hold_does_not_end_an_emergency_stop():
    driver = Driver().counting().send(*danger(Response.HOLD)).send(EmergencyStop, True, "button")
    driver.send(EmergencyStop, False, "button").send(AlarmOver, "place")
    assert driver.phase is Phase.PAUSED


def test_the_next_plan_comes_only_after_the_release():
    driver = Driver().start().send(EmergencyStop, True, "button")
    plans = driver.count_of(RequestPlan)
    driver.plan(EAST)
    assert (driver.phase, driver.count_of(GoTo)) == (Phase.PAUSED, 0), "a late plan moves nothing"
    driver.send(EmergencyStop, False, "button").command("resume")
    assert driver.count_of(RequestPlan) == plans + 1
