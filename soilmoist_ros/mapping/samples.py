# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples: counts and exposures at places, checked; joined at exactly one place, or with neighbours in pools.

A record that was counted while driving, or over a footprint, is a mean over an area: its *spread*. Of the path
only the covariance matrix (sxx, sxy, syy) [m^2] of a place drawn from it is kept: a straight path of length l
along the unit vector u has l^2/12 u u', and independent paths add up. Of the footprint the radius [m] is kept, the
fourth column: its shape is published (:mod:`soilmoist_ros.sensing.moisture.footprint`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import floats

Array = NDArray[np.float64]

MIN_SPREAD_M2 = 1.0
"""Spreads with a smaller trace count as points: the noise of positions makes as much where a robot stands."""
_TINY_M2 = 1e-12
"""Rounding allowed in the moments of a spread: of tiny lengths, one product may vanish and another not."""
_COLUMNS = ("xy", "counts", "exposure_s", "spread")


def path_spread(along_m: ArrayLike) -> Array:
    """Spread of counts gathered evenly along straight paths."""
    x, y = np.moveaxis(np.asarray(along_m, float), -1, 0)
    return np.stack([x * x, x * y, y * y, 0 * x], axis=-1) / 12


def footprint_spread(radius_m: float) -> Array:
    """Spread of a footprint that sends 86 % of the counts from within a radius.

    :param radius_m: radius [m], >= 0; 0 for a sensor that sees its own place only
    :raises ValueError: if the radius is negative or not finite
    """
    if not (np.isfinite(radius_m) and radius_m >= 0):
        raise ValueError(f"the radius of a footprint must be >= 0 and finite, got {radius_m}")
    return np.array([0.0, 0.0, 0.0, radius_m])


def full_spread(moments: ArrayLike, radius_m: float = 0.0) -> Array:
    """Spreads with four columns, from second moments of paths, shape (..., 3) [m^2], and a radius [m]."""
    path = np.asarray(moments, float)
    return np.concatenate([path, np.full((*path.shape[:-1], 1), radius_m)], axis=-1)


def without_noise(spread: Array) -> Array:
    """Spreads of shape (n, 4) with the paths set to zero that :data:`MIN_SPREAD_M2` takes for noise."""
    moves = (spread[:, 0] + spread[:, 2] >= MIN_SPREAD_M2)[:, None]
    return np.where(moves | (np.arange(spread.shape[1]) > 2), spread, 0.0)


# -- Samples -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Neutron counts at places; ``counts ~ Poisson(rate * exposure_s)`` at each.

    The arrays are copied, checked and made read-only.

    :param xy: places, shape (n, 2) [m]; a single place may be given as (x, y)
    :param exposure_s: *effective* exposure, which makes ``counts / exposure_s`` the corrected rate, > 0,
        shape (n,) [s]
    :param spread: second moments (sxx, sxy, syy) [m^2] of the path along which each was counted and the radius
        [m] of the footprint, shape (n, 4) or (4,) for all, zero for a point; without a footprint (n, 3) or (3,)
        will do. See :mod:`.samples`
    :raises ValueError: if the shapes do not agree, or a value is masked or out of range; names the first offender

    >>> Samples([(0, 0), (10, 0)], counts=[310, 295], exposure_s=[100.0, 100.0])
    Samples(2 of 200 s and 605 counts in all)
    """

    xy: Array
    counts: Array
    exposure_s: Array
    spread: Array = field(default_factory=lambda: np.zeros(4))

    def __post_init__(self) -> None:
        xy = check_xy(self.xy)
        counts, exposure_s = (np.array(floats(values), ndmin=1) for values in (self.counts, self.exposure_s))
        for name, values in (("counts", counts), ("exposure_s", exposure_s)):
            if values.shape != (len(xy),):
                raise ValueError(f"{name} must have shape ({len(xy)},) like xy, got {values.shape}")
        whole = np.isfinite(counts) & (counts >= 0) & (counts == np.rint(counts))
        _refuse(~whole, counts, "counts must be whole numbers >= 0")
        _refuse(~(np.isfinite(exposure_s) & (exposure_s > 0)), exposure_s, "exposure_s must be > 0 and finite")
        spread = _check_spread(self.spread, len(xy))
        for name, values in (("xy", xy), ("counts", counts), ("exposure_s", exposure_s), ("spread", spread)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.counts)

    def __repr__(self) -> str:
        return f"Samples({len(self)} of {self.exposure_s.sum():g} s and {self.counts.sum():g} counts in all)"

    @classmethod
    def none(cls) -> Samples:
        """No samples at all."""
        return NO_SAMPLES

    @property
    def merged(self) -> Samples:
        """One sample for each distinct place, in the order of first appearance."""
        return merge_exactly(self)[0]

    @cached_property
    def without_footprint(self) -> Samples:
        """Copy of these samples, as if the sensor saw its own place only."""
        return replace(self, spread=self.spread * [1, 1, 1, 0]) if self.spread[:, 3].any() else self

    def joined(self, more: Samples) -> Samples:
        """Copy of these samples with more samples behind them."""
        return Samples(*(np.concatenate([getattr(self, name), getattr(more, name)]) for name in _COLUMNS))

    def some(self, numbers: NDArray[np.intp] | slice) -> Samples:
        """Samples with these numbers, in their order."""
        return Samples(*(getattr(self, name)[numbers] for name in _COLUMNS))

    @property
    def rate_cps(self) -> Array:
        """Count rate of each sample [counts/s]."""
        return self.counts / self.exposure_s

    @property
    def mean_rate_cps(self) -> float:
        """Mean count rate m* = sum of counts / sum of exposures [counts/s]; NaN without samples."""
        return float(self.counts.sum() / self.exposure_s.sum()) if len(self) else float("nan")


def good_samples(xy: Array, counts: Array, exposure_s: Array, spread: Array) -> Samples:
    """:class:`Samples` of new arrays that are known to be good: neither copied nor checked."""
    samples = object.__new__(Samples)
    for name, values in (("xy", xy), ("counts", counts), ("exposure_s", exposure_s), ("spread", spread)):
        values.setflags(write=False)
        object.__setattr__(samples, name, values)
    return samples


def as_samples(
    xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike, spread: ArrayLike | None = None
) -> Samples:
    """:class:`Samples` of anything that numpy takes for arrays; points without a spread."""
    moments = np.zeros(4) if spread is None else np.asanyarray(spread, float)
    places, numbers, times_s = (np.asanyarray(values, float) for values in (xy, counts, exposure_s))
    return Samples(places, numbers, times_s, moments)


def check_xy(xy: ArrayLike) -> Array:
    """Places as a new float array of shape (n, 2); (x, y) is one. ``ValueError`` if one is not finite."""
    places = np.array(floats(xy))
    if places.shape in ((2,), (0,)):
        places = places.reshape(-1, 2)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ValueError(f"xy must have shape (n, 2), got {places.shape}")
    _refuse(~np.asarray(np.isfinite(places).all(axis=1)), places, "xy must be finite")
    return places + 0.0  # -0.0 and 0.0 are the same place


def _check_spread(spread: ArrayLike, n: int) -> Array:
    """Spreads as a new array of shape (n, 4); covariance matrices but for the rounding of 32 bits."""
    moments = np.array(floats(spread))
    if moments.shape not in ((3,), (4,), (n, 3), (n, 4)):
        raise ValueError(f"spread must have shape ({n}, 4) or (4,), got {moments.shape}")
    if moments.shape[-1] == 3:
        moments = full_spread(moments)
    if not moments.any():
        return np.zeros((n, 4))
    if moments.shape == (4,):
        moments = np.tile(moments, (n, 1))
    xx, xy, yy, radius_m = moments.T
    finite = np.isfinite(moments).all(axis=1) & (radius_m >= 0)
    rounding = 1e-6 * (xx + yy) + _TINY_M2
    possible = finite & (xx >= 0) & (yy >= 0) & (np.abs(xy) <= np.sqrt(np.abs(xx * yy)) + rounding)
    _refuse(~possible, moments, "spread must be the second moments (sxx, sxy, syy) of a path, and a radius")
    return moments


def noise_rate(samples: Samples) -> float:
    """Mean rate m* for the Poisson noise ``m* / exposure`` [counts/s], never zero.

    It is ``sum(counts) / sum(exposure_s)``. Where nothing at all was counted that would claim a noiseless
    measurement, so half a count is put in: the mean of Jeffreys' posterior of a Poisson rate.
    """
    return float((samples.counts.sum() or 0.5) / samples.exposure_s.sum())


def merge_exactly(samples: Samples) -> tuple[Samples, NDArray[np.intp]]:
    """Merge the records of each place: counts add, exposures add. Loses nothing.

    :returns: a sample of each place, in the order of first appearance; the place of each record, shape (n,)
    """
    order = np.lexsort(samples.xy.T)  # quicker than np.unique, and mostly there is nothing to merge
    sorted_xy = samples.xy[order]
    if (sorted_xy[1:] != sorted_xy[:-1]).any(axis=1).all():
        return samples, np.arange(len(samples))
    _, first, place = np.unique(samples.xy, axis=0, return_index=True, return_inverse=True)
    rank = np.empty_like(first)
    rank[np.argsort(first)] = np.arange(len(first))
    place = rank[place.reshape(-1)]
    counts = np.bincount(place, samples.counts, len(first))
    exposure_s = np.bincount(place, samples.exposure_s, len(first))
    spread = _mean_spread(samples, place) if samples.spread.any() else None
    return as_samples(samples.xy[np.sort(first)], counts, exposure_s, spread), place


def _mean_spread(samples: Samples, group: NDArray[np.intp]) -> Array:
    """Exposure-weighted mean of the spreads of each group, shape (groups, 4)."""
    share = samples.exposure_s / np.bincount(group, samples.exposure_s)[group]
    return np.column_stack([np.bincount(group, share * samples.spread[:, k]) for k in range(4)])


def _refuse(bad: NDArray[np.bool_], values: Array, rule: str) -> None:
    if np.count_nonzero(bad):  # quicker than any(), and asked several times of every map
        index = int(np.argmax(bad))
        raise ValueError(f"{rule}, got {values[index]} at index {index}")


NO_SAMPLES = Samples(np.empty((0, 2)), np.empty(0), np.empty(0))


# -- Surveys -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Surveys:
    """Samples of surveys whose rates have one variogram.

    :param effects: known further structure E of each survey, shapes (n, k) [counts/s], such as covariates times
        the standard deviations of their effects: its rates have the covariance ``E E'`` in addition; ``None``
        for none
    """

    samples: tuple[Samples, ...]  # samples of each survey at distinct places; the present survey comes first
    effects: tuple[Array, ...] | None = None

    def __len__(self) -> int:
        return sum(map(len, self.samples))

    @property
    def places(self) -> Samples:
        """Samples of all surveys, one after the other."""
        joined = self.samples[0]
        for more in self.samples[1:]:
            joined = joined.joined(more)
        return joined

    @property
    def starts(self) -> list[int]:
        """Number of the first sample of each survey among all."""
        return [sum(map(len, self.samples[:number])) for number in range(len(self.samples))]

    @property
    def noise(self) -> Array:
        """Poisson variance of each rate, from the mean rate of its survey, shape (n,) [(counts/s)^2]."""
        return np.concatenate([noise_rate(one) / one.exposure_s for one in self.samples])

    def thinned(self, most: int) -> Surveys:
        """Places of each survey as points, evenly from its first to its last, about ``most`` in all."""
        share = min(1.0, most / len(self))
        parts = [
            np.linspace(0, len(one) - 1, max(round(share * len(one)), 1)).astype(np.intp) for one in self.samples
        ]
        samples = tuple(
            Samples(one.xy[some], one.counts[some], one.exposure_s[some])
            for one, some in zip(self.samples, parts, strict=True)
        )
        if self.effects is None:
            return Surveys(samples)
        return Surveys(samples, tuple(one[some] for one, some in zip(self.effects, parts, strict=True)))


# -- Pools ---------------------------------------------------------------------------------------------------


def spatial_blocks(xy: Array, one_block: int, size: int) -> list[NDArray[np.intp]]:
    """Disjoint compact blocks of places, halved across the wider side until no block exceeds ``size``."""
    if len(xy) <= one_block:
        return [np.arange(len(xy))]
    blocks, todo = [], [np.arange(len(xy))]
    while todo:
        block = todo.pop()
        if len(block) <= size:
            blocks.append(block)
            continue
        axis = int(np.argmax(np.ptp(xy[block], axis=0)))
        block = block[np.lexsort((xy[block, 1 - axis], xy[block, axis]))]
        todo += [block[len(block) // 2 :], block[: len(block) // 2]]
    return blocks


def pooled(samples: Samples, most: int) -> Samples:
    """The samples, or at most ``most`` pools of neighbours, each with the area over which it was counted."""
    if len(samples) <= most:
        return samples
    pool = np.empty(len(samples), int)
    for number, block in enumerate(spatial_blocks(samples.xy, 0, -(-2 * len(samples) // most))):
        pool[block] = number

    def summed(values: Array) -> Array:
        return np.stack([np.bincount(pool, column) for column in np.atleast_2d(values.T)], axis=-1).astype(float)

    counts, exposure_s = summed(samples.counts)[:, 0], summed(samples.exposure_s)[:, 0]
    weight = samples.exposure_s / exposure_s[pool]
    centre = summed(samples.xy * weight[:, None])
    x, y = (samples.xy - centre[pool]).T
    spread = summed((samples.spread + full_spread(np.column_stack([x * x, x * y, y * y]))) * weight[:, None])
    return Samples(centre, counts, exposure_s, without_noise(spread))
