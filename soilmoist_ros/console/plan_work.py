# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Work for the page *Plan*, done in a process of its own: fields, outlines, walks.

Reads a JSON object from its input and prints one: the answer, or ``{"error": ...}``.
"""

from __future__ import annotations

import base64
import json
import math
import resource
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.views import PLACE_DIGITS
from soilmoist_ros.foundation import InputError, Mistake

MAX_BYTES: Final = 4 << 30
MAX_CORNERS: Final = 2000
"""Corners of an outline; one with more is simplified."""
MAX_READ: Final = 200_000
"""Corners of all polygons of a file."""
MAX_AREAS: Final = 200
"""No-go areas of a field."""
_ENDINGS: Final = (".geojson", ".json", ".kml", ".kmz", ".zip")
STEP_M: Final = 0.3
"""Moves shorter than this are noise of the receiver [m]."""
MAX_PLACES: Final = 20_000
MAX_PLACE_M: Final = 1e6
"""Largest coordinate [m]; the library that simplifies a ring never ends with an infinite area."""
MIN_TOLERANCE_M, MAX_TOLERANCE_M = 0.25, 3.0
"""Smallest and largest distance of the ring from the places that it leaves out [m]."""
_KEPT_SHARE: Final = 0.9
"""Smallest share of the area that may remain when loops are cut off."""


def field_text(given: Mapping[str, Any]) -> str:
    """A field file of what was drawn.

    :param given: ``name``, ``datum`` [latitude, longitude], ``boundary`` and ``no_go`` [m]
    """
    latitude, longitude = (float(value) for value in given["datum"])
    lines = [
        f"name: {json.dumps(str(given.get('name') or 'drawn field'), ensure_ascii=False)}",
        f"datum: {{latitude_deg: {latitude!r}, longitude_deg: {longitude!r}}}",
        f"polygon: {_ring(given['boundary'])}",
    ]
    if given.get("no_go"):
        lines += ["no_go:", *(f"  - {_ring(area)}" for area in given["no_go"])]
    return "\n".join(lines) + "\n"


def check_field(given: Mapping[str, Any]) -> dict[str, Any]:
    """The field file of what was drawn, after the check that every node does.

    :returns: ``file``; ``area_m2`` without the no-go areas; ``note``: parts that a robot cannot reach, in words
    :raises InputError: if it is no field
    """
    import shapely

    from soilmoist_ros.exploration import ROBOT_RADIUS_M, unreachable
    from soilmoist_ros.mapping import Field, load_field

    text = field_text(given)
    size = shapely.Polygon(given["boundary"] if len(given["boundary"]) > 2 else [])
    if size.is_valid and 0 < size.area < Field.MIN_AREA_M2:  # the remedy for a file is for who writes one
        what = f"the boundary encloses {size.area:.2g} m2, smaller than any footprint of the sensor"
        raise InputError(what, "draw or walk a larger one")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.yaml"
        path.write_text(text, encoding="utf-8")
        field = load_field(path)
    left_out = shapely.union_all([shapely.Polygon(ring) for ring in field.no_go])
    area = shapely.Polygon(field.polygon).difference(left_out).area
    return {"file": text, "area_m2": round(area), "note": unreachable(field, ROBOT_RADIUS_M)}


def _without_folder(mistake: Mistake) -> Mistake:
    """The mistake without a file of this process, which people have never seen."""
    made_here = mistake.path is not None and mistake.path.is_absolute()
    return replace(mistake, path=None, line=0) if made_here else mistake


def _ring(corners: Any) -> str:
    return json.dumps([[round(float(x_m), 3), round(float(y_m), 3)] for x_m, y_m in corners])


# The outline of a field from a file of strangers, for the page; read as the ``border`` of a field file ----------


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


# A boundary from a walk with the robot: its places from start to stop, and the ring that they enclose -----------


class Walk:
    """Records the places of one robot, in the section ``walk/ROBOT``."""

    def __init__(self, board: Board, robot: str) -> None:
        self._board, self._section = board, f"walk/{robot}"
        self._guard = threading.Lock()
        self._about: dict[str, Any] = {}
        self._places: tuple[tuple[float, float], ...] = ()
        self._worst_m = 0.0

    def begin(self, who: str, kind: str) -> None:
        """Record from now on."""
        with self._guard:
            self._about, self._places, self._worst_m = {"who": who, "kind": kind}, (), 0.0
            self._show()

    def place(self, x_m: float, y_m: float, sd_m: float) -> None:
        """The robot is at a place [m], with this standard deviation of each coordinate [m]."""
        with self._guard:
            if not self._about:
                return
            here = round(x_m, PLACE_DIGITS), round(y_m, PLACE_DIGITS)
            if self._places and math.dist(self._places[-1], here) < STEP_M:
                return
            self._worst_m = max(self._worst_m, sd_m) if math.isfinite(sd_m) else math.inf
            if len(self._places) >= MAX_PLACES:
                self._places = self._places[::2]
            self._places = (*self._places, here)
            self._show()

    def end(self) -> dict[str, Any]:
        """Stop recording: the places and their accuracy, for :func:`walked`."""
        with self._guard:
            done = {"places": self._places, **self._shown()}
            self._about = {}
            self._show()
        return done

    def _shown(self) -> dict[str, Any]:
        worst = round(self._worst_m, PLACE_DIGITS) if math.isfinite(self._worst_m) else None
        return {**self._about, "sd": worst, "count": len(self._places)}

    def _show(self) -> None:
        self._board.put(self._section, self._shown() if self._about else None)
        self._board.put(f"{self._section}/places", self._places if self._about else ())


def walked(given: Mapping[str, Any]) -> dict[str, Any]:
    """The ring that a walk encloses, with few corners.

    :param given: ``places`` [[x, y], ...] [m], and ``sd``: their largest standard deviation [m], if known
    :returns: ``ring``; ``sd``; ``tolerance_m``: distance within which places were left out; ``gap_m``: distance
        between the ends of the walk
    :raises InputError: if it encloses no area
    """
    import shapely

    places = [(float(x_m), float(y_m)) for x_m, y_m in given["places"]]
    if len(places) < 4:
        remedy = "walk around the area, and wait for positions of the robot"
        raise InputError(f"the walk has {len(places)} places", remedy)
    if not all(abs(value) <= MAX_PLACE_M for place in places for value in place):
        raise InputError("the walk has places off the field", "wait for positions of the robot, and walk again")
    sd_m = None if given.get("sd") is None else float(given["sd"])
    tolerance_m = min(max(MIN_TOLERANCE_M, 2 * (sd_m or 0.0)), MAX_TOLERANCE_M)
    whole = shapely.Polygon(places)
    parts = [one for one in shapely.get_parts(shapely.make_valid(whole)) if one.geom_type == "Polygon"]
    ring = shapely.Polygon(max(parts, key=lambda one: float(one.area)).exterior) if parts else shapely.Polygon()
    total = sum(float(one.area) for one in parts)
    if ring.area < 1.0 or ring.area < _KEPT_SHARE * total:
        remedy = "walk around the area once, without crossing your own way"
        raise InputError("the walk encloses no single area", remedy)
    simple = ring.simplify(tolerance_m)
    return {
        "ring": [[round(x_m, PLACE_DIGITS), round(y_m, PLACE_DIGITS)] for x_m, y_m in simple.exterior.coords[:-1]],
        "sd": sd_m,
        "tolerance_m": tolerance_m,
        "gap_m": round(math.dist(places[0], places[-1]), 1),
    }


TASKS: Final[Mapping[str, Callable[[Mapping[str, Any]], dict[str, Any]]]] = {
    "field": check_field,
    "outline": outline,
    "walk": walked,
}


def main() -> None:
    """Do one task, with bounded memory: a small file may unpack to a large one."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    given = json.load(sys.stdin)
    try:
        answer = TASKS[given["task"]](given)
        said = json.dumps(answer, allow_nan=False)
    except InputError as error:
        said = json.dumps({"error": "\n".join(str(_without_folder(one)) for one in error.mistakes)})
    except (KeyError, TypeError, ValueError, OverflowError, MemoryError, RecursionError) as error:
        said = json.dumps({"error": f"this cannot be used: {error!s:.200}"})
    print(said)


if __name__ == "__main__":
    main()
