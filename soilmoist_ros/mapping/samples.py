"""Samples: counts and exposures at places, checked; and how records become samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_BLOCK_ELEMENTS = 2_000_000
"""Elements of a temporary distance block (16 MB)."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Neutron counts at places; ``counts ~ Poisson(rate * exposure_s)`` at each.

    The arrays are copied, checked and made read-only.

    :param xy: places, shape (n, 2) [m]; a single place may be given as (x, y)
    :param counts: raw counts, whole numbers >= 0, shape (n,)
    :param exposure_s: *effective* exposure, which makes ``counts / exposure_s`` the corrected rate, > 0,
        shape (n,) [s]
    :raises ValueError: if the shapes do not agree or a value is out of range; names the first offender
    """

    xy: Array
    counts: Array
    exposure_s: Array

    def __post_init__(self) -> None:
        xy = check_xy(self.xy)
        counts = np.array(self.counts, float, ndmin=1)
        exposure_s = np.array(self.exposure_s, float, ndmin=1)
        for name, values in (("counts", counts), ("exposure_s", exposure_s)):
            if values.shape != (len(xy),):
                raise ValueError(f"{name} must have shape ({len(xy)},) like xy, got {values.shape}")
        whole = np.isfinite(counts) & (counts >= 0) & (counts == np.rint(counts))
        _refuse(~whole, counts, "counts must be whole numbers >= 0")
        _refuse(~(np.isfinite(exposure_s) & (exposure_s > 0)), exposure_s, "exposure_s must be > 0 and finite")
        for name, values in (("xy", xy), ("counts", counts), ("exposure_s", exposure_s)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def rate_cps(self) -> Array:
        """Count rate of each sample [counts/s]."""
        return self.counts / self.exposure_s

    @property
    def rate_sd_cps(self) -> Array:
        """Poisson standard error of each rate, ``sqrt(counts) / exposure`` [counts/s]; 0 for no counts."""
        return np.sqrt(self.counts) / self.exposure_s

    @property
    def mean_rate_cps(self) -> float:
        """Mean count rate m* = sum of counts / sum of exposures [counts/s]; NaN without samples."""
        return float(self.counts.sum() / self.exposure_s.sum()) if len(self) else float("nan")


def as_samples(xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike) -> Samples:
    """:class:`Samples` of anything that numpy takes for arrays."""
    return Samples(np.asarray(xy, float), np.asarray(counts, float), np.asarray(exposure_s, float))


def check_xy(xy: ArrayLike) -> Array:
    """Places as a new float array of shape (n, 2); (x, y) is taken as one place.

    :raises ValueError: for another shape or a coordinate that is not finite
    """
    places = np.array(xy, float)
    if places.shape in ((2,), (0,)):
        places = places.reshape(-1, 2)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ValueError(f"xy must have shape (n, 2), got {places.shape}")
    _refuse(~np.isfinite(places).all(axis=1), places, "xy must be finite")
    return places + 0.0  # -0.0 and 0.0 are the same place


def noise_rate(samples: Samples) -> float:
    """Mean rate m* for the Poisson noise ``m* / exposure`` [counts/s], never zero.

    It is ``sum(counts) / sum(exposure_s)``. Where nothing at all was counted that would claim a noiseless
    measurement, so half a count is put in: the mean of Jeffreys' posterior of a Poisson rate.
    """
    return float((samples.counts.sum() or 0.5) / samples.exposure_s.sum())


def merge_exactly(samples: Samples) -> tuple[Samples, NDArray[np.intp]]:
    """Merge the records of each place: counts add, exposures add. Loses nothing.

    :returns: one sample per distinct place, in the order of first appearance; and the number of the
        place of each record, shape (n,)
    """
    _, first, place = np.unique(samples.xy, axis=0, return_index=True, return_inverse=True)
    rank = np.empty_like(first)
    rank[np.argsort(first)] = np.arange(len(first))
    place = rank[place.reshape(-1)]
    counts = np.bincount(place, samples.counts, len(first))
    exposure_s = np.bincount(place, samples.exposure_s, len(first))
    return as_samples(samples.xy[np.sort(first)], counts, exposure_s), place


def merge_records(xy: ArrayLike, counts: ArrayLike, exposure_s: ArrayLike, radius_m: float = 0.0) -> Samples:
    """Merge records into samples; the total counts and the total exposure are conserved.

    With ``radius_m = 0`` only records at exactly one place merge, which changes no estimate. With a radius,
    records of a stop whose positions jitter become one sample:

    1. The place with the longest exposure within the radius is a centre, and the places within the radius
       of it are settled; the next centre is chosen likewise among those left, until none is.
    2. Each record joins the nearest centre. A sample lies at the exposure-weighted mean of its records.

    Records of one sample are never more than two radii apart, so a chain of records taken while driving
    becomes a chain of samples. The rule depends on the records only, not on their order. The cost is
    quadratic in the number of places (about two seconds for 10^4).

    :param xy: places of the records, shape (n, 2) [m]
    :param counts: raw counts, shape (n,)
    :param exposure_s: effective exposure, shape (n,) [s]
    :param radius_m: radius of a stop [m], >= 0; keep it well below the sensor's footprint
    :returns: samples in the order of their first record
    :raises ValueError: as :class:`Samples`, or if the radius is negative or not finite
    """
    if not (np.isfinite(radius_m) and radius_m >= 0):
        raise ValueError(f"radius_m must be >= 0 and finite, got {radius_m}")
    places, _ = merge_exactly(as_samples(xy, counts, exposure_s))
    if radius_m == 0 or len(places) < 2:
        return places
    centres = _centres(places, radius_m)
    group = _nearest(places.xy, places.xy[centres])
    return _join(places, group)


def _centres(places: Samples, radius_m: float) -> NDArray[np.intp]:
    """Numbers of the places that become centres of stops, the longest exposures first."""
    from scipy.spatial.distance import cdist

    n = len(places)
    within = np.empty(n)
    for rows in _row_blocks(n, n):
        within[rows] = (cdist(places.xy[rows], places.xy) <= radius_m) @ places.exposure_s
    ranking = np.lexsort((places.xy[:, 1], places.xy[:, 0], -within))
    free = np.ones(n, bool)
    centres = []
    for candidate in ranking:
        if free[candidate]:
            centres.append(candidate)
            offset = places.xy - places.xy[candidate]
            free[np.hypot(offset[:, 0], offset[:, 1]) <= radius_m] = False
    return np.array(centres)


def _nearest(xy: Array, centres_xy: Array) -> NDArray[np.intp]:
    """Number of the nearest centre of each place."""
    from scipy.spatial.distance import cdist

    blocks = _row_blocks(len(xy), len(centres_xy))
    return np.concatenate([cdist(xy[rows], centres_xy).argmin(axis=1) for rows in blocks])


def _join(places: Samples, group: NDArray[np.intp]) -> Samples:
    """Samples of groups of places, in the order in which the groups first appear."""
    _, first, group = np.unique(group, return_index=True, return_inverse=True)
    exposure_s = np.bincount(group, places.exposure_s)
    counts = np.bincount(group, places.counts)
    share = places.exposure_s / exposure_s[group]
    xy = np.column_stack([np.bincount(group, share * places.xy[:, axis]) for axis in (0, 1)])
    order = np.argsort(first)
    return as_samples(xy[order], counts[order], exposure_s[order])


def _row_blocks(rows: int, columns: int) -> list[slice]:
    step = max(1, _BLOCK_ELEMENTS // max(columns, 1))
    return [slice(start, min(start + step, rows)) for start in range(0, rows, step)]


def _refuse(bad: NDArray[np.bool_], values: Array, rule: str) -> None:
    if bad.any():
        index = int(np.argmax(bad))
        raise ValueError(f"{rule}, got {values[index]} at index {index}")
