# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples merged on all scales: near samples stay single, far ones form groups.

The tree of Barnes & Hut (1986), Nature 324:446-449, over counts instead of masses. A group is one sample with all
counts and the whole exposure of its members, at their exposure-weighted mean place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples import Samples

Array = NDArray[np.float64]

_BITS = 20
"""Halvings of the square around the samples; places closer together than its side / 2^20 are parted at once."""


class Neighbourhood(NamedTuple):
    """Samples around a rectangle, the far ones merged.

    :param xy: places, shape (m, 2) [m]
    :param rate: corrected rates, shape (m,) [counts/s]
    :param exposure_s: effective exposures, shape (m,) [s]
    :param spread: second moments of the areas of those that are not merged, shape (m, 4)
    """

    xy: Array
    rate: Array
    exposure_s: Array
    spread: Array


class _Level(NamedTuple):
    """Groups of one size in the order along the curve; the children of group i are those from first[i] on."""

    xy: Array
    counts: Array
    exposure_s: Array
    spread: Array
    low: Array
    high: Array
    first: NDArray[np.intp]


class SampleTree:
    """A quadtree of merged samples.

    :param places: samples at distinct places, at least one

    Attributes
    ----------
    low_m : ndarray
        south-west corner of the square around all samples [m]
    side_m : float
        its side [m]
    """

    def __init__(self, places: Samples) -> None:
        from scipy.spatial import cKDTree

        self.low_m = places.xy.min(axis=0)
        self.side_m = float(np.ptp(places.xy, axis=0).max()) or 1.0
        cell = ((places.xy - self.low_m) / self.side_m * 2**_BITS).astype(np.uint64)
        code = _interleaved(*np.minimum(cell, np.uint64(2**_BITS - 1)).T)
        order = np.argsort(code, kind="stable")
        code, xy = code[order], places.xy[order]
        counts, exposure_s = places.counts[order], places.exposure_s[order]
        levels = [_Level(xy, counts, exposure_s, places.spread[order], xy, xy, np.arange(len(xy)))]
        for bits in range(2 * _BITS, -1, -2):
            _, first = np.unique(code, return_index=True)
            if len(first) < len(levels[-1].counts) or bits == 0:
                levels.append(_merged(levels[-1], first))
                code = code[first]
            code >>= np.uint64(2)
        self._levels = levels
        self._index = cKDTree(xy)

    def __len__(self) -> int:
        return len(self._levels[0].counts)

    def margin_m(self, low: Array, high: Array, nearest: int) -> float:
        """Width of a margin around a rectangle that contains at most a number of samples [m].

        :param low: south-west corner of the rectangle, shape (2,) [m]
        :param high: north-east corner [m]
        :param nearest: number of samples
        :returns: infinity if there are no more samples at all, negative if the rectangle itself may hold more
        """
        if nearest >= len(self):
            return np.inf
        radius_m = self._index.query((low + high) / 2, [nearest])[0].item()
        return float(radius_m - np.hypot(*(high - low)) / 2)

    def neighbourhood(
        self, low: Array, high: Array, margin_m: float, reach_m: float, opening: float
    ) -> Neighbourhood:
        """Single samples within a margin around a rectangle, and groups that look small from the rectangle beyond.

        :param low: south-west corner of the rectangle, shape (2,) [m]
        :param high: north-east corner [m]
        :param margin_m: distance from the rectangle up to which nothing is merged [m]
        :param reach_m: distance from which on samples are left out [m]
        :param opening: largest width of a group over its distance from the rectangle, >= 0; 0 merges nothing
        """
        taken: list[tuple[_Level, NDArray[np.intp]]] = []
        group = np.arange(len(self._levels[-1].counts))
        for number in range(len(self._levels) - 1, -1, -1):
            level = self._levels[number]
            gap = np.maximum(np.maximum(low - level.high[group], level.low[group] - high), 0)
            distance = np.hypot(gap[:, 0], gap[:, 1])
            seen = distance <= reach_m
            group, distance = group[seen], distance[seen]
            width = (level.high[group] - level.low[group]).max(axis=1, initial=0)
            whole = (width <= opening * distance) & (distance > margin_m) | (width == 0)
            taken.append((level, group[whole]))
            if number:
                opened = group[~whole]
                end = np.append(level.first[1:], len(self._levels[number - 1].counts))
                group = _ranges(level.first[opened], end[opened])
        columns = [(level.xy, level.counts, level.exposure_s, level.spread) for level, _ in taken]
        xy, counts, exposure_s, spread = (
            np.concatenate([column[group] for column, (_, group) in zip(same, taken, strict=True)])
            for same in zip(*columns, strict=True)
        )
        return Neighbourhood(xy, counts / exposure_s, exposure_s, spread)


def _merged(below: _Level, first: NDArray[np.intp]) -> _Level:
    """Groups of consecutive members, each beginning at an element of ``first``."""
    exposure_s = np.add.reduceat(below.exposure_s, first)
    mean = np.add.reduceat(below.xy * below.exposure_s[:, None], first) / exposure_s[:, None]
    low, high = np.minimum.reduceat(below.low, first), np.maximum.reduceat(below.high, first)
    single = (low == high).all(axis=1, keepdims=True)  # stays exactly where and what it is
    return _Level(
        np.where(single, low, mean),
        np.add.reduceat(below.counts, first),
        exposure_s,
        np.where(single, below.spread[first], 0.0),
        low,
        high,
        first,
    )


def _ranges(start: NDArray[np.intp], end: NDArray[np.intp]) -> NDArray[np.intp]:
    """The numbers from each start up to its end, one range after the other."""
    count = end - start
    return np.repeat(end - np.cumsum(count), count) + np.arange(count.sum())


def _interleaved(x: NDArray[np.uint64], y: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Number of a cell along the Z-shaped curve (Morton order): the bits of x and y in turn."""
    code = np.zeros_like(x)
    for bit in range(_BITS):
        one, place = np.uint64(1), np.uint64(bit)
        code |= ((x >> place) & one) << np.uint64(2 * bit)
        code |= ((y >> place) & one) << np.uint64(2 * bit + 1)
    return code
