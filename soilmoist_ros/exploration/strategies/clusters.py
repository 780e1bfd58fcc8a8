# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stops spread over a field: k-means of its cells, each with a mass that attracts stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LLOYD_ROUNDS = 50
"""Maximum number of rounds of the k-means."""
_STILL_M, _STILL = 1e-9, 1e-5
"""Moves, absolute and relative to the coordinate, at which the rounds end."""
_SURE_M = 1e-6
"""A place has its nearest centre for certain if the next one is farther by more than this."""
_FEW_PAIRS = 50_000
"""Number of pairs of places and centres up to which all distances are faster than a tree."""


class KMeans:
    """Centres of clusters of places; Lloyd's algorithm with a k-means++ start.

    :param xy: places, shape (g, 2) [m]
    :param rng: random numbers for the start
    :param mass: weight of each place, shape (g,), >= 0; equal ones if ``None`` or all are 0
    """

    def __init__(self, xy: Array, rng: np.random.Generator, mass: Array | None = None) -> None:
        has_mass = mass is not None and bool(mass.any())
        self._xy, self._rng = xy, rng
        self._mass = mass if mass is not None and has_mass else np.ones(len(xy))
        first = _drawn(self._mass, rng) if has_mass else int(rng.integers(len(xy)))
        self._start = [first]
        self._square = squared_distances(xy, xy[[first]])[:, 0]

    def centres(self, count: int) -> Array:
        """Centres, shape (count, 2) [m]; any number begins with the same start.

        :param count: number of clusters, >= 1; limited to the number of different places
        """
        while len(self._start) < count and (share := self._mass * self._square).any():
            self._start.append(_drawn(share, self._rng))
            self._square = np.minimum(self._square, squared_distances(self._xy, self._xy[self._start[-1:]])[:, 0])
        centres = self._xy[self._start[:count]]
        owner, lead_m = np.zeros(len(self._xy), np.intp), np.zeros(len(self._xy))
        for _ in range(LLOYD_ROUNDS):
            # Centres that moved less than the lead of the nearest one leave it the nearest (Hamerly 2010).
            open_ = np.flatnonzero(lead_m <= _SURE_M)
            owner[open_], lead_m[open_] = _nearest(self._xy[open_], centres)
            moved = _middles(self._xy, self._mass, owner, centres)
            if (np.abs(moved - centres) <= _STILL_M + _STILL * np.abs(centres)).all():
                break
            away_m = np.hypot(*(moved - centres).T)
            lead_m -= away_m[owner] + away_m.max()
            centres = moved
        return centres


def _drawn(weight: Array, rng: np.random.Generator) -> int:
    """An index drawn in proportion to its weight; that of ``rng.choice``, which checks more."""
    total = np.cumsum(weight / weight.sum())
    return int(np.searchsorted(total / total[-1], rng.random(), side="right"))


def lloyd(xy: Array, mass: Array, centres: Array) -> Array:
    """Centres, shape (k, 2) [m], moved to the middle of the mass that is nearest to them.

    :param xy: places, shape (g, 2) [m]
    :param mass: weight of each place, shape (g,)
    """
    return _middles(xy, mass, squared_distances(xy, centres).argmin(axis=1), centres)


def _nearest(xy: Array, centres: Array) -> tuple[Indices, Array]:
    """Number of the centre nearest to each place, the first of equals, and its lead over the next one [m]."""
    count = len(centres)
    if count > 1 and len(xy) * count > _FEW_PAIRS:
        from scipy.spatial import KDTree

        away_m, numbers = KDTree(centres).query(xy, 2)
        owner, lead_m = np.asarray(numbers[:, 0], np.intp), np.asarray(away_m[:, 1] - away_m[:, 0])
        equal = np.flatnonzero(lead_m <= _SURE_M)
        owner[equal] = squared_distances(xy[equal], centres).argmin(axis=1)
        return owner, lead_m
    square = squared_distances(xy, centres)
    owner, places = square.argmin(axis=1), np.arange(len(xy))
    nearest_m = np.sqrt(square[places, owner])
    square[places, owner] = np.inf
    return owner, np.sqrt(square.min(axis=1)) - nearest_m


def _middles(xy: Array, mass: Array, owner: Indices, centres: Array) -> Array:
    """Middle of the mass of each centre's places; a centre without mass stays."""
    total = np.bincount(owner, mass, len(centres))
    sums = np.column_stack([np.bincount(owner, mass * axis, len(centres)) for axis in xy.T])
    return np.where(total[:, None] > 0, sums / np.where(total > 0, total, 1.0)[:, None], centres)
