# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.exploration import Counting, FreeTravel, RobotMotion, Stop
from soilmoist_ros.exploration.planning.dwell import MAX_DWELL_S, MarginalValue
from soilmoist_ros.exploration.planning.planning_model import PlanningModel
from soilmoist_ros.exploration.planning.prospect import Prospect
from soilmoist_ros.mapping import PoissonKriging, Variogram

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(2.5, 60.0, 5.0), np.arange(2.5, 50.0, 5.0)))
CELLS = np.column_stack([X, Y])
STOPS = tuple(Stop(f"p{i}", x, y) for i, (x, y) in enumerate(CELLS.tolist()))
TRAVEL = FreeTravel(RobotMotion())
PLACE = (2.5, 2.5)
ALL = np.arange(len(STOPS))


def prospect(budget_s=3600.0, counting=None, travel_s=None):
    xy = np.array([[5.0, 5.0], [15.0, 12.0], [8.0, 20.0]])
    kriging = PoissonKriging(Variogram("matern32", 0.01, 15.0, 1.0)).fit(xy, [400, 350, 500], [100, 100, 100])
    model = PlanningModel(kriging, CELLS, np.full(len(CELLS), 1 / len(CELLS)), CELLS)
    travel_s = TRAVEL.travel_s(PLACE, STOPS) if travel_s is None else travel_s
    budget = np.full(len(STOPS), float(budget_s))
    return Prospect(model, STOPS, TRAVEL, PLACE, travel_s, budget, counting or Counting(), travel_s, ALL)


def test_only_what_can_be_reached_in_time_is_weighed():
    travel_s = TRAVEL.travel_s(PLACE, STOPS)
    travel_s[3] = np.inf
    near = prospect(60.0, travel_s=travel_s)
    assert set(near.reachable.tolist()) == set(np.flatnonzero(travel_s < 60.0).tolist())
    assert len(near.worth().value) == len(near.reachable)
    assert (travel_s[near.reachable] + near.worth().dwell_s <= 60.0 + 1e-9).all()
    nothing = prospect(5.0)
    assert not len(nothing.reachable)
    assert nothing.price == 0.0
    assert nothing.dwell(STOPS[0]) is None


def test_counting_on_the_way_makes_a_trip_worth_more():
    driving, standing = prospect(), prospect(counting=Counting(on_way=False))
    far = [row for row, number in enumerate(driving.reachable.tolist()) if number > 30]
    assert (driving.worth().on_way[0, far] > 0).all()
    assert (standing.worth().on_way < 1e-12).all()
    assert (driving.worth().value[far] > standing.worth().value[far]).all()


def test_the_dwell_of_the_most_valuable_stop_is_its_best():
    look = prospect()
    all_worth = look.worth()
    best = int(np.argmax(all_worth.value))
    rule = look.dwell(STOPS[look.reachable[best]])
    assert isinstance(rule, MarginalValue)
    assert rule.price == look.price == pytest.approx(all_worth.value[best], rel=1e-9)
    # the marginal value of the best trip falls to its mean value exactly when it ends
    assert rule.expected_s(float(all_worth.noise[0, best])) == pytest.approx(all_worth.dwell_s[best], rel=1e-6)
    worse = int(np.argmin(all_worth.value))
    other = look.dwell(STOPS[look.reachable[worse]])
    assert 0 <= other.expected_s(4.0) <= MAX_DWELL_S
    assert look.dwell(Stop("elsewhere", 0.0, 0.0)) is None


def test_staying_needs_no_trip_and_sets_no_price():
    travel_s = TRAVEL.travel_s(PLACE, STOPS)
    travel_s[110] = 0.0
    look = prospect(travel_s=travel_s)
    look.staying, look.min_dwell_s = 110, 10.0
    value = look.worth().value
    assert value.argmax() == 110
    assert look.price == np.delete(value, 110).max()
