# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an operator asks for, checked against the field and the mission, as a command of the state machine."""

from __future__ import annotations

import math
from collections.abc import Callable
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
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import GraphTravel
from soilmoist_ros.foundation import InputError, did_you_mean, listing
from soilmoist_ros.mapping import Field, require_no_go

Place = tuple[float, float]

TARGETS = ("rate", "vwc")
"""Which map is to be good."""


class ReplyCode(StrEnum):
    """What became of a request, for programs."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    """Not in this state of the mission."""
    UNKNOWN_VERB = "unknown_verb"
    BAD_PLACE = "bad_place"
    BAD_POLYGON = "bad_polygon"
    BAD_DWELL = "bad_dwell"
    UNKNOWN_STOP = "unknown_stop"
    BAD_SETTING = "bad_setting"


@dataclass(frozen=True)
class OperatorRequest:
    """What an operator asks for, as it came; what a verb does not use is ignored.

    :param until_sd: standard deviation of the map at which the mission ends; 0: never, ``None``: as it is
    :param covariates: files that may explain the map of the next mission; ``None``: as they are
    """

    verb: str  # one of Verb
    who: str = ""  # who asks; empty: the operator
    place: tuple[float, ...] = ()  # east and north of the field's datum [m], or nothing
    geographic_place: tuple[float, ...] = ()  # latitude and longitude in WGS-84 [deg], or nothing
    dwell: str = ""  # seconds or a dwell rule; empty for that of the mission
    polygon: tuple[Place, ...] = ()  # corners of an area, east and north [m]
    stops: tuple[str, ...] = ()  # names of stops
    hours: float = 0.0  # time of the mission from its start [h]; 0: as it is
    strategy: str = ""  # how stops are chosen; empty: as it is
    target: str = ""  # which map is to be good; empty: as it is
    home: str = ""  # name of the stop to return to; empty: as it is
    until_sd: float | None = None
    until_gain: float | None = None  # gain in ten minutes below which it ends [%]; 0: never, ``None``: as it is
    field: str = ""  # field file of the next mission; empty: as it is
    earlier: tuple[str, ...] | None = None  # earlier runs that inform the next mission; ``None``: as they are
    covariates: tuple[str, ...] | None = None


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
    """A request that cannot be carried out in any state of the mission.

    :param code: what is wrong
    :param message: the same in words
    :param remedy: what to do
    """

    def __init__(self, code: ReplyCode, message: str, remedy: str) -> None:
        super().__init__(message, remedy)
        self.code = code


@dataclass(frozen=True)
class Requests:
    """Turns requests into commands."""

    field: Field  # the field
    access: FieldAccess | None  # where the robot may go; ``None`` while that is not known
    settings: ExplorerSettings  # how stops are chosen
    rules: MissionRules  # those of the mission
    state: MissionState  # the mission

    def command(self, request: OperatorRequest, now_s: float) -> Command:
        """The command of a request.

        :param now_s: time of the command [s]
        :raises RequestError: if something in the request is missing or impossible
        """
        verbs = [str(verb) for verb in Verb]
        if request.verb not in verbs:
            remedy = f"use one of: {', '.join(verbs)}{did_you_mean(request.verb, verbs)}"
            raise RequestError(ReplyCode.UNKNOWN_VERB, f"there is no verb {request.verb!r}", remedy)
        command = Command(now_s, Verb(request.verb), who=request.who.strip())
        details: dict[Verb, Callable[[OperatorRequest, Command], Command]] = {
            Verb.MEASURE: self._measure,
            Verb.RULE_OUT: self._rule_out,
            Verb.ORDER: self._order,
            Verb.CHANGE: self._change,
        }
        add = details.get(command.verb)
        return command if add is None else add(request, command)

    def _measure(self, request: OperatorRequest, command: Command) -> Command:
        given = (request.place, request.geographic_place, request.stops)
        if sum(map(bool, given)) != 1 or len(request.stops) > 1:
            remedy = "give one of: place as [x, y], geographic_place as [latitude, longitude], one name in stops"
            raise RequestError(ReplyCode.BAD_PLACE, "measure needs one place", remedy)
        access = self._known_access()
        stop = (
            self._named(access, request.stops[0]) if request.stops else self._stop_at(access, self._place(request))
        )
        position = self.state.position
        if position is not None and not math.isfinite(access.travel.travel_s(position, [stop])[0]):
            message = f"no route leads from the robot at ({position[0]:.1f}, {position[1]:.1f}) to {stop.name}"
            raise RequestError(ReplyCode.BAD_PLACE, message, "choose another place")
        return replace(command, stop=stop, dwell_s=self._dwell_s(request.dwell))

    def _known_access(self) -> FieldAccess:
        if self.access is None:
            message = "it is not known yet where the robot may drive"
            raise RequestError(ReplyCode.REFUSED, message, "wait for the map of the navigation")
        return self.access

    def _place(self, request: OperatorRequest) -> Place:
        """The place that was asked for [m]."""
        name = "place" if request.place else "geographic_place"
        given = request.place or request.geographic_place
        if len(given) != 2 or not all(map(math.isfinite, given)):
            what = "[x, y] in metres" if request.place else "[latitude, longitude] in degrees"
            raise RequestError(ReplyCode.BAD_PLACE, f"{name} is {list(given)}", f"give {what}")
        if request.place:
            return given[0], given[1]
        if abs(given[0]) > 90 or abs(given[1]) > 180:
            remedy = "give the latitude (-90 .. 90) first, then the longitude (-180 .. 180)"
            raise RequestError(ReplyCode.BAD_PLACE, f"{name} is {list(given)}", remedy)
        x_m, y_m = self.field.frame.to_local(given[0], given[1])[0]
        return float(x_m), float(y_m)

    def _stop_at(self, access: FieldAccess, place: Place) -> Stop:
        """A stop at a place: for free travel the place itself, on a graph the node there."""
        refusal = access.fence.refusal(place)
        if refusal:
            raise RequestError(ReplyCode.BAD_PLACE, f"the place cannot be used: {refusal}", "choose one inside")
        if not isinstance(access.travel, GraphTravel):
            return Stop(f"x{place[0]:.1f}y{place[1]:.1f}", *place)
        nearest = min(access.stops, key=lambda stop: math.dist(place, (stop.x_m, stop.y_m)))
        away_m = math.dist(place, (nearest.x_m, nearest.y_m))
        if away_m > self.rules.arrival_radius_m:
            message = f"the robot drives on a graph, and its nearest node {nearest.name} is {away_m:.1f} m away"
            raise RequestError(ReplyCode.BAD_PLACE, message, f"measure there: stops: [{nearest.name}]")
        return nearest

    def _named(self, access: FieldAccess, name: str) -> Stop:
        for stop in access.stops:
            if stop.name == name:
                return stop
        names = [stop.name for stop in access.stops]
        message = f"there is no stop {name!r} to measure at"
        remedy = f"use one of the {len(names)} stops inside the field{did_you_mean(name, names)}"
        raise RequestError(ReplyCode.UNKNOWN_STOP, message, remedy)

    def _dwell_s(self, text: str) -> float | None:
        """Fixed time of a stop [s]; ``None`` for the mission's rule."""
        if not text.strip():
            return None
        longest_s = self.rules.dwell.longest_s
        try:
            seconds = float(text)
        except ValueError:
            rule = self._rule(text)
            if not isinstance(rule, FixedInterval):
                message = f"a single stop needs a fixed time, not {text!r}"
                raise RequestError(ReplyCode.BAD_DWELL, message, "give seconds, such as 120") from None
            seconds = rule.interval_s
        if not 1.0 <= seconds <= longest_s:
            message = f"a dwell of {seconds:g} s is not possible"
            raise RequestError(ReplyCode.BAD_DWELL, message, f"give 1 .. {longest_s:g} s")
        return seconds

    def _rule(self, text: str) -> object:
        try:
            return parse_dwell(text, self.rules.dwell.longest_s)
        except InputError as error:
            first = error.mistakes[0]
            raise RequestError(ReplyCode.BAD_DWELL, first.message, first.remedy) from None

    def _rule_out(self, request: OperatorRequest, command: Command) -> Command:
        import shapely

        corners = list(dict.fromkeys(request.polygon))
        if len(corners) < 3 or not all(math.isfinite(value) for corner in corners for value in corner):
            message = f"the polygon has {len(corners)} different corners, or one is not a number"
            raise RequestError(ReplyCode.BAD_POLYGON, message, "give three corners or more in metres")
        try:
            require_no_go(np.array(corners), "the polygon", self.field.polygon, self.field.frame)
        except InputError as error:
            first = error.mistakes[0]
            raise RequestError(ReplyCode.BAD_POLYGON, first.message, first.remedy) from None
        area = shapely.Polygon(corners)
        if self.access is not None and not any(
            shapely.intersects_xy(area, stop.x_m, stop.y_m) for stop in self.access.stops
        ):
            west, south, east, north = area.bounds
            message = f"no stop lies in the polygon (x {west:.0f} .. {east:.0f} m, y {south:.0f} .. {north:.0f} m)"
            remedy = "give metres east and north of the field's datum"
            raise RequestError(ReplyCode.BAD_POLYGON, message, remedy)
        return replace(command, polygon=tuple(corners))

    def _order(self, request: OperatorRequest, command: Command) -> Command:
        queue = [queued.stop.name for queued in self.state.queue]
        for name in request.stops:
            if name not in queue:
                message = f"{name!r} is not in the queue, which has {listing(queue) or 'no stop'}"
                remedy = f"name stops of the queue{did_you_mean(name, queue)}, or add one with measure"
                raise RequestError(ReplyCode.UNKNOWN_STOP, message, remedy)
        if len(set(request.stops)) < len(request.stops):
            message = f"a stop is named twice: {listing(request.stops)}"
            raise RequestError(ReplyCode.UNKNOWN_STOP, message, "name each stop once")
        return replace(command, stops=request.stops)

    def _change(self, request: OperatorRequest, command: Command) -> Command:
        changes = Changes(
            budget_s=self._budget_s(request.hours) if request.hours else None,
            dwell=str(self._rule(request.dwell)) if request.dwell else None,
            strategy=request.strategy or None,
            target=self._target(request.target) if request.target else None,
            home=self._home(request.home) if request.home else None,
            warm_up_stops=self._warm_up_stops(request.strategy) if request.strategy else None,
            until_sd=self._limit("until_sd", request.until_sd),
            until_gain=self._limit("until_gain", request.until_gain),
            field=request.field or None,
            earlier=request.earlier,
            covariates=request.covariates,
        )
        if changes == Changes():
            remedy = (
                "give hours, dwell, strategy, target, home, until_sd, until_gain, field, earlier or covariates"
            )
            raise RequestError(ReplyCode.BAD_SETTING, "there is nothing to change", remedy)
        return replace(command, changes=changes)

    def _budget_s(self, hours: float) -> float:
        if not (math.isfinite(hours) and hours > 0):
            raise RequestError(ReplyCode.BAD_SETTING, f"hours is {hours:g}", "give a number of hours above 0")
        used_s = self.state.time_used_s if self.state.under_way else 0.0
        if hours * 3600 <= used_s:
            message = f"hours is {hours:g}, and {used_s / 3600:.2f} h are used already"
            remedy = "give the time from the start of the mission, or use return_home or abort"
            raise RequestError(ReplyCode.BAD_SETTING, message, remedy)
        return hours * 3600

    def _limit(self, name: str, value: float | None) -> float | None:
        if value is not None and not (math.isfinite(value) and value >= 0):
            remedy = "give a number above 0, or 0 for no such end"
            raise RequestError(ReplyCode.BAD_SETTING, f"{name} is {value:g}", remedy)
        if name == "until_sd" and value is not None and value > MAX_UNTIL_SD:
            remedy = f"it is not in percent: write {value / 100:g}"
            raise RequestError(ReplyCode.BAD_SETTING, f"{name} is {value:g}", remedy)
        return value

    def _target(self, target: str) -> str:
        if target not in TARGETS:
            remedy = f"use one of: {', '.join(TARGETS)}{did_you_mean(target, TARGETS)}"
            raise RequestError(ReplyCode.BAD_SETTING, f"there is no target {target!r}", remedy)
        if target == "vwc" and self.settings.calibration is None:
            message = "target is vwc, but there is no calibration"
            raise RequestError(ReplyCode.BAD_SETTING, message, "start the planner with a calibrated site file")
        return target

    def _home(self, home: str) -> Stop:
        try:
            return self._known_access().with_home(home, self.state.position).stop(home)
        except RequestError:
            raise
        except InputError as error:
            first = error.mistakes[0]
            raise RequestError(ReplyCode.UNKNOWN_STOP, first.message, first.remedy) from None

    def _warm_up_stops(self, strategy: str) -> int:
        try:
            make_strategy(strategy, self.settings.preset)
        except InputError as error:
            first = error.mistakes[0]
            raise RequestError(ReplyCode.BAD_SETTING, first.message, first.remedy) from None
        return warm_up(strategy, self.settings.preset)[0]
