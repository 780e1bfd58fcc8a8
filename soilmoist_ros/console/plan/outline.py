# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The outline of a field from a file of strangers, for the page; read as the ``border`` of a field file."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation import InputError

MAX_CORNERS: Final = 2000
"""Corners of an outline; one with more is simplified."""
MAX_READ: Final = 200_000
"""Corners of all polygons of a file."""
MAX_AREAS: Final = 200
"""No-go areas of a field."""
_ENDINGS: Final = (".geojson", ".json", ".kml", ".kmz", ".zip")


def outline(given: Mapping[str, Any]) -> dict[str, Any]:
    """Boundary and no-go areas of a file in metres about a datum: its largest polygon, and what lies in it.

    :param given: ``name`` of the file, ``content`` (base64), ``datum`` [latitude, longitude] or nothing
    :returns: ``boundary``, ``no_go``, ``datum``; ``note``: what was decided and left out, in words
    :raises InputError: if the file has no polygon that can be read
    """
    import numpy as np

    from soilmoist_ros.foundation import LocalFrame
    from soilmoist_ros.mapping import BorderSource

    name = str(given["name"])[:80]
    suffix = Path(name).suffix.lower()
    if suffix not in _ENDINGS:
        raise InputError(f"{name} cannot be read", f"choose one of: {', '.join(_ENDINGS)}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"outline{suffix}")  # a name of our own, so that it cannot lead elsewhere
        try:
            path.write_bytes(base64.b64decode(given["content"], validate=True))
            border = BorderSource(path, takes_largest=True).read()
        except InputError as error:
            raise InputError([replace(mistake, path=Path(name)) for mistake in error.mistakes]) from None
        except Exception as error:  # GDAL and damaged files have many
            raise InputError(f"{name} cannot be read: {error!s:.200}", "export one polygon again") from None
    rings = (border.outline, *border.no_go)
    if sum(map(len, rings)) > MAX_READ:
        raise InputError(f"{name} has more than {MAX_READ} corners", "export the boundary alone, or simplify it")
    if len(border.no_go) > MAX_AREAS:
        raise InputError(f"{name} has {len(border.no_go)} no-go areas", f"join them to {MAX_AREAS} at most")
    datum = given.get("datum") or np.round(border.outline.mean(axis=0)[::-1], 7).tolist()
    frame = LocalFrame(float(datum[0]), float(datum[1]))
    local = [frame.to_local(ring[:, 1], ring[:, 0]) for ring in rings]
    if not all(np.isfinite(ring).all() for ring in local):
        raise InputError(f"{name} lies on another side of the earth than the datum", "check the datum")
    boundary, *no_go = [_few_corners(ring) for ring in local]
    return {
        "boundary": boundary,
        "no_go": no_go,
        "datum": [float(value) for value in datum],
        "note": ". ".join(border.notes),
    }


def _few_corners(ring: Any) -> list[list[float]]:
    import shapely

    line, tolerance_m = shapely.LinearRing(ring), 0.05
    while len(line.coords) > MAX_CORNERS:
        line, tolerance_m = line.simplify(tolerance_m), 2 * tolerance_m
    return [[round(float(x_m), 2), round(float(y_m), 2)] for x_m, y_m in line.coords[:-1]]
