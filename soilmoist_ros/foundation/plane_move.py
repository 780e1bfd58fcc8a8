# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Turn and shift between two planes in metres, such as the plane of a field and the map frame of a navigation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation.geodesy import LocalFrame

Array = NDArray[np.float64]

_AROUND_M = np.array([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (-100.0, 0.0), (0.0, -100.0)])


@dataclass(frozen=True, slots=True)
class PlaneMove:
    """Coordinates of one plane to those of another: ``R(yaw_rad) @ place + shift_m``.

    :param yaw_rad: turn, counter-clockwise [rad]
    :param shift_m: where the origin of the first plane lies in the second [m]

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
        """Whether the two planes are one."""
        return self == PlaneMove()

    @property
    def inverse(self) -> PlaneMove:
        """The move back."""
        back = PlaneMove(-self.yaw_rad)
        x, y = back.place(self.shift_m)
        return PlaneMove(-self.yaw_rad, (-x, -y))

    def places(self, xy_m: ArrayLike) -> Array:
        """Coordinates of n places in the second plane, shape (n, 2) [m].

        :param xy_m: coordinates in the first plane, shape (n, 2) [m]
        """
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

    :param start_m: coordinates in the first plane, shape (n, 2) [m]; not all equal
    :param end_m: coordinates of the same places in the second plane, shape (n, 2) [m]
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

    :param start: plane of the coordinates that are given
    :param end: datum of the coordinates that are wanted
    :param yaw_rad: direction of the wanted x axis, counter-clockwise from east [rad]
    :param about_m: where the move is used, in the plane ``start`` [m]
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
