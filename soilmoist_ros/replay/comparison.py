"""Whether a replayed map is the one that the mapper had made on line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field_map import FieldMap, MapState
from soilmoist_ros.mapping.soil_map import SoilMap
from soilmoist_ros.recording.bag.point_cloud import points
from soilmoist_ros.replay.topics import CLOUD, RunTopics

_BANDS = ("rate", "rate_sd", "vwc", "vwc_sd")
_ROUNDING = 1e-4
"""Relative difference below which a map is taken for one of other rounding."""


@dataclass(frozen=True, eq=False)
class OnLine:
    """The last map that the mapper published.

    :param stamp_s: end of the last record in it [s since 1970-01-01 UTC]; 0 without records
    :param cells: its cells, shape (ny, nx)
    :param raw_counts: counts of all records in it, ``None`` if the bag does not tell
    :param was_reset: whether an empty map came after another one
    """

    stamp_s: float
    cells: NDArray[Any]
    raw_counts: float | None
    was_reset: bool


def read_on_line(topics: RunTopics) -> OnLine | None:
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
    return OnLine(_stamp_s(last), cells, raw_counts, was_reset)


def compare(online: FieldMap, states: Sequence[MapState], last: OnLine | None) -> tuple[bool | None, str]:
    """Whether the map of the same records is the same, bit for bit, and that in words.

    Recorder and mapper begin and end at their own times, so the maps compared are those up to the last record
    of the map on line. ``None`` if that was not made of the records in the bag.

    :param online: settings, and all that makes maps
    :param states: states after each record
    :param last: the last map on line
    """
    if last is None:
        return None, "not compared: the bag has no map"
    if last.stamp_s == 0:
        return None, "not compared: the robot's last map is empty" + (", it was reset" if last.was_reset else "")
    same_time = [
        state
        for state, later in zip(states, [*states[1:], None], strict=True)
        if state.stamp_s == last.stamp_s and (later is None or later.stamp_s != last.stamp_s)
    ]
    if not same_time:
        return None, "not compared: the robot's last map ends with a record that is not in the bag"
    alike = [state for state in same_time if last.raw_counts in (None, float(state.samples.counts.sum()))]
    if not alike or (last.was_reset and last.raw_counts is None):
        return None, (
            "not compared: the robot's last map was made of other records than those in the bag up to then "
            "(it was reset, or began before the recording)"
        )
    return _same(online.compute(alike[-1]), last.cells)


def _same(soil_map: SoilMap | None, cells: NDArray[Any]) -> tuple[bool, str]:
    differs = "differs from the robot's last one: "
    if any(name not in (cells.dtype.names or ()) for name in _BANDS):
        return False, f"{differs}that lacks bands"
    shape = np.shape(cells) if soil_map is None else soil_map.rate.shape
    if shape != cells.shape:
        return False, f"{differs}it has {shape[0]} x {shape[1]} cells, not {cells.shape[0]} x {cells.shape[1]}"
    largest = 0.0
    for name in _BANDS:
        there = cells[name]
        here = np.full(shape, np.nan) if soil_map is None else np.asarray(getattr(soil_map, name))
        here = here.astype(there.dtype)
        if not np.array_equal(np.isnan(here), np.isnan(there)):
            return False, f"{differs}other cells have a {name}"
        known = ~np.isnan(there)
        if known.any():
            error = np.abs(here[known].astype(float) - there[known])
            largest = max(largest, float(error.max()) / max(float(np.abs(there[known]).max()), 1e-30))
    if largest == 0:
        return True, "equals the robot's last one, bit for bit"
    why = ": rounding, as on another processor or with more threads" if largest < _ROUNDING else ""
    return False, f"{differs}by up to {largest:.1e} of its largest values{why}"


def _raw_counts(topics: RunTopics, stamp_s: float) -> float | None:
    """Counts of all samples that belong to the map of this time."""
    name = topics.find("samples", CLOUD)
    found = None
    for message in topics.reader.messages([name]) if name else ():
        cloud = topics.reader.decode(message)
        if _stamp_s(cloud) == stamp_s:
            found = float(points(cloud)["raw_counts"].sum())
    return found


def _stamp_s(cloud: Any) -> float:
    return float(cloud.header.stamp.sec + cloud.header.stamp.nanosec * 1e-9)
