# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A boundary from a walk with the robot: its places from start to stop, and the ring that they enclose."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from typing import Any, Final

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.views import PLACE_DIGITS
from soilmoist_ros.foundation import InputError

STEP_M: Final = 0.3
"""Moves shorter than this are noise of the receiver [m]."""
MAX_PLACES: Final = 20_000
MAX_PLACE_M: Final = 1e6
"""Largest coordinate [m]; the library that simplifies a ring never ends with an infinite area."""
MIN_TOLERANCE_M, MAX_TOLERANCE_M = 0.25, 3.0
"""Smallest and largest distance of the ring from the places that it leaves out [m]."""
_KEPT_SHARE: Final = 0.9
"""Smallest share of the area that may remain when loops are cut off."""


class Walk:
    """Records the places of one robot, in the section ``walk/ROBOT``.

    :param board: where
    :param robot: namespace of the robot
    """

    def __init__(self, board: Board, robot: str) -> None:
        self._board, self._section = board, f"walk/{robot}"
        self._guard = threading.Lock()
        self._about: dict[str, Any] = {}
        self._places: tuple[tuple[float, float], ...] = ()
        self._worst_m = 0.0

    def begin(self, who: str, kind: str) -> None:
        """Record from now on.

        :param who: who walks
        :param kind: ``boundary`` or ``area``
        """
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
