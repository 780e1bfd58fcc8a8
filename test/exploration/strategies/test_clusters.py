# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.exploration.strategies import route as clusters
from soilmoist_ros.exploration.strategies.route import KMeans, lloyd


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


def test_a_centre_moves_to_the_middle_of_its_mass_and_stays_without_any():
    cells = np.array([[0.0, 0.0], [4.0, 0.0], [100.0, 0.0]])
    moved = lloyd(cells, np.array([3.0, 1.0, 0.0]), np.array([[2.0, 0.0], [90.0, 0.0]]))
    np.testing.assert_allclose(moved, [[1.0, 0.0], [90.0, 0.0]])


def test_more_centres_begin_with_the_same_start():
    cells = rng(3).uniform(0, 50, (300, 2))
    found = KMeans(cells, rng(1))
    for count in (20, 5, 30):
        np.testing.assert_array_equal(found.centres(count), KMeans(cells, rng(1)).centres(count))


@pytest.mark.parametrize(("columns", "count"), [(20, 1), (20, 30), (100, 30), (100, 200)])
@pytest.mark.parametrize("rounds", [1, 2, 9, 50])
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
