# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stops spread over a field: k-means of its cells, each with a mass that attracts stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.geodesy import squared_distances

Array = NDArray[np.float64]

LLOYD_ROUNDS = 50
"""Maximum number of rounds of the k-means."""
_STILL_M, _STILL = 1e-9, 1e-5
"""Moves, absolute and relative to the coordinate, at which the rounds end."""


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
        for _ in range(LLOYD_ROUNDS):
            moved = lloyd(self._xy, self._mass, centres)
            if (np.abs(moved - centres) <= _STILL_M + _STILL * np.abs(centres)).all():
                break
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
    owner = squared_distances(xy, centres).argmin(axis=1)
    total = np.bincount(owner, mass, len(centres))
    sums = np.column_stack([np.bincount(owner, mass * axis, len(centres)) for axis in xy.T])
    return np.where(total[:, None] > 0, sums / np.where(total > 0, total, 1.0)[:, None], centres)
