# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests of operators, checked against the field and the mission, as commands of the state machine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from soilmoist_ros.exploration.control.explorer import ExplorerSettings
from soilmoist_ros.exploration.control.field_access import FieldAccess
from soilmoist_ros.exploration.mission.events import Command
from soilmoist_ros.exploration.mission.state import MissionState
from soilmoist_ros.exploration.mission.types import MAX_UNTIL_SD, Changes, MissionRules, Verb
from soilmoist_ros.exploration.planning.dwell import FixedInterval, parse_dwell
from soilmoist_ros.exploration.strategies.registry import make_strategy, warm_up
from soilmoist_ros.exploration.travel.stop import Stop, stops_xy
from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.mapping import Field, require_no_go

Place = tuple[float, float]

ROUNDED_M = 0.02
"""Largest error of a corner that a message or a page has rounded [m]."""
TARGETS = ("rate", "vwc", "decision")  # which map is to be good
_LACKS = {
    "vwc": ("is no calibration", "a calibrated site file"),
    "decision": ("are no thresholds", "target decision and threshold"),
}
"""Lack because of which a target cannot be chosen, and the remedy: with what to start the planner."""


class ReplyCode(StrEnum):
    """Result of a request, as a code for programs."""

    ACCEPTED = "accepted"
    REFUSED = "refused"  # not in this state of the mission
    UNKNOWN_VERB = "unknown_verb"
    BAD_PLACE = "bad_place"
    BAD_POLYGON = "bad_polygon"
    BAD_DWELL = "bad_dwell"
    UNKNOWN_STOP = "unknown_stop"
    BAD_SETTING = "bad_setting"


@dataclass(frozen=True)
class OperatorRequest:
    """Request of an operator, unchecked; values that its verb does not use are ignored."""

    verb: str  # one of Verb
    who: str = ""  # name of the client; empty: the operator
    place: tuple[float, ...] = ()  # east and north of the field's datum [m], or nothing
    geographic_place: tuple[float, ...] = ()  # latitude and longitude in WGS-84 [deg], or nothing
    dwell: str = ""  # seconds or a dwell rule; empty for that of the mission
    polygon: tuple[Place, ...] = ()  # corners of an area, east and north [m]
    stops: tuple[str, ...] = ()  # names of stops
    hours: float = 0.0  # time of the mission from its start [h]; 0: as it is
    strategy: str = ""  # strategy that chooses stops; empty: as it is
    target: str = ""  # map that plans improve; empty: as it is
    home: str = ""  # name of the stop to return to; empty: the one nearest to the place, or as it is
    until_sd: float | None = None  # deviation of the map at which the mission ends; 0: never, ``None``: as it is
    until_gain: float | None = None  # gain in ten minutes below which it ends [%]; 0: never, ``None``: as it is
    field: str = ""  # field file of the next mission; empty: as it is
    earlier: tuple[str, ...] | None = None  # earlier runs that inform the next mission; ``None``: as they are
    covariates: tuple[str, ...] | None = None  # files that may explain the next map; ``None``: as they are


@dataclass(frozen=True)
class Reply:
    """Answer to a request: a code for programs, and what happens, or why nothing does and what to do."""

    code: ReplyCode
    message: str

    @property
    def accepted(self) -> bool:
        """True if it is carried out."""
        return self.code is ReplyCode.ACCEPTED


class RequestError(InputError):
    """A request that cannot be carried out in any state of the mission."""

    def __init__(self, code: ReplyCode, message: str, remedy: str) -> None:
        super().__init__(message, remedy)
        self.code = code


@contextmanager
def refused(code: ReplyCode) -> Iterator[None]:
    """Errors of the input become those of a request."""
    try:
        yield
    except RequestError:
        raise
    except InputError as error:
        first = error.mistakes[0]
        raise RequestError(code, first.message, first.remedy) from None


@dataclass(frozen=True)
class Requests:
    """Turns requests into commands."""

    field: Field
    access: FieldAccess | None  # region for the robot; ``None`` while it is unknown
    settings: ExplorerSettings  # settings of the choice of stops
    rules: MissionRules  # rules of the mission
    state: MissionState

    def command(self, request: OperatorRequest, now_s: float) -> Command:
        """The command of a request.

        :raises RequestError: if something in the request is missing or impossible
        """
        verbs = [*map(str, Verb)]
        if request.verb not in verbs:
            remedy = f"use one of: {', '.join(verbs)}{did_you_mean(request.verb, verbs)}"
            raise RequestError(ReplyCode.UNKNOWN_VERB, f"there is no verb {request.verb!r}", remedy)
        command = Command(now_s, Verb(request.verb), who=request.who.strip())
        match command.verb:
            case Verb.MEASURE:
                return replace(command, stop=self._stop(request), dwell_s=self._dwell_s(request.dwell))
            case Verb.RULE_OUT:
                return replace(command, polygon=self._polygon(request))
            case Verb.LIFT:
                return replace(command, polygon=self._ruled_out(request))
            case Verb.ORDER:
                return replace(command, stops=request.stops)
            case Verb.CHANGE:
                return replace(command, changes=self._changes(request))
        return command

    def _known_access(self) -> FieldAccess:
        if self.access is not None:
            return self.access
        what, remedy = "it is not known yet where the robot may drive", "wait for the map of the navigation"
        raise RequestError(ReplyCode.REFUSED, what, remedy)

    def _stop(self, request: OperatorRequest) -> Stop:
        """The stop to measure at: by name, or a place; on a graph that is the node there."""
        given = (request.place, request.geographic_place, request.stops)
        if sum(map(bool, given)) != 1 or len(request.stops) > 1:
            remedy = "give one of: place as [x, y], geographic_place as [latitude, longitude], one name in stops"
            raise RequestError(ReplyCode.BAD_PLACE, "measure needs one place", remedy)
        access, place = self._known_access(), self.state.position
        named = {one.name: one for one in access.stops}
        if not request.stops:
            stop = self._stop_at(access, self._place(request))
        elif request.stops[0] in named:
            stop = named[request.stops[0]]
        else:
            remedy = f"use one of the {len(named)} stops inside the field"
            remedy += did_you_mean(request.stops[0], list(named))
            message = f"there is no stop {request.stops[0]!r} to measure at"
            raise RequestError(ReplyCode.UNKNOWN_STOP, message, remedy)
        if place is not None and not math.isfinite(access.travel.travel_s(place, [stop])[0]):
            message = f"no route leads from the robot at ({place[0]:.1f}, {place[1]:.1f}) to {stop.name}"
            raise RequestError(ReplyCode.BAD_PLACE, message, "choose another place")
        return stop

    def _place(self, request: OperatorRequest) -> Place:
        """The place that was asked for [m]."""
        given, name, form, highest = request.place, "place", "[x, y] in metres", (math.inf, math.inf)
        if not given:
            given, name, highest = request.geographic_place, "geographic_place", (90.0, 180.0)
            form = "the latitude (-90 .. 90) first, then the longitude (-180 .. 180), in degrees"
        if len(given) != 2 or not all(
            math.isfinite(value) and abs(value) <= high for value, high in zip(given, highest, strict=True)
        ):
            raise RequestError(ReplyCode.BAD_PLACE, f"{name} is {list(given)}", f"give {form}")
        if request.place:
            return given[0], given[1]
        x_m, y_m = self.field.frame.to_local(given[0], given[1])[0].tolist()
        return x_m, y_m

    def _stop_at(self, access: FieldAccess, place: Place) -> Stop:
        if refusal := access.fence.refusal(place):
            raise RequestError(ReplyCode.BAD_PLACE, f"the place cannot be used: {refusal}", "choose one inside")
        if not access.on_graph:
            return Stop(f"x{place[0]:.1f}y{place[1]:.1f}", *place)
        nearest = min(access.stops, key=lambda stop: math.dist(place, stop.xy))
        away_m = math.dist(place, nearest.xy)
        if away_m > self.rules.arrival_radius_m:
            message = f"the robot drives on a graph, and its nearest node {nearest.name} is {away_m:.1f} m away"
            raise RequestError(ReplyCode.BAD_PLACE, message, f"measure there: stops: [{nearest.name}]")
        return nearest

    def _dwell_s(self, text: str) -> float | None:
        """Fixed time of a stop [s], given as seconds or ``fmi:SECONDS``; ``None`` for the mission's rule."""
        if not text.strip():
            return None
        longest_s = self.rules.dwell.longest_s
        with refused(ReplyCode.BAD_DWELL):
            rule = parse_dwell(text if ":" in text or text.isalpha() else f"fmi:{text}", longest_s)
        if not (type(rule) is FixedInterval and 1.0 <= rule.interval_s <= longest_s):
            remedy = f"give 1 .. {longest_s:g} seconds, such as 120"
            raise RequestError(ReplyCode.BAD_DWELL, f"a single stop cannot have the dwell {text!r}", remedy)
        return rule.interval_s

    def _polygon(self, request: OperatorRequest) -> tuple[Place, ...]:
        import shapely

        corners = list(dict.fromkeys(request.polygon))
        if len(corners) < 3 or not all(math.isfinite(value) for corner in corners for value in corner):
            message = f"the polygon has {len(corners)} different corners, or one is not a number"
            raise RequestError(ReplyCode.BAD_POLYGON, message, "give three corners or more in metres")
        with refused(ReplyCode.BAD_POLYGON):
            require_no_go(np.array(corners), "the polygon", self.field.polygon, self.field.frame)
        area = shapely.Polygon(corners)
        if self.access is not None and not shapely.intersects_xy(area, stops_xy(self.access.stops)).any():
            west, south, east, north = area.bounds
            message = f"no stop lies in the polygon (x {west:.0f} .. {east:.0f} m, y {south:.0f} .. {north:.0f} m)"
            remedy = "give metres east and north of the field's datum"
            raise RequestError(ReplyCode.BAD_POLYGON, message, remedy)
        return tuple(corners)

    def _ruled_out(self, request: OperatorRequest) -> tuple[Place, ...]:
        """The ruled-out area with these corners."""
        for area in self.state.ruled_out:
            pairs = zip(area, request.polygon, strict=False)
            if len(area) == len(request.polygon) and all(math.dist(*pair) <= ROUNDED_M for pair in pairs):
                return area
        message = f"none of the {len(self.state.ruled_out)} ruled-out areas has these corners"
        remedy = "give polygon as in ruled_out_areas of mission_state"
        raise RequestError(ReplyCode.BAD_POLYGON, message, remedy)

    def _changes(self, request: OperatorRequest) -> Changes:
        rule, strategy = None, request.strategy
        if request.dwell:
            with refused(ReplyCode.BAD_DWELL):
                rule = str(parse_dwell(request.dwell, self.rules.dwell.longest_s))
        if strategy:
            with refused(ReplyCode.BAD_SETTING):
                make_strategy(strategy, self.settings.preset)
        for name, end in (
            ("hours", ""),
            ("until_sd", ", or 0 for no such end"),
            ("until_gain", ", or 0 for no such end"),
        ):
            value = getattr(request, name)
            if value is not None and not 0.0 <= value < math.inf:
                raise RequestError(ReplyCode.BAD_SETTING, f"{name} is {value:g}", f"give a number above 0{end}")
        if request.until_sd is not None and request.until_sd > MAX_UNTIL_SD:
            remedy = f"it is not in percent: write {request.until_sd / 100:g}"
            raise RequestError(ReplyCode.BAD_SETTING, f"until_sd is {request.until_sd:g}", remedy)
        changes = Changes(
            budget_s=request.hours * 3600 if request.hours else None,
            dwell=rule,
            strategy=strategy or None,
            target=self._target(request.target) if request.target else None,
            home=self._home(request),
            warm_up_stops=warm_up(strategy, self.settings.preset)[0] if strategy else None,
            until_sd=request.until_sd,
            until_gain=request.until_gain,
            field=request.field or None,
            earlier=request.earlier,
            covariates=request.covariates,
        )
        if changes == Changes():
            remedy = "give one of the settings, such as hours, dwell, strategy, target, home, until_sd or field"
            raise RequestError(ReplyCode.BAD_SETTING, "there is nothing to change", remedy)
        return changes

    def _target(self, target: str) -> str:
        if target not in TARGETS:
            remedy = f"use one of: {', '.join(TARGETS)}{did_you_mean(target, TARGETS)}"
            raise RequestError(ReplyCode.BAD_SETTING, f"there is no target {target!r}", remedy)
        if target not in self.settings.targets:
            lacks, remedy = _LACKS[target]
            message = f"target is {target}, but there {lacks}"
            raise RequestError(ReplyCode.BAD_SETTING, message, f"start the planner with {remedy}")
        return target

    def _home(self, request: OperatorRequest) -> Stop | None:
        """The stop to return to: by name, or the one nearest to a place; ``None``: as it is."""
        home = request.home
        if not home and (request.place or request.geographic_place):
            place = self._place(request)
            home = min(self._known_access().stops, key=lambda stop: math.dist(place, stop.xy)).name
        with refused(ReplyCode.UNKNOWN_STOP):
            return self._known_access().with_home(home, self.state.position).stop(home) if home else None
