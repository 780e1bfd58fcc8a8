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
NEAR = WayPoint(Stop("near", 0.0, 0.0, reach_m=0.5))
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
ONE, TWO = frozenset([b"one"]), frozenset([b"two"])
OURS, OTHERS = frozenset([1]), Listed(ONE, others=True)
ENDS = {
    "arrived": Outcome.SUCCEEDED, "failed": Outcome.FAILED, "over": Outcome.CANCELED,
    "stopped": Outcome.STOPPED, "superseded": Outcome.SUPERSEDED,
}  # fmt: skip


def said(request):
    match request:
        case SendGoal(goal_id=goal_id, point=point):
            return f"send {goal_id} {point.stop.name}"
        case CancelSent(goal_id=goal_id, ours=ours, accepted=accepted):
            return f"cancel {goal_id}{'' if ours else ' of all'}{'' if accepted else ' early'}"
        case Ended(goal_id=goal_id, outcome=outcome):
            return f"{next(word for word, one in ENDS.items() if one is outcome)} {goal_id}"


SENT = (("tick", 1, 0.0), ""), (("go", 1, (A,), 0.0), "send 1 a")
DRIVES = *SENT, (("answered", 1, True, 0.1), "")
CANCELS = *DRIVES, (("cancel", 1, 1.0), "cancel 1")
LISTED = (("tick", 1, 0.0, Listed(ONE)), ""), *DRIVES[1:]
COURSES = {
    "arrived when status, result and a later position agree": (
        *DRIVES, (("moved", (0.0, 0.0), 1.0), ""), (("ended", 1, SUCCEEDED, True, 2.0), ""),
        (("moved", (2.0, 0.0), 2.5), "arrived 1")),
    **{f"status {status} and success {success} is no arrival": (
        *DRIVES, (("ended", 1, status, success, 2.0), "failed 1"), (("moved", (0.0, 0.0), 3.0), ""))
       for status, success in ((SUCCEEDED, False), (ABORTED, True), (0, True))},
    "a goal that somebody else cancels is left to people": (
        *DRIVES, (("ended", 1, CANCELED, False, 2.0), "stopped 1")),
    "a stop is reached within its own reach": (
        DRIVES[0], (("go", 1, (NEAR,), 0.0), "send 1 near"), (("answered", 1, True, 0.1), ""),
        (("ended", 1, SUCCEEDED, True, 2.0), ""), (("moved", (1.0, 0.0), 2.5), ""),
        (("moved", (0.4, 0.0), 3.0), "arrived 1")),
    "a position that never agrees": (
        *DRIVES, (("ended", 1, SUCCEEDED, True, 2.0), ""),
        *((("moved", (30.0, 40.0), 3.0 + number), "") for number in range(9)),
        (("moved", (30.0, 40.0), 12.0), "failed 1")),
    "no goal goes to two servers of one name, and the robot can always be stopped": (
        (("tick", 2, 0.0), ""), (("go", 1, (A,), 0.0), ""), (("tick", 1, 1.0), "send 1 a"),
        (("answered", 1, True, 1.1), ""), (("tick", 2, 2.0), ""), (("cancel", 1, 3.0), "cancel 1"),
        (("ended", 1, CANCELED, False, 3.5), "over 1"), (("go", 2, (B,), 4.0), ""),
        (("tick", 2, 34.5), "failed 2")),
    **{f"any end ({status}) after a cancellation is the end, and a rejection says nothing": (
        *CANCELS, (("cancel_answered", 1, 1, 1.1), ""), (("cancel_answered", 1, 0, 1.1), ""),
        (("ended", 1, status, True, 2.0), "over 1")) for status in (SUCCEEDED, CANCELED, ABORTED)},
    **{f"a goal that the server does not know any more ({code}) has ended": (
        *CANCELS, (("cancel_answered", 1, code, 1.1), "over 1")) for code in (2, 3)},
    "a goal is not sent before the end of the one before is known, which is cancelled again": (
        *DRIVES, (("go", 2, (B,), 1.0), "over 1, cancel 1"), (("tick", 1, 2.0), ""),
        (("tick", 1, 3.5), "cancel 1"), (("ended", 1, ABORTED, False, 4.0), "send 2 b")),
    "a restarted server is asked before the next goal": (
        *DRIVES, (("tick", 0, 4.0), ""), (("tick", 0, 10.0), "failed 1"), (("go", 2, (B,), 11.0), ""),
        (("tick", 1, 12.0), "cancel 1"), (("cancel_answered", 1, 2, 12.1), "send 2 b")),
    "an acceptance that comes too late, of a goal that is not known any more, cancels all": (
        *SENT, (("tick", 1, 11.0), "failed 1, cancel 1 early"), (("cancel_answered", 1, 2, 11.1, False), ""),
        (("answered", 1, True, 12.0), "cancel 1 of all")),
    "nothing is sent while another client drives": (
        (("tick", 1, 0.0, OTHERS), ""), (("go", 1, (A,), 0.0), ""), (("tick", 1, 1.0, Listed(ONE)), "send 1 a")),
    **{f"a goal that another client has replaced ({status}) is no failure": (
        *DRIVES, (("tick", 1, 1.0, OTHERS), ""), (("ended", 1, status, False, 1.1), "superseded 1"))
       for status in (ABORTED, CANCELED)},
    "nor if its server reports success of what was replaced": (
        *DRIVES, (("tick", 1, 1.0, OTHERS), ""), (("ended", 1, SUCCEEDED, True, 1.1), ""),
        (("tick", 1, 31.2, OTHERS), "superseded 1")),
    "the list of the server tells the end of a cancelled goal, and not that of others": (
        *DRIVES, (("tick", 1, 0.5, Listed(ONE, ended=OURS)), ""), (("cancel", 1, 1.0), "over 1")),
    "a server that was started again at once does not know the goal, unless that came to it": (
        *LISTED, *((("tick", 1, now_s, Listed(TWO, active=OURS)), "") for now_s in (1.0, 5.0)),
        (("tick", 1, 6.0, Listed(TWO)), ""), (("tick", 1, 8.0, Listed(TWO)), "failed 1, cancel 1")),
    "already there needs no goal unless another one may still drive": (
        SENT[0], (("go", 1, (A,), 0.0, True), "arrived 1"), (("go", 2, (B,), 1.0), "send 2 b"),
        (("answered", 2, True, 1.1), ""), (("go", 3, (A,), 2.0, True), "over 2, cancel 2"),
        (("ended", 2, CANCELED, False, 3.0), "send 3 a")),
    "a way point that fails ends the goal": (
        SENT[0], (("go", 1, (A, B), 0.0), "send 1 a"), (("answered", 1, True, 0.1), ""),
        (("ended", 1, ABORTED, False, 5.0), "failed 1"), (("moved", (0.0, 0.0), 6.0), "")),
}  # fmt: skip
"""What is told to a client, and what it asks for and reports then."""


def told(client, steps):
    for (kind, *values), expected in steps:
        assert ", ".join(map(said, getattr(client, kind)(*values))) == expected, (kind, values)
    return client


@pytest.mark.parametrize("name", COURSES)
def test_what_a_client_makes_of_what_it_is_told(name):
    told(GoalClient(3.0), COURSES[name])


@pytest.mark.parametrize(
    ("steps", "event", "reason"),
    [
        (DRIVES, ("ended", 1, ABORTED, False, 5.0, "no path"), "the navigation aborted the goal: no path"),
        ((*SENT[:1], (("tick", 2, 0.0), ""), (("go", 1, (A,), 0.0), "")), ("tick", 2, 31.0), "has 2 servers"),
        ((*DRIVES, (("ended", 1, SUCCEEDED, True, 2.0), ""), (("moved", (30.0, 40.0), 2.5), "")),
         ("tick", 1, 33.0), "reported as reached, but the robot is 50.0 m away from it"),
    ],
)  # fmt: skip
def test_the_reason_of_an_end_is_for_people(steps, event, reason):
    kind, *values = event
    (end,) = getattr(told(GoalClient(3.0), steps), kind)(*values)
    assert reason in end.reason


def test_a_goal_without_an_answer_is_cancelled_at_once_and_again_when_it_is_accepted():
    early = (("cancel", 1, 0.2), "cancel 1 early"), (("tick", 1, 0.4), "")
    client = told(GoalClient(3.0), (*SENT, *early, (("cancel_answered", 1, 2, 0.5, False), "")))
    assert client.stop_unheard, "the server has not seen the goal yet"
    accepted, overtaken = ("answered", 1, True, 0.6), ("cancel_answered", 1, 2, 0.7, False)
    told(client, ((accepted, "cancel 1"), (overtaken, "")))  # an answer that was overtaken proves nothing
    assert client.stop_unheard
    told(client, ((("cancel_answered", 1, 0, 0.8), ""),))
    assert not client.stop_unheard
    told(client, ((("ended", 1, ABORTED, False, 0.9), "over 1"),))


def test_a_cancelled_goal_without_an_end_is_waited_for_until_the_server_is_another():
    client = told(GoalClient(3.0), (*LISTED, (("cancel", 1, 1.0), "cancel 1")))
    client.tick(1, 10.0, Listed(ONE))
    assert client.unended == ""
    client.tick(1, 11.5, Listed(ONE))
    assert client.unended == "the goal to a"
    client.go(2, (B,), 12.0)
    assert SendGoal(2, B) not in (*client.tick(0, 14.0, Listed()), *client.tick(1, 17.0, Listed(ONE))), "as before"
    told(client, ((("tick", 1, 18.0, Listed(TWO)), ""), (("tick", 1, 20.0, Listed(TWO)), "send 2 b")))
    assert client.unended == ""


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
