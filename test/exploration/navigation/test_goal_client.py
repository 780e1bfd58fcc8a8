# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rules of a client of topological navigation, event by event."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.navigation.goal_client import (
    ActionStatus,
    CancelSent,
    GoalClient,
    Listed,
    SendGoal,
    failure,
    progress,
)
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop, WayPoint

A, B = WayPoint(Stop("a", 0.0, 0.0)), WayPoint(Stop("b", 20.0, 0.0))
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


def client_with_goal(*points, listed=None):
    client = GoalClient(3.0)
    client.tick(1, 0.0, listed or Listed())
    points = points or (A,)
    assert client.go(1, points, 0.0) == (SendGoal(1, points[0]),)
    assert client.answered(1, True, 0.1) == ()
    return client


def outcomes(requests):
    return [request.outcome for request in requests if isinstance(request, Ended)]


def test_arrived_when_status_result_and_a_later_position_agree():
    client = client_with_goal()
    assert client.moved((0.0, 0.0), 1.0) == (), "a position of before the end proves nothing"
    assert client.ended(1, SUCCEEDED, True, 2.0) == ()
    assert outcomes(client.moved((2.0, 0.0), 2.5)) == [Outcome.SUCCEEDED]


@pytest.mark.parametrize(("status", "success"), [(SUCCEEDED, False), (ABORTED, True), (0, True)])
def test_anything_else_is_not_an_arrival(status, success):
    client = client_with_goal()
    assert outcomes(client.ended(1, status, success, 2.0)) == [Outcome.FAILED]
    assert client.moved((0.0, 0.0), 3.0) == ()


def test_a_goal_that_somebody_else_cancels_is_left_to_people():
    assert outcomes(client_with_goal().ended(1, CANCELED, False, 2.0)) == [Outcome.STOPPED]


def test_no_goal_goes_to_two_servers_of_one_name():
    client = GoalClient(3.0)
    client.tick(2, 0.0)
    assert client.go(1, (A,), 0.0) == ()
    assert client.tick(1, 1.0) == (SendGoal(1, A),)
    client.answered(1, True, 1.1)
    assert client.tick(2, 2.0) == (), "a goal that runs goes on"
    assert client.cancel(1, 3.0) == (CancelSent(1, True),), "the robot can always be stopped"
    client.ended(1, CANCELED, False, 3.5)
    assert client.go(2, (B,), 4.0) == ()
    (end,) = client.tick(2, 34.5)
    assert end.outcome is Outcome.FAILED
    assert "has 2 servers" in end.reason


def test_a_position_that_never_agrees():
    client = client_with_goal()
    client.ended(1, SUCCEEDED, True, 2.0)
    requests = [client.moved((30.0, 40.0), 3.0 + number) for number in range(10)]
    assert [outcomes(each) for each in requests] == [*[[]] * 9, [Outcome.FAILED]]
    assert "50.0 m away" in requests[-1][0].reason


@pytest.mark.parametrize("status", [SUCCEEDED, CANCELED, ABORTED])
def test_any_end_after_a_cancellation_is_the_end(status):
    client = client_with_goal()
    assert client.cancel(1, 1.0) == (CancelSent(1, True),)
    assert client.cancel_answered(1, 1, 1.1) == (), "a rejection says nothing"
    assert client.cancel_answered(1, 0, 1.1) == ()
    assert outcomes(client.ended(1, status, True, 2.0)) == [Outcome.CANCELED]


@pytest.mark.parametrize("code", [2, 3])
def test_a_goal_that_the_server_does_not_know_any_more_has_ended(code):
    client = client_with_goal()
    client.cancel(1, 1.0)
    assert outcomes(client.cancel_answered(1, code, 1.1)) == [Outcome.CANCELED]


def test_a_goal_is_not_sent_before_the_end_of_the_one_before_is_known():
    client = client_with_goal()
    assert client.go(2, (B,), 1.0) == (Ended(1, Outcome.CANCELED, "replaced by another goal"), CancelSent(1, True))
    assert client.tick(1, 2.0) == ()
    assert client.tick(1, 3.5) == (CancelSent(1, True),), "cancelled again while it does not end"
    assert client.ended(1, ABORTED, False, 4.0) == (SendGoal(2, B),)


def test_a_restarted_server_is_asked_before_the_next_goal():
    client = client_with_goal()
    assert client.tick(0, 4.0) == ()
    assert outcomes(client.tick(0, 10.0)) == [Outcome.FAILED]
    assert client.go(2, (B,), 11.0) == ()
    assert client.tick(1, 12.0) == (CancelSent(1, True),)
    assert client.cancel_answered(1, 2, 12.1) == (SendGoal(2, B),)


def test_an_acceptance_that_comes_too_late_is_cancelled():
    client = GoalClient(3.0)
    client.tick(1, 0.0)
    client.go(1, (A,), 0.0)
    given_up = client.tick(1, 11.0)
    assert outcomes(given_up) == [Outcome.FAILED]
    assert CancelSent(1, True, accepted=False) in given_up
    client.cancel_answered(1, 2, 11.1, accepted=False)
    assert client.answered(1, True, 12.0) == (CancelSent(1, False),), "not known by name any more: all goals"


def test_a_goal_without_an_answer_is_cancelled_at_once_and_again_when_it_is_accepted():
    client = GoalClient(3.0)
    client.tick(1, 0.0)
    client.go(1, (A,), 0.0)
    assert client.cancel(1, 0.2) == (CancelSent(1, True, accepted=False),)
    assert client.tick(1, 0.4) == ()
    assert client.cancel_answered(1, 2, 0.5, accepted=False) == (), "the server has not seen the goal yet"
    assert client.stop_unheard
    assert client.answered(1, True, 0.6) == (CancelSent(1, True),), "now it drives"
    assert client.cancel_answered(1, 2, 0.7, accepted=False) == (), "an answer that was overtaken proves nothing"
    assert client.stop_unheard
    assert client.cancel_answered(1, 0, 0.8) == ()
    assert not client.stop_unheard
    assert outcomes(client.ended(1, ABORTED, False, 0.9)) == [Outcome.CANCELED]


ONE, TWO = frozenset([b"one"]), frozenset([b"two"])


def test_nothing_is_sent_while_another_client_drives():
    client = GoalClient(3.0)
    client.tick(1, 0.0, Listed(ONE, others=True))
    assert client.go(1, (A,), 0.0) == ()
    assert client.tick(1, 1.0, Listed(ONE)) == (SendGoal(1, A),)


@pytest.mark.parametrize(("status", "success"), [(ABORTED, False), (CANCELED, False), (SUCCEEDED, True)])
def test_a_goal_that_another_client_has_replaced_is_no_failure(status, success):
    client = client_with_goal()
    client.tick(1, 1.0, Listed(ONE, others=True))
    requests = client.ended(1, status, success, 1.1)
    if success:  # servers of topological navigation report success of what was replaced
        requests = client.tick(1, 31.2, Listed(ONE, others=True))
    assert outcomes(requests) == [Outcome.SUPERSEDED]


def test_the_list_of_the_server_tells_the_end_of_a_cancelled_goal():
    client = client_with_goal()
    assert client.tick(1, 0.5, Listed(ONE, ended=frozenset([1]))) == (), "its result says how it ended"
    assert outcomes(client.cancel(1, 1.0)) == [Outcome.CANCELED]


def test_a_cancelled_goal_without_an_end_is_waited_for_until_the_server_is_another():
    client = client_with_goal(listed=Listed(ONE))
    client.cancel(1, 1.0)
    client.tick(1, 10.0, Listed(ONE))
    assert client.unended == ""
    client.tick(1, 11.5, Listed(ONE))
    assert client.unended == "the goal to a"
    client.go(2, (B,), 12.0)
    assert SendGoal(2, B) not in (*client.tick(0, 14.0, Listed()), *client.tick(1, 17.0, Listed(ONE))), "as before"
    client.tick(1, 18.0, Listed(TWO))
    assert client.tick(1, 20.0, Listed(TWO)) == (SendGoal(2, B),)
    assert client.unended == ""


def test_a_server_that_was_started_again_at_once_does_not_know_the_goal():
    client = client_with_goal(listed=Listed(ONE))
    client.tick(1, 1.0, Listed(TWO, active=frozenset([1])))
    assert client.tick(1, 5.0, Listed(TWO, active=frozenset([1]))) == (), "it had come to the new one"
    client.tick(1, 6.0, Listed(TWO))
    given_up = client.tick(1, 8.0, Listed(TWO))
    assert outcomes(given_up) == [Outcome.FAILED]
    assert given_up[1:] == (CancelSent(1, True),)


def test_a_stop_is_reached_within_its_own_reach():
    client = client_with_goal(WayPoint(Stop("near", 0.0, 0.0, reach_m=0.5)))
    client.ended(1, SUCCEEDED, True, 2.0)
    assert client.moved((1.0, 0.0), 2.5) == (), "at the neighbour"
    assert outcomes(client.moved((0.4, 0.0), 3.0)) == [Outcome.SUCCEEDED]


def test_already_there_needs_no_goal_unless_another_one_may_still_drive():
    client = GoalClient(3.0)
    client.tick(1, 0.0)
    assert client.go(1, (A,), 0.0, True) == (Ended(1, Outcome.SUCCEEDED, "already at a"),)
    assert client.go(2, (B,), 1.0) == (SendGoal(2, B),)
    client.answered(2, True, 1.1)
    assert client.go(3, (A,), 2.0, True)[-1] == CancelSent(2, True)
    assert client.ended(2, CANCELED, False, 3.0) == (SendGoal(3, A),)


def test_a_way_point_that_fails_ends_the_goal():
    client = client_with_goal(A, B)
    (end,) = client.ended(1, ABORTED, False, 5.0, "no valid path (code 208)")
    assert (end.outcome, end.reason) == (
        Outcome.FAILED,
        "the navigation aborted the goal: no valid path (code 208)",
    )
    assert client.moved((0.0, 0.0), 6.0) == ()


EVENTS = st.one_of(
    st.tuples(st.just("go"), st.integers(1, 3), st.booleans()),
    st.tuples(st.just("cancel")),
    st.tuples(st.just("answered"), st.booleans()),
    st.tuples(st.just("ended"), st.sampled_from([0, 4, 5, 6]), st.booleans()),
    st.tuples(st.just("cancel_answered"), st.integers(0, 3)),
    st.tuples(st.just("overtaken")),
    st.tuples(st.just("moved"), st.sampled_from([(0.0, 0.0), (20.0, 0.0)])),
    st.tuples(st.just("tick"), st.booleans()),
)


class Server:
    """What the requests of a client make a server do; a request that breaks a rule fails the test."""

    def __init__(self):
        self.asked, self.running, self.accepted = 0, 0, False
        self.cancelled, self.ended, self.early = set(), [], False

    def take(self, requests):
        for request in requests:
            if isinstance(request, SendGoal):
                assert not self.running, "another goal may still be at work"
                assert request.goal_id == self.asked
                assert request.goal_id not in self.cancelled
                assert request.goal_id not in self.ended
                self.running, self.accepted, self.early = request.goal_id, False, False
            elif isinstance(request, CancelSent):
                self.early |= not request.accepted
            elif isinstance(request, Ended):
                assert request.goal_id not in self.ended, "an end is reported once"
                self.ended.append(request.goal_id)

    def can(self, kind):
        """Whether the server may say this now: it answers a goal once, and then ends it once."""
        if kind == "overtaken":
            return self.running > 0 and self.early and self.accepted
        return kind not in ("answered", "ended", "cancel_answered") or (
            self.running > 0 and self.accepted != (kind == "answered")
        )

    def said(self, kind, value):
        over = {"answered": not value, "ended": True, "cancel_answered": value in (2, 3)}
        if kind == "answered":
            self.accepted = bool(value)
        if over.get(kind):
            self.running = 0


@given(st.lists(st.tuples(EVENTS, st.floats(0, 4)), max_size=60))
@settings(deadline=None)
def test_whatever_happens_every_goal_ends_once_and_one_runs_at_a_time(events):
    client, server, now_s = GoalClient(3.0), Server(), 0.0
    for (kind, *values), pause_s in events:
        now_s += pause_s
        if kind == "go":
            server.asked += 1
            points, there = values
            server.take(client.go(server.asked, (A, B, A)[:points], now_s, there))
        elif kind == "cancel":
            if server.asked and server.asked not in server.ended:
                server.cancelled.add(server.asked)
                server.take(client.cancel(server.asked, now_s))
        elif kind == "overtaken":  # it did not know the goal, which it has accepted since
            if server.can(kind):
                server.early = False
                server.take(client.cancel_answered(server.running, 2, now_s, accepted=False))
        elif server.can(kind):
            about = () if kind in ("moved", "tick") else (server.running,)
            server.said(kind, values[0])
            server.take(getattr(client, kind)(*about, *values, now_s))
    for _ in range(200):
        now_s += 1.0
        server.take(client.tick(0, now_s))
    assert sorted(server.ended) == list(range(1, server.asked + 1))


# Whose goals the servers of an action list ----------------------------------------------------------------------

FIRST, SECOND = b"one", b"two"


def test_own_goals_those_of_an_earlier_life_and_those_of_others():
    before, status = ActionStatus("/planner"), ActionStatus("/planner")
    own, again, old, other = status.new_identity(), status.new_identity(), before.new_identity(), bytes(range(16))
    assert len({own, again, old}) == 3
    assert [len(each) for each in (own, again, old)] == [16, 16, 16]
    assert not ActionStatus("/planner_2").new_identity().startswith(own[:8])
    status.serve(frozenset([FIRST]))
    status.take({own: 2, again: 4, old: 1, other: 3})
    assert (status.before, status.others, status.state(again)) == ((old,), (other,), 4)
    status.take({own: 2, old: 6, other: 5})
    assert (status.before, status.others, status.state(again)) == ((), (), 0), "what has ended drives nobody"


@pytest.mark.parametrize("next_servers", [[], [SECOND]])
def test_what_a_server_that_has_died_listed_does_not_count(next_servers):
    status = ActionStatus("/planner")
    assert not status.serve(frozenset([FIRST]))
    status.take({bytes(16): 2})
    assert status.known
    anew = status.serve(frozenset(next_servers))
    assert (status.others, status.known, anew) == ((), False, bool(next_servers))


def test_each_of_two_servers_has_a_list():
    status = ActionStatus("/planner")
    status.serve(frozenset([FIRST, SECOND]))
    status.take({b"a" * 16: 2})
    status.take({b"b" * 16: 2})
    assert len(status.others) == 2
    assert status.serve(frozenset([SECOND])), "its list is fetched again"
    assert status.others == ()


# Error codes and feedback of Nav2 in words ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "text", "words"),
    [
        (0, "", ""),
        (0, "the tree failed", "the tree failed"),
        (105, "stuck", "the robot made no progress (Nav2 error 105: stuck)"),
        (4711, "odd", "unknown cause (Nav2 error 4711: odd)"),
    ],
)
def test_failures(code, text, words):
    assert failure(code, text) == words


def test_progress():
    assert progress(12.34, 1) == "12.3 m to go, recoveries: 1"
    assert (progress(math.nan, 3), progress(math.inf, 0)) == ("recoveries: 3", "")
