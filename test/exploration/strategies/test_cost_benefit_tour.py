import numpy as np
import pytest

from soilmoist_ros.exploration.control.explorer import Explorer, cell_stops
from soilmoist_ros.exploration.mission.actions import RequestPlan
from soilmoist_ros.exploration.mission.types import PlanKind
from soilmoist_ros.exploration.planning.dwell import Optimal
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.planning.prospect import Counting
from soilmoist_ros.exploration.strategies import cost_benefit_tour
from soilmoist_ros.exploration.strategies.cost_benefit_tour import MAX_STOPS, CostBenefitTour, _Tour
from soilmoist_ros.exploration.strategies.information import VarianceReduction
from soilmoist_ros.exploration.strategies.registry import make_strategy
from soilmoist_ros.exploration.travel.graph_builders import open_lattice
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.simulation.fields.catalogue import known_field

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
PLACE = (2.5, 2.5)
PLANNING = FieldMapSettings(for_planning=True)


def situation(left_s=3600.0, on_way=True, graph=False):
    travel, stops = FreeTravel(RobotMotion()), cell_stops(GRID)
    if graph:
        lattice = open_lattice(known_field("synthetic-high"), 8.0).graph
        travel, stops = GraphTravel(lattice, RobotMotion()), lattice.stops
    planner = Explorer(
        [Property(FieldMap(GRID, PLANNING))], stops, travel, make_strategy("gcb"), make_strategy("random"),
        Optimal(),
        np.random.default_rng(1), counting=Counting(on_way=on_way),
    )  # fmt: skip
    for xy, counts in (((5.0, 5.0), 300), ((9.0, 20.0), 320), ((20.0, 8.0), 410), ((5.0, 40.0), 330)):
        planner.properties[0].field_map.add_sample(xy, counts, 100.0)
    planner.properties[0].field_map.update()
    return planner.situation(RequestPlan(1, PlanKind.EXPLORE, (), left_s, left_s), PLACE)


def rng():
    return np.random.default_rng(0)


def test_at_the_start_it_is_the_largest_fall_per_second():
    now = situation()
    assert CostBenefitTour().choose(now, rng()) == VarianceReduction().choose(now, rng())


@pytest.mark.parametrize("graph", [False, True])
@pytest.mark.parametrize("on_way", [True, False])
def test_later_it_plans_a_tour_within_its_horizon(graph, on_way):
    now = situation(on_way=on_way, graph=graph)
    choice = CostBenefitTour(begun_s=3600.0 + 2400.0).choose(now, rng())
    assert 1 <= len(choice.ahead) < MAX_STOPS
    assert len({choice.stop, *choice.ahead}) == 1 + len(choice.ahead)
    assert f"a tour of {1 + len(choice.ahead)} stops" in choice.reason
    seconds = float(choice.reason.split(" in ")[1].removesuffix(" s"))
    assert seconds <= cost_benefit_tour.HORIZON * 2400.0**2 / 6000.0 + 1


def test_the_tour_is_worth_more_than_to_stay_at_its_first_stop_and_sorting_shortens_it():
    prospect = situation().prospect()
    tour = _Tour(prospect, int(np.argmax(prospect.worth.value)))
    node = prospect.model.stop_nodes[prospect.reachable[tour.stops]]
    while tour.insert(900.0):
        pass
    assert len(tour.stops) > 2
    assert 0 < tour.time_s <= 900
    assert prospect.model.fall(*tour.counted()) > 1.5 * prospect.model.fall(node, np.array([tour.time_s]))
    straight = tour.time_s
    tour.stops = tour.stops[::2] + tour.stops[1::2]
    tangled = tour.time_s
    tour.shorten()
    assert tour.time_s < tangled
    assert tour.time_s <= straight + 30.0


@pytest.mark.parametrize("on_way", [True, False])
def test_what_is_left_of_each_stop_is_that_of_the_posterior_after_the_tour(on_way):
    prospect = situation(on_way=on_way).prospect()
    model = prospect.model
    tour = _Tour(prospect, int(np.argmax(prospect.worth.value)))
    tour.insert(900.0)
    nodes, seconds = tour.counted()
    noisy = model.covariance[np.ix_(nodes, nodes)] + np.diag(model.noise(nodes, seconds))
    left = model.covariance - model.covariance[:, nodes] @ np.linalg.solve(noisy, model.covariance[nodes])
    stops = model.stop_nodes[prospect.reachable]
    gain, variance, _ = tour._left(model, nodes, seconds)
    np.testing.assert_allclose(gain, model.weight @ left[: len(model.weight), stops] ** 2, rtol=1e-8)
    np.testing.assert_allclose(variance, np.diag(left)[stops] + model.nugget, rtol=1e-8)


def test_without_a_map_or_time_it_does_as_ivr():
    now = situation(left_s=20.0)
    assert CostBenefitTour().choose(now, rng()) is None
