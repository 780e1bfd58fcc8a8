# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tours of gcb."""

from itertools import pairwise

import numpy as np
import pytest

from soilmoist_ros.exploration import Counting, Explorer, Property, RequestPlan, cell_stops, make_strategy
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import FixedInterval, Optimal
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
from soilmoist_ros.mapping import FieldGrid, FieldMap
from soilmoist_ros.simulation.fields.catalogue import known_field

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
PLACE = (2.5, 2.5)
OPTIMAL, MOTION = Optimal(), RobotMotion()


def situation(left_s=3600.0, on_way=True, graph=False, place=PLACE, dwell=OPTIMAL, motion=MOTION, aim=None):
    travel, stops = FreeTravel(motion), cell_stops(GRID)
    if graph:
        lattice = open_lattice(known_field("synthetic-high"), 8.0).graph
        travel, stops = GraphTravel(lattice, RobotMotion()), lattice.stops
    planner = Explorer(
        [Property(FieldMap(GRID))], stops, travel, make_strategy("gcb"), make_strategy("random"),
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
    legs_s = ground.legs_s(tour.stops)
    assert legs_s.sum() + len(tour.stops) * tour.dwell_s == pytest.approx(1800.0)
    nodes, exposure_s = ground.prospect.counted_on_tour(tour.stops, tour.dwell_s, legs_s)
    assert len(set(nodes.tolist())) == len(nodes), "counts at one place add up"
    counted_s = 1800.0 if on_way else len(tour.stops) * tour.dwell_s
    assert exposure_s.sum() == pytest.approx(counted_s)


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


def test_costs_of_a_metre_make_stops_fewer():
    motions = (RobotMotion(metre_cost_s=cost_s) for cost_s in (0.0, 20.0))
    cheap, dear = (design(Ground(situation(7200.0, motion=one)), 3600.0, rng()) for one in motions)
    assert len(dear.stops) < len(cheap.stops)


def test_no_dwell_is_planned_shorter_than_the_mission_allows():
    now = situation(7200.0)
    now.prospect().min_dwell_s = 90.0
    ground = Ground(now)
    tour = design(ground, 3600.0, rng())
    assert tour.dwell_s >= 90.0
    assert ground.dwell(0, 20.0).interval_s == 90.0
