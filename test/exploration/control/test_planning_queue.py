# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plan requests wait for the map, but not for ever, and whatever goes wrong is an answer."""

from dataclasses import replace
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from stand_in import square_setup

from soilmoist_ros.exploration import Choice, FieldAccess, RobotMotion, Stop, parse_dwell
from soilmoist_ros.exploration.control.explorer import ExplorerSettings
from soilmoist_ros.exploration.control.planning_queue import (
    OWN,
    PlanJob,
    PlanningQueue,
    PlanningThread,
    PropertyMap,
    Terms,
    answer,
    make_explorer,
)
from soilmoist_ros.exploration.mission.events import PlanFailed, Planned, RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.mapping import Change, Changing, Drift, TimedSamples, estimate_variogram
from soilmoist_ros.mapping.samples import as_samples

SAMPLES = as_samples([(2.0, 2.0), (10.0, 5.0), (18.0, 18.0)], [50, 60, 40], [10.0, 10.0, 10.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=20.0)
PLACE = (1.0, 1.0)
FOLLOWED = PropertyMap("", required=True, samples=(SAMPLES, 0.0), fit=(FIT, 0.0))
SETTINGS = ExplorerSettings(strategy="greedy", preset="paper", seed=0, motion=RobotMotion())
RULES = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60"))
BOTH = (OWN, PropertyMap("/compaction", 0.5))


def request(plan_id=1, kind=PlanKind.EXPLORE, blacklisted=(), left_s=3600.0):
    return RequestPlan(plan_id, kind, blacklisted, left_s, left_s)


def access():
    return FieldAccess(square_setup(20, 2.0).field, RobotMotion(), None)


@pytest.fixture
def explorer():
    return make_explorer(access(), SETTINGS, RULES)


@pytest.mark.parametrize(("kind", "needs_fit"), [(PlanKind.EXPLORE, True), (PlanKind.WARM_UP, False)])
def test_waits_until_the_map_has_what_was_measured(kind, needs_fit):
    queue = PlanningQueue(20.0)
    queue.take_samples("", SAMPLES, 90.0)
    queue.take_fit("", FIT, 90.0)
    queue.measured(100.0)
    queue.ask(request(kind=kind), 101.0)
    assert queue.due(101.0, PLACE) is None
    queue.take_samples("", SAMPLES, 100.0 - 1e-6)
    if needs_fit:
        assert queue.due(102.0, PLACE) is None
        queue.take_fit("", FIT, 100.0)
    job = queue.due(102.0, PLACE)
    (own,) = job.maps
    assert own.samples[0] is SAMPLES
    assert own.fit[0] is FIT
    assert not job.late


def test_waits_no_longer_than_allowed():
    queue = PlanningQueue(20.0)
    queue.measured(100.0)
    queue.ask(request(), 101.0)
    assert queue.due(120.9, PLACE) is None
    assert queue.due(121.0, PLACE).late


def test_the_answer_follows_the_map(explorer):
    planned = answer(lambda: explorer, PlanJob(request(), PLACE, (FOLLOWED,)), "greedy")
    assert isinstance(planned, Planned)
    assert "highest kriging variance" in planned.choice.reason
    nearest = np.hypot(*(SAMPLES.xy - (planned.choice.stop.x_m, planned.choice.stop.y_m)).T).min()
    assert nearest > 5.0, "the least known place is far from all samples"


def test_the_map_follows_the_drift_that_came_with_the_variogram(explorer):
    changing = Changing(
        TimedSamples(SAMPLES, np.array([0.0, 40.0, 80.0])),
        Change(Drift(0.9, False, (0.0, 90.0), (-0.1, 0.0), ((0.1, 0.0),))),
        90.0,
    )
    queue = PlanningQueue(20.0)
    for each in (changing, None):
        queue.take_samples("", SAMPLES, 90.0)
        queue.take_fit("", FIT, 90.0, changing=each)
        queue.ask(request(), 91.0)
        answer(lambda: explorer, queue.due(91.0, PLACE), "greedy")
        (own,) = explorer.properties
        assert own.field_map.samples is SAMPLES
        assert own.field_map.soil_map.change == (Change() if each is None else each.change)


def test_exploring_without_a_map_fails_where_one_is_needed(explorer):
    job = PlanJob(request(), PLACE, (replace(FOLLOWED, fit=None),), True)
    assert answer(lambda: explorer, job, "greedy") == PlanFailed(0.0, 1, "no map has come: is the mapper running?")
    assert isinstance(answer(lambda: explorer, job, "random"), Planned)
    assert explorer.properties[0].field_map.samples is SAMPLES, "places measured are known without a map, too"


@pytest.mark.parametrize("error", [ValueError("bad luck"), KeyError("bad luck")])
def test_whatever_breaks_is_a_failed_plan(explorer, monkeypatch, error):
    def broken(*_):
        raise error

    monkeypatch.setattr(explorer, "plan", broken)
    for make in (lambda: explorer, broken):
        failed = answer(make, PlanJob(request(7), PLACE, (FOLLOWED,)), "greedy")
        assert failed.plan_id == 7
        assert "bad luck" in failed.reason


def test_a_strategy_that_is_gone_is_a_failed_plan():
    woken = Event()
    thread = PlanningThread(woken.set)
    settings = replace(SETTINGS, strategy="removed")
    thread.submit(PlanJob(request(7), PLACE, (FOLLOWED,)), Terms(0.0, access(), settings, RULES))
    assert woken.wait(60.0)
    (failed,) = thread.answers()
    thread.close()
    assert "removed" in failed.reason
    assert np.isnan(thread.busy_s)


@pytest.mark.parametrize(
    ("returned", "what"),
    [
        (Stop("a", 1.0, 1.0), "Stop"),
        ("a", "str"),
        (Choice(Stop("nowhere", 1.0, 1.0), "why"), "a Choice of another stop"),
        (Choice("a", "why"), "a Choice of another stop"),
    ],
)
def test_a_strategy_that_returns_something_else_is_told_what_it_must_return(explorer, returned, what):
    explorer.strategy = SimpleNamespace(choose=lambda situation, rng: returned)
    failed = answer(lambda: explorer, PlanJob(request(), PLACE, (FOLLOWED,)), "greedy")
    said = f"strategy SimpleNamespace: choose must return a Choice or None; it returned {what} -> return Choice("
    assert failed.reason.startswith(said)


def held(queue, kind=PlanKind.EXPLORE, now_s=101.0):
    queue.ask(request(kind=kind), now_s)
    return queue.due(now_s, PLACE)


def test_a_property_that_is_not_required_is_left_out_until_it_has_a_map():
    queue = PlanningQueue(20.0, BOTH)
    assert not held(queue).maps[1].is_complete
    assert queue.faults == ("no map of /compaction: stops are chosen without it",)
    queue.take_samples("/compaction", SAMPLES, 90.0)
    assert not held(queue).maps[1].is_complete
    queue.take_fit("/compaction", FIT, 90.0)
    assert held(queue).maps[1].is_complete
    assert queue.weighed == ("/compaction",)
    assert queue.faults == ()
    queue.take_fit("/compaction", None, 91.0)
    assert not held(queue).maps[1].is_complete, "its mapper has forgotten all"


def test_a_stale_map_that_is_not_required_is_waited_for_once():
    queue = PlanningQueue(20.0, BOTH)
    for name, stamp_s in (("", 100.0), ("/compaction", 80.0)):
        queue.take_samples(name, SAMPLES, stamp_s)
        queue.take_fit(name, FIT, stamp_s)
    queue.measured(100.0)
    assert held(queue) is None
    job = queue.due(121.0, PLACE)
    assert not job.late
    assert job.maps[1].is_complete
    assert queue.faults == ("the map of /compaction is stale: stops are chosen with the old one",)
    assert held(queue, now_s=122.0) is not None, "it is not waited for again"
    queue.take_samples("/compaction", SAMPLES, 92.0)  # its records end at other times
    queue.take_fit("/compaction", FIT, 92.0)
    assert held(queue, now_s=123.0) is not None
    assert queue.faults == ()


def test_the_answer_goes_where_a_further_property_is_unknown(explorer):
    alone = answer(lambda: explorer, PlanJob(request(), PLACE, (FOLLOWED,)), "greedy").choice.stop
    near = as_samples([(alone.x_m, alone.y_m), (10.0, 5.0), (2.0, 2.0)], [800, 900, 700], [100.0] * 3)
    compaction = PropertyMap("/compaction", 50.0, samples=(near, 0.0), fit=(FIT, 0.0))
    both = answer(lambda: explorer, PlanJob(request(), PLACE, (FOLLOWED, compaction)), "greedy").choice
    assert np.hypot(both.stop.x_m - alone.x_m, both.stop.y_m - alone.y_m) > 3.0
    again = answer(lambda: explorer, PlanJob(request(), PLACE, (FOLLOWED,)), "greedy").choice.stop
    assert again == alone, "a map that has gone does not matter any more"
