# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The robot in the plane of the field and in the frame of its navigation: datum, heading, and their check."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from soilmoist_ros.exploration.guard.frames import (
    BASE_M,
    Agreement,
    FrameCheck,
    FrameVerdict,
    Place,
    datum_text,
    direction,
    parse_datum,
)
from soilmoist_ros.exploration.guard.transforms import FramePose, Transform, TransformTree
from soilmoist_ros.foundation import Health, Level, LocalFrame, PlaneMove, fit_move, move_between
from soilmoist_ros.mapping import Field
from soilmoist_ros.sensing import NO_ARMS, UNKNOWN_COVARIANCE, Covariance, Fix, FixStatus, LeverArms, Track

FIELD, MAP, ROBOT = "field", "map", "robot"
"""Sources of the navigation's datum that are no datum themselves."""
MAX_TF_AGE_S: Final = 5.0
"""Age from which TF no longer tells where the robot is [s]."""
ASKED_M: Final = np.array([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)])
"""Places about which the robot's datum service is asked, relative to :attr:`RobotFrames.ask_about_m` [m]."""
ASK_NEAR_M: Final = 500.0
"""Distance from the field at which the answers of the datum service are exact enough [m]."""
_KEPT_FIXES: Final = 100

_LEVELS = {Agreement.AGREE: Level.OK, Agreement.UNKNOWN: Level.OK, Agreement.DISAGREE: Level.ERROR}


@dataclass(frozen=True, kw_only=True)
class FrameSettings:
    """Names and origin of the frames.

    :param frame: frame of all messages of this package: east, north, up about the field's datum
    :param navigation_frame: frame of the goals and the map of the navigation
    :param base_frame: frame of the robot's base
    :param datum: origin of the navigation's frame: ``field``, ``LAT,LON``, ``LAT,LON,YAW``, ``map`` or ``robot``
    :param limit_m: distance between TF and fix that still agrees [m]
    :param arms: where the antenna sits on the robot
    """

    frame: str = "map"
    navigation_frame: str = "map"
    base_frame: str = "base_link"
    datum: str = FIELD
    limit_m: float = 2.0
    arms: LeverArms = NO_ARMS


@dataclass(frozen=True, slots=True)
class RobotPose:
    """Pose of the robot's base in the plane of the field.

    :param place_m: east and north [m]
    :param yaw_rad: heading, counter-clockwise from east [rad]; NaN if unknown
    :param covariance_m2: covariance of the fix [m^2], NaN if unknown
    """

    place_m: Place
    yaw_rad: float
    covariance_m2: Covariance = UNKNOWN_COVARIANCE


class RobotFrames:
    """Follows fixes and transforms of a robot.

    :param field: the field
    :param settings: names and origin of the frames
    :raises InputError: if the datum is invalid

    Attributes
    ----------
    move : PlaneMove | None
        plane of the field to the frame of the navigation; ``None`` until it is known
    ask_about_m : tuple[float, float]
        place about which the datum service is to be asked, in the frame of the navigation [m]
    """

    def __init__(self, field: Field, settings: FrameSettings) -> None:
        self._frame = field.frame
        self._centre_m: Place = (float(field.polygon[:, 0].mean()), float(field.polygon[:, 1].mean()))
        self._settings = settings
        self.move: PlaneMove | None = None
        self.ask_about_m: Place = (0.0, 0.0)
        if settings.datum == FIELD:
            self.move = PlaneMove()
        elif settings.datum not in (MAP, ROBOT):
            self.move = parse_datum(settings.datum, field.frame, self._centre_m)
        self._tree = TransformTree()
        self._check = FrameCheck(field.frame, settings.limit_m, self.move)
        self._track = Track(max_positions=_KEPT_FIXES)
        self._datum = "unknown" if self.move is None else datum_text(field.frame, self.move)
        self._map_fault = ""
        self._unchecked = ""
        self._agreed = False
        self._disagreed = ""

    @property
    def waiting_for(self) -> str:
        """What is missing to know the frame of the navigation, and to trust it; empty if nothing is."""
        if self.move is not None:
            return self._unchecked
        if self._settings.datum == MAP:
            return self._map_fault or "a map of the navigation with a datum"
        return f"the navigation's datum: a datum service, or {BASE_M:.0f} m driven by hand with TF and fixes"

    def take_transforms(self, transforms: Iterable[Transform], now_s: float) -> None:
        """Take in transforms of TF.

        :param now_s: time of the arrival [s]
        """
        self._tree.add(transforms, now_s)

    def take_fix(self, fix: Fix, now_s: float) -> RobotPose | None:
        """Take in a fix of the antenna.

        :param now_s: time of the arrival [s]
        :returns: the robot's pose; ``None`` without a fix, or on another side of the earth
        """
        if fix.status is FixStatus.NO_FIX:
            return None
        x, y = self._frame.to_local(fix.position.latitude_deg, fix.position.longitude_deg)[0].tolist()
        if not math.isfinite(x + y):
            return None
        self._track.add(now_s, fix.position)
        tf = self._tf(now_s)
        yaw_rad = self._heading(tf, now_s)
        east_m, north_m = self._settings.arms.base_from_antenna(yaw_rad) or (0.0, 0.0)
        place = (x + east_m, y + north_m)
        if tf is not None:
            delay_s = max(tf.age_s, min(max(now_s - fix.stamp_s, 0.0), MAX_TF_AGE_S))
            self._check.add(now_s, place, (tf.x_m, tf.y_m), delay_s)
            if self.move is None and self._settings.datum == ROBOT and (found := self._check.fitted()) is not None:
                self._use(found)
        if tf is not None and self.move is not None:
            self._judge(self._check.verdict(now_s))
        self._unchecked = self._doubt(tf, now_s)
        return RobotPose(place, yaw_rad, fix.covariance_m2)

    def take_map_datum(self, datum: LocalFrame | None, frame: str = "") -> None:
        """Take in the datum and the frame that the map of the navigation names.

        :param datum: its datum, ``None`` if it names none
        :param frame: the frame of its places, empty if it names none
        """
        self._map_fault = ""
        own, navigation = (name.strip("/") for name in (self._settings.frame, self._settings.navigation_frame))
        if (named := frame.strip("/")) not in ("", navigation):
            apart = self.move is None or not self.move.is_identity
            if named != own or apart:
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
        if self._settings.datum == MAP:
            if self.move is None:
                self._use(move)
            elif math.dist(move.place(self._centre_m), self.move.place(self._centre_m)) > self._settings.limit_m:
                self._map_fault = (
                    f"the datum {datum_text(self._frame, move)} of the navigation's map was {self._datum} before: "
                    "start the planner again"
                )
        elif self._settings.datum == FIELD:
            (x, y), (field_x, field_y) = move.place(self._centre_m), self._centre_m
            away_m = math.dist((x, y), (field_x, field_y))
            if away_m > self._settings.limit_m:
                where = f"{away_m:.1f} m {direction(field_x - x, field_y - y)} of the field's"
                self._map_fault = (
                    f"the datum {datum_text(self._frame, move)} of the navigation's map lies {where}: "
                    "set navigation_datum: map"
                )

    def take_datum_answers(self, latitude_longitude_deg: Sequence[Place]) -> bool:
        """Take in what the datum service says of the places :data:`ASKED_M` about :attr:`ask_about_m`.

        :param latitude_longitude_deg: latitude and longitude of each place [deg]
        :returns: whether the frame of the navigation is known now; otherwise ask again, about another place
        """
        places = self._frame.to_local(*np.array(latitude_longitude_deg, float).T)
        if self.move is not None or not np.isfinite(places).all():
            return self.move is not None
        found, _ = fit_move(places, ASKED_M + self.ask_about_m)
        centre_m = found.place(self._centre_m)
        if math.dist(centre_m, self.ask_about_m) > ASK_NEAR_M:
            self.ask_about_m = centre_m
            return False
        self._use(found)
        return True

    @property
    def fault(self) -> str:
        """Why the robot must not drive, in words; empty if nothing is known against it.

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
            "pairs of TF and fix": str(verdict.pairs),
        }
        if verdict.pairs:
            values |= {
                "distance of TF and fix [m]": f"{verdict.distance_m:.2f}",
                "TF minus fix, east [m]": f"{verdict.east_m:.2f}",
                "TF minus fix, north [m]": f"{verdict.north_m:.2f}",
                "limit [m]": f"{verdict.limit_m:.2f}",
            }
        message = verdict.message
        if self._map_fault or self.move is None:
            level, message = Level.ERROR if self._map_fault else Level.WARN, self._map_fault or self.waiting_for
        elif self._disagreed and verdict.agreement is not Agreement.DISAGREE:
            level, message = Level.ERROR, f"{self._disagreed}; since then {message}"
        elif self._settings.frame == self._settings.navigation_frame and not self.move.is_identity:
            level = max(level, Level.WARN)
            message += f"; {self._settings.frame} names two frames: give the navigation's another name"
        return Health("frames", level, message, values)

    def _verdict(self, now_s: float) -> tuple[FrameVerdict, Level]:
        """The comparison, or why there is none."""
        settings = self._settings
        if not len(self._tree):
            return FrameVerdict(Agreement.UNKNOWN, "not checked: no TF"), Level.OK
        pose = self._tree.pose(settings.base_frame, settings.navigation_frame, now_s)
        if pose is None:
            gap = self._tree.gap(settings.base_frame, settings.navigation_frame)
            return FrameVerdict(Agreement.UNKNOWN, f"not checked: {gap}"), Level.WARN
        if pose.age_s > MAX_TF_AGE_S:
            return FrameVerdict(Agreement.UNKNOWN, f"not checked: TF is {pose.age_s:.0f} s old"), Level.WARN
        verdict = self._check.verdict(now_s)
        return verdict, _LEVELS[verdict.agreement]

    def _tf(self, now_s: float) -> FramePose | None:
        settings = self._settings
        pose = self._tree.pose(settings.base_frame, settings.navigation_frame, now_s)
        return pose if pose is not None and pose.age_s <= MAX_TF_AGE_S else None

    def _doubt(self, tf: FramePose | None, now_s: float) -> str:
        """Why the frames are not trusted yet; empty without TF, and once they have agreed: then faults decide."""
        if self._agreed or (tf is None and not self._disagreed):
            return ""
        return f"agreement of TF and fixes ({self._disagreed or self._check.verdict(now_s).message})"

    def _judge(self, verdict: FrameVerdict) -> None:
        match verdict.agreement:
            case Agreement.AGREE:
                self._agreed, self._disagreed = True, ""
            case Agreement.DISAGREE:
                self._disagreed = verdict.message

    def _heading(self, tf: FramePose | None, now_s: float) -> float:
        """Heading in the plane of the field: by TF, else from the last fixes; NaN if unknown [rad]."""
        if tf is not None and self.move is not None:
            return self.move.inverse.heading(tf.yaw_rad)
        return self._track.course.at(now_s)

    def _use(self, move: PlaneMove) -> None:
        self.move = self._check.move = move
        self._disagreed = ""
        self._datum = datum_text(self._frame, move)
