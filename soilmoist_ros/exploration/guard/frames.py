# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the navigation's frame is where the field's plane says: TF and fixes of the robot, compared.

A navigation with another datum, or a map that is turned, drives the robot to shifted places without an error.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, PlaneMove, fit_move, move_between

Place = tuple[float, float]

PAIRS = 15
"""Number of latest pairs that decide."""
MIN_PAIRS = 5
MIN_GAP_S = 0.5
"""Minimum time between two pairs; a receiver of 10 Hz would fill the memory with one moment [s]."""
PAIR_LIFE_S = 30.0
"""Age beyond which a pair no longer counts [s]."""
LATENCY_S = 1.0
"""Smallest delay between fix and TF that is allowed for while the robot moves [s]."""
STEP_M = 1.0
"""Distance between the pairs to which a frame is fitted [m]."""
BASE_M = 20.0
"""Extent of the pairs from which the turn of a frame is known [m]."""
MAX_FITTED = 500
TURN_SHOWN_M = 0.1
"""Displacement of the field from which the turn of a frame is part of its datum [m]."""
MAX_SPEED_MPS = 3.0
"""Speed above which a robot is not allowed for [m/s]."""
_DIRECTIONS = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")


class Agreement(StrEnum):
    """Whether TF and fixes agree."""

    UNKNOWN = "unknown"
    AGREE = "agree"
    DISAGREE = "disagree"


@dataclass(frozen=True, slots=True)
class FrameVerdict:
    """Result of a comparison.

    :param agreement: whether TF and fixes agree
    :param message: the result in words, with the remedy
    :param east_m: median of TF minus fix, east [m]; NaN if unknown
    :param north_m: the same, north [m]
    :param limit_m: largest distance that agrees, with the allowance for motion [m]
    :param pairs: number of pairs compared
    """

    agreement: Agreement
    message: str
    east_m: float = math.nan
    north_m: float = math.nan
    limit_m: float = math.nan
    pairs: int = 0

    @property
    def distance_m(self) -> float:
        """Distance between the place by TF and the place by the fixes [m]."""
        return math.hypot(self.east_m, self.north_m)


@dataclass(frozen=True, slots=True)
class _Pair:
    now_s: float
    fix_m: Place
    tf_m: Place
    """In the frame of the navigation."""
    delay_s: float


class FrameCheck:
    """Compares the robot's place by TF with its place by fixes.

    Medians over some pairs decide, so a bad fix has no effect. A moving robot may be ahead of its fix.

    :param frame: plane of the field
    :param limit_m: distance between TF and fix that still agrees, for a robot that stands [m]
    :param move: plane of the field to the frame of the navigation
    """

    def __init__(self, frame: LocalFrame, limit_m: float, move: PlaneMove | None = None) -> None:
        self._frame = frame
        self._limit_m = limit_m
        self.move = move or PlaneMove()
        self._pairs: deque[_Pair] = deque(maxlen=PAIRS)
        self._apart: deque[_Pair] = deque(maxlen=MAX_FITTED)
        self._known: tuple[tuple[object, ...], FrameVerdict] | None = None

    def add(self, now_s: float, fix_m: Place, tf_m: Place, delay_s: float = 0.0) -> None:
        """Add a pair.

        :param now_s: time of both [s]
        :param fix_m: place of the robot's base by the fix, in the plane of the field [m]
        :param tf_m: place of the robot's base by TF, in the frame of the navigation [m]
        :param delay_s: largest time between the measurements of the two [s]
        """
        if not all(map(math.isfinite, (*fix_m, *tf_m))):
            return
        pair = _Pair(now_s, fix_m, tf_m, delay_s)
        if self._pairs and now_s < self._pairs[-1].now_s:
            self._pairs.clear()  # the clock stepped back
        if self._pairs and now_s - self._pairs[-1].now_s < MIN_GAP_S:
            return
        self._pairs.append(pair)
        if not self._apart or math.dist(self._apart[-1].tf_m, tf_m) >= STEP_M:
            self._apart.append(pair)

    def verdict(self, now_s: float) -> FrameVerdict:
        """Compare the latest pairs."""
        pairs = [pair for pair in self._pairs if now_s - pair.now_s <= PAIR_LIFE_S]
        compared = (self.move, *pairs)
        if self._known is None or self._known[0] != compared:  # words about a datum take milliseconds
            self._known = compared, self._compare(pairs)
        return self._known[1]

    def _compare(self, pairs: list[_Pair]) -> FrameVerdict:
        if len(pairs) < MIN_PAIRS:
            return FrameVerdict(
                Agreement.UNKNOWN, f"not checked yet: {len(pairs)} pairs of TF and fix of {MIN_PAIRS}"
            )
        back = self.move.inverse
        found = np.array([back.place(pair.tf_m) for pair in pairs]) - [pair.fix_m for pair in pairs]
        east_m, north_m = np.median(found, axis=0).tolist()
        delay_s = max(LATENCY_S, median(pair.delay_s for pair in pairs))
        limit_m = self._limit_m + delay_s * _speed_mps(pairs)
        away_m = math.hypot(east_m, north_m)
        if away_m <= limit_m:
            message = f"TF and fix agree within {away_m:.1f} m (limit {limit_m:.1f} m)"
            return FrameVerdict(Agreement.AGREE, message, east_m, north_m, limit_m, len(pairs))
        message = (
            f"TF places the robot {away_m:.1f} m {direction(east_m, north_m)} of its fix "
            f"({east_m:.1f} m east, {north_m:.1f} m north; limit {limit_m:.1f} m): "
            f"{self._remedy(found, (east_m, north_m))}"
        )
        return FrameVerdict(Agreement.DISAGREE, message, east_m, north_m, limit_m, len(pairs))

    def fitted(self) -> PlaneMove | None:
        """Move from the field's plane to the navigation's frame that explains the pairs.

        ``None`` until the robot has moved :data:`BASE_M`, or if no turn and shift explains the pairs.
        """
        if len(self._apart) < MIN_PAIRS:
            return None
        fix, tf = (np.array([getattr(pair, name) for pair in self._apart]) for name in ("fix_m", "tf_m"))
        if max(np.ptp(tf, axis=0)) < BASE_M:
            return None
        move, _ = fit_move(fix, tf)
        errors_m = np.hypot(*(move.places(fix) - tf).T)
        good = errors_m <= 3 * np.median(errors_m) + 1e-3
        move, error_m = fit_move(fix[good], tf[good])
        return (
            move if error_m <= max(self._limit_m, LATENCY_S) and max(np.ptp(tf[good], axis=0)) >= BASE_M else None
        )

    def _remedy(self, found: NDArray[np.float64], offset_m: Place) -> str:
        move = self.fitted()
        spread_m = float(np.median(np.hypot(*(found - np.median(found, axis=0)).T)))
        if move is None and spread_m > max(self._limit_m, 0.1 * math.hypot(*offset_m)):
            return "the distance varies, so check the localisation and the GNSS receiver"
        if move is None:
            x, y = PlaneMove(self.move.yaw_rad).place(offset_m)
            move = PlaneMove(self.move.yaw_rad, (self.move.shift_m[0] + x, self.move.shift_m[1] + y))
        own, other = (datum_text(self._frame, each) for each in (PlaneMove(), move))
        return (
            f"give the navigation the field's datum {own}, "
            f"or set navigation_datum: {other}, which explains the shift"
        )


def direction(east_m: float, north_m: float) -> str:
    """Direction in words, one of eight.

    >>> direction(0.0, 30.0), direction(-1.0, -1.1)
    ('north', 'south-west')
    """
    return _DIRECTIONS[round(math.atan2(north_m, east_m) / (math.pi / 4)) % 8]


def datum_text(frame: LocalFrame, move: PlaneMove) -> str:
    """Datum of a navigation's frame as the parameter ``navigation_datum`` takes it.

    :param frame: plane of the field
    :param move: plane of the field to the frame of the navigation
    """
    latitude, longitude = frame.to_geographic([move.inverse.place((0.0, 0.0))])[0].tolist()
    text = f"{latitude:.7f},{longitude:.7f}"
    unturned = move_between(frame, LocalFrame(latitude, longitude))
    yaw_rad = math.remainder(unturned.yaw_rad - move.yaw_rad, math.tau)
    reach_m = math.hypot(*move.shift_m) + BASE_M
    return text if abs(yaw_rad) * reach_m < TURN_SHOWN_M else f"{text},{math.degrees(yaw_rad):.4f}"


def parse_datum(text: str, field: LocalFrame, about_m: Place = (0.0, 0.0)) -> PlaneMove:
    """Move from the field's plane to the frame of a navigation.

    :param text: ``LAT,LON`` or ``LAT,LON,YAW`` [deg]; YAW is the direction of the x axis, counter-clockwise from
        east
    :param field: plane of the field
    :param about_m: a place in the field [m]
    :raises InputError: if the text is no datum, or one of the other side of the earth
    """
    remedy = "write LAT,LON or LAT,LON,YAW in degrees, such as 53.2686,-0.5257"
    try:
        latitude, longitude, yaw = [*map(float, text.split(",")), 0.0][:3]
        datum = LocalFrame(latitude, longitude)
        if not math.isfinite(yaw) or text.count(",") not in (1, 2):
            raise ValueError("it needs two or three numbers")
        return move_between(field, datum, math.radians(yaw), about_m)
    except ValueError as error:
        raise InputError(f"navigation_datum {text!r} is no datum: {error}", remedy) from None


def _speed_mps(pairs: list[_Pair]) -> float:
    """Median speed between consecutive pairs, the lower of those by TF and by fix [m/s]."""
    steps = [(one, other) for one, other in pairwise(pairs) if other.now_s > one.now_s]
    speeds = [
        median(
            [
                math.dist(getattr(one, name), getattr(other, name)) / (other.now_s - one.now_s)
                for one, other in steps
            ]
        )
        for name in ("fix_m", "tf_m")
        if steps
    ]
    return min([*speeds, MAX_SPEED_MPS]) if speeds else 0.0
