# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pending measurements of other robots count as done, and no robot goes where another one is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.control.explorer import Explorer, cell_stops
from soilmoist_ros.exploration.control.team import PendingMeasurement, foreseen, pending_measurement, taken
from soilmoist_ros.exploration.mission.actions import RequestPlan
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import STRATEGIES, make_strategy, warm_up
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.mapping import PoissonKriging
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.samples.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram

GRID = FieldGrid.from_polygon(np.array([[0, 0], [30, 0], [30, 20], [0, 20]], float), 2.5)
STOPS = cell_stops(GRID)
SAMPLES = as_samples([(1.25, 1.25), (26.25, 6.25), (11.25, 16.25)], [250, 500, 300], [100.0, 100.0, 100.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=30.0)


def field_map(known=True):
    found = FieldMap(GRID, FieldMapSettings(for_planning=True))
    if known:
        found.set_samples(SAMPLES, FIT)
        found.update()
    return found


def explorer(strategy, known=True, dwell="fmi:120", seed=0):
    return Explorer(
        [Property(field_map(known))], STOPS, FreeTravel(RobotMotion()), make_strategy(strategy),
        warm_up(strategy, "paper")[1], parse_dwell(dwell), np.random.default_rng(seed),
    )  # fmt: skip


def request(kind=PlanKind.EXPLORE, blacklisted=()):
    return RequestPlan(1, kind, blacklisted, 7200.0, 7200.0)


def test_counts_to_come_lower_the_variance_as_if_they_had_come():
    before = field_map()
    after = foreseen(before, [PendingMeasurement(16.25, 6.25, 400.0)])
    rate = before.kriging.predict([(16.25, 6.25)])[0][0]
    come = PoissonKriging(FIT.variogram, mean_rate=FIT.mean_rate).fit(
        [*SAMPLES.xy, (16.25, 6.25)], [*SAMPLES.counts, round(rate * 400)], [*SAMPLES.exposure_s, 400.0]
    )
    np.testing.assert_allclose(after.variance, come.predict(GRID.cells)[1], rtol=1e-9)
    assert (after.variance < before.variance).all()
    assert after.variance.mean() < 0.9 * before.variance.mean()
    np.testing.assert_allclose(after.rate, before.rate, atol=0.01)
    assert len(before.samples) == 3
    for exposure_s in (0.0, 1e-308, 1e-13):  # a difference of times is rounded
        assert foreseen(before, [PendingMeasurement(16.25, 6.25, exposure_s)]) is before, "nothing will be counted"


def test_the_drift_of_the_map_is_that_of_what_is_to_come():
    before = field_map()
    timed = TimedSamples(SAMPLES, np.array([0.0, 1800.0, 3600.0]))
    before.set_samples(
        SAMPLES, FIT, Changing(timed, Change(Drift(0.9, False, (0.0, 3600.0), (-0.1, 0.0), ((0.1, 0.0),))), 3600.0)
    )
    before.update()
    after = foreseen(before, [PendingMeasurement(16.25, 6.25, 400.0)])
    assert after.soil_map.change == before.soil_map.change
    np.testing.assert_array_equal(after.changing.timed.time_s, [0.0, 1800.0, 3600.0, 3600.0])
    assert (after.variance < before.variance).all()


def test_without_a_map_only_the_places_are_known():
    ahead = foreseen(field_map(known=False), [PendingMeasurement(16.25, 6.25, 400.0)])
    assert ahead.kriging is None
    np.testing.assert_array_equal(ahead.samples.xy, [(16.25, 6.25)])


def test_places_within_half_a_cell_are_the_same():
    xy = np.array([[0.0, 0.0], [2.4, 0.0], [2.6, 0.0]])
    assert taken(xy, [PendingMeasurement(0.0, 0.0, 0.0)], 5.0).tolist() == [True, True, False]
    assert not taken(xy, [], 5.0).any()


def test_an_errand_is_what_a_status_leaves_to_count():
    idle = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:300"))).status
    assert pending_measurement(idle) is None
    counting = replace(idle, target=Stop("a", 3.0, 4.0), planned_dwell_s=300.0, dwell_s=100.0)
    assert pending_measurement(counting) == PendingMeasurement(3.0, 4.0, 200.0)
    assert pending_measurement(counting, mapped_at_once=False) == PendingMeasurement(3.0, 4.0, 300.0)
    assert pending_measurement(replace(counting, dwell_s=400.0)) == PendingMeasurement(3.0, 4.0, 0.0)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    strategy=st.sampled_from([name for name in STRATEGIES.names() if name != "lattice"]),
    kind=st.sampled_from(PlanKind),
    targets=st.lists(st.sampled_from(STOPS), min_size=1, max_size=len(STOPS) - 1, unique=True),
    exposure_s=st.floats(0.0, 4000.0),
    dwell=st.sampled_from(["fmi:120", "optimal"]),
    data=st.data(),
)
def test_no_strategy_goes_where_another_robot_is(strategy, kind, targets, exposure_s, dwell, data):
    out = data.draw(st.sampled_from(["", STOPS[0].name]))
    others = [PendingMeasurement(stop.x_m, stop.y_m, exposure_s) for stop in targets]
    chooses = explorer(strategy, known=kind is PlanKind.EXPLORE, dwell=dwell)
    plan = chooses.plan(request(kind, (out,)), (2.5, 2.5), others)
    free = {stop.name for stop in STOPS} - {stop.name for stop in targets} - {out}
    if plan.choice is None:
        assert not free
    else:
        assert {plan.choice.stop.name, *(stop.name for stop in plan.choice.ahead)} <= free


@pytest.mark.slow
def test_the_static_lattice_passes_over_a_place_that_is_taken():
    alone = explorer("lattice").plan(request(), (2.5, 2.5)).choice
    with_others = explorer("lattice")
    stop = with_others.plan(
        request(), (2.5, 2.5), [PendingMeasurement(alone.stop.x_m, alone.stop.y_m, 120.0)]
    ).choice.stop
    assert stop != alone.stop


@pytest.mark.parametrize("strategy", ["greedy", "ivr", "gcb"])
def test_a_second_robot_keeps_away_from_what_the_first_will_know(strategy):
    first = explorer(strategy).plan(request(), (15.0, 10.0)).choice.stop
    there = PendingMeasurement(first.x_m, first.y_m, 600.0)
    alone, with_others = (
        explorer(strategy).plan(request(blacklisted=(first.name,)), (15.0, 10.0), others).choice.stop
        for others in ((), (there,))
    )
    nearness = [np.hypot(stop.x_m - first.x_m, stop.y_m - first.y_m) for stop in (alone, with_others)]
    assert nearness[1] >= nearness[0]
    assert nearness[1] > 4.0


def test_robots_that_begin_together_do_not_all_go_to_the_middle():
    middle = explorer("ivr", known=False).plan(request(PlanKind.WARM_UP), (0.0, 0.0)).choice.stop
    other = explorer("ivr", known=False).plan(
        request(PlanKind.WARM_UP), (0.0, 0.0), [PendingMeasurement(middle.x_m, middle.y_m, 60.0)]
    ).choice.stop  # fmt: skip
    assert np.hypot(other.x_m - middle.x_m, other.y_m - middle.y_m) >= 10.0
