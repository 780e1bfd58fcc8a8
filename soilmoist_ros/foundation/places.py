# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places, sizes and durations in words: coordinates, distance, direction, and the nearest town of a gazetteer."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LatLon, LocalFrame, distance_and_bearing
from soilmoist_ros.foundation.lazy import optional_module

_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
_SAME_DATUM_M = 0.05
"""Datums this close are the same one, written with fewer digits [m]."""
_NEAR_M = 30_000.0
"""Distance up to which a place is near a town [m]."""
HECTARE_M2 = 1e4


def direction(bearing_deg: float) -> str:
    """The nearest of eight directions of the compass.

    >>> direction(287.0), direction(359.0)
    ('west', 'north')
    """
    return _COMPASS[round(bearing_deg / 45) % 8]


def distance_text(distance_m: float) -> str:
    """A distance in m or km.

    >>> distance_text(42.4), distance_text(2340.0), distance_text(7_012_345.0)
    ('42 m', '2.3 km', '7,012 km')
    """
    if distance_m < 1000:
        return f"{distance_m:.0f} m"
    return f"{distance_m / 1000:,.{1 if distance_m < 10_000 else 0}f} km"


def coordinates_text(latitude_deg: float, longitude_deg: float, digits: int = 2) -> str:
    """Latitude and longitude with letters instead of signs.

    >>> coordinates_text(53.268, -0.5245)
    '53.27 N, 0.52 W'
    """
    north, east = "S" if latitude_deg < 0 else "N", "W" if longitude_deg < 0 else "E"
    return f"{abs(latitude_deg):.{digits}f} {north}, {abs(longitude_deg):.{digits}f} {east}"


def other_datum(datum: LatLon, plane: LocalFrame) -> str:
    """Difference between a datum and that of a plane, with a remedy; empty if both are the same.

    :param datum: latitude and longitude of the other one [deg]
    """
    away_m = distance_and_bearing((plane.latitude_deg, plane.longitude_deg), datum)[0]
    if away_m < _SAME_DATUM_M:
        return ""
    there = coordinates_text(*datum, digits=6)
    return f"its places are about another datum ({there}, {distance_text(away_m)} away): give all one field file"


def town_text(place: LatLon) -> str:
    """The nearest town with region and country; empty without the extra ``reports``."""
    town = _nearest_town(place)
    if town is None:
        return ""
    region = [town.get("state", ""), town["country"]]
    name = f"{town['city']} ({', '.join(dict.fromkeys(filter(None, region)))})"
    distance_m, bearing_deg = distance_and_bearing((town["latitude"], town["longitude"]), place)
    return (
        f"near {name}"
        if distance_m < _NEAR_M
        else f"{distance_text(distance_m)} {direction(bearing_deg)} of {name}"
    )


def town_distance_m(place: LatLon) -> float | None:
    """Distance to the nearest town [m]; ``None`` without the extra ``reports``."""
    town = _nearest_town(place)
    return None if town is None else distance_and_bearing((town["latitude"], town["longitude"]), place)[0]


def place_text(place: LatLon) -> str:
    """Coordinates, and the nearest town if the extra ``reports`` is installed."""
    return ", ".join(filter(None, [coordinates_text(*place), town_text(place)]))


@lru_cache(maxsize=64)
def _nearest_town(place: LatLon) -> dict[str, Any] | None:
    """Town of more than 1000 inhabitants (GeoNames), ``None`` without the gazetteer."""
    try:
        gazetteer = optional_module("reverse_geocode")
    except InputError:
        return None
    return dict(gazetteer.get(place))


def number(value: float | None, digits: int = 3) -> str:
    """A number with this many significant digits, without an exponent if possible; a dash if undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    decimals = max(digits - 1 - (math.floor(math.log10(abs(value))) if value else 0), 0)
    return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")


def area(area_m2: float) -> tuple[str, str]:
    """An area and its unit: hectares, square kilometres if very large."""
    size, unit = area_unit(area_m2)
    return number(area_m2 / size, 2 if size == HECTARE_M2 > area_m2 else 3), unit


def area_unit(area_m2: float) -> tuple[float, str]:
    """Size [m^2] and name of the unit in which an area is shown."""
    if area_m2 >= 5e7:
        return 1e6, "km²"
    return (HECTARE_M2, "ha") if area_m2 >= 500 else (1.0, "m²")


def duration(seconds: float) -> str:
    """A duration in words, rounded to a suitable unit."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{minutes} min"
    if minutes < 2880:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes / 1440:.1f} days"
