# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tree of coordinate frames that a robot publishes, and the pose of one frame in another."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Components x, y, z, w."""

CLOCK_JUMP_S = 10.0
"""Step back of the stamps above which a publisher has started anew [s]."""
_STILL: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Transform:
    """Pose of a frame in its parent frame.

    :param parent: name of the parent frame
    :param child: name of the frame
    :param translation_m: origin of the frame in its parent [m]
    :param rotation: turn from the frame to its parent, a quaternion of any length > 0
    :param stamp_s: time of the transform [s since 1970-01-01 UTC]
    :param static: whether it never changes
    """

    parent: str
    child: str
    translation_m: Vector
    rotation: Quaternion = _STILL
    stamp_s: float = 0.0
    static: bool = False


@dataclass(frozen=True, slots=True)
class FramePose:
    """Pose of a frame in another, seen from above.

    :param x_m: x of its origin [m]
    :param y_m: y of its origin [m]
    :param yaw_rad: direction of its x axis, counter-clockwise [rad]
    :param age_s: age of the oldest transform in it [s]: since its stamp or its arrival, whichever is longer; 0 if
        all are static
    """

    x_m: float
    y_m: float
    yaw_rad: float
    age_s: float


class TransformTree:
    """Keeps the newest transform of every frame; may be filled in one thread and read in another."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[Transform, float]] = {}  # with the earlier of stamp and arrival

    def __len__(self) -> int:
        return len(self._above)

    def add(self, transforms: Iterable[Transform], now_s: float) -> None:
        """Take in transforms; one that is older than the last of its frame, or impossible, is ignored.

        :param now_s: time of the arrival [s]
        """
        for new in transforms:
            numbers = (*new.translation_m, *new.rotation)
            if not all(map(math.isfinite, numbers)) or not any(new.rotation) or new.parent == new.child:
                continue
            last = self._above.get(new.child)
            if last is not None and not new.static and 0 < last[0].stamp_s - new.stamp_s < CLOCK_JUMP_S:
                continue
            self._above[new.child] = (new, min(new.stamp_s, now_s) if new.stamp_s > 0 else now_s)

    def pose(self, frame: str, within: str, now_s: float) -> FramePose | None:
        """Newest pose of a frame in another; ``None`` if they are not connected.

        :param frame: name of the frame, such as ``base_link``
        :param within: name of the other frame, such as ``map``
        :param now_s: time [s]
        """
        down, up = self._roots(frame), self._roots(within)
        common = next((name for name in down if name in up), None)
        if common is None:
            return None
        place, turn, oldest_s = down[common]
        origin, other_turn, other_s = up[common]
        back = _conjugate(other_turn)
        x, y, _ = _rotated(back, (place[0] - origin[0], place[1] - origin[1], place[2] - origin[2]))
        age_s = now_s - min(oldest_s, other_s)
        return FramePose(x, y, _yaw(_product(back, turn)), 0.0 if math.isinf(age_s) else max(age_s, 0.0))

    def gap(self, frame: str, within: str) -> str:
        """Why a frame has no pose in another, in words."""
        known = {name for above, _ in list(self._above.values()) for name in (above.parent, above.child)}
        for name in (frame, within):
            if name not in known:
                return f"TF has no frame {name}"
        return f"TF does not connect {frame} with {within}"

    def _roots(self, frame: str) -> dict[str, tuple[Vector, Quaternion, float]]:
        """Pose of a frame in itself and in every frame above, and the time of its oldest transform [s]."""
        place: Vector = (0.0, 0.0, 0.0)
        turn, oldest_s = _STILL, math.inf
        found = {frame: (place, turn, oldest_s)}
        while (above := self._above.get(frame)) is not None and above[0].parent not in found:
            link, time_s = above
            rotation = _unit(link.rotation)
            x, y, z = _rotated(rotation, place)
            shift = link.translation_m
            place, turn = (x + shift[0], y + shift[1], z + shift[2]), _product(rotation, turn)
            oldest_s = oldest_s if link.static else min(oldest_s, time_s)
            frame = link.parent
            found[frame] = (place, turn, oldest_s)
        return found


def yaw_rotation(yaw_rad: float) -> Quaternion:
    """Quaternion of a turn about the vertical [rad]."""
    return (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


def _unit(rotation: Quaternion) -> Quaternion:
    length = math.hypot(*rotation)
    x, y, z, w = rotation
    return x / length, y / length, z / length, w / length


def _conjugate(rotation: Quaternion) -> Quaternion:
    x, y, z, w = rotation
    return -x, -y, -z, w


def _product(first: Quaternion, second: Quaternion) -> Quaternion:
    """The turn ``second``, then the turn ``first``."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(rotation: Quaternion, place: Vector) -> Vector:
    x, y, z, _ = _product(_product(rotation, (*place, 0.0)), _conjugate(rotation))
    return x, y, z


def _yaw(rotation: Quaternion) -> float:
    x, y, z, w = rotation
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
