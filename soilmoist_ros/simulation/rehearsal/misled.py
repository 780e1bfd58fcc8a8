# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faults of motion: a navigation that drives elsewhere than it was asked to, and robots that creep or slip."""

from __future__ import annotations

import math

import numpy as np
import shapely

from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, Span
from soilmoist_ros.simulation.rehearsal.ground import Ground

Place = tuple[float, float]
Way = list[Place]

STAYS_S = 30
"""Time that a detour stays in a no-go area [s], at 1 m/s."""
SHORT_M = 2.5
"""Without nodes an arrival is reported this far before the goal [m]."""
SLIDE_MPS = 0.7
STOOD_S = 12.0
"""A robot that has stood for this time counts or waits [s]."""


class Misled:
    """Leads the robot, or its fixes, astray.

    :param ground: the field
    :param faults: what goes wrong when
    :param stood_s: a robot that slips, or whose fixes leave it, has stood for this time [s]
    """

    def __init__(self, ground: Ground, faults: Faults, stood_s: float = STOOD_S) -> None:
        self._faults, self._stood_s = faults, stood_s
        areas = [shapely.Polygon(ring).representative_point() for ring in ground.field.no_go]
        self._no_go: Way = [(point.x, point.y) for point in areas]
        x, y = ground.field.polygon.mean(axis=0).tolist()
        self._centre: Place = (x, y)
        self._slid_m: dict[Span, float] = {}
        self._left_s: dict[Span, float] = {}  # when fixes have begun to leave the robot

    def way(self, way: Way, here: Place, now_s: float, begins: bool = False) -> Way:
        """The way that the navigation drives instead of the right one; the right one without a fault.

        :param way: corners that are still ahead [m]
        :param here: where the robot is [m]
        :param now_s: time [s]
        :param begins: whether the goal has just been sent; otherwise a fault has begun in mid-way
        """
        faults = self._faults
        if begins and (span := faults.span(Fault.OTHER_MAP, now_s)) is not None:
            way = [self._on_other_map(corner, span.size) for corner in way]
        if begins and faults.on(Fault.NEIGHBOUR, now_s):
            way = _cut_short(way, here)
        far = bool(way) and math.dist(here, way[0]) > 2  # a pose that stops the robot is obeyed
        if far and faults.on(Fault.DETOUR, now_s) and self._no_go:
            x, y = min(self._no_go, key=lambda area: math.dist(area, here))
            way = [*([(x - 0.8, y), (x + 0.8, y)] * round(STAYS_S / 3.2)), *way]
        if far and (span := faults.span(Fault.STRAY, now_s)) is not None:
            (x, y), whole, off_m = (
                way[0],
                math.dist(here, way[0]),
                math.copysign(3.0 + 34.0 * abs(span.size - 0.5), span.size - 0.5),
            )
            along, across = (x - here[0]) / whole, (y - here[1]) / whole
            middle = ((x + here[0]) / 2 - off_m * across, (y + here[1]) / 2 + off_m * along)
            way = [middle, *way]
        return way

    def push(self, stood_s: float, now_s: float, for_s: float) -> Place:
        """By how much a robot that is not driven moves nevertheless in a short time [m].

        :param stood_s: for how long it has stood [s]
        :param now_s: time [s]
        :param for_s: the short time [s]
        """
        if (span := self._faults.span(Fault.CREEP, now_s)) is not None:
            return _towards(span, (0.06 + 0.24 * span.size) * for_s)
        span = self._faults.span(Fault.SLIDE, now_s)
        if span is not None and (span in self._slid_m or stood_s >= self._stood_s):
            slid_m = self._slid_m.get(span, 0.0)
            step_m = min(SLIDE_MPS * for_s, max(0.0, 1.0 + 7.0 * span.size - slid_m))
            self._slid_m[span] = slid_m + step_m
            return _towards(span, step_m)
        return 0.0, 0.0

    def fix_error(self, stood_s: float, now_s: float) -> Place:
        """Error of a fix beyond the receiver's noise [m]; arguments as those of :meth:`push`."""
        for fault in (Fault.FIX_STEP, Fault.FIX_DRIFT):
            span = self._faults.span(fault, now_s)
            if span is None or (span not in self._left_s and stood_s < self._stood_s):
                continue
            since_s = now_s - self._left_s.setdefault(span, now_s)
            drift = fault is Fault.FIX_DRIFT
            return _towards(span, (0.1 + 1.9 * span.size) * since_s if drift else 3.5 + 11.5 * span.size)
        return 0.0, 0.0

    def _on_other_map(self, place: Place, size: float) -> Place:
        """Shifted for the one half of all sizes, turned about the middle of the field for the other."""
        if size < 0.5:
            far_m, angle = 4.0 + 112.0 * size, 100.0 * size
            return place[0] + far_m * math.cos(angle), place[1] + far_m * math.sin(angle)
        angle = np.deg2rad(10 + 340 * (size - 0.5))
        x, y = place[0] - self._centre[0], place[1] - self._centre[1]
        c, s = math.cos(angle), math.sin(angle)
        return self._centre[0] + c * x - s * y, self._centre[1] + s * x + c * y


def _towards(span: Span, far_m: float) -> Place:
    """A step in the direction of a fault."""
    angle = 2 * math.pi * (7.3 * span.size % 1)
    return far_m * math.cos(angle), far_m * math.sin(angle)


def _cut_short(way: Way, here: Place) -> Way:
    if len(way) > 1:
        return way[:-1]
    x, y = way[0]
    away_m = math.dist(here, way[0])
    share = max(0.0, 1 - SHORT_M / away_m) if away_m > 0 else 1.0
    return [(here[0] + share * (x - here[0]), here[1] + share * (y - here[1]))]
