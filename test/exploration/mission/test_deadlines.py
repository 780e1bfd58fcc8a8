# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a mission does without an event (deadlines.py)."""

from mission_driver import EAST, HOME, Driver

from soilmoist_ros.exploration.mission.events import (
    CancelGoal,
    Finish,
    GoalFailed,
    GoalReached,
    GoTo,
    Moved,
    PlanFailed,
    Publish,
    RequestPlan,
    Save,
    StopCounting,
    Tick,
    VisitDone,
)
from soilmoist_ros.exploration.mission.types import OnSilence, Phase
from soilmoist_ros.exploration.planning.dwell import parse_dwell


def test_a_goal_that_takes_too_long_is_cancelled_before_the_next():
    driver = Driver().travelling()
    assert driver.mission.next_deadline_s == driver.now_s + 3 * 40.0 + 60.0
    driver.send(Tick, after=179.0)
    assert driver.phase is Phase.TRAVELLING
    assert driver.send(Tick, after=1.0).kinds() == [CancelGoal, Publish]
    assert driver.phase is Phase.CANCELLING
    assert driver.fail_goal("cancelled").kinds() == [GoTo, Publish]
    assert driver.last(GoTo).goal_id == 2


def test_after_a_cancel_without_a_result_nothing_is_sent_before_the_end_is_known():
    driver = Driver(standstill_s=4.0).travelling().command("skip")
    for _ in range(4):
        assert CancelGoal in driver.send(Moved, 3.0, 0.0, after=30.0).kinds()
        assert driver.phase is Phase.CANCELLING
    assert "has not reported the end of the goal to east: asked 5 times to stop; cancel it there" in driver.reason
    assert driver.mission.status.needs_operator
    driver.send(Moved, 3.0, 0.0, after=1.0)
    assert driver.send(GoalFailed, 1, "cancelled").kinds() == [RequestPlan, Publish]


def test_a_mission_that_stays_does_not_wait_for_the_end_of_its_goal():
    driver = Driver().travelling().command("pause")
    assert driver.send(Tick, after=29.0).kinds() == []
    assert driver.send(Tick, after=1.0).phase is Phase.PAUSED
    assert "was not reported in 30 s" in driver.reason
    assert driver.send(GoalReached, 1, EAST.x_m, EAST.y_m).kinds() == []


def test_planning_that_fails_or_hangs_is_repeated_then_handed_to_the_operator():
    driver = Driver(failures_to_pause=3).start()
    driver.send(PlanFailed, 1, "no variogram")
    assert driver.last(RequestPlan).plan_id == 2
    assert driver.send(Tick, after=120.0).last(RequestPlan).plan_id == 3
    assert "no plan within 120 s" in driver.reason
    driver.send(PlanFailed, 3, "out of memory")
    assert driver.phase is Phase.PAUSED
    assert "out of memory" in driver.reason
    assert driver.command("resume").last(RequestPlan).plan_id == 4


def test_the_end_of_the_time_closes_the_sample_and_sends_the_robot_home():
    driver = Driver(
        home=HOME, budget_s=200.0, min_last_dwell_s=0.0, min_dwell_s=0.0, dwell=parse_dwell("fmi:600")
    ).counting()
    driver.record().record()
    assert driver.mission.next_deadline_s == 1000.0 + 200.0 - (10.0 + 30.0 + 60.0)
    driver.send(Tick, after=60.0)
    assert driver.kinds() == [StopCounting, VisitDone, GoTo, Publish]
    assert driver.last(VisitDone).visit.raw_counts == 60
    assert driver.reason == "going home: the time left is needed for the way home"
    driver.reach(after=40.0)
    assert driver.phase is Phase.FINISHED
    assert driver.mission.status.time_used_s <= 200.0


def test_a_record_that_arrives_as_the_time_ends_still_counts():
    driver = Driver(budget_s=100.0, min_last_dwell_s=0.0, min_dwell_s=0.0, dwell=parse_dwell("fmi:600")).counting()
    driver.record(after=80.0)
    assert driver.last(VisitDone).visit.raw_counts == 30
    assert driver.phase is Phase.FINISHED
    assert driver.reason == "the mission time is used up"


def test_the_end_of_the_time_on_the_way_cancels():
    driver = Driver(budget_s=110.0).travelling().send(Tick, after=110.0)
    assert driver.kinds() == [CancelGoal, Publish]
    assert driver.phase is Phase.CANCELLING
    assert driver.fail_goal().kinds() == [Save, Finish, Publish]


def test_a_robot_that_strays_from_home_leaves_earlier():
    driver = Driver(home=HOME, budget_s=500.0).travelling()
    assert driver.send(Moved, 300.0, 0.0, after=100.0).phase is Phase.TRAVELLING
    assert driver.send(Moved, 331.0, 0.0).phase is Phase.CANCELLING


def test_a_dead_sensor_ends_with_the_longest_dwell_and_rules_the_stop_out():
    driver = Driver(dwell=parse_dwell("ami:3%", longest_s=50.0)).counting()
    for _ in range(4):
        driver.send(Tick, after=10.0)
    assert driver.phase is Phase.COUNTING
    driver.send(Tick, after=10.0)
    assert driver.count_of(VisitDone) == 0
    assert driver.last(RequestPlan).blacklisted == ("east",)
    assert "nothing was counted at east" in driver.reason


def test_silence_is_reported_and_waited_out_until_the_longest_dwell():
    driver = Driver(dwell=parse_dwell("ami:3%", longest_s=300.0)).counting().record()
    assert driver.send(Tick, after=59.0).kinds() == []
    assert driver.send(Tick, after=1.0).kinds() == [Publish]
    assert "no record from this stop for 60 s" in driver.reason
    assert driver.mission.status.silent
    assert driver.send(Tick, after=1.0).kinds() == [], "it is said once"
    assert driver.record().reason == "counting at east (ami:0.03)"
    assert not driver.mission.status.silent
    driver.send(Tick, after=60.0)
    assert driver.mission.next_deadline_s == 1020.0 + 300.0
    driver.now_s = 1320.0
    driver.send(Tick)
    assert driver.last(VisitDone).visit.outcome == "the longest dwell of 300 s is over"


def test_a_pause_does_not_shorten_or_lengthen_the_longest_dwell():
    driver = Driver(dwell=parse_dwell("ami:3%", longest_s=50.0)).counting().record().record()
    driver.command("pause").send(Tick, after=1000.0).command("resume")
    assert driver.mission.next_deadline_s == driver.now_s + 30.0


def test_several_things_that_are_due_after_a_gap_are_all_done():
    driver = Driver(budget_s=400.0).counting().record().send(Tick, after=5000.0)
    assert driver.phase is Phase.FINISHED
    assert driver.last(VisitDone).visit.raw_counts == 30


def test_silence_can_pause_or_abort():
    driver = Driver(on_silence=OnSilence.PAUSE).counting().send(Tick, after=60.0)
    assert driver.phase is Phase.PAUSED
    assert driver.command("resume").phase is Phase.COUNTING
    assert driver.mission.next_deadline_s == driver.now_s + 60.0
    driver = Driver(on_silence=OnSilence.ABORT).counting().send(Tick, after=60.0)
    assert driver.phase is Phase.IDLE
    assert driver.last(Finish).aborted


def test_a_pause_uses_the_budget_but_never_drives_home_by_itself():
    driver = Driver(home=HOME, budget_s=400.0).counting().record().command("pause").send(Tick, after=400.0)
    assert driver.phase is Phase.PAUSED
    assert driver.kinds() == [VisitDone, Publish]
    assert driver.reason == "the mission time was used up in a pause: resume to go home, or abort"
    assert driver.mission.next_deadline_s is None
    assert driver.command("resume").phase is Phase.RETURNING


def test_without_a_way_home_the_mission_ends_in_the_pause():
    driver = Driver(budget_s=400.0).counting().record().command("pause").send(Tick, after=400.0)
    assert driver.phase is Phase.FINISHED
    assert driver.last(VisitDone).visit.raw_counts == 30
