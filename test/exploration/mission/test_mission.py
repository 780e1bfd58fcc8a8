# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission, path by path: events in, actions out."""

import json
import math
from dataclasses import replace

import pytest
from mission_driver import EAST, HOME, NORTH, Driver, make_rules

from soilmoist_ros.exploration import Choice, Forecast, Stop, VisitEnd
from soilmoist_ros.exploration.mission.events import (
    Answer,
    CancelGoal,
    Command,
    Finish,
    GoalFailed,
    GoTo,
    Moved,
    PlanFailed,
    Planned,
    Publish,
    RequestPlan,
    StartCounting,
    Tick,
    VisitDone,
)
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import event_from_dict, event_to_dict
from soilmoist_ros.exploration.mission.types import Changes, MissionEnd, Phase, PlanKind, Verb
from soilmoist_ros.exploration.planning.dwell import Optimal, parse_dwell
from soilmoist_ros.foundation.errors import InputError

# The usual course


def test_a_mission_from_start_to_end():
    driver = Driver(home=HOME)
    driver.start()
    assert driver.kinds() == [RequestPlan, Answer, Publish]
    assert driver.last(RequestPlan) == RequestPlan(1, PlanKind.WARM_UP, (), 7200.0, 7200.0)
    assert driver.plan().kinds() == [GoTo, Publish]
    assert driver.last(GoTo).stop == EAST
    assert driver.reach().kinds() == [StartCounting, Publish]
    for _ in range(5):
        assert driver.record().kinds() == [Publish]
    assert driver.mission.status.progress == pytest.approx(5 / 6)
    assert driver.record().kinds() == [VisitDone, RequestPlan, Publish]
    visit = driver.last(VisitDone).visit
    assert (visit.name, visit.raw_counts, visit.exposure_s, visit.records) == ("east", 180, 60.0, 6)
    assert (visit.arrived_s, visit.arrival_stamp_s, visit.dwell_s) == (20.0, 1020.0, 60.0)
    assert visit.effective_exposure_s == pytest.approx(48.0)
    assert (visit.reason, visit.ended, visit.dwell) == ("it is the least known place", VisitEnd.ENOUGH, "fmi:60")
    assert driver.last(RequestPlan).kind is PlanKind.EXPLORE
    assert driver.plan(None, reason="all is known well").kinds() == [GoTo, Publish]
    assert driver.phase is Phase.RETURNING
    assert driver.mission.status.target == HOME
    assert driver.reach(after=30.0).kinds() == [Finish, Publish]
    assert driver.last(Finish).reason == (
        "nothing is left that is worth measuring or can be reached: all is known well; the robot is back home"
    )
    assert driver.last(Finish).code is MissionEnd.NOTHING_LEFT
    status = driver.mission.status
    assert (status.phase, status.samples, status.counting_s, status.distance_m) == (Phase.FINISHED, 1, 60.0, 60.0)
    assert status.estimated_end_s is None
    used_s = status.time_used_s
    assert driver.send(Tick, after=500.0).mission.status.time_used_s == used_s == 110.0


def test_the_dwell_of_a_stop_survives_a_restart():
    driver = Driver(dwell=parse_dwell("optimal"), warm_up_stops=0)
    driver.start().plan(dwell="ami:0.05").reach().record()
    snapshot = driver.mission.snapshot()
    restored = Mission.restore(driver.mission.rules, snapshot)
    assert restored.state.target.dwell == parse_dwell("ami:0.05")
    assert restored.status.planned_dwell_s == driver.mission.status.planned_dwell_s == pytest.approx(400 / 3)
    earlier = snapshot.replace("ami:0.05", "value:0.01,0.1,1e-05,1.25;1,2,3/300")
    assert Mission.restore(driver.mission.rules, earlier).status.planned_dwell_s == Optimal().interval_s
    event = Planned(1.0, 3, Choice(EAST, "why", (NORTH,), parse_dwell("ami:0.05")))
    assert event_from_dict(json.loads(json.dumps(event_to_dict(event)))) == event


# Records

NO_RECORDS = {
    "begun while driving": lambda driver: driver.counting().record(after=4.0),
    "begun while driving, with a tube missing": lambda driver: (
        driver.travelling().record(after=12.0).reach(after=2.0).record(after=8.0, exposure_s=7.5)
    ),
    "begun while driving, stamped ahead": lambda driver: driver.counting().record(after=2.0, stamp_s=5000.0),
    "elsewhere": lambda driver: driver.counting().record(place=(60.0, 0.0)),
    "nowhere": lambda driver: driver.counting().record(place=(math.nan, 0.0)),
    "without exposure": lambda driver: driver.counting().record(exposure_s=0.0),
    "of endless exposure": lambda driver: driver.counting().record(exposure_s=math.inf),
    "of negative counts": lambda driver: driver.counting().record(raw_counts=-1),
    "on the way": lambda driver: driver.travelling().record().reach(),
    "in a pause": lambda driver: driver.counting().command("pause").record().command("resume"),
}


@pytest.mark.parametrize("send", NO_RECORDS.values(), ids=NO_RECORDS)
def test_what_was_not_counted_wholly_at_the_stop_is_not_of_it(send):
    driver = Driver()
    send(driver)
    assert driver.mission.state.counting.records == 0
    assert driver.record(after=10.0).mission.state.counting.records == 1, "nor does it keep out those that follow"


def test_repeated_and_late_records_do_not_count():
    driver = Driver().counting().record()
    stamp_s = driver.now_s
    driver.record(after=0.0, stamp_s=stamp_s).record(after=10.0, stamp_s=stamp_s - 5.0)
    assert driver.mission.state.counting.records == 1


# Travel and its failures


def test_reached_is_believed_only_at_the_stop():
    driver = Driver().travelling().reach(NORTH)
    assert driver.phase is Phase.TRAVELLING
    assert driver.last(GoTo).goal_id == 2
    assert "reported as reached, but the robot is 42.4 m away" in driver.reason


def test_a_stop_that_fails_twice_is_ruled_out_for_a_while():
    driver = Driver(retries=1, blacklist_s=100.0).travelling().fail_goal()
    assert driver.kinds() == [GoTo, Publish]
    driver.fail_goal("no route")
    assert driver.last(RequestPlan).blacklisted == ("east",)
    assert driver.reason == "east is ruled out for now: no route; choosing warm-up stop 1 of 1"
    assert driver.plan(NORTH).mission.status.blacklisted == ("east",)
    driver.send(Moved, 1.0, 1.0, after=100.0)
    assert driver.mission.status.blacklisted == ()


def test_many_failures_in_a_row_ask_the_operator():
    driver = Driver(retries=9, failures_to_pause=3).travelling().fail_goal().fail_goal().fail_goal("wheel stuck")
    assert driver.phase is Phase.PAUSED
    assert driver.reason.startswith("3 failures since the last sample: east was not reached: wheel stuck; check")
    assert driver.mission.status.needs_operator
    driver.command("resume")
    assert not driver.mission.status.needs_operator
    assert driver.phase is Phase.TRAVELLING
    assert driver.mission.state.failures == 0


# Planning


def test_no_plan_is_asked_for_when_the_time_is_too_short_for_a_stop():
    driver = Driver(budget_s=130.0).counting()
    for _ in range(6):
        driver.record()
    assert driver.count_of(RequestPlan) == 1
    assert driver.reason == "east is done: 180 counts in 60 of 60 s; the time left is too short for another stop"


def test_a_stop_that_does_not_fit_ends_the_mission():
    driver = Driver(budget_s=200.0).start().plan(EAST, travel_s=150.0)
    assert driver.phase is Phase.FINISHED
    assert driver.reason == "no time for east: it needs 210 s and 200 s are left"
    unreachable = Driver().start().plan(EAST, travel_s=math.inf)
    assert unreachable.phase is Phase.FINISHED
    json.loads(unreachable.mission.snapshot())


def test_a_plan_that_comes_too_late_does_not_move_the_robot():
    driver = (
        Driver(home=HOME, budget_s=300.0, min_last_dwell_s=0.0, min_dwell_s=0.0)
        .send(Moved, 150.0, 0.0)
        .command("start")
    )
    driver.plan(Stop("near home", 2.0, 0.0), after=85.0)
    assert driver.last(GoTo).stop == HOME
    assert driver.count_of(CancelGoal) == 0


# Time


def test_home_is_tried_again_and_then_given_up_where_the_robot_is():
    driver = Driver(home=HOME).counting().record().command("skip").plan(None)
    assert driver.phase is Phase.RETURNING
    assert driver.fail_goal().kinds() == [GoTo, Publish]
    assert driver.fail_goal("gate shut").kinds() == [Finish, Publish]
    assert driver.last(Finish).reason.endswith("the robot did not get home: gate shut")


def test_there_is_no_way_home_for_a_robot_at_home():
    driver = Driver(home=HOME).start().plan(None)
    assert driver.count_of(GoTo) == 0
    assert driver.last(Finish).reason.endswith("the robot is home")


# Counting that does not go well


@pytest.mark.parametrize(
    ("end", "rules", "act"),
    [
        (VisitEnd.ENOUGH, {"dwell": parse_dwell("fmi:20")}, lambda driver: driver.record()),
        (VisitEnd.MAX_DWELL, {"dwell": parse_dwell("ami:3%", 20.0)}, lambda driver: driver.record()),
        (VisitEnd.MAX_DWELL, {"dwell": parse_dwell("ami:3%", 40.0)}, lambda driver: driver.send(Tick, after=30.0)),
        (VisitEnd.TIME_UP, {"budget_s": 400.0}, lambda driver: driver.send(Tick, after=400.0)),
        (VisitEnd.TIME_UP, {"home": HOME, "budget_s": 400.0},
         lambda driver: driver.command("pause").send(Tick, after=400.0)),
        (VisitEnd.MOVED, {}, lambda driver: driver.command("pause").send(Moved, 35.0, 0.0).command("resume")),
        (VisitEnd.SKIPPED, {}, lambda driver: driver.command("skip")),
        (VisitEnd.ABORTED, {}, lambda driver: driver.command("abort")),
    ],
)  # fmt: skip
def test_a_visit_has_a_code_for_its_end(end, rules, act):
    driver = Driver(**rules).counting().record()
    act(driver)
    assert driver.last(VisitDone).visit.ended is end
    assert driver.last(VisitDone).visit.outcome


# Operator


def test_a_mission_does_not_start_without_a_position():
    driver = Driver().command("start")
    assert driver.phase is Phase.IDLE
    assert not driver.answer.accepted
    assert "position is not known" in driver.answer.message


def test_pause_while_counting_keeps_what_was_counted():
    driver = Driver().counting().record().record().command("pause")
    assert driver.kinds() == [Answer, Publish]
    driver.record(after=300.0)
    driver.command("resume")
    assert driver.kinds() == [StartCounting, Answer, Publish]
    assert driver.record(after=4.0).mission.state.counting.records == 2, "begun in the pause"
    for _ in range(4):
        driver.record()
    visit = driver.last(VisitDone).visit
    assert (visit.raw_counts, visit.dwell_s) == (180, 20.0 + 44.0)


def test_skip_on_the_way_and_in_a_pause():
    driver = Driver().travelling().command("skip")
    assert driver.kinds() == [CancelGoal, Answer, Publish]
    assert not driver.command("skip").answer.accepted, "it is skipped already"
    assert driver.fail_goal().phase is Phase.PLANNING
    paused = Driver().travelling().command("pause").command("skip").fail_goal()
    assert paused.phase is Phase.PAUSED
    assert not paused.mission.status.needs_operator
    assert paused.command("resume").phase is Phase.PLANNING


def test_abort_on_the_way_waits_for_the_robot_to_stop():
    driver = Driver(home=HOME).travelling().command("abort")
    assert driver.kinds() == [CancelGoal, Answer, Publish]
    assert not driver.command("pause").answer.accepted
    assert driver.fail_goal().kinds() == [Finish, Publish]
    assert driver.phase is Phase.IDLE
    assert driver.last(Finish).code is MissionEnd.ABORTED


# Position, time, storage


def test_noise_of_the_position_is_not_distance():
    driver = Driver().start()
    for k in range(100):
        driver.send(Moved, 0.2 * (k % 2), 0.0, after=1.0)
    driver.send(Moved, math.nan, 5.0)
    assert driver.mission.status.distance_m == 0.0
    assert driver.send(Moved, 3.0, 4.0).mission.status.distance_m == 5.0
    assert driver.mission.state.position == (3.0, 4.0)


def test_time_does_not_run_backwards():
    driver = Driver().start()
    driver.mission.step(Tick(500.0))
    assert driver.mission.status.now_s == 1000.0
    with pytest.raises(ValueError, match="must be finite"):
        driver.mission.step(Tick(math.nan))


@pytest.mark.parametrize(
    ("name", "value"),
    [("budget_s", 0.0), ("speed_mps", -1.0), ("detour", 0.9), ("min_dwell_s", math.inf), ("retries", -1)],
)
def test_rules_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        make_rules(**{name: value})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not valid JSON"),
        ("[]", "this is not a mission state"),
        ('{"phase": "flying"}', "phase: .*'idle'"),
        ('{"altitude_m": 3}', "unknown altitude_m"),
        ('{"goal": {"goal_id": 1}}', "goal.stop"),
    ],
)
def test_what_is_not_a_snapshot_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        Mission.restore(make_rules(), text)


FORECAST = Forecast(0.03, (600.0, 3600.0), (0.028, 0.02), (1.1, 1.2), 0.028, 4.0)


def forecast(driver, *forecasts):
    """Plans with these forecasts, one after the other, each after a stop."""
    for one in forecasts:
        driver.reach() if driver.phase is Phase.TRAVELLING else None
        driver.record().command("skip").send(Tick, after=2.0).plan(NORTH, forecast=one)
    return driver


@pytest.mark.parametrize(
    ("rules", "made", "end"),
    [
        ({"until_sd": 0.03}, FORECAST, MissionEnd.GOOD_ENOUGH),
        ({"until_sd": 0.029}, FORECAST, None),
        ({"until_gain": 7.0}, FORECAST, MissionEnd.LITTLE_GAIN),
        ({"until_gain": 6.0}, FORECAST, None),
        ({"until_gain": 99.0}, replace(FORECAST, is_guess=True), None),
        ({}, replace(FORECAST, sd_soon=0.03), None),
        ({}, replace(FORECAST, wrong=0.009, outside=(0.4,)), MissionEnd.GOOD_ENOUGH),
        ({}, replace(FORECAST, wrong=0.02, wrong_end=0.019), None),
    ],
)
def test_a_mission_ends_when_the_map_is_good_enough_or_little_is_to_be_gained(rules, made, end):
    driver = forecast(Driver(home=HOME, blacklist_s=1.0, **rules).counting(), *[made] * 3)
    assert driver.mission.status.forecast == made
    assert driver.mission.status.ended is end
    assert Mission.restore(driver.mission.rules, driver.mission.snapshot()).state == driver.mission.state
    if end is None:
        assert driver.phase is Phase.TRAVELLING
        return
    assert driver.phase is Phase.RETURNING, "the robot goes home as with time up"
    driver.reach()
    assert driver.last(Finish).code is end


def test_one_good_forecast_may_be_chance():
    worse = replace(FORECAST, sd=0.031)
    driver = forecast(
        Driver(blacklist_s=1.0, until_sd=0.03).counting(), FORECAST, FORECAST, worse, FORECAST, FORECAST
    )
    assert driver.mission.status.ended is None
    assert forecast(driver, FORECAST).mission.status.ended is MissionEnd.GOOD_ENOUGH


# Commands in mid-mission ----------------------------------------------------------------------------------------


def ask(driver, verb, **values):
    return driver.send(Command, Verb(verb), who="eve", **values)


def finish_stop(driver):
    while driver.phase is Phase.COUNTING:
        driver.record()
    return driver


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


def test_an_area_is_ruled_out():
    driver = Driver().travelling(NORTH)
    area = ((-5.0, 25.0), (5.0, 25.0), (5.0, 35.0), (-5.0, 35.0))
    assert ask(driver, "rule_out", polygon=area).answer.accepted
    assert driver.phase is Phase.CANCELLING, "the target lies in it"
    driver.fail_goal()
    assert driver.last(RequestPlan).ruled_out == (area,)
    driver.plan(NORTH)
    assert "ruled out" in driver.reason
    assert not ask(driver, "measure", stop=NORTH).answer.accepted
    assert ask(driver, "lift", polygon=area).answer.accepted
    assert driver.mission.status.ruled_out == ()
    assert ask(driver, "measure", stop=NORTH).answer.accepted


def test_settings_change_while_it_runs():
    driver = Driver().counting()
    driver.record()
    changes = Changes(budget_s=9000.0, dwell="fmi:20", home=HOME, strategy="greedy")
    assert ask(driver, "change", changes=changes).answer.accepted
    status = driver.mission.status
    assert (status.time_left_s, status.changes.strategy) == (9000.0 - status.time_used_s, "greedy")
    driver.record()
    assert driver.phase is Phase.PLANNING, "the new dwell counts at this stop already"
    driver.plan(None)
    assert driver.last(GoTo).stop == HOME
    restored = type(driver.mission).restore(driver.mission.rules, driver.mission.snapshot())
    assert restored.status == driver.mission.status


@pytest.mark.parametrize("changes", [Changes(budget_s=1.0), Changes(budget_s=math.nan), Changes(dwell="often")])
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


# Deadlines ------------------------------------------------------------------------------------------------------


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
    assert driver.kinds() == [VisitDone, GoTo, Publish]
    assert driver.last(VisitDone).visit.raw_counts == 60
    assert driver.reason == "going home: the time left is needed for the way home"
    driver.reach(after=40.0)
    assert driver.phase is Phase.FINISHED
    assert driver.mission.status.time_used_s <= 200.0


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


def test_a_pause_uses_the_budget_but_never_drives_home_by_itself():
    driver = Driver(home=HOME, budget_s=400.0).counting().record().command("pause").send(Tick, after=400.0)
    assert driver.phase is Phase.PAUSED
    assert driver.kinds() == [VisitDone, Publish]
    assert driver.reason == "the mission time was used up in a pause: resume to go home, or abort"
    assert driver.mission.next_deadline_s is None
    assert driver.command("resume").phase is Phase.RETURNING
