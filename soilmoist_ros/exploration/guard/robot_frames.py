# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The robot in the plane of the field and in the frame of its navigation: datum, heading, and their check.

A navigation with another datum, or a map that is turned, drives the robot to shifted places without an error.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import Health, InputError, Level, LocalFrame, PlaneMove, fit_move, move_between
from soilmoist_ros.mapping import Field
from soilmoist_ros.sensing import UNKNOWN_COVARIANCE, Course, Covariance, Fix, FixStatus, base_from_antenna

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Frames that a robot publishes ----------------------------------------------------------------------------------

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # components x, y, z, w

CLOCK_JUMP_S = 10.0  # step back of the stamps above which a publisher has started anew [s]
_STILL: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Transform:
    """Pose of a frame in its parent frame."""

    parent: str  # name of the parent frame
    child: str  # name of the frame
    translation_m: Vector  # origin of the frame in its parent [m]
    rotation: Quaternion = _STILL  # turn from the frame to its parent, a quaternion of any length > 0
    stamp_s: float = 0.0  # time of the transform [s since 1970-01-01 UTC]
    static: bool = False  # whether it never changes


@dataclass(frozen=True, slots=True)
class FramePose:
    """Pose of a frame in another, seen from above."""

    x_m: float  # x of its origin [m]
    y_m: float  # y of its origin [m]
    yaw_rad: float  # direction of its x axis, counter-clockwise [rad]
    age_s: float  # age of its oldest transform, by stamp or arrival, whichever is longer [s]; 0 if all are static


class TransformTree:
    """Keeps the newest transform of every frame; may be filled in one thread and read in another."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[Transform, float]] = {}  # with the earlier of stamp and arrival

    def __len__(self) -> int:
        return len(self._above)

    def add(self, transforms: Iterable[Transform], now_s: float) -> None:
        """Take in transforms at a time [s]; impossible ones, and those older than the last of a frame, are not."""
        for new in transforms:
            numbers = (*new.translation_m, *new.rotation)
            turns = 0 < sum(value * value for value in new.rotation) < math.inf  # scipy refuses others
            if not all(map(math.isfinite, numbers)) or not turns or new.parent == new.child:
                continue
            last = self._above.get(new.child)
            if last is None or new.static or not 0 < last[0].stamp_s - new.stamp_s < CLOCK_JUMP_S:
                self._above[new.child] = (new, min(new.stamp_s, now_s) if new.stamp_s > 0 else now_s)

    def pose(self, frame: str, within: str, now_s: float) -> FramePose | None:
        """Newest pose of a frame, such as ``base_link``, in another at a time [s]; ``None`` if not connected."""
        down, up = self._roots(frame), self._roots(within)
        common = next((name for name in down if name in up), None)
        if common is None:
            return None
        place, turn, oldest_s = down[common]
        origin, other_turn, other_s = up[common]
        back = other_turn.inv()
        x, y, _ = back.apply(place - origin).tolist()
        age_s = now_s - min(oldest_s, other_s)
        yaw_rad = float((back * turn).as_euler("ZYX")[0])
        return FramePose(x, y, yaw_rad, 0.0 if math.isinf(age_s) else max(age_s, 0.0))

    def gap(self, frame: str, within: str) -> str:
        """Reason why a frame has no pose in another, in words."""
        known = {name for above, _ in list(self._above.values()) for name in (above.parent, above.child)}
        unknown = [name for name in (frame, within) if name not in known]
        return f"TF has no frame {unknown[0]}" if unknown else f"TF does not connect {frame} with {within}"

    def _roots(self, frame: str) -> dict[str, tuple[Array, Rotation, float]]:
        """Pose of a frame in itself and in every frame above, and the time of its oldest transform [s]."""
        from scipy.spatial.transform import Rotation

        place, turn, oldest_s = np.zeros(3), Rotation.identity(), math.inf
        found = {frame: (place, turn, oldest_s)}
        while (above := self._above.get(frame)) is not None and above[0].parent not in found:
            link, time_s = above
            rotation = Rotation.from_quat(link.rotation)
            place, turn = rotation.apply(place) + link.translation_m, rotation * turn
            oldest_s = oldest_s if link.static else min(oldest_s, time_s)
            frame = link.parent
            found[frame] = (place, turn, oldest_s)
        return found


def yaw_rotation(yaw_rad: float) -> Quaternion:
    """Quaternion of a turn about the vertical [rad]."""
    return (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


# Comparison of TF and fixes -------------------------------------------------------------------------------------

Place = tuple[float, float]

LIMIT_M = 2.0  # distance between TF and fix of a robot that stands that still agrees [m]
PAIRS = 15  # number of latest pairs that decide
MIN_PAIRS = 5
MIN_GAP_S = 0.5  # minimum time between two pairs; a receiver of 10 Hz would fill the memory with one moment [s]
PAIR_LIFE_S = 30.0  # age beyond which a pair no longer counts [s]
LATENCY_S = 1.0  # smallest delay between fix and TF that is allowed for while the robot moves [s]
STEP_M = 1.0  # distance between the pairs to which a frame is fitted [m]
BASE_M = 20.0  # extent of the pairs from which the turn of a frame is known [m]
MAX_FITTED = 500
TURN_SHOWN_M = 0.1  # displacement of the field from which the turn of a frame is part of its datum [m]
MAX_SPEED_MPS = 3.0  # speed above which a robot is not allowed for [m/s]


class FrameVerdict(NamedTuple):
    """Result of a comparison of TF and fixes."""

    agrees: bool | None  # ``None`` if that is not known
    message: str  # the result in words, with the remedy


class _Pair(NamedTuple):
    now_s: float
    fix_m: Place  # in the plane of the field
    tf_m: Place  # in the frame of the navigation
    delay_s: float


class FrameCheck:
    """Compares the robot's place by TF with its place by fixes.

    Medians over some pairs decide, so a bad fix has no effect. A moving robot may be ahead of its fix.

    :param move: plane of the field to the frame of the navigation
    """

    def __init__(self, frame: LocalFrame, move: PlaneMove | None = None) -> None:
        self._frame = frame
        self.move = move or PlaneMove()
        self._pairs: deque[_Pair] = deque(maxlen=PAIRS)
        self._apart: deque[_Pair] = deque(maxlen=MAX_FITTED)

    def add(self, now_s: float, fix_m: Place, tf_m: Place, delay_s: float = 0.0) -> None:
        """Add places of the robot's base: by the fix in the field's plane, by TF in the navigation's frame [m].

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
        if len(pairs) < MIN_PAIRS:
            return FrameVerdict(None, f"not checked yet: {len(pairs)} pairs of TF and fix of {MIN_PAIRS}")
        back = self.move.inverse
        found = np.array([back.place(pair.tf_m) for pair in pairs]) - [pair.fix_m for pair in pairs]
        east_m, north_m = np.median(found, axis=0).tolist()
        delay_s = max(LATENCY_S, median(pair.delay_s for pair in pairs))
        limit_m = LIMIT_M + delay_s * _speed_mps(pairs)
        away_m = math.hypot(east_m, north_m)
        message = f"TF and fix agree within {away_m:.1f} m (limit {limit_m:.1f} m)"
        if away_m > limit_m:
            message = (
                f"TF places the robot {away_m:.1f} m from its fix ({east_m:.1f} m east, {north_m:.1f} m north; "
                f"limit {limit_m:.1f} m): {self._remedy(found, (east_m, north_m))}"
            )
        return FrameVerdict(away_m <= limit_m, message)

    def fitted(self, reach_m: float = 0.0) -> PlaneMove | None:
        """Move from the field's plane to the navigation's frame that explains the pairs.

        ``None`` until the robot has moved :data:`BASE_M`, or if no turn and shift explains the pairs.

        :param reach_m: distance from the pairs within which it must hold: noise of the fixes turns it [m]
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
        extent_m = max(np.ptp(tf[good], axis=0))
        fits = error_m * max(reach_m / extent_m, 1.0) <= max(LIMIT_M, LATENCY_S)
        return move if fits and extent_m >= BASE_M else None

    def _remedy(self, found: NDArray[np.float64], offset_m: Place) -> str:
        move = self.fitted()
        spread_m = float(np.median(np.hypot(*(found - np.median(found, axis=0)).T)))
        if move is None and spread_m > max(LIMIT_M, 0.1 * math.hypot(*offset_m)):
            return "the distance varies, so check the localisation and the GNSS receiver"
        if move is None:
            x, y = PlaneMove(self.move.yaw_rad).place(offset_m)
            move = PlaneMove(self.move.yaw_rad, (self.move.shift_m[0] + x, self.move.shift_m[1] + y))
        own, other = (datum_text(self._frame, each) for each in (PlaneMove(), move))
        return (
            f"give the navigation the field's datum {own}, "
            f"or set navigation_datum: {other}, which explains the shift"
        )


def datum_text(frame: LocalFrame, move: PlaneMove) -> str:
    """Datum of a navigation's frame, by a move from the field's plane, as the parameter takes it."""
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
    times_s = np.diff([pair.now_s for pair in pairs])
    moved = (np.diff([getattr(pair, name) for pair in pairs], axis=0) for name in ("fix_m", "tf_m"))
    speeds = [float(np.median(np.hypot(*each.T) / times_s)) for each in moved]
    return min([*speeds, MAX_SPEED_MPS])


# The robot between the two planes -------------------------------------------------------------------------------

FIELD = "field"
MAP = "map"
ROBOT = "robot"  # as FIELD and MAP: sources of the datum of the navigation that are no datum themselves
MAX_TF_AGE_S: Final = 5.0  # age from which TF no longer tells where the robot is [s]
_KEPT_HEADINGS: Final = 100


@dataclass(frozen=True, kw_only=True)
class FrameSettings:
    """Names and origin of the frames.

    :param datum: origin of the navigation's frame: ``field``, ``LAT,LON``, ``LAT,LON,YAW``, ``map`` or ``robot``
    """

    frame: str = "map"  # frame of all messages of this package: east, north, up about the field's datum
    navigation_frame: str = "map"  # frame of the goals and the map of the navigation
    base_frame: str = "base_link"  # frame of the robot's base
    datum: str = FIELD
    antenna_m: Place = (0.0, 0.0)  # place of the antenna in the frame of the base: forward, to the left [m]


@dataclass(frozen=True, slots=True)
class RobotPose:
    """Pose of the robot's base in the plane of the field."""

    place_m: Place  # east and north [m]
    yaw_rad: float  # heading, counter-clockwise from east [rad]; NaN if unknown
    covariance_m2: Covariance = UNKNOWN_COVARIANCE  # covariance of the fix [m^2], NaN if unknown


class RobotFrames:
    """Follows fixes and transforms of a robot.

    :raises InputError: if the datum is invalid
    """

    def __init__(self, field: Field, settings: FrameSettings) -> None:
        self._frame = field.frame
        self._polygon = field.polygon
        self._centre_m: Place = (float(field.polygon[:, 0].mean()), float(field.polygon[:, 1].mean()))
        self._settings = settings
        self.move: PlaneMove | None = None  # from the plane of the field to the frame of the navigation, if known
        if settings.datum == FIELD:
            self.move = PlaneMove()
        elif settings.datum not in (MAP, ROBOT):
            self.move = parse_datum(settings.datum, field.frame, self._centre_m)
        self._tree = TransformTree()
        self._check = FrameCheck(field.frame, self.move)
        self._course = Course(_KEPT_HEADINGS)
        self._datum = "unknown" if self.move is None else datum_text(field.frame, self.move)
        self._map_fault = self._unchecked = self._disagreed = ""
        self._agreed = False

    @property
    def waiting_for(self) -> str:
        """Reason why the frame of the navigation is not known, or not trusted yet; empty without one."""
        if self.move is not None:
            return self._unchecked
        if self._settings.datum == MAP:
            return self._map_fault or "a map of the navigation with a datum"
        return f"the navigation's datum: at least {BASE_M:.0f} m driven by hand with TF and fixes"

    def take_transforms(self, transforms: Iterable[Transform], now_s: float) -> None:
        """Take in transforms of TF."""
        self._tree.add(transforms, now_s)

    def take_fix(self, fix: Fix, now_s: float) -> RobotPose | None:
        """Take in a fix of the antenna; ``None`` without a pose, also on the other side of the earth."""
        if fix.status is FixStatus.NO_FIX:
            return None
        x, y = self._frame.to_local(fix.position.latitude_deg, fix.position.longitude_deg)[0].tolist()
        if not math.isfinite(x + y):
            return None
        self._course.add(now_s, fix.position)
        tf = self._tf(now_s)
        yaw_rad = self._course.at(now_s)
        if tf is not None and self.move is not None:
            yaw_rad = self.move.inverse.heading(tf.yaw_rad)
        east_m, north_m = base_from_antenna(self._settings.antenna_m, yaw_rad)
        place = (x + east_m, y + north_m)
        if tf is not None:
            delay_s = max(tf.age_s, min(max(now_s - fix.stamp_s, 0.0), MAX_TF_AGE_S))
            self._check.add(now_s, place, (tf.x_m, tf.y_m), delay_s)
            if self.move is None and self._settings.datum == ROBOT:
                reach_m = float(np.hypot(*(self._polygon - place).T).max())
                if (found := self._check.fitted(reach_m)) is not None:
                    self._use(found)
        if tf is not None and self.move is not None:
            verdict = self._check.verdict(now_s)
            if verdict.agrees is not None:
                self._agreed |= verdict.agrees
                self._disagreed = "" if verdict.agrees else verdict.message
        self._unchecked = self._doubt(tf, now_s)
        return RobotPose(place, yaw_rad, fix.covariance_m2)

    def take_map_datum(self, datum: LocalFrame | None, frame: str = "") -> None:
        """Take in the datum and the frame that the map of the navigation names.

        :param datum: ``None`` if the map names none
        :param frame: empty if the map names none
        """
        self._map_fault = ""
        own, navigation = (name.strip("/") for name in (self._settings.frame, self._settings.navigation_frame))
        named = frame.strip("/")
        identical = self.move is not None and self.move.is_identity
        if named not in ("", navigation) and not (named == own and identical):
            who = f"the field's, {own!r}, and navigation_frame is" if named == own else "navigation_frame is"
            self._map_fault = (
                f"the navigation's map is in the frame {frame!r}, but {who} {navigation!r}: set "
                "navigation_frame to the frame of the map, or correct 'parent' in its transformation"
            )
            return
        if datum is None:
            if self._settings.datum == MAP:
                self._map_fault = (
                    "a datum in the navigation's map (origin, or datum_latitude and datum_longitude, in its meta)"
                )
            return
        try:
            move = move_between(self._frame, datum, about_m=self._centre_m)
        except ValueError as error:
            self._map_fault = f"the navigation's map is not of this field: {error}"
            return
        if self.move is None:
            if self._settings.datum == MAP:
                self._use(move)
            return
        place, known = move.place(self._centre_m), self.move.place(self._centre_m)
        away_m = math.dist(place, known)
        if away_m <= LIMIT_M:
            return
        text = f"the datum {datum_text(self._frame, move)} of the navigation's map"
        if self._settings.datum == MAP:
            self._map_fault = f"{text} was {self._datum} before: start the planner again"
        elif self._settings.datum == FIELD:
            self._map_fault = f"{text} lies {away_m:.1f} m from the field's: set navigation_datum: map"

    @property
    def fault(self) -> str:
        """Reason why the robot must not drive, in words; empty if nothing is known against it.

        A disagreement of TF and fixes stays one until they agree: without TF, or without fixes, the navigation
        still has the wrong frame.
        """
        return "" if self.move is None else self._map_fault or self._disagreed

    def health(self, now_s: float) -> Health:
        """State of the frames."""
        verdict, level = self._verdict(now_s)
        values = {
            "frame": self._settings.frame,
            "frame of the navigation": self._settings.navigation_frame,
            "datum of the navigation": self._datum,
        }
        message = verdict.message
        if self._map_fault:
            level, message = Level.ERROR, self._map_fault
        elif self.move is None:
            level, message = Level.WARN, self.waiting_for
        elif self._disagreed and verdict.agrees is not False:
            level, message = Level.ERROR, f"{self._disagreed}; since then {message}"
        elif self._settings.frame == self._settings.navigation_frame and not self.move.is_identity:
            level = max(level, Level.WARN)
            message += f"; {self._settings.frame} names two frames: give the navigation's another name"
        return Health("frames", level, message, values)

    def _verdict(self, now_s: float) -> tuple[FrameVerdict, Level]:
        """The comparison, or why there is none."""
        names = self._settings.base_frame, self._settings.navigation_frame
        pose, level = self._tree.pose(*names, now_s), Level.WARN
        if not len(self._tree):
            why, level = "no TF", Level.OK
        elif pose is None:
            why = self._tree.gap(*names)
        elif pose.age_s > MAX_TF_AGE_S:
            why = f"TF is {pose.age_s:.0f} s old"
        else:
            verdict = self._check.verdict(now_s)
            return verdict, Level.ERROR if verdict.agrees is False else Level.OK
        return FrameVerdict(None, f"not checked: {why}"), level

    def _tf(self, now_s: float) -> FramePose | None:
        pose = self._tree.pose(self._settings.base_frame, self._settings.navigation_frame, now_s)
        return pose if pose is not None and pose.age_s <= MAX_TF_AGE_S else None

    def _doubt(self, tf: FramePose | None, now_s: float) -> str:
        """Reason why frames are not trusted yet; empty without TF, and once they agreed: then faults decide."""
        if self._agreed or (tf is None and not self._disagreed):
            return ""
        return f"agreement of TF and fixes ({self._disagreed or self._check.verdict(now_s).message})"

    def _use(self, move: PlaneMove) -> None:
        self.move = self._check.move = move
        self._disagreed = ""
        self._datum = datum_text(self._frame, move)
