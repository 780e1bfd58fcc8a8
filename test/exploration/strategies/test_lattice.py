# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import FreeTravel, RobotMotion, Situation, Stop, parse_dwell
from soilmoist_ros.exploration.strategies.lattice import Lattice, least_tour_s
from soilmoist_ros.exploration.strategies.route import open_route
from soilmoist_ros.exploration.strategies.strategy import RECORDS_OF_10_S, whole_records

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(12) * 5.0, np.arange(10) * 5.0))
PLACES = np.column_stack([X, Y])
STOPS = tuple(Stop(f"p{i}", float(x), float(y)) for i, (x, y) in enumerate(PLACES))
NUMBER = {stop.name: number for number, stop in enumerate(STOPS)}
MODEL = FreeTravel(RobotMotion())


def situation(
    left=7200.0, dwell="fmi:300", position=(0.0, 0.0), out_of_reach=(), counting=RECORDS_OF_10_S, rate=4.0
):
    travel = MODEL.travel_s(position, STOPS)
    travel[[NUMBER[name] for name in out_of_reach]] = np.inf
    rule = parse_dwell(dwell)
    return Situation(
        candidates=STOPS, candidates_xy=PLACES, stop_variance=lambda: np.full(len(PLACES), np.nan),
        map_variance=np.ones(len(PLACES)), map_xy=PLACES, cell_m=5.0, position_xy=np.asarray(position, float),
        measured_xy=np.empty((0, 2)), travel_s=travel,
        travel_between_s=lambda indices: MODEL.between_s(STOPS, indices), time_left_s=left,
        expected_dwell_s=rule.expected_s(rate), rate_cps=rate, overhead_s=MODEL.motion.stop_overhead_s,
        counting=counting, dwell=rule,
    )  # fmt: skip


def rng(seed=0):
    return np.random.default_rng(seed)


def tour_s(choice, dwell_s, position=(0.0, 0.0)):
    """Time of a planned tour of equal dwells, driven by a robot that leaves at the end of a record."""
    used_s = 0.0
    for stop in (choice.stop, *choice.ahead):
        leg_s = float(MODEL.travel_s(position, [stop])[0])
        used_s += math.ceil(leg_s / 10 - 1e-9) * 10 + dwell_s
        position = stop.x_m, stop.y_m
    return used_s


def mission(left, seed=0, late_s=0.0, dwell="optimal", ends=(1.0,)):
    """Time left, and dwell, place and time of each stop of a mission; legs take a little longer than planned."""
    strategy, dice, visits, position, budget_s = Lattice(ends), rng(seed), [], (0.0, 0.0), left
    while (choice := strategy.choose(situation(left, dwell, position), dice)) is not None:
        leg_s = float(MODEL.travel_s(position, [choice.stop])[0]) + late_s
        position = choice.stop.x_m, choice.stop.y_m
        dwell_s = parse_dwell(dwell).interval_s if choice.dwell is None else choice.dwell.interval_s
        left -= math.ceil(leg_s / 10 - 1e-9) * 10 + dwell_s
        visits.append((dwell_s, *position, budget_s - left))
    return strategy.size, left, np.array(visits)


@pytest.mark.parametrize("left", [200.0, 900.0, 3600.0, 7200.0])
def test_the_lattice_fits_the_time_and_is_kept(left):
    now = situation(left)
    strategy = Lattice()
    choice = strategy.choose(now, rng(1))
    planned = (choice.stop, *choice.ahead)
    assert tour_s(choice, 300.0) <= left or len(planned) == 1
    assert len(planned) == {200.0: 1}.get(left, len(planned))
    assert left < 3600 or tour_s(choice, 300.0) > left - 2 * 300 - 150
    assert choice.dwell is None
    for stop in choice.ahead:
        choice = strategy.choose(now, rng())
        assert choice.stop == stop
    assert f"place {len(planned)} of {len(planned)}" in choice.reason
    assert strategy.choose(now, rng()) is None


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), count=st.integers(1, 8), dwell_s=st.floats(0, 600))
def test_no_tour_is_shorter_than_the_bound(seed, count, dwell_s):
    now = situation()
    chosen = rng(seed).choice(len(STOPS), count, replace=False)
    route = open_route(now.travel_s[chosen], now.travel_between_s(chosen), rng())
    legs_s = np.diff(route.arrival_s, prepend=0.0)
    shortest_s = float(whole_records(legs_s, 10.0).sum() + count * dwell_s)
    assert shortest_s / 3 < least_tour_s(now, chosen, dwell_s) <= shortest_s + 1e-6


@pytest.mark.slow
@settings(deadline=None, max_examples=10)
@given(left=st.floats(1000, 7200), seed=st.integers(0, 100), late_s=st.floats(0, 3))
def test_a_planned_lattice_is_complete_and_uses_its_budget(left, seed, late_s):
    size, rest_s, visits = mission(left, seed, late_s)
    dwells = visits[:, 0]
    assert size - (late_s > 0) <= len(dwells) <= size > 3  # a late robot may have no time for the last stop
    # Whole records, the rounding of the last leg, and what was lost on it; a late robot counts once everywhere.
    assert rest_s < 10 or dwells[-1] == 10
    assert -20 - 10 * size * (late_s > 0) <= rest_s <= 30
    assert (dwells % 10 == 0).all()
    assert late_s > 0 or np.ptp(dwells[:-1]) <= 10


@pytest.mark.parametrize("dwell", ["fmi:300", "optimal"])
def test_nothing_in_reach_is_no_lattice(dwell):
    assert Lattice().choose(situation(dwell=dwell, out_of_reach=NUMBER), rng()) is None
    near = [name for name in NUMBER if name not in ("p7", "p40")]
    choice = Lattice().choose(situation(dwell=dwell, out_of_reach=near), rng())
    assert {choice.stop.name, *(stop.name for stop in choice.ahead)} <= {"p7", "p40"}


@pytest.mark.parametrize("dwell", ["fmi:20", "optimal"])
def test_two_passes_are_an_early_lattice_and_a_lattice_of_all_stops(dwell):
    size, rest_s, visits = mission(5400.0, dwell=dwell, ends=(0.25, 1.0))
    assert 0 <= rest_s < 100
    first, every = visits[visits[:, 3] <= 1350, 1:3], visits[:, 1:3]
    assert len(first) == len(every) - size >= 12
    assert len(np.unique(every, axis=0)) == len(every), "no stop is visited again"

    def gap_m(xy):
        return np.hypot(*(PLACES[:, None] - xy).transpose(2, 0, 1)).min(axis=1)

    # An even lattice of n stops leaves no place farther than about 0.7 sqrt(2 area / n) from its stops.
    assert gap_m(first).max() < 0.8 * math.sqrt(2 * 3000 / len(first))
    assert gap_m(every).mean() < 0.45 * math.sqrt(3000 / len(every))


def test_two_passes_are_one_where_few_stops_fit():
    one, two = (mission(1200.0, ends=ends)[2] for ends in ((1.0,), (0.25, 1.0)))
    np.testing.assert_array_equal(one, two)
