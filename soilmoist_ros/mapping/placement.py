# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records outside the field of a map: how far away they are, and why that may be."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import (
    InputError,
    LatLon,
    Mistake,
    coordinates_text,
    direction,
    distance_and_bearing,
    distance_text,
)
from soilmoist_ros.mapping.field import Field

Array = NDArray[np.float64]

PLANE_M = 100_000.0  # distance up to which distances in the plane of the field are used; beyond, geodesics [m]


@dataclass(frozen=True)
class PositionSource:
    """Source of the positions of records, for the advice to users.

    :param longitude: side of Greenwich that the site file gives to a log without signs; ``signed`` if the log or
        receiver has signs
    :param field_file: the field file, ``None`` if unknown
    :param target: what they are compared with, in words; empty for the field by its name
    :param subject: what lies there, with its verb; empty for the number of records
    """

    name: str = "the log"
    longitude: str = "signed"
    field_file: Path | None = None
    target: str = ""
    target_keys: str = "'datum' and boundary in the field file"
    subject: str = ""


_ANY = PositionSource()


@dataclass(frozen=True, eq=False)
class Placement:
    """Placement of records with respect to a field."""

    field: Field  # the field
    latlon: Array  # latitude and longitude of the records, shape (n, 2), n >= 1 [deg]

    @cached_property
    def xy_m(self) -> Array:
        """Places in the plane of the field, shape (n, 2) [m]; NaN on the far side of the earth."""
        return self.field.frame.to_local(self.latlon[:, 0], self.latlon[:, 1])

    @cached_property
    def distances_m(self) -> Array:
        """Distance of each record from the field, shape (n,) [m]; 0 inside, infinite beyond 100 km."""
        import shapely

        near = np.hypot(*self.xy_m.T) < PLANE_M
        found = np.full(len(self.latlon), np.inf)
        found[near] = shapely.distance(shapely.Polygon(self.field.polygon), shapely.points(self.xy_m[near]))
        return found

    @property
    def inside(self) -> int:
        """Number of records inside the boundary."""
        return int(np.count_nonzero(self.distances_m == 0))

    @property
    def nearest_m(self) -> float:
        """Distance of the nearest record from the field [m]."""
        nearest_m = float(self.distances_m.min())
        return nearest_m if math.isfinite(nearest_m) else self.nearest_from_centre[0]

    @cached_property
    def nearest_from_centre(self) -> tuple[float, float]:
        """Distance [m] and bearing [deg] from the centre of the field to the nearest record."""
        index = int(np.argmin(self.distances_m))
        if math.isfinite(self.distances_m[index]):
            return distance_and_bearing(self.field.centre, (self.latlon[index, 0], self.latlon[index, 1]))
        return min(
            distance_and_bearing(self.field.centre, (lat, lon)) for lat, lon in np.unique(self.latlon, axis=0)
        )

    @property
    def middle(self) -> LatLon:
        """Median place of the records."""
        latitude, longitude = np.median(self.latlon, axis=0)
        return float(latitude), float(longitude)

    def words(self, source: PositionSource = _ANY) -> str:
        """Distance of the records from the field: length, direction and bearing."""
        bearing_deg = self.nearest_from_centre[1]
        count = len(self.latlon)
        whose = source.subject or ("the only record lies" if count == 1 else f"all {count} records lie")
        least = "" if count == 1 or self.nearest_m >= PLANE_M else "at least "
        return (
            f"{whose} {least}{distance_text(self.nearest_m)} {direction(bearing_deg)} "
            f"(bearing {bearing_deg:.0f} deg) of {source.target or f'the field {self.field.name!r}'}"
        )


def require_near(field: Field, latlon: ArrayLike, reach_m: float, source: PositionSource) -> Placement | None:
    """Check that records lie within reach of a field.

    :param reach_m: distance from the field at which a record still says something about it [m]
    :returns: where the records lie, ``None`` if none has a place
    :raises InputError: if none lies within reach, with distance, direction and the likely cause
    """
    places = np.asarray(latlon, float).reshape(-1, 2)
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return None
    placement = Placement(field, places)
    if placement.nearest_m > reach_m:
        raise InputError(
            [Mistake(placement.words(source), likely_cause(placement, reach_m, source), source.field_file)]
        )
    return placement


_Move = Callable[[Array, Array], tuple[Array, Array]]


def _from_minutes(degrees: Array) -> Array:
    """Degrees that were written as degrees and minutes: 53.16 for 53 deg 16 min."""
    whole = np.trunc(degrees)
    return np.asarray(whole + (degrees - whole) / 0.6)


def _to_minutes(degrees: Array) -> Array:
    whole = np.trunc(degrees)
    return np.asarray(whole + (degrees - whole) * 0.6)


_CAUSES: tuple[tuple[str, _Move], ...] = (
    ("longitude", lambda lat, lon: (lat, -lon)),
    ("latitude", lambda lat, lon: (-lat, lon)),
    ("swapped", lambda lat, lon: (lon, lat)),
    ("both", lambda lat, lon: (-lat, -lon)),
    ("swapped", lambda lat, lon: (-lon, lat)),
    ("swapped", lambda lat, lon: (lon, -lat)),
    ("swapped", lambda lat, lon: (-lon, -lat)),
    ("minutes", lambda lat, lon: (_from_minutes(lat), _from_minutes(lon))),
    ("minutes", lambda lat, lon: (_to_minutes(lat), _to_minutes(lon))),
)
"""Mistakes in positions, the simple ones first, each with the positions as they should be."""


def likely_cause(placement: Placement, reach_m: float, source: PositionSource) -> str:
    """Advice: the first mistake in the positions without which most records would lie near the field."""
    near_m = reach_m + placement.field.extent_m  # a boundary in metres is not mirrored with its datum
    for code, move in _CAUSES:
        latitude, longitude = move(*placement.latlon.T)
        valid = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180)
        if not valid.any():
            continue
        moved = Placement(placement.field, np.column_stack([latitude, longitude])[valid])
        if 2 * np.count_nonzero(moved.distances_m <= near_m) >= len(placement.latlon):
            return _advice(code, source)
    records, field = (coordinates_text(*place, digits=4) for place in (placement.middle, placement.field.centre))
    return (
        f"give the {'site' if source.target else 'field'} file of this place: {source.name} has records at "
        f"{records}, {source.target or 'the field'} lies at {field}"
    )


def _advice(code: str, source: PositionSource) -> str:
    where, other = f"in {source.name}, or in {source.target_keys}", _OTHER_SIDE.get(source.longitude, "")
    if code == "longitude" and other:
        return f"write 'longitude: {other}' in the site file, or correct the sign in {source.target_keys}"
    both = f" ('longitude: {other}' in the site file)" if other else ""
    return {
        "longitude": f"correct the sign of the longitude, west is negative: {where}",
        "latitude": f"correct the sign of the latitude, south is negative: {where}",
        "both": f"correct the signs of latitude and longitude{both}, south and west are negative: {where}",
        "swapped": f"swap latitude and longitude {where}: 'polygon_lonlat' is [longitude, latitude]",
        "minutes": f"give decimal degrees {where}: there, degrees and minutes are written as degrees "
        "(53.16 for 53 deg 16 min is 53.2667)",
    }[code] + " (so changed, the records lie there)"


_OTHER_SIDE = {"east": "west", "west": "east"}
