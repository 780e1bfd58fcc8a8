"""Positions inside a field: a tangent plane (east, north, in metres) about a fixed datum.

The plane is the ellipsoidal orthographic projection (EPSG method 9840). For points on the ellipsoid, it *is* the
horizontal part of topocentric east-north-up coordinates. A field does not use UTM internally and may cross a zone
border; a projected CRS is chosen once, at export.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from pyproj import CRS, Transformer


@dataclass(frozen=True)
class LocalFrame:
    """East-north tangent plane about a datum.

    :param latitude_deg: latitude of the datum [deg], -90..90
    :param longitude_deg: longitude of the datum [deg], -180..180, east positive
    :raises ValueError: if a coordinate is out of range
    """

    latitude_deg: float
    longitude_deg: float

    def __post_init__(self) -> None:
        if not -90 <= self.latitude_deg <= 90:
            raise ValueError(f"latitude must be within -90..90 deg, got {self.latitude_deg}")
        if not -180 <= self.longitude_deg <= 180:
            raise ValueError(f"longitude must be within -180..180 deg, got {self.longitude_deg}")

    @cached_property
    def crs(self) -> CRS:
        """The tangent plane as a coordinate reference system."""
        from pyproj import CRS

        return CRS.from_proj4(
            f"+proj=ortho +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} "
            "+datum=WGS84 +units=m +no_defs +type=crs"
        )

    @cached_property
    def _from_wgs84(self) -> Transformer:
        from pyproj import Transformer

        return Transformer.from_crs("EPSG:4326", self.crs, always_xy=True)

    def to_local(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> NDArray[np.float64]:
        """East and north [m], shape (n, 2), of n positions; NaN beyond the datum's hemisphere."""
        lat, lon = np.atleast_1d(np.asarray(latitude_deg, float), np.asarray(longitude_deg, float))
        xy = np.column_stack(self._from_wgs84.transform(lon, lat))
        return np.where(np.isfinite(xy), xy, np.nan)

    def to_geographic(self, xy_m: ArrayLike) -> NDArray[np.float64]:
        """Latitude and longitude [deg], shape (n, 2), of n local points of shape (n, 2) [m]."""
        xy = np.atleast_2d(np.asarray(xy_m, float))
        lon, lat = self._from_wgs84.transform(xy[:, 0], xy[:, 1], direction="INVERSE")
        return np.column_stack([lat, lon])

    def export_crs(self) -> CRS:
        """The UTM zone (WGS-84) in which the datum lies, or polar stereographic beyond 84 N / 80 S."""
        from pyproj import CRS

        if self.latitude_deg > 84:
            return CRS.from_epsg(32661)
        if self.latitude_deg < -80:
            return CRS.from_epsg(32761)
        zone = int((self.longitude_deg + 180) // 6) % 60 + 1
        return CRS.from_epsg((32600 if self.latitude_deg >= 0 else 32700) + zone)
