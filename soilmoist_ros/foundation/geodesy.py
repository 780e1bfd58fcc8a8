# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions inside a field: a tangent plane (east, north, in metres) about a fixed datum.

The plane is the ellipsoidal orthographic projection (EPSG method 9840). For points on the ellipsoid, it *is* the
horizontal part of topocentric east-north-up coordinates. A field does not use UTM internally and may cross a zone
border; a projected CRS is chosen once, at export.

The formulas are those of EPSG guidance note 7-2 (2020), sections 3.3.5 (projection) and 4.1.2 (topocentric
coordinates). pyproj is only needed for coordinate reference systems.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS

Array = NDArray[np.float64]
LatLon = tuple[float, float]
"""Latitude and longitude, WGS-84, north and east positive [deg]."""

SEMI_MAJOR_M = 6378137.0  # semi-major axis of the WGS-84 ellipsoid [m]
FLATTENING = 1 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)  # square of the first eccentricity
DEGREE = math.pi / 180
_AROUND_M = np.array([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (-100.0, 0.0), (0.0, -100.0)])
_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
_SAME_DATUM_M = 0.05  # datums this close are the same one, written with fewer digits [m]


def floats(values: ArrayLike) -> Array:
    """Values as an array; the masked values of a masked array are NaN, never numbers."""
    if not isinstance(values, np.ma.MaskedArray):
        return np.asarray(values, float)
    found: Array = np.array(values, np.float64)
    found[np.ma.getmaskarray(values)] = np.nan
    return found


@dataclass(frozen=True)
class LocalFrame:
    """East-north tangent plane about a datum.

    :raises ValueError: if a coordinate is out of range
    """

    latitude_deg: float
    longitude_deg: float

    def __post_init__(self) -> None:
        if not -90 <= self.latitude_deg <= 90:
            raise ValueError(f"latitude must be within -90..90 deg, got {self.latitude_deg}")
        if not -180 <= self.longitude_deg <= 180:
            raise ValueError(f"longitude must be within -180..180 deg, got {self.longitude_deg}")
        for name in ("latitude_deg", "longitude_deg"):  # numbers of numpy have a name in their text
            object.__setattr__(self, name, float(getattr(self, name)))

    @cached_property
    def crs(self) -> CRS:
        """The tangent plane as a coordinate reference system."""
        from pyproj import CRS

        return CRS.from_proj4(
            f"+proj=ortho +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} "
            "+datum=WGS84 +units=m +no_defs +type=crs"
        )

    @cached_property
    def _origin(self) -> tuple[float, float, float, float]:
        """Sine and cosine of the datum's latitude, its longitude [rad], its prime vertical radius [-]."""
        # PROJ reads a datum with 15 digits: so do we, or rasters would lie elsewhere than the map, if by 1e-9 m.
        latitude, longitude = (
            float(f"{value:.15g}") * DEGREE for value in (self.latitude_deg, self.longitude_deg)
        )
        sine = math.sin(latitude)
        return sine, math.cos(latitude), longitude, 1 / math.sqrt(1 - ECCENTRICITY2 * sine * sine)

    def to_local(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Array:
        """East and north [m], shape (n, 2), of n positions; NaN beyond the datum's hemisphere."""
        lat, lon = np.atleast_1d(floats(latitude_deg), floats(longitude_deg))
        lat, lon = np.broadcast_arrays(lat, lon)
        good = np.isfinite(lat) & np.isfinite(lon) & (np.abs(lat) <= 90)
        sin_0, cos_0, lon_0, nu_0 = self._origin
        phi = np.where(good, lat, np.nan) * DEGREE
        lam = np.where(good, lon, np.nan) * DEGREE - lon_0
        lam = _within_a_turn(lam)
        sin_phi, cos_phi = _each(math.sin, phi), _each(math.cos, phi)
        sin_lam, cos_lam = _each(math.sin, lam), _each(math.cos, lam)
        nu = 1 / np.sqrt(1 - ECCENTRICITY2 * sin_phi * sin_phi)
        east = nu * cos_phi * sin_lam
        north = (
            nu * (sin_phi * cos_0 - cos_phi * sin_0 * cos_lam)
            + ECCENTRICITY2 * (nu_0 * sin_0 - nu * sin_phi) * cos_0
        )
        visible = sin_0 * sin_phi + cos_0 * cos_phi * cos_lam >= -1e-10
        return np.where(visible[:, None], SEMI_MAJOR_M * np.column_stack([east, north]), np.nan)

    def to_geographic(self, xy_m: ArrayLike) -> Array:
        """Latitude and longitude [deg], shape (n, 2), of n local points of shape (n, 2) [m]; NaN off the earth."""
        east, north = np.atleast_2d(floats(xy_m)).T / SEMI_MAJOR_M
        sin_0, cos_0, lon_0, nu_0 = self._origin
        # The point on the ellipsoid above or below a point of the plane: p and z are its distances from the axis
        # and the equator in the meridian of the datum, each linear in the height; its length fixes the height.
        one_e2 = 1 - ECCENTRICITY2
        p, z = nu_0 * cos_0 - north * sin_0, one_e2 * nu_0 * sin_0 + north * cos_0
        square = cos_0 * cos_0 + sin_0 * sin_0 / one_e2
        half = cos_0 * p + sin_0 * z / one_e2
        # p² + z² / (1 - e²) - 1, without the difference of nearly equal numbers
        rest = east * east + north * north * (sin_0 * sin_0 + cos_0 * cos_0 / one_e2)
        with np.errstate(invalid="ignore"):
            height = -rest / (half + np.sqrt(half * half - square * rest))
        p, z = p + height * cos_0, z + height * sin_0
        latitude = np.arctan2(z, one_e2 * np.hypot(p, east))
        return np.column_stack([latitude, _within_a_turn(np.arctan2(east, p) + lon_0)]) / DEGREE

    def export_crs(self, crs: CRS | str | int | None = None) -> CRS:
        """The requested reference system, by default :meth:`export_epsg`; ``InputError`` if there is none."""
        import pyproj

        try:
            return pyproj.CRS.from_user_input(self.export_epsg() if crs is None else crs)
        except pyproj.exceptions.CRSError:
            raise InputError(
                f"'{crs}' is not a coordinate reference system", "give one as an EPSG code, e.g. EPSG:25832"
            ) from None

    def export_epsg(self) -> int:
        """EPSG code of the UTM zone (WGS-84) of the datum, or of polar stereographic beyond 84 N / 80 S."""
        if self.latitude_deg > 84:
            return 32661
        if self.latitude_deg < -80:
            return 32761
        zone = int((self.longitude_deg + 180) // 6) % 60 + 1
        return (32600 if self.latitude_deg >= 0 else 32700) + zone


def squared_distances(xy_m: Array, others_m: Array) -> Array:
    """Squared distances between places of the plane, shapes (n, 2) and (m, 2) [m], as shape (n, m) [m^2]."""
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(xy_m, others_m, "sqeuclidean"))


def distance_and_bearing(start: LatLon, end: LatLon) -> tuple[float, float]:
    """Distance between two places [m] and the bearing at the start, 0..360 [deg from north], for messages.

    Lambert's formula for long lines (Thomas 1970, U.S. Naval Oceanographic Office SP-138), exact to 1e-5, and the
    bearing on the sphere of reduced latitudes, exact to half a degree; places opposite each other are less exact.

    >>> distance_m, bearing_deg = distance_and_bearing((53.27, -0.52), (38.71, -97.43))
    >>> round(distance_m / 1000), round(bearing_deg)
    (7088, 300)
    """
    lat_1, lat_2 = (math.atan((1 - FLATTENING) * math.tan(place[0] * DEGREE)) for place in (start, end))
    apart = (end[1] - start[1]) * DEGREE
    mean, half = (lat_1 + lat_2) / 2, (lat_2 - lat_1) / 2
    chord2 = math.sin(half) ** 2 + math.cos(lat_1) * math.cos(lat_2) * math.sin(apart / 2) ** 2
    sigma = 2 * math.asin(math.sqrt(min(chord2, 1.0)))
    if not 0 < chord2 < 1 - 1e-12:
        return SEMI_MAJOR_M * sigma, 0.0
    x = (sigma - math.sin(sigma)) * (math.sin(mean) * math.cos(half)) ** 2 / (1 - chord2)
    y = (sigma + math.sin(sigma)) * (math.cos(mean) * math.sin(half)) ** 2 / chord2
    east = math.cos(lat_2) * math.sin(apart)
    north = math.cos(lat_1) * math.sin(lat_2) - math.sin(lat_1) * math.cos(lat_2) * math.cos(apart)
    return SEMI_MAJOR_M * (sigma - FLATTENING / 2 * (x + y)), math.atan2(east, north) / DEGREE % 360


def _each(function: Callable[[float], float], values: Array) -> Array:
    """A function of the C library for each value: numpy's own differ in the last digit by processor."""
    return np.fromiter(map(function, values.ravel().tolist()), float, values.size).reshape(values.shape)


def _within_a_turn(angle: Array) -> Array:
    """An angle within -pi..pi."""
    turned = angle + math.pi
    return np.where(
        np.abs(angle) > math.pi, turned - 2 * math.pi * np.floor(turned / (2 * math.pi)) - math.pi, angle
    )


# Moves between planes --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PlaneMove:
    """Coordinates of one plane to those of another: ``R(yaw_rad) @ place + shift_m``.

    >>> move = PlaneMove(math.pi / 2, (10.0, 0.0))
    >>> move.place((1.0, 0.0))
    (10.0, 1.0)
    >>> move.inverse.place((10.0, 1.0))
    (1.0, 0.0)
    """

    yaw_rad: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    @property
    def is_identity(self) -> bool:
        """True if the two planes are one."""
        return self == PlaneMove()

    @property
    def inverse(self) -> PlaneMove:
        """The move back."""
        back = PlaneMove(-self.yaw_rad)
        x, y = back.place(self.shift_m)
        return PlaneMove(-self.yaw_rad, (-x, -y))

    def places(self, xy_m: ArrayLike) -> Array:
        """Coordinates of n places in the second plane, shape (n, 2) [m]."""
        xy = np.atleast_2d(np.asarray(xy_m, float))
        if self.is_identity:
            return xy
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.asarray(xy @ np.array([(cosine, sine), (-sine, cosine)]) + self.shift_m)

    def place(self, xy_m: tuple[float, float]) -> tuple[float, float]:
        """Coordinates of one place in the second plane [m]."""
        if self.is_identity:
            return xy_m
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = xy_m
        return cosine * x - sine * y + self.shift_m[0], sine * x + cosine * y + self.shift_m[1]

    def heading(self, yaw_rad: float) -> float:
        """A heading in the second plane, counter-clockwise from its x axis [rad], -pi..pi."""
        return math.remainder(yaw_rad + self.yaw_rad, math.tau)


def fit_move(start_m: ArrayLike, end_m: ArrayLike) -> tuple[PlaneMove, float]:
    """Move that brings places of one plane closest to the same places in another, and its error.

    Least squares over turn and shift (Umeyama, IEEE TPAMI 13, 1991, without scale).

    :returns: the move, and the root mean square of the distances that remain [m]
    """
    start, end = np.asarray(start_m, float), np.asarray(end_m, float)
    start_mean, end_mean = start.mean(axis=0), end.mean(axis=0)
    from_start, from_end = start - start_mean, end - end_mean
    across = float(np.sum(from_start[:, 0] * from_end[:, 1] - from_start[:, 1] * from_end[:, 0]))
    along = float(np.sum(from_start * from_end))
    turn = PlaneMove(math.atan2(across, along))
    x, y = turn.places([start_mean])[0]
    move = PlaneMove(turn.yaw_rad, (float(end_mean[0] - x), float(end_mean[1] - y)))
    error_m = math.sqrt(float(np.mean(np.sum((move.places(start) - end) ** 2, axis=1))))
    return move, error_m


def move_between(
    start: LocalFrame, end: LocalFrame, yaw_rad: float = 0.0, about_m: ArrayLike = (0.0, 0.0)
) -> PlaneMove:
    """Move from the plane of one datum to that of another, exact at a place.

    The meridians of two datums are not parallel, so the move turns a little even without ``yaw_rad``.

    :returns: the move; the identity if the two planes are one
    :raises ValueError: if the datums are on two sides of the earth
    """
    if start == end and yaw_rad == 0.0:
        return PlaneMove()
    around = np.asarray(about_m, float) + _AROUND_M
    geographic = start.to_geographic(around)
    wanted = end.to_local(*geographic.T)
    if not np.isfinite(wanted).all():
        raise ValueError("the two datums are on two sides of the earth")
    return fit_move(around, PlaneMove(-yaw_rad).places(wanted))[0]


# Places in words -------------------------------------------------------------------------------------------------


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
    """Difference between a datum and that of a plane, with a remedy; empty if both are the same."""
    away_m = distance_and_bearing((plane.latitude_deg, plane.longitude_deg), datum)[0]
    if away_m < _SAME_DATUM_M:
        return ""
    there = coordinates_text(*datum, digits=6)
    return f"its places are about another datum ({there}, {distance_text(away_m)} away): give all one field file"
