"""Stops spread over a field: k-means of its cells, each with a mass that attracts stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LLOYD_ROUNDS = 50
"""Maximum number of rounds of the k-means."""


def k_means(xy: Array, count: int, rng: np.random.Generator, mass: Array | None = None) -> Array:
    """Centres of clusters of places, shape (count, 2) [m]; Lloyd's algorithm with a k-means++ start.

    :param xy: places, shape (g, 2) [m]
    :param count: number of clusters, >= 1; limited to the number of different places
    :param rng: random numbers for the start
    :param mass: weight of each place, shape (g,), >= 0; equal ones if ``None`` or all are 0
    """
    if mass is None or not mass.any():
        mass = np.ones(len(xy))
        centres = xy[[int(rng.integers(len(xy)))]]
    else:
        centres = xy[[int(rng.choice(len(xy), p=mass / mass.sum()))]]
    square = squares(xy, centres)[:, 0]
    while len(centres) < count and (share := mass * square).any():
        centre = xy[int(rng.choice(len(xy), p=share / share.sum()))]
        centres = np.vstack([centres, centre])
        square = np.minimum(square, squares(xy, centres[-1:])[:, 0])
    for _ in range(LLOYD_ROUNDS):
        moved = lloyd(xy, mass, centres)
        if np.allclose(moved, centres, atol=1e-9):
            break
        centres = moved
    return np.asarray(centres)


def lloyd(xy: Array, mass: Array, centres: Array) -> Array:
    """Centres, shape (k, 2) [m], moved to the middle of the mass that is nearest to them.

    :param xy: places, shape (g, 2) [m]
    :param mass: weight of each place, shape (g,)
    """
    from scipy.spatial import KDTree

    _, owner = KDTree(centres).query(xy)
    total = np.bincount(owner, mass, len(centres))
    sums = np.column_stack([np.bincount(owner, mass * axis, len(centres)) for axis in xy.T])
    return np.where(total[:, None] > 0, sums / np.where(total > 0, total, 1.0)[:, None], centres)


def squares(xy: Array, centres: Array) -> Array:
    """Squared distances of places to centres, shape (g, k) [m^2]."""
    return np.asarray(((xy[:, None, :] - centres) ** 2).sum(axis=2))
