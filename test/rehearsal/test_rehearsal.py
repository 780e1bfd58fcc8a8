# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rehearsals: ``rehearsal.py``, ``planner.py``, ``world.py``, ``cases.py``."""

from dataclasses import replace

import numpy as np
import pytest

from rehearsal import planner as clients
from rehearsal.cases import RECEIVERS, Fault, Faults, Span, make_case, make_quiet_case
from rehearsal.judge import Kind, Violation
from rehearsal.rehearsal import Outcome, rehearse
from soilmoist_ros.exploration import Cause, Fence, Listed, MissionRules, Response, Watch
from soilmoist_ros.exploration.control.watching import Watching
from soilmoist_ros.exploration.guard.motion import Motion, Standing


@pytest.fixture(scope="module")
def safety(load_script):
    return load_script("safety")


@pytest.fixture
def rehearsed(safety, tmp_path):
    """A function that rehearses a case, each time with a new journal."""
    stores = iter(range(100))

    def run(case):
        return rehearse(case, safety.Disk(tmp_path / str(next(stores))))

    return run


def quiet(number, **changes):
    return replace(make_case(7, number), faults=Faults(), **{"budget_s": 600.0, **changes})


@pytest.mark.slow
def test_case_and_outcome_follow_from_seed_and_number(rehearsed):
    case = replace(make_case(7, 4), budget_s=300.0)
    assert str(case) == str(make_case(7, 4))
    assert str(case) != str(make_case(8, 4))
    assert rehearsed(case) == rehearsed(case)


@pytest.mark.slow
def test_a_killed_planner_comes_back_with_its_mission(rehearsed):
    kill = Faults([Span(Fault.KILL_PLANNER, 200.0, 1.0, 0.0)])
    outcome = rehearsed(replace(quiet(31, strategy="greedy"), faults=kill))
    assert outcome.kills == 1
    assert outcome.visits >= 3
    assert outcome.ended.startswith("finished")


@pytest.mark.slow
def test_where_the_robot_was_is_no_place_to_stop_at(rehearsed):
    """After a stall of the connection the places of 20 s of driving come at once."""
    case = quiet(152, strategy="random", navigator="goal_pose")
    for at_s in (120.0, 390.0):
        stall = Faults([Span(Fault.LINK_STALL, at_s, 20.0, 0.0)])
        outcome = rehearsed(replace(case, faults=stall))
        assert outcome.violations == ()
        assert outcome.visits >= 3


FIX_JUMPS = Faults([Span(Fault.FIX_JUMP, 60.0, 200.0, 0.3), Span(Fault.FIX_RUNS, 300.0, 100.0, 0.5)])


EVERYWHERE = 1000.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def open_fence(field, *margins):
    return Fence(replace(field, polygon=EVERYWHERE, no_go=()), *margins)


def violated(rehearsed, numbers, faults):
    cases = [replace(make_case(1, number), faults=faults, budget_s=600.0, strategy="random") for number in numbers]
    return {violation.kind for case in cases for violation in rehearsed(case).violations}


@pytest.mark.slow
def test_without_fence_or_watch_the_judge_finds_violations(rehearsed, monkeypatch):
    assert violated(rehearsed, (0, 9), Faults()) | violated(rehearsed, (2,), FIX_JUMPS) == set()
    with monkeypatch.context() as patch:
        patch.setattr("soilmoist_ros.exploration.control.field_access.Fence", open_fence)
        assert {Kind.NO_GO, Kind.OUTSIDE, Kind.GOAL_OUTSIDE} <= violated(rehearsed, (0, 9), Faults())
    # Every fix is believed, and nothing is wrong.
    monkeypatch.setattr(Watch, "fix", lambda self, fix: fix.xy)
    monkeypatch.setattr(Watch, "check", lambda self, now_s, doing: ())
    assert Kind.WRONG_PLACE in violated(rehearsed, (2,), FIX_JUMPS)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(3))
def test_rehearsals_without_violations(rehearsed, number):
    outcome = rehearsed(make_case(1, number))
    assert outcome.violations == ()
    assert not outcome.refused


@pytest.mark.slow
def test_the_script_ends_with_the_sum(safety, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["safety", "--fields", "1", "--seed", "5", "--workers", "1"])
    short = lambda seed, number, fault: replace(make_case(seed, number), budget_s=120.0, faults=Faults())  # noqa: E731
    monkeypatch.setattr(safety, "make_case", short)
    assert safety.main() == 0
    assert capsys.readouterr().out.splitlines()[-1] == "violations: 0"
    monkeypatch.setattr(
        safety, "rehearse", lambda case, store: Outcome(violations=(Violation(Kind.NO_GO, 1, ""),))
    )
    assert safety.main() == 1
    assert capsys.readouterr().out.splitlines()[-1] == "violations: 3"


# Each watch is needed -----------------------------------------------------------------------------------------


def ignore(*causes):
    def switch_off(monkeypatch):
        made = Watch.__init__

        def init(self, *given, **named):
            made(self, *given, **named)
            self.responses |= dict.fromkeys(causes, Response.IGNORE)

        monkeypatch.setattr(Watch, "__init__", init)

    return switch_off


def no_standing_robot(monkeypatch):
    """Nothing is known about what the robot does when its place is judged."""
    monkeypatch.setattr(Watching, "expect", lambda *_: None)


def everything_stands(monkeypatch):
    monkeypatch.setattr(Motion, "standing", lambda self, for_s, since_s=0.0: Standing(for_s))


def whole_radius(monkeypatch):
    """A stop is reached within the arrival radius, however near another node is."""
    monkeypatch.setattr(MissionRules, "reach_m", lambda self, stop, noise_m=0.0: self.arrival_radius_m)


def nobody_else(monkeypatch):
    monkeypatch.setattr(clients, "Listed", lambda lives, active, others: Listed(lives, active))
    monkeypatch.setattr(clients.ActionNavigator, "other_client", "")


NEEDED = [  # the number of a rehearsal, what is switched off, and what the judge must find then
    (Fault.DETOUR, 1, ignore(Cause.IN_NO_GO, Cause.FAR_OFF_ROUTE), Kind.IN_NO_GO),
    (Fault.DETOUR, 41, ignore(Cause.IN_NO_GO), Kind.IN_NO_GO),
    (Fault.STRAY, 34, ignore(Cause.FAR_OFF_ROUTE), Kind.OFF_ROUTE),
    (Fault.OTHER_MAP, 1, ignore(Cause.OUTSIDE, Cause.FAR_OFF_ROUTE), Kind.AWAY),
    (Fault.CREEP, 7, ignore(Cause.MOVING), Kind.UNNOTICED),
    (Fault.CREEP, 5, everything_stands, Kind.MOVED_STANDING),
    (Fault.FIX_STEP, 1, no_standing_robot, Kind.MISPLACED),
    (Fault.NEIGHBOUR, 9, whole_radius, Kind.NOT_REACHED),
    (Fault.OTHER_CLIENT, 22, nobody_else, Kind.OVERRIDDEN),
]


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "number", "switch_off", "kind"), NEEDED)
def test_each_watch_is_needed(rehearsed, monkeypatch, fault, number, switch_off, kind):
    case = replace(make_case(1, number, fault), budget_s=420.0)
    assert {violation.kind for violation in rehearsed(case).violations} <= {Kind.EARLY}, "its time is short"
    switch_off(monkeypatch)
    assert kind in {violation.kind for violation in rehearsed(case).violations}


@pytest.mark.slow
@pytest.mark.parametrize("number", range(5), ids=RECEIVERS)
def test_no_receiver_that_works_stops_a_mission(rehearsed, number):
    outcome = rehearsed(replace(make_quiet_case(1, number), budget_s=800.0, stated="true"))
    assert outcome.stops == {}
    assert (outcome.quarantined, outcome.refused) == (0, "")
    assert outcome.visits > 3
