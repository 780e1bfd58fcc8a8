# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import sys
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.strategies import route
from soilmoist_ros.exploration.strategies.published import RENEWAL_ITERATIONS
from soilmoist_ros.exploration.strategies.route import (
    nearest_neighbour,
    open_route,
    require_solver,
    shortened,
    timed_route,
)
from soilmoist_ros.foundation.errors import InputError


def instance(seed, count, symmetric=True):
    rng = np.random.default_rng(seed)
    if symmetric:
        xy = rng.uniform(0, 100, (count + 1, 2))
        times = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1))
    else:
        times = rng.uniform(1, 100, (count + 1, count + 1))
    return times[0, 1:], times[1:, 1:]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.integers(1, 6), st.booleans())
def test_small_routes_are_optimal(seed, count, symmetric):
    start, between = instance(seed, count, symmetric)
    found = open_route(start, between, np.random.default_rng(0))
    best = min(timed_route(np.array(order), start, between).travel_s for order in permutations(range(count)))
    assert sorted(found.order) == list(range(count))
    assert found.travel_s == pytest.approx(best)


def test_the_search_finds_the_optimum_of_small_routes(monkeypatch):
    for seed in range(6):
        start, between = instance(seed, 8, symmetric=seed % 2 == 0)
        exact = open_route(start, between, np.random.default_rng(0))
        monkeypatch.setattr(route, "EXACT_UP_TO", 0)
        searched = open_route(start, between, np.random.default_rng(0))
        monkeypatch.undo()
        assert searched.travel_s == pytest.approx(exact.travel_s)


@pytest.mark.parametrize("count", [9, 20, 60])
@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("iterations", [1, 100])
def test_never_worse_than_nearest_neighbour(count, symmetric, iterations):
    start, between = instance(count, count, symmetric)
    found = open_route(start, between, np.random.default_rng(0), iterations=iterations)
    assert sorted(found.order) == list(range(count))
    assert found.travel_s <= timed_route(nearest_neighbour(start, between), start, between).travel_s + 1e-9


def test_nearest_neighbours_are_reached_first_and_the_first_of_equals():
    start = np.array([2.0, 1.0, 1.0, np.inf])
    between = np.array([[0, 9, 9, np.inf], [9, 0, 4, np.inf], [3, 9, 0, np.inf], [7, 5, 5, 0]])
    assert nearest_neighbour(start, between).tolist() == [1, 2, 0, 3]
    cut_off = np.where(between == 3, np.inf, between)
    assert nearest_neighbour(start, np.where(cut_off == 9, np.inf, cut_off)).tolist() == [1, 2, 0, 3]
    assert nearest_neighbour(np.empty(0), np.empty((0, 0))).tolist() == []


def test_the_same_seed_gives_the_same_route():
    start, between = instance(5, 40)
    routes = [open_route(start, between, np.random.default_rng(7)).order for _ in range(2)]
    assert routes[0] == routes[1]


def test_service_times_shift_arrivals_but_not_the_order():
    start, between = instance(3, 5)
    plain = open_route(start, between, np.random.default_rng(0))
    service = np.arange(5) * 10.0
    served = open_route(start, between, np.random.default_rng(0), service)
    assert served.order == plain.order
    waited = np.concatenate([[0], np.cumsum(service[list(plain.order)])])
    np.testing.assert_allclose(served.arrival_s, plain.arrival_s + waited[:-1])
    assert served.duration_s == pytest.approx(plain.travel_s + 100)
    assert served.travel_s == pytest.approx(plain.travel_s)


def test_impossible_legs_are_avoided_and_shown_if_they_cannot_be():
    inf = np.inf
    for count in (4, 12):
        between = np.full((count, count), inf)
        between[np.arange(count - 1), np.arange(1, count)] = 1.0
        found = open_route(np.full(count, 5.0), between, np.random.default_rng(0))
        assert found.order == tuple(range(count))
        between[1, 2] = inf
        assert open_route(np.full(count, 5.0), between, np.random.default_rng(0)).travel_s == inf


def test_no_targets_and_bad_times():
    empty = open_route([], np.empty((0, 0)), np.random.default_rng(0))
    assert (empty.order, empty.duration_s) == ((), 0.0)
    with pytest.raises(ValueError, match="shapes"):
        open_route([1, 2], np.ones((3, 3)), np.random.default_rng(0))
    with pytest.raises(ValueError, match="not NaN"):
        open_route([1, np.nan], np.ones((2, 2)), np.random.default_rng(0))


def test_a_missing_solver_is_named_with_the_way_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvrp", None)
    with pytest.raises(InputError, match=r"pip install 'soilmoist_ros\[campaign\]'"):
        require_solver()
    small = len(open_route([1, 2], np.ones((2, 2)), np.random.default_rng(0)).order)
    assert small == 2


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), count=st.integers(0, 40))
def test_a_shortened_route_visits_all_and_is_never_longer(seed, count):
    xy = np.random.default_rng(seed).uniform(0, 100, (count, 2))
    start, between = np.hypot(*xy.T), np.hypot(*(xy[:, None] - xy).T)
    order = shortened(start, between)
    assert sorted(order.tolist()) == list(range(count))
    as_given = timed_route(np.arange(count), start, between).travel_s
    assert timed_route(order, start, between).travel_s <= as_given + 1e-6


def test_a_crossing_is_removed_and_one_way_legs_are_left_alone():
    xy = np.array([[1.0, 0.0], [2.0, 1.0], [2.0, 0.0], [3.0, 1.0]])[[0, 3, 2, 1]]
    start, between = np.hypot(*xy.T), np.hypot(*(xy[:, None] - xy).T)
    order = shortened(start, between)
    assert timed_route(order, start, between).travel_s < timed_route(np.arange(4), start, between).travel_s
    between[0, 1] += 5.0
    assert shortened(start, between).tolist() == [0, 1, 2, 3]


@pytest.mark.slow
def test_a_route_renewed_at_each_stop_needs_few_iterations():
    def driven_m(seed, iterations):
        rng = np.random.default_rng(seed)
        left, here, total_m = rng.uniform(0, 60, (40, 2)), np.zeros(2), 0.0
        while len(left):
            start = np.hypot(*(left - here).T)
            between = np.hypot(*(left[:, None] - left).transpose(2, 0, 1))
            order = list(open_route(start, between, rng, iterations=iterations).order)
            total_m += start[order[0]]
            here, left = left[order[0]], left[order[1:]]
        return total_m

    few, many = (sum(driven_m(seed, iterations) for seed in range(4)) for iterations in (RENEWAL_ITERATIONS, 50))
    assert few < 1.02 * many
