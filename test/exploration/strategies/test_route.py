# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Orders of visits against all permutations, and stops spread by k-means."""

import sys
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.strategies import route as clusters
from soilmoist_ros.exploration.strategies.route import (
    KMeans,
    lloyd,
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


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.integers(1, 7), st.booleans())
def test_small_routes_are_optimal(seed, count, symmetric):
    start, between = instance(seed, count, symmetric)
    found = open_route(start, between, np.random.default_rng(0))
    best = min(timed_route(np.array(order), start, between).travel_s for order in permutations(range(count)))
    assert sorted(found.order) == list(range(count))
    assert found.travel_s == pytest.approx(best)


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


def test_impossible_legs_are_avoided_and_shown_if_they_cannot_be():
    inf = np.inf
    for count in (4, 12):
        between = np.full((count, count), inf)
        between[np.arange(count - 1), np.arange(1, count)] = 1.0
        found = open_route(np.full(count, 5.0), between, np.random.default_rng(0))
        assert found.order == tuple(range(count))
        between[1, 2] = inf
        assert open_route(np.full(count, 5.0), between, np.random.default_rng(0)).travel_s == inf


def test_no_targets():
    empty = open_route([], np.empty((0, 0)), np.random.default_rng(0))
    assert (empty.order, empty.duration_s) == ((), 0.0)


def test_a_missing_solver_is_named_with_the_way_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvrp", None)
    with pytest.raises(InputError, match=r"pip install 'soilmoist_ros\[campaign\]'"):
        require_solver()
    for seed in range(9):  # a mission that has begun must not end for want of it
        start, between = instance(seed, 6, symmetric=False)
        best = min(timed_route(np.array(order), start, between).travel_s for order in permutations(range(6)))
        assert open_route(start, between, rng()).travel_s == pytest.approx(best), "a few targets need no solver"
    start, between = instance(1, 20, symmetric=False)
    nearest_s = timed_route(nearest_neighbour(start, between), start, between).travel_s
    assert open_route(start, between, rng()).travel_s < 0.9 * nearest_s, "many are visited, too"


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), count=st.integers(0, 40), symmetric=st.booleans())
def test_a_shortened_route_visits_all_and_is_never_longer(seed, count, symmetric):
    start, between = instance(seed, count, symmetric)
    order = shortened(start, between)
    assert sorted(order.tolist()) == list(range(count))
    as_given = timed_route(np.arange(count), start, between).travel_s
    assert timed_route(order, start, between).travel_s <= as_given + 1e-6


# K-means --------------------------------------------------------------------------------------------------------


def rng(seed=0):
    return np.random.default_rng(seed)


def test_k_means_finds_clusters_and_no_more_centres_than_places():
    middle = np.array([[0, 0], [50, 0], [0, 50]], float)
    points = (middle[:, None] + rng(1).normal(0, 1, (3, 40, 2))).reshape(-1, 2)
    found = KMeans(points, rng(4)).centres(3)
    assert np.hypot(*(found[:, None] - middle).transpose(2, 0, 1)).min(axis=0).max() < 1
    assert len(KMeans(np.zeros((5, 2)), rng()).centres(3)) == 1


def test_mass_attracts_centres():
    cells = np.array([(x, y) for x in range(20) for y in range(10)], float)
    mass = np.where(cells[:, 0] < 10, 9.0, 1.0)
    centres = KMeans(cells, rng(1), mass).centres(24)
    assert 1.5 < (centres[:, 0] < 9.5).sum() / (centres[:, 0] > 9.5).sum() < 9
    assert np.array_equal(KMeans(cells, rng(2), np.zeros(200)).centres(5), KMeans(cells, rng(2)).centres(5))


def test_more_centres_begin_with_the_same_start():
    cells = rng(3).uniform(0, 50, (300, 2))
    found = KMeans(cells, rng(1))
    for count in (20, 5, 30):
        np.testing.assert_array_equal(found.centres(count), KMeans(cells, rng(1)).centres(count))


@pytest.mark.parametrize(("columns", "count", "rounds"), [(20, 1, 50), (20, 30, 2), (100, 30, 9), (100, 200, 50)])
def test_centres_are_those_of_rounds_that_compare_all_distances(columns, count, rounds, monkeypatch):
    # Cells are as far from one centre as from another very often.
    cells = np.array([(x, y) for x in range(columns) for y in range(columns // 2)], float)
    mass = rng(5).uniform(0, 1, len(cells))
    mass[: columns // 2] = 0.0
    monkeypatch.setattr(clusters, "LLOYD_ROUNDS", 0)
    centres = KMeans(cells, rng(1), mass).centres(count)
    for _ in range(rounds):
        moved = lloyd(cells, mass, centres)
        if (np.abs(moved - centres) <= 1e-9 + 1e-5 * np.abs(centres)).all():
            break
        centres = moved
    monkeypatch.setattr(clusters, "LLOYD_ROUNDS", rounds)
    np.testing.assert_array_equal(KMeans(cells, rng(1), mass).centres(count), centres)
