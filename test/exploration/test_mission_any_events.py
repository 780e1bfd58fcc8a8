# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What holds whatever happens in whatever order: hypothesis plays operator, planner, navigation and sensor."""

import json
import math
from dataclasses import replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from soilmoist_ros.exploration import Alarm, Changes, Choice, MissionRules, Phase, Response, Stop, Verb
from soilmoist_ros.exploration.mission.events import (
    ANYBODYS,
    STILL_M,
    AlarmOver,
    Answer,
    CancelGoal,
    ClockStepped,
    Command,
    EmergencyStop,
    Finish,
    GoalFailed,
    GoalReached,
    GoTo,
    Moved,
    PlanFailed,
    Planned,
    Publish,
    RecordArrived,
    RequestPlan,
    StartCounting,
    Tick,
    VisitDone,
)
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import Todo, event_from_dict, event_to_dict
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.sensing.records import CountRecord

STOPS = [Stop("a", 10.0, 0.0), Stop("b", 0.0, 20.0), Stop("far", 400.0, 0.0)]
STILL = (Phase.PAUSED, Phase.IDLE, Phase.FINISHED)
PLACES = [(0.0, 0.0), (10.0, 0.0), (11.0, 1.0), (0.0, 20.0), (200.0, 0.0), (math.nan, 0.0)]
WAITS = st.sampled_from([0.0, 1.0, 10.0, 31.0, 61.0, 400.0])
STALE = st.sampled_from([0, 0, -1, 1])
"""What is added to the current id."""


class AnyEvents(RuleBasedStateMachine):
    @initialize(
        home=st.sampled_from([None, Stop("home", 0.0, 0.0), Stop("corner", 60.0, 0.0)]),
        dwell=st.sampled_from(["fmi:20", "ami:0.2", "ami:0.1"]),
        budget_s=st.sampled_from([400.0, 2000.0, 20000.0]),
        failures_to_pause=st.sampled_from([1, 2, 5]),
        standstill_s=st.sampled_from([0.0, 4.0]),
        backoff_s=st.sampled_from([0.0, 2.0]),
        stays=st.booleans(),
    )
    def begin(self, home, dwell, **changes):
        rule_of_dwell = parse_dwell(dwell, longest_s=300.0)
        self.rules = MissionRules(dwell=rule_of_dwell, home=home, min_dwell_s=5.0, blacklist_s=50.0, **changes)
        self.mission = Mission(self.rules)
        self.now_s = 0.0
        self.history = []
        self.open_goal = None  # (id, when it was cancelled last)
        self.places = []
        self.locked = False  # from an emergency stop to the next command of an operator that moves the robot
        self.take(Moved(self.now_s, 0.0, 0.0))
        self.take(Command(self.now_s, Verb.START))

    def take(self, event):
        """Let an event happen, to the mission and to one restored from its snapshot; check what both do."""
        before = self.mission.state
        restored = Mission.restore(self.rules, self.mission.snapshot())
        assert repr(restored.state) == repr(before)  # a travel time that is not known is not equal to itself
        actions = self.mission.step(event)
        self.watch(event, actions)
        written = json.dumps(event_to_dict(event), allow_nan=False)
        assert repr(restored.step(event_from_dict(json.loads(written)))) == repr(actions)
        assert repr(restored.state) == repr(self.mission.state)
        self.history.append((event, self.mission.state, actions))
        if isinstance(event, GoalReached | GoalFailed) and self.open_goal and self.open_goal[0] == event.goal_id:
            self.open_goal = None
        for action in actions:
            self.check_action(action, before)
        if self.mission.state.phase in STILL and self.no_goal_moves_the_robot():
            self.open_goal = None  # what moves a robot that stood without a mission is no goal
        self.check_progress(before)

    def watch(self, event, actions):
        """Follow where the robot was seen, and whether an operator has released it."""
        after = self.mission.state
        if isinstance(event, Moved | GoalReached) and math.isfinite(event.x_m):
            self.places.append((after.now_s, (event.x_m, event.y_m)))
        accepted = any(isinstance(action, Answer) and action.accepted for action in actions)
        if isinstance(event, EmergencyStop) and event.active:
            self.locked = True
        if isinstance(event, Command) and event.verb in (Verb.START, Verb.RESUME, Verb.RETURN) and accepted:
            assert not after.emergency
            self.locked = False

    def check_action(self, action, before):
        match action:
            case GoTo(goal_id=goal_id):
                assert self.open_goal is None, "two goals at once"
                assert not self.locked, "it moves after an emergency stop"
                assert not any(alarm.response.stops for alarm in self.mission.state.alarms)
                self.open_goal = (goal_id, None)
            case CancelGoal(goal_id=goal_id):
                asked_s = self.open_goal[1] if self.open_goal and self.open_goal[0] == goal_id else -math.inf
                late = self.now_s >= (asked_s or 0.0) + self.rules.cancel_limit_s
                urgent = isinstance(self.history[-1][0], EmergencyStop)
                anybodys = goal_id == ANYBODYS
                again = late or urgent or anybodys
                assert self.open_goal == (goal_id, None) or again, "cancelled twice, or what is not open"
                if self.open_goal == (goal_id, None) or (self.open_goal and late and not urgent):
                    self.open_goal = (goal_id, self.now_s)
            case VisitDone(visit=visit):
                assert visit.records > 0
                assert before.counting is not None or self.rules.dwell.enough(visit.raw_counts, visit.exposure_s)
            case Finish(reason=reason):
                assert self.no_goal_moves_the_robot(), "a goal outlives the mission"
                assert reason
            case Publish():
                assert self.mission.state.reason

    def no_goal_moves_the_robot(self):
        if self.open_goal is None:
            return True
        cancelled_s = self.open_goal[1]
        if cancelled_s is None:
            return False
        if self.rules.standstill_s == 0:
            return self.now_s >= cancelled_s + self.rules.cancel_limit_s
        return self.seen_standing(cancelled_s)

    def seen_standing(self, cancelled_s):
        """Whether the last places are close to each other, and one of them is newer than a cancellation."""
        if not self.places or self.places[-1][0] < cancelled_s:
            return False
        last_s, last = self.places[-1]
        first_s = max(
            (time_s for time_s, _ in self.places if time_s <= last_s - self.rules.standstill_s), default=None
        )
        near_m = 2 * STILL_M
        return first_s is not None and all(
            math.dist(place, last) <= near_m for time_s, place in self.places if time_s >= first_s
        )

    def check_progress(self, before):
        after = self.mission.state
        if before.started_s == after.started_s and before.plans <= after.plans and not self.restarted(before):
            assert after.time_used_s >= before.time_used_s
            assert after.distance_m >= before.distance_m
            assert after.samples >= before.samples
            assert after.counting_s >= before.counting_s
            assert after.raw_counts >= before.raw_counts
        counts = before.phase is Phase.COUNTING or (self.rules.stays and before.phase is Phase.PLANNING)
        if not counts and before.counting and after.counting:
            assert after.counting.records == before.counting.records, "counted outside COUNTING"

    def restarted(self, before):
        return before.ended_s is not None and self.mission.state.ended_s is None

    # What may happen

    @rule(steps=st.integers(1, 12), stop=st.sampled_from(STOPS[:2]), wait_s=st.sampled_from([0.0, 3.0, 15.0]))
    def all_goes_well(self, steps, stop, wait_s):
        """What is expected happens, as often as it takes to get anywhere."""
        for _ in range(steps):
            self.now_s += wait_s
            state = self.mission.state
            x_m, y_m = state.position
            match state.phase:
                case Phase.PLANNING:
                    self.take(Planned(self.now_s, state.plans, Choice(stop, "why")))
                case Phase.TRAVELLING | Phase.RETURNING:
                    goal = state.goal
                    self.take(GoalReached(self.now_s, goal.goal_id, goal.stop.x_m, goal.stop.y_m))
                case Phase.CANCELLING:
                    self.take(GoalFailed(self.now_s, state.goals, "cancelled"))
                    self.stand()
                case Phase.WAITING:
                    self.now_s = state.wait_until_s
                    self.take(Tick(self.now_s))
                case Phase.COUNTING:
                    self.now_s += 10.0
                    record = CountRecord(self.now_s, x_m, y_m, 0.0, 15, 10.0, 8.0)
                    self.take(RecordArrived(self.now_s, record))
                case Phase.PAUSED:
                    self.take(Command(self.now_s, Verb.RESUME))
                case Phase.IDLE | Phase.FINISHED:
                    self.take(Command(self.now_s, Verb.START))

    def stand(self):
        for wait_s in (0.0, 2.0, 2.0, 2.0):
            self.now_s += wait_s
            self.take(Moved(self.now_s, *self.mission.state.position))

    @rule()
    def robot_stands(self):
        self.stand()

    @rule(still_s=st.sampled_from([0.0, 4.0, 30.0]), unseen_mps=st.sampled_from([0.0, 0.3]))
    def noise_is_judged(self, still_s, unseen_mps):
        """The estimate of the motion decides; a robot that stands is where it was."""
        if still_s and len({place for _, place in self.places[-4:]}) > 1:
            return
        if still_s:
            self.stand()
        self.take(Moved(self.now_s, *self.mission.state.position, still_s, unseen_mps))

    @rule(cause=st.sampled_from("ab"), response=st.sampled_from(list(Response)))
    def guard_warns(self, cause, response):
        self.take(Alarm(self.now_s, cause, response, f"{cause} is wrong"))

    @rule(cause=st.sampled_from("ab"))
    def guard_is_content(self, cause):
        self.take(AlarmOver(self.now_s, cause))

    @rule(active=st.booleans())
    def emergency_stop_is_pressed_or_released(self, active):
        self.take(EmergencyStop(self.now_s, active, "button"))

    @rule(step_s=st.sampled_from([-3600.0, 21600.0]))
    def clock_is_set(self, step_s):
        before = self.mission.status
        self.take(ClockStepped(self.now_s, step_s))
        after = self.mission.status
        assert (after.phase, after.time_used_s) == (before.phase, before.time_used_s)

    @rule(
        command=st.sampled_from(
            [
                {"verb": Verb.MEASURE, "stop": STOPS[0], "dwell_s": 20.0},
                {"verb": Verb.MEASURE, "stop": STOPS[2]},
                {"verb": Verb.RULE_OUT, "polygon": ((-5.0, 15.0), (5.0, 15.0), (5.0, 25.0))},
                {"verb": Verb.ORDER, "stops": ("far", "a")},
                {"verb": Verb.ORDER},
                {"verb": Verb.CHANGE, "changes": Changes(budget_s=30000.0, dwell="fmi:30")},
                {"verb": Verb.CHANGE, "changes": Changes(home=STOPS[1])},
                {"verb": Verb.CHANGE, "changes": Changes(dwell="nonsense")},
                {"verb": Verb.RETURN},
            ]
        )
    )
    def operator_steers(self, command):
        before = self.mission.state
        self.take(Command(self.now_s, who="eve", **command))
        answer = next(action for action in self.history[-1][2] if isinstance(action, Answer))
        if not answer.accepted:
            assert replace(self.mission.state, now_s=before.now_s) == before, "what is refused changes nothing"

    @rule(wait_s=WAITS)
    def time_passes(self, wait_s):
        self.now_s += wait_s
        self.take(Tick(self.now_s))

    @precondition(lambda self: self.mission.next_deadline_s is not None)
    @rule()
    def deadline_comes(self):
        deadline_s, state = self.mission.next_deadline_s, self.mission.state
        between_s = (self.now_s + deadline_s) / 2
        tried = Mission(self.rules, state)
        assert (tried.step(Tick(between_s)), tried.state) == ((), replace(state, now_s=between_s))
        self.now_s = deadline_s
        self.take(Tick(self.now_s))
        assert replace(self.mission.state, now_s=state.now_s) != state

    @rule(verb=st.sampled_from([Verb.START, Verb.PAUSE, Verb.RESUME, Verb.SKIP]))
    def operator_asks(self, verb):
        self.take(Command(self.now_s, verb))

    @precondition(lambda self: len(self.history) % 8 == 7)
    @rule()
    def operator_aborts(self):
        self.take(Command(self.now_s, Verb.ABORT))

    @rule(
        wait_s=WAITS,
        stale=STALE,
        stop=st.sampled_from([*STOPS, None]),
        travel_s=st.sampled_from([None, 10.0, math.inf, math.nan]),
    )
    def planner_answers(self, wait_s, stale, stop, travel_s):
        self.now_s += wait_s
        choice = Choice(stop, "why") if stop else None
        self.take(Planned(self.now_s, self.mission.state.plans + stale, choice, travel_s))

    @rule(stale=STALE)
    def planner_breaks(self, stale):
        self.take(PlanFailed(self.now_s, self.mission.state.plans + stale, "broken"))

    @rule(wait_s=WAITS, stale=STALE)
    def navigation_arrives(self, wait_s, stale):
        self.now_s += wait_s
        goal = self.mission.state.goal
        x_m, y_m = (goal.stop.x_m, goal.stop.y_m + 0.5) if goal else (1.0, 1.0)
        self.take(GoalReached(self.now_s, self.mission.state.goals + stale, x_m, y_m))

    @rule(stale=STALE, place=st.sampled_from(PLACES))
    def navigation_claims_to_have_arrived(self, stale, place):
        self.take(GoalReached(self.now_s, self.mission.state.goals + stale, *place))

    @rule(wait_s=WAITS, stale=STALE)
    def navigation_gives_up(self, wait_s, stale):
        self.now_s += wait_s
        self.take(GoalFailed(self.now_s, self.mission.state.goals + stale, "blocked"))

    @rule(number=st.integers(1, 4), raw_counts=st.sampled_from([0, 30, 60]))
    def sensor_counts_on(self, number, raw_counts):
        x_m, y_m = self.mission.state.position
        for _ in range(number):
            self.now_s += 10.0
            record = CountRecord(self.now_s, x_m, y_m, 0.0, raw_counts, 10.0, 8.0)
            self.take(RecordArrived(self.now_s, record))

    @rule(
        late_s=st.sampled_from([-1000.0, 0.0, 5.0, 12.0]),
        exposure_s=st.sampled_from([10.0, 7.5, 0.0, math.nan]),
        place=st.sampled_from(PLACES),
    )
    def sensor_sends_anything(self, late_s, exposure_s, place):
        record = CountRecord(self.now_s - late_s, *place, math.nan, 10, exposure_s, exposure_s)
        self.take(RecordArrived(self.now_s, record))

    @rule(place=st.sampled_from(PLACES))
    def robot_is_somewhere(self, place):
        self.take(Moved(self.now_s, *place))

    @rule(event=st.sampled_from([Tick(-5.0), Moved(-5.0, 1.0, 1.0), GoalFailed(-5.0, 1, "late")]))
    def an_event_is_late(self, event):
        self.take(event)

    # What always holds

    @invariant()
    def abort_reaches_idle(self):
        if not hasattr(self, "mission"):
            return
        aborted = Mission(self.rules, self.mission.state)
        actions, state = aborted.step(Command(self.now_s, Verb.ABORT)), aborted.state
        assert not any(isinstance(action, GoTo | RequestPlan | StartCounting) for action in actions)
        assert state.phase in (Phase.IDLE, Phase.CANCELLING)
        if state.phase is Phase.IDLE:
            return
        late_s = self.now_s + self.rules.cancel_limit_s
        seen = [Moved(late_s + wait_s, *state.position) for wait_s in (1.0, 6.0)]
        for events in ([Tick(late_s)], [GoalFailed(self.now_s, state.goals, "cancelled")]):
            after = Mission(self.rules, state)
            for event in [*events, *([] if self.rules.standstill_s == 0 else [*seen, Tick(late_s + 100.0)])]:
                after.step(event)
            assert after.state.phase is Phase.IDLE

    @invariant()
    def the_state_makes_sense(self):
        if not hasattr(self, "mission"):
            return
        state, status = self.mission.state, self.mission.status
        assert status.reason
        assert 0 <= status.progress <= 1
        assert 0 <= status.time_left_s <= self.mission.current_rules.budget_s
        stays = state.phase is Phase.PLANNING and state.counting is not None
        assert not stays or (self.rules.stays and state.counting.met is not None and state.target is not None)
        counts = state.counting is not None and state.counting.since_s is not None
        assert counts == (state.phase is Phase.COUNTING or stays)
        assert (state.plan is not None) == (state.phase is Phase.PLANNING)
        assert (state.goal is not None) == (state.phase in (Phase.TRAVELLING, Phase.RETURNING, Phase.CANCELLING))
        assert (state.todo is not None) == (state.phase in (Phase.CANCELLING, Phase.WAITING))
        assert state.wait_until_s is None or state.phase in (Phase.WAITING, Phase.CANCELLING)
        if state.phase in STILL:
            assert self.no_goal_moves_the_robot()
        assert (state.resume is not None) == (state.phase is Phase.PAUSED or state.todo is Todo.PAUSE)
        if state.phase in (Phase.IDLE, Phase.FINISHED):
            assert not state.under_way
            assert state.target is None
            assert state.counting is None
        deadline_s = self.mission.next_deadline_s
        assert deadline_s is None or deadline_s > state.now_s, "something that was due is not done"
        assert status.dwell_s <= status.counting_s <= status.time_used_s + 1e-6

    def teardown(self):
        """The same events from the start give the same states and actions."""
        if not hasattr(self, "mission"):
            return
        again = Mission(self.rules)
        for event, state, actions in self.history:
            assert again.step(event) == actions
            assert again.state == state


AnyEvents.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestAnyEvents = pytest.mark.slow(AnyEvents.TestCase)
