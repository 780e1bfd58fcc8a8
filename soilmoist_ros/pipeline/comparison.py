# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compares a replayed map with the map that the mapper published."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import FieldMap, MapState, SoilMap
from soilmoist_ros.pipeline.topics import CLOUD, RunTopics
from soilmoist_ros.recording import points

_OF_RATE = ("rate", "rate_sd")
_OF_MOISTURE = ("vwc", "vwc_sd", "vwc_p05", "vwc_p95")
"""Compared if the map has all of them: in earlier versions moisture had no limits and no quantiles."""
_ROUNDING = 1e-4
"""Relative difference below which maps differ only by rounding."""


@dataclass(frozen=True, eq=False)
class PublishedMap:
    """The last map that the mapper published.

    :param stamp_s: end of the last record in it [s since 1970-01-01 UTC]; 0 without records
    :param cells: its cells, shape (ny, nx)
    :param raw_counts: counts of all records in it, ``None`` if the bag has no samples of that time
    :param was_reset: whether an empty map came after another one
    """

    stamp_s: float
    cells: NDArray[Any]
    raw_counts: float | None
    was_reset: bool


@dataclass(frozen=True)
class Comparison:
    """Comparison of a replayed map with the last map that its mapper published.

    :param same: whether the maps are equal, bit for bit; ``None`` if they were not compared
    :param message: result and reason, for people
    :param difference: largest difference as a share of the largest value of its band; NaN if there are no
        values to compare
    """

    same: bool | None
    message: str
    difference: float = math.nan

    @property
    def is_rounding(self) -> bool:
        """Whether the maps differ at most by rounding, as on another processor."""
        return self.difference < _ROUNDING


def read_published_map(topics: RunTopics) -> PublishedMap | None:
    """The last map in a bag, ``None`` if there is none.

    :raises InputError: if it cannot be read
    """
    name = topics.find("soil_map", CLOUD)
    if name is None:
        return None
    reader = topics.reader
    last, mapped, was_reset = None, False, False
    for message in reader.messages([name]):
        last = reader.decode(message)
        empty = _stamp_s(last) == 0
        was_reset |= empty and mapped
        mapped |= not empty
    if last is None:
        return None
    try:
        cells = points(last)
        raw_counts = _raw_counts(topics, _stamp_s(last))
    except (KeyError, ValueError) as error:
        raise InputError(f"{name}: {error}", "was it recorded by soilmoist_ros?", reader.path) from None
    return PublishedMap(_stamp_s(last), cells, raw_counts, was_reset)


def compare(
    field_map: FieldMap, states: Sequence[MapState], last: PublishedMap | None, several: bool = False
) -> Comparison:
    """Compare the replayed map with the last published map.

    Recorder and mapper begin and end at different times, so the replayed map uses the records up to the last
    record of the published map.

    :param field_map: makes the maps
    :param states: states after each record
    :param last: the last published map
    :param several: whether several robots sent the records; mapper and recorder may receive them in different
        orders
    """
    if last is None:
        return Comparison(None, "not compared: the bag has no map")
    if last.stamp_s == 0:
        reset = ", it was reset" if last.was_reset else ""
        return Comparison(None, f"not compared: the robot's last map is empty{reset}")
    # Records of several robots may have the same stamp; the counts say how many of these are in the map.
    same_time = [state for state in states if state.stamp_s == last.stamp_s]
    if not same_time:
        return Comparison(None, "not compared: the robot's last map ends with a record that is not in the bag")
    alike = [state for state in same_time if last.raw_counts in (None, float(state.samples.counts.sum()))]
    if not alike or (last.was_reset and last.raw_counts is None):
        return Comparison(
            None,
            "not compared: the robot's last map was made of other records than those in the bag up to then "
            "(it was reset, or began before the recording)",
        )
    return _compare_bands(field_map.compute(alike[-1]), last.cells, several)


def _compare_bands(soil_map: SoilMap | None, cells: NDArray[Any], several: bool) -> Comparison:
    differs = "differs from the robot's last one: "
    known_bands = cells.dtype.names or ()
    if any(name not in known_bands for name in _OF_RATE):
        return Comparison(False, f"{differs}that lacks bands")
    shape = np.shape(cells) if soil_map is None else soil_map.rate.shape
    if shape != cells.shape:
        sizes = f"it has {shape[0]} x {shape[1]} cells, not {cells.shape[0]} x {cells.shape[1]}"
        return Comparison(False, f"{differs}{sizes}")
    largest = 0.0
    moisture = all(name in known_bands for name in _OF_MOISTURE)
    for name in (*_OF_RATE, *_OF_MOISTURE) if moisture else _OF_RATE:
        there = cells[name]
        here = np.full(shape, np.nan) if soil_map is None else np.asarray(getattr(soil_map, name))
        here = here.astype(there.dtype)
        if not np.array_equal(np.isnan(here), np.isnan(there)):
            return Comparison(False, f"{differs}other cells have a {name}")
        known = ~np.isnan(there)
        if known.any():
            error = np.abs(here[known].astype(float) - there[known])
            largest = max(largest, float(error.max()) / max(float(np.abs(there[known]).max()), 1e-30))
    if largest == 0:
        return Comparison(True, "equals the robot's last one, bit for bit", 0.0)
    why = ""
    if largest < _ROUNDING:
        why = ": rounding, as on another processor or with more threads"
    elif several:
        why = ": records of several robots reach mapper and recorder in different orders"
    return Comparison(False, f"{differs}by up to {largest:.1e} of its largest values{why}", largest)


def _raw_counts(topics: RunTopics, stamp_s: float) -> float | None:
    """Counts of all samples in the map of this time."""
    name = topics.find("samples", CLOUD)
    found = None
    for message in topics.reader.messages([name]) if name else ():
        cloud = topics.reader.decode(message)
        if _stamp_s(cloud) == stamp_s:
            found = float(points(cloud)["raw_counts"].sum())
    return found


def _stamp_s(cloud: Any) -> float:
    return float(cloud.header.stamp.sec + cloud.header.stamp.nanosec * 1e-9)
