# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.control.field_access import cell_stops
from soilmoist_ros.exploration.mission.events import RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import MarginalValue, Optimal, parse_dwell
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import make_strategy
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
CURVE = CalibrationCurve(n0_cps=8.0, bulk_density_gcm3=1.4)


def explorer(strategy="ivr", dwell="optimal", curve=None, stops=None, home=None):
    return Explorer(
        [Property(FieldMap(GRID, FieldMapSettings(for_planning=True)), curve=curve)],
        cell_stops(GRID) if stops is None else stops,
        FreeTravel(RobotMotion()),
        make_strategy(strategy),
        make_strategy("random"),
        MissionRules(budget_s=7200, dwell=parse_dwell(dwell), home=home, return_margin_s=0.0),
        np.random.default_rng(1),
    )


def with_map(planner):
    for xy, counts in (((5.0, 5.0), 300), ((9.0, 20.0), 320), ((20.0, 8.0), 410), ((5.0, 40.0), 330)):
        planner.properties[0].field_map.add_sample(xy, counts, 100.0)
    planner.properties[0].field_map.update()
    return planner


def request(left=3600.0):
    return RequestPlan(1, PlanKind.EXPLORE, (), left, left)


def test_without_a_map_it_begins_in_the_middle():
    plan = explorer().plan(request(), (2.5, 2.5))
    assert np.hypot(plan.choice.stop.x_m - 30, plan.choice.stop.y_m - 25) < 5
    assert plan.choice.dwell is None
    assert plan.choice.reason == "no map yet: to the middle of the field"


def test_it_goes_where_the_variance_falls_most_per_second():
    planner = with_map(explorer())
    plan = planner.plan(request(), (2.5, 2.5))
    look = planner.situation(request(), (2.5, 2.5)).prospect()
    best = look.stops[look.reachable[np.argmax(look.worth().value)]]
    assert plan.choice.stop == best
    assert plan.travel_s == pytest.approx(planner.travel.travel_s((2.5, 2.5), [best])[0])
    assert plan.choice.reason.startswith("most variance less per second")
    assert isinstance(plan.choice.dwell, MarginalValue)


@pytest.mark.parametrize("strategy", ["greedy", "monte_carlo", "random", "adaptive_sampling"])
def test_every_strategy_gets_the_dwell_that_pays(strategy):
    plan = with_map(explorer(strategy)).plan(request(), (2.5, 2.5))
    assert isinstance(plan.choice.dwell, MarginalValue)
    assert with_map(explorer(strategy, "fmi:60")).plan(request(), (2.5, 2.5)).choice.dwell is None
    assert isinstance(parse_dwell("optimal"), Optimal)


def test_a_stop_off_the_weighed_ones_gets_a_dwell_too():
    many = tuple(Stop(f"n{i}", x, y) for i, (x, y) in enumerate(np.random.default_rng(3).uniform(0, 50, (900, 2))))
    planner = with_map(explorer("greedy", stops=many))
    for position in ((2.5, 2.5), (50.0, 45.0)):
        assert isinstance(planner.plan(request(), position).choice.dwell, MarginalValue)


def test_too_little_time_is_an_end():
    planner = with_map(explorer())
    assert planner.plan(request(left=20.0), (2.5, 2.5)).choice is None
    assert explorer().plan(request(left=20.0), (2.5, 2.5)).choice is None


def test_the_way_home_is_kept_back():
    home = Stop("home", 2.5, 2.5)
    planner = with_map(explorer(home=home))
    plan = planner.plan(request(left=130.0), (2.5, 2.5))
    back_s = planner.travel.travel_s((plan.choice.stop.x_m, plan.choice.stop.y_m), [home])[0]
    assert plan.travel_s + back_s < 130.0


def test_a_map_of_the_moisture_draws_to_wet_soil_and_counts_longer_there():
    """Two halves alike but for the rate: west is wet (few counts), east dry."""
    places = [(x, y) for x in (10.0, 20.0, 40.0, 50.0) for y in (10.0, 25.0, 40.0)]
    dwell_s, value = {}, {}
    for name, curve in (("rate", None), ("vwc", CURVE)):
        planner = explorer(curve=curve)
        for x, y in places:
            planner.properties[0].field_map.add_sample((x, y), round((4.2 if x < 30 else 6.0) * 300), 300.0)
        planner.properties[0].field_map.update()
        look = planner.situation(request(), (30.0, 25.0)).prospect()
        east = np.array([look.stops[number].x_m for number in look.reachable.tolist()])
        at = {side: np.flatnonzero(east == x) for side, x in (("wet", 12.5), ("dry", 47.5))}
        worth = look.worth()
        price = 0.01 * (worth.gain / worth.rate).max()
        for side, rows in at.items():
            terms = [(worth.gain[row], worth.variance[row], worth.rate[row]) for row in rows]
            dwell_s[name, side] = np.mean([MarginalValue(a, b, price).expected_s(rate) for a, b, rate in terms])
            value[name, side] = worth.value[rows].max()
    assert value["vwc", "wet"] > 2 * value["vwc", "dry"]
    assert value["rate", "wet"] < 2 * value["rate", "dry"]
    assert dwell_s["rate", "wet"] < dwell_s["rate", "dry"]
    assert dwell_s["vwc", "wet"] > 2 * dwell_s["vwc", "dry"] > 0
