"""The rules of a client of topological navigation, event by event."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.navigation.goal_client import CancelSent, GoalClient, GoalLimits, SendGoal
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop

A, B = Stop("a", 0.0, 0.0), Stop("b", 20.0, 0.0)
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


def client_with_goal(**limits):
    client = GoalClient(3.0, GoalLimits(**limits))
    client.tick(True, 0.0)
    assert client.go(1, A, 0.0) == (SendGoal(1, A),)
    assert client.answered(1, True, 0.1) == ()
    return client


def outcomes(requests):
    return [request.outcome for request in requests if isinstance(request, Ended)]


def test_arrived_when_status_result_and_a_later_position_agree():
    client = client_with_goal()
    assert client.moved((0.0, 0.0), 1.0) == (), "a position of before the end proves nothing"
    assert client.ended(1, SUCCEEDED, True, 2.0) == ()
    assert outcomes(client.moved((2.0, 0.0), 2.5)) == [Outcome.SUCCEEDED]


@pytest.mark.parametrize(("status", "success"), [(SUCCEEDED, False), (ABORTED, True), (CANCELED, True), (0, True)])
def test_anything_else_is_not_an_arrival(status, success):
    client = client_with_goal()
    assert outcomes(client.ended(1, status, success, 2.0)) == [Outcome.FAILED]
    assert client.moved((0.0, 0.0), 3.0) == ()


def test_a_position_that_never_agrees():
    client = client_with_goal(positions=3)
    client.ended(1, SUCCEEDED, True, 2.0)
    requests = [client.moved((30.0, 40.0), 3.0 + number) for number in range(3)]
    assert [outcomes(each) for each in requests] == [[], [], [Outcome.FAILED]]
    assert "50.0 m away" in requests[-1][0].reason


def test_no_position_at_all():
    client = client_with_goal(position_s=10.0)
    client.ended(1, SUCCEEDED, True, 2.0)
    assert client.tick(True, 11.0) == ()
    assert "no position" in client.tick(True, 12.5)[0].reason


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
    assert client.go(2, B, 1.0) == (Ended(1, Outcome.CANCELED, "replaced by another goal"), CancelSent(1, True))
    assert client.tick(True, 2.0) == ()
    assert client.tick(True, 3.5) == (CancelSent(1, True),), "cancelled again while it does not end"
    assert client.ended(1, ABORTED, False, 4.0) == (SendGoal(2, B),)


def test_it_does_not_wait_for_that_for_ever():
    client = client_with_goal(start_s=5.0)
    client.go(2, B, 1.0)
    assert outcomes(client.tick(True, 6.5)) == [Outcome.FAILED]
    assert SendGoal(3, B) not in client.go(3, B, 7.0), "the server is still at work"


def test_a_restarted_server_is_asked_before_the_next_goal():
    client = client_with_goal(lost_s=5.0)
    assert client.tick(False, 4.0) == ()
    assert outcomes(client.tick(False, 10.0)) == [Outcome.FAILED]
    assert client.go(2, B, 11.0) == ()
    assert client.tick(True, 12.0) == (CancelSent(1, True),)
    assert client.cancel_answered(1, 2, 12.1) == (SendGoal(2, B),)


def test_an_acceptance_that_comes_too_late_is_cancelled():
    client = GoalClient(3.0, GoalLimits(answer_s=2.0))
    client.tick(True, 0.0)
    client.go(1, A, 0.0)
    given_up = client.tick(True, 3.0)
    assert outcomes(given_up) == [Outcome.FAILED]
    assert CancelSent(1, True) in given_up
    client.cancel_answered(1, 2, 3.1)
    assert client.answered(1, True, 4.0) == (CancelSent(1, False),), "not known by name any more: all goals"


def test_cancelled_before_it_was_sent():
    client = GoalClient(3.0)
    assert client.go(1, A, 0.0) == ()
    assert outcomes(client.cancel(1, 1.0)) == [Outcome.CANCELED]
    assert client.tick(True, 2.0) == ()


EVENTS = st.one_of(
    st.tuples(st.just("go")),
    st.tuples(st.just("cancel")),
    st.tuples(st.just("answered"), st.booleans()),
    st.tuples(st.just("ended"), st.sampled_from([0, 4, 5, 6]), st.booleans()),
    st.tuples(st.just("cancel_answered"), st.integers(0, 3)),
    st.tuples(st.just("moved"), st.sampled_from([(0.0, 0.0), (20.0, 0.0)])),
    st.tuples(st.just("tick"), st.booleans()),
)


@given(st.lists(st.tuples(EVENTS, st.floats(0, 4)), max_size=60))
@settings(deadline=None)
def test_whatever_happens_every_goal_ends_once_and_one_runs_at_a_time(events):
    client, now_s = GoalClient(3.0, GoalLimits()), 0.0
    asked, open_goals, accepted, asked_to_cancel = 0, [], set(), []

    def take(requests):
        for request in requests:
            if isinstance(request, SendGoal):
                assert not open_goals, "another goal may still be at work"
                assert request.goal_id == asked
                assert request.goal_id not in asked_to_cancel
                open_goals.append(request.goal_id)
            elif isinstance(request, Ended):
                assert request.goal_id not in asked_to_cancel
                asked_to_cancel.append(request.goal_id)

    for (kind, *values), pause_s in events:
        now_s += pause_s
        if kind == "go":
            asked += 1
            values = [asked, (A, B)[asked % 2]]
        elif kind == "cancel":
            if asked in asked_to_cancel or not asked:
                continue
            values = [asked]
        elif kind in ("answered", "ended", "cancel_answered"):
            # what the server may say: it answers a goal once, and then ends it once
            if not open_goals or (kind == "answered") == (open_goals[0] in accepted):
                continue
            values = [open_goals[0], *values]
            if kind == "answered" and values[1]:
                accepted.add(open_goals[0])
            elif kind != "cancel_answered" or values[1] in (2, 3):
                open_goals.clear()
        take(getattr(client, kind)(*values, now_s))
    for _ in range(200):
        now_s += 1.0
        take(client.tick(False, now_s))
    assert sorted(asked_to_cancel) == list(range(1, asked + 1))
