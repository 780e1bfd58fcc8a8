# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strategies that weigh what a count is worth: the tours of gcb, and the stops of ivr."""

from itertools import pairwise

import numpy as np
import pytest

from soilmoist_ros.exploration import Counting, Explorer, Property, RequestPlan, cell_stops, make_strategy
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import FixedInterval, MarginalValue, Optimal, parse_dwell
from soilmoist_ros.exploration.planning.properties import Aim
from soilmoist_ros.exploration.strategies.cost_benefit_tour import (
    CostBenefitTour,
    Ground,
    design,
    filled,
    renewed,
    shortest,
)
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import open_lattice
from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation.fields.catalogue import known_field

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
PLACE = (2.5, 2.5)
PLANNING = FieldMapSettings(for_planning=True)
OPTIMAL, MOTION = Optimal(), RobotMotion()


def situation(left_s=3600.0, on_way=True, graph=False, place=PLACE, dwell=OPTIMAL, motion=MOTION, aim=None):
    travel, stops = FreeTravel(motion), cell_stops(GRID)
    if graph:
        lattice = open_lattice(known_field("synthetic-high"), 8.0).graph
        travel, stops = GraphTravel(lattice, RobotMotion()), lattice.stops
    planner = Explorer(
        [Property(FieldMap(GRID, PLANNING))], stops, travel, make_strategy("gcb"), make_strategy("random"),
        MissionRules(budget_s=left_s, dwell=dwell, until=aim), np.random.default_rng(1),
        counting=Counting(on_way=on_way),
    )  # fmt: skip
    for xy, counts in (((5.0, 5.0), 300), ((9.0, 20.0), 320), ((20.0, 8.0), 410), ((5.0, 40.0), 330)):
        planner.properties[0].field_map.add_sample(xy, counts, 100.0)
    planner.properties[0].field_map.update()
    return planner.situation(RequestPlan(1, PlanKind.EXPLORE, (), left_s, left_s), place)


def rng():
    return np.random.default_rng(0)


def drive(strategy, left_s, dwell_s, choices):
    now, place = situation(left_s), PLACE
    made = []
    for _ in range(choices):
        choice = strategy.choose(now, rng())
        if choice is None:
            break
        made.append((choice, left_s))
        travel_s = float(FreeTravel(RobotMotion()).travel_s(place, [choice.stop])[0])
        place = (choice.stop.x_m, choice.stop.y_m)
        left_s -= travel_s + dwell_s
        now = situation(left_s, place=place)
    return made


@pytest.mark.parametrize("graph", [False, True])
@pytest.mark.parametrize("on_way", [True, False])
def test_a_tour_fits_into_its_pass_and_visits_no_stop_twice(graph, on_way):
    now = situation(7200.0, on_way, graph)
    ground = Ground(now)
    tour = design(ground, 1800.0, rng())
    assert len(tour.stops) > 2
    assert len(set(tour.stops.tolist())) == len(tour.stops)
    assert ground.legs_s(tour.stops).sum() + len(tour.stops) * tour.dwell_s == pytest.approx(1800.0)


@pytest.mark.slow
def test_passes_end_at_their_shares_of_the_time_and_become_finer():
    strategy = CostBenefitTour()
    made = drive(strategy, 7200.0, 30.0, 200)
    remaining = [len(choice.ahead) for choice, _ in made]
    times = [left_s for _, left_s in made[1:]]
    begun = [left_s for left_s, (old, new) in zip(times, pairwise(remaining), strict=True) if new > old + 5]
    assert [7200.0 - left_s for left_s in begun] == pytest.approx([1800.0], abs=120.0)
    assert made[-1][1] < 120.0
    assert max(remaining) > 1.5 * remaining[0]


@pytest.mark.parametrize(("kind", "graph"), [("sd", False), ("p95-sd", False), ("zone", False), ("sd", True)])
def test_the_shortest_tour_meets_its_aim_and_no_second_more(kind, graph):
    best, share = 0.9 if kind == "zone" else 0.001, 0.3 if graph or kind == "p95-sd" else 0.4
    now = situation(7200.0, graph=graph, aim=Aim(kind, best)).goal()
    figure = now.aim.figure(now.rate, now.variance, now.slope2)
    ground = Ground(situation(7200.0, graph=graph, aim=Aim(kind, figure + share * (best - figure))))
    tour = shortest(ground, 7200.0, rng())

    def met(dwell_s):
        counted = ground.prospect.counted_on_tour(tour.stops, dwell_s, ground.legs_s(tour.stops))
        return ground.goal.is_met_after(ground.prospect.model.cell_fall(*counted))

    assert 100 < tour.time_s < 7000
    assert tour.time_s == pytest.approx(ground.legs_s(tour.stops).sum() + len(tour.stops) * tour.dwell_s)
    assert met(1.15 * tour.dwell_s)
    assert tour.dwell_s <= 10 or not met(0.8 * tour.dwell_s)
    assert shortest(ground, 0.7 * tour.time_s, rng()) is None, "no other tour is much shorter"


def test_the_rest_of_a_tour_moves_to_where_the_variance_is():
    ground = Ground(situation(3600.0))
    ground.mass = np.where(ground.cells_xy[:, 0] > 30.0, 1.0, 1e-6)
    west = ground.nearest(np.array([[10.0, 10.0], [10.0, 30.0], [28.0, 20.0]]))
    tour = renewed(ground, west, np.empty((0, 2)), 600.0, 60.0)
    assert (ground.xy[tour.stops, 0] > 25.0).sum() >= 1
    assert len(tour.stops) > 3  # 600 s are enough for more stops


def test_without_time_stops_are_dropped_and_the_least_useful_first():
    ground = Ground(situation(3600.0))
    twins = ground.nearest(np.array([[10.0, 10.0], [11.0, 14.0], [40.0, 10.0], [40.0, 40.0], [10.0, 40.0]]))
    needed_s = ground.legs_s(twins).sum()
    tour = filled(ground, twins, float(needed_s) + 4 * 40.0, 60.0)
    assert len(tour.stops) == 4
    assert len({*tour.stops.tolist()} & {*twins[:2].tolist()}) == 1
    assert filled(ground, twins, 15.0, 60.0) is None


def test_a_dwell_rule_of_the_mission_stays_and_optimal_becomes_whole_records():
    made = CostBenefitTour().choose(situation(), rng())
    assert made.dwell.interval_s % 10 == 0
    fixed = CostBenefitTour().choose(situation(dwell=FixedInterval(60.0)), rng())
    assert fixed.dwell is None


def test_costs_of_a_stop_make_stops_fewer():
    cheap, dear = (
        len(design(Ground(situation(7200.0, motion=RobotMotion(stop_cost_s=cost_s))), 3600.0, rng()).stops)
        for cost_s in (0.0, 300.0)
    )
    assert dear < cheap


def test_no_dwell_is_planned_shorter_than_the_mission_allows():
    now = situation(7200.0)
    now.prospect().min_dwell_s = 90.0
    ground = Ground(now)
    tour = design(ground, 3600.0, rng())
    assert tour.dwell_s >= 90.0
    assert ground.dwell(0, 20.0).interval_s == 90.0


# One stop at a time ---------------------------------------------------------------------------------------------

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


def test_too_little_time_is_an_end():
    planner = with_map(explorer())
    assert planner.plan(request(left=20.0), (2.5, 2.5)).choice is None
    assert explorer().plan(request(left=20.0), (2.5, 2.5)).choice is None


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
