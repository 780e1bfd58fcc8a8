# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Vertical cutoff rigidity of a place, from a table of the world."""

from __future__ import annotations

from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

TABLE = Path(__file__).with_name("cutoff_rigidity.csv")


@lru_cache(maxsize=256)
def cutoff_rigidity_gv(latitude_deg: float, longitude_deg: float) -> float:
    """Effective vertical cutoff rigidity [GV], bilinear in the table.

    The table has one value per 5 x 10 degrees, for the field of 2020. ``scripts/cutoff_rigidity_table.py``
    computed it by tracing particles through the International Geomagnetic Reference Field (IGRF-14). Between its
    values the error is about 0.1 GV, at most 0.3. Published values of neutron monitors, of other years, differ by
    up to 0.5 GV.

    >>> round(cutoff_rigidity_gv(51.5, 0.0), 1)  # London
    3.0

    :param latitude_deg: geographic latitude [deg]
    :param longitude_deg: geographic longitude, any number of turns [deg]
    :raises ValueError: if the latitude is not within -90..90
    """
    if not abs(latitude_deg) <= 90:
        raise ValueError(f"the latitude must be within -90..90 degrees, got {latitude_deg}")
    latitudes, longitudes, table = _table()
    row = min(int(np.searchsorted(latitudes, latitude_deg, side="right")) - 1, len(latitudes) - 2)
    north = (latitude_deg - latitudes[row]) / (latitudes[row + 1] - latitudes[row])
    step = longitudes[1] - longitudes[0]
    turns, east = divmod(((longitude_deg - longitudes[0]) % 360) / step, 1)
    columns = [int(turns) % len(longitudes), (int(turns) + 1) % len(longitudes)]
    low, high = table[row : row + 2, columns] @ np.array([1 - east, east])
    return float(low + north * (high - low))


@cache
def _table() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Latitudes, ascending, longitudes and rigidities [GV]."""
    header, *rows = TABLE.read_text(encoding="ascii").splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])[::-1]
    return values[:, 0], np.array([float(cell) for cell in header.split(",")[1:]]), values[:, 1:]
