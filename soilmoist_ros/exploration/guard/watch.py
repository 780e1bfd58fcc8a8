# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Watches what a mission depends on, and answers each cause of trouble with a response.

There is no clock in it: every observation has its time, and :meth:`Watch.check` is called several times a second.
An alarm begins when its cause is there, and ends when the cause has been over for some time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from soilmoist_ros.exploration.guard.failsafes import FAILSAFES, Cause, WatchLimits
from soilmoist_ros.exploration.guard.motion import UNKNOWN_SD_M, Motion
from soilmoist_ros.exploration.guard.signals import Battery, BatteryLimit, CountTrust
from soilmoist_ros.exploration.mission.events import AlarmOver
from soilmoist_ros.exploration.mission.types import Alarm, Response
from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.sensing import REPEATED_M, PlaceFix, PlaceJudge, Verdict

MIN_JUMPS: Final = 3
"""Number of implausible fixes in a row from which the place counts as lost; also of fixes that are too fast."""
MIN_JUMP_S: Final = 2.0  # minimum time over which implausible fixes come until the place counts as lost [s]
POSES_FROZEN_S: Final = 30.0
"""Shortest limit of frozen fixes where fixes show that the robot has arrived: noisy ones take up to 20 s [s]."""
APART_S: Final = 6.0  # fixes farther apart than this do not show whether places in between have changed [s]
RECORDS_APART: Final = 6.0
"""An alarm about single records ends after this multiple of the usual time, as they come every 10 s or so."""

IN_A_ROW: Final = 2  # number of fixes in a row that must agree that the robot is where it must not be
NOISE_SDS: Final = 4.0  # errors of a place across a border up to this many standard deviations are noise
MAX_NOISE_M: Final = 10.0  # errors of a place across a border beyond this distance are never noise [m]
NEAR_ROUTE_M: Final = 2.0  # a robot this close to its route follows it, wherever it heads [m]
SETTLE_S: Final = 3.0  # time after the end of a goal in which the robot may roll out [s]
SETTLE_M: Final = 1.0  # distance by which the robot may roll out after the end of a goal [m]
STILL_S: Final = 4.0  # standstill after which a robot that moved without a goal counts as standing [s]
AGAIN_S: Final = 10.0  # time after which an alarm about such a robot is repeated, so that it is stopped again [s]

_LOST: Final = frozenset((Cause.IN_NO_GO, Cause.OUTSIDE, Cause.JUMP, Cause.RELOCATED, Cause.SPEED))
"""While these are on, the way home is not known."""


@dataclass(frozen=True, kw_only=True)
class Doing:
    """State of the mission and its navigation at the time of a check.

    :param near_corner: whether it seems to be within the arrival radius of its goal, or of a bend of its route
    """

    under_way: bool = False  # whether a mission has started and not ended
    driving: bool = False  # whether a goal has been sent and has not ended
    near_corner: bool = False
    still: bool = False  # whether the robot should stand: it is the planner's, and its navigation works on no goal
    going_home: bool = False  # whether the robot is on its way home for good
    waiting_for: str = ""  # what is missing of the navigation; empty if nothing is
    other_client: str = ""  # who drives the robot instead of the planner; empty if nobody does
    feedback_age_s: float = math.nan  # time since the last feedback about the goal [s]; NaN if none has come
    time_left_s: float = math.inf  # time until the mission ends [s]
    way_home_s: float = 0.0  # time of the way home [s]; 0 without a home


@dataclass(frozen=True, kw_only=True)
class RobotSurroundings:
    """Place of the robot relative to field and route, now and in three seconds if it drives on."""

    outside_m: float = 0.0  # distance outside the field [m]
    no_go_m: float = 0.0  # depth in a no-go area, its margin included [m]
    off_route_m: float = 0.0  # distance from the route [m]; 0 without a goal
    ahead_outside_m: float = 0.0  # distance outside the field in three seconds [m]
    ahead_no_go_m: float = 0.0  # depth in a no-go area in three seconds [m]
    sd_m: float = math.nan  # standard deviation of each coordinate [m], NaN if unknown
    leaving_m: float = 0.0  # how deep in a no-go area a robot may be that is sent out of it [m]

    @property
    def noise_m(self) -> float:
        """Error of the place across a border that noise explains [m]."""
        sd_m = self.sd_m if math.isfinite(self.sd_m) else UNKNOWN_SD_M
        return min(NOISE_SDS * sd_m, MAX_NOISE_M)


@dataclass
class _State:
    """A cause: what is wrong (empty if nothing is), when that was seen last, and whether its alarm is on."""

    text: str = ""
    momentary: bool = False
    seen_s: float = -math.inf
    on: bool = False
    reason: str = ""
    times: int = 0
    told_s: float = -math.inf


class Watch:
    """Feed it with what comes in, use only the places that :meth:`fix` returns, and :meth:`check` it regularly.

    What has never been there is not missed: a robot without a battery monitor is normal. In a mission, records and
    the map are missed from its start.

    :param responses: what follows a cause where that is not the default in :data:`FAILSAFES`
    """

    def __init__(
        self, limits: WatchLimits | None = None, responses: Mapping[Cause, Response] = MappingProxyType({})
    ) -> None:
        self.limits = limits or WatchLimits()
        self.responses = {cause: responses.get(cause, row.response) for cause, row in FAILSAFES.items()}
        self.places = PlaceJudge(self.limits.place)  # decides on measured places
        self.motion, self._astray = Motion(), Motion()  # by plausible places, and by those that are not believed
        self._states = {cause: _State() for cause in Cause}
        self._heard: dict[str, tuple[float, int]] = {}  # when something was heard last, and the check then [s]
        self._checks = 0
        self._under_way = False
        self._fast, self._strayed = 0, False
        self._around = RobotSurroundings()
        self._allowed_outside_m = self._allowed_no_go_m = 0.0  # where the mission has begun
        self._seen = dict.fromkeys((Cause.IN_NO_GO, Cause.OUTSIDE, Cause.OFF_ROUTE, Cause.FAR_OFF_ROUTE), 0)
        self._still_since_s = math.inf
        self._frozen: tuple[float, float] | None = None  # the last place that was new
        self._stuck_s, self._stuck_since_s = 0.0, math.inf  # driven without a change of the place, and since when
        self._judged_s = math.inf
        self._record_stamp_s = self._map_stamp_s = -math.inf
        self._trust = CountTrust(self.limits.counts_bad_s)
        self.logger_fault = self.fix_fault = ""
        """Fault of the logger, as its driver says, and reason why the last epoch of the receiver had no place."""
        self._battery = Battery()
        self._battery_limits = {
            Cause.BATTERY_LOW: BatteryLimit(self.limits.battery_low, self.limits.battery_low_v),
            Cause.BATTERY_EMPTY: BatteryLimit(self.limits.battery_empty, self.limits.battery_empty_v),
        }

    # What comes in -------------------------------------------------------------------------------------------

    def fix(self, fix: PlaceFix) -> tuple[float, float] | None:
        """A measured place has come, from the receiver or with a record.

        :returns: the robot's place [m]; ``None`` if this one is not plausible, or too old when it comes
        """
        places, verdict = self.places, self.places.take(fix)
        if verdict is Verdict.JUMP:
            lost = places.rejected >= MIN_JUMPS and fix.now_s - places.rejected_since_s >= MIN_JUMP_S
            if lost:
                away = f"the newest is {places.jump_m(fix):.0f} m from where the sensor can be"
                self.report(Cause.JUMP, f"the last {places.rejected} positions are wrong: {away}")
            if places.rejected == 1 or places.agreeing == 1:
                self._astray = Motion()
            self._astray.take(fix.measured_s, fix.xy, places.sd_m(fix.sd_m))
        if verdict is not Verdict.PLAUSIBLE:
            return None
        self.report(Cause.JUMP, "")
        if places.relocated_m > 0:
            self.note(Cause.RELOCATED, f"the fixes agree on a place {places.relocated_m:.0f} m from the last one")
        if places.strayed_m > 0 and not self._strayed:
            self.note(Cause.RELOCATED, f"the place of the standing robot has moved by {places.strayed_m:.1f} m")
        self._strayed = places.strayed_m > 0
        if fix.age_s > self.limits.fix_old_s:
            return None
        self.hear("fix", fix.now_s)
        self.motion.take(fix.measured_s, fix.xy, places.sd_m(fix.sd_m))
        if self._frozen is None or math.dist(self._frozen, fix.xy) > REPEATED_M:
            self._frozen = fix.xy
            self._stuck_s, self._stuck_since_s = 0.0, math.inf
        fast = places.speed_mps > self.limits.place.max_speed_mps
        self._fast = self._fast + 1 if fast else 0
        self.report(
            Cause.SPEED, f"the robot moves at {places.speed_mps:.1f} m/s" if self._fast >= MIN_JUMPS else ""
        )
        return fix.xy

    def moved(self, around: RobotSurroundings) -> None:
        """The robot is at a plausible place.

        A mission may begin outside, or at the edge of a no-go area. Only what is worse than its best place since
        then counts.
        """
        self._around, limits, noise_m = around, self.limits, around.noise_m
        self._allowed_outside_m = min(self._allowed_outside_m, around.outside_m)
        self._allowed_no_go_m = min(self._allowed_no_go_m, around.no_go_m)
        outside_m, no_go_m = limits.max_outside_m + self._allowed_outside_m, math.inf
        if self._under_way:
            no_go_m = limits.max_in_no_go_m + self._allowed_no_go_m
        else:
            outside_m = max(limits.max_outside_m, limits.max_entry_m)
        outside_m, no_go_m = outside_m + noise_m, no_go_m + noise_m
        off_m, near_m = around.off_route_m, NEAR_ROUTE_M + noise_m
        ahead = ""
        if off_m > near_m and around.ahead_no_go_m > no_go_m:
            ahead = " and heads for a no-go area"
        elif off_m > near_m and around.ahead_outside_m > outside_m:
            ahead = " and heads for the border"
        for cause, wrong, text in (
            (Cause.IN_NO_GO, around.no_go_m > no_go_m, f"{around.no_go_m:.1f} m deep in a no-go area"),
            (Cause.OUTSIDE, around.outside_m > outside_m, f"{around.outside_m:.0f} m outside the field"),
            (Cause.OFF_ROUTE, off_m > limits.off_route_m + noise_m, f"{off_m:.0f} m off its route"),
            (
                Cause.FAR_OFF_ROUTE,
                bool(ahead) or off_m > limits.far_off_route_m + noise_m,
                f"{off_m:.0f} m off its route{ahead}",
            ),
        ):
            self._seen[cause] = self._seen[cause] + 1 if wrong else 0
            self.report(cause, f"the robot is {text}" if self._seen[cause] >= IN_A_ROW else "")

    def record(self, now_s: float, stamp_s: float, in_field: bool, quarantine: str = "") -> None:
        """A record has come.

        :param in_field: whether the map must have it, unless it is quarantined
        :param quarantine: reason why its counts or place are bad; empty if they are good
        """
        self.hear("record", now_s)
        self._trust.take(now_s, quarantine)
        if in_field and not quarantine:
            if self._record_stamp_s <= self._map_stamp_s:
                self.hear("map", now_s)  # the map was complete until now
            self._record_stamp_s = max(self._record_stamp_s, stamp_s)

    def map(self, now_s: float, stamp_s: float) -> None:
        """A map has come."""
        if stamp_s > self._map_stamp_s:
            self._map_stamp_s = stamp_s
            self.hear("map", now_s)

    def operator_absent(self, now_s: float) -> None:
        """A dead man's switch says that nobody is present."""
        self._heard.setdefault("operator", (now_s, self._checks))

    @property
    def has_watchdog(self) -> bool:
        """True if a watchdog was ever heard."""
        return "watchdog" in self._heard

    def battery(self, now_s: float, charge: float, voltage_v: float) -> None:
        """The state of the battery has come."""
        if self._battery.take(now_s, charge, voltage_v):
            self.hear("battery", now_s)
        for cause, limit in self._battery_limits.items():
            limit.take(charge, voltage_v)
            self.report(cause, limit.fault)

    def report(self, cause: Cause, text: str) -> None:
        """Report the fault of a cause from now on, with its values; empty without a fault."""
        state = self._states[cause]
        state.times += bool(text) and not state.text
        state.text, state.momentary = text, False

    def note(self, cause: Cause, text: str) -> None:
        """Something was wrong for a moment, such as a record that cannot be used."""
        state = self._states[cause]
        state.times += 1
        state.text, state.momentary = text, True

    def answer(self, cause: Cause, text: str, now_s: float) -> Alarm | AlarmOver | None:
        """Something was wrong, and is answered before the next check: by its alarm, ``None`` if that is on."""
        self.note(cause, text)
        return self._turn(cause, self._states[cause], now_s)

    def adopt(self, causes: Iterable[str], now_s: float) -> None:
        """Continue the alarms of an interrupted mission; they end as all others do."""
        for cause in set(causes) & set(Cause):
            state = self._states[Cause(cause)]
            state.on, state.seen_s, state.reason = True, now_s, "not seen again since the restart"

    # What follows --------------------------------------------------------------------------------------------

    def check(self, now_s: float, doing: Doing) -> tuple[Alarm | AlarmOver, ...]:
        """Judge all causes; to be called several times a second.

        :returns: the alarms that have begun or ended, in the order of :class:`Cause`
        """
        self._checks += 1
        self._judge(now_s, doing)
        return tuple(filter(None, (self._turn(cause, state, now_s) for cause, state in self._states.items())))

    @property
    def on(self) -> tuple[Cause, ...]:
        """Causes whose alarms are on."""
        return tuple(cause for cause, state in self._states.items() if state.on)

    def health(self, now_s: float) -> Health:
        """All causes with their severity, and the values behind them."""
        values, levels, messages = {}, [Level.OK], list[str]()
        for cause, state in self._states.items():
            response, level = self.responses[cause], Level.OK
            wrong = state.text or (state.reason if state.on else "")
            if state.on:
                level = Level.ERROR if self._under_way and response is not Response.WARN else Level.WARN
                messages.append(f"{cause}: {wrong}; {FAILSAFES[cause].remedy}")
            levels.append(level)
            times = f", {state.times} so far" if state.times else ""
            values[cause.value] = f"{level.name}{f': {wrong}' if wrong else ''} ({response}{times})"
        return Health("guard", max(levels), "; ".join(messages) or "nothing is wrong", values | self._facts(now_s))

    def _facts(self, now_s: float) -> dict[str, str]:
        facts = {
            "outside [m]": f"{self._around.outside_m:.1f}",
            "in no-go area [m]": f"{self._around.no_go_m:.1f}",
            "off route [m]": f"{self._around.off_route_m:.1f}",
            "speed [m/s]": f"{self.places.speed_mps:.2f}",
            "place trusted": "yes" if (doubt := self.places.doubt) is None else f"not since {doubt.since_s:.1f} s",
            **{f"fixes {verdict}": str(count) for verdict, count in self.places.counts.items() if count},
        }
        facts |= {f"age of {name} [s]": f"{now_s - heard_s:.1f}" for name, (heard_s, _) in self._heard.items()}
        if "battery" in self._heard:
            facts |= {"charge": f"{self._battery.charge:.2f}", "voltage [V]": f"{self._battery.voltage_v:.1f}"}
        else:
            facts["charge"] = "not watched: no message has come"
        return facts

    def _turn(self, cause: Cause, state: _State, now_s: float) -> Alarm | AlarmOver | None:
        """Begin or end the alarm of a cause."""
        response = self.responses[cause]
        wrong = state.text if response is not Response.IGNORE else ""
        if wrong:
            state.seen_s = now_s
        if state.momentary:
            state.text, state.momentary = "", False
        again = cause is Cause.MOVING and now_s - state.told_s >= AGAIN_S
        if wrong and (again or not state.on):
            state.on, state.reason, state.told_s = True, wrong, now_s
            return Alarm(now_s, cause.value, response, state.reason)
        apart = RECORDS_APART if cause in (Cause.COUNTS_FRAME, Cause.COUNTS_STAMP) else 1.0
        if state.on and not wrong and now_s - state.seen_s >= apart * self.limits.clear_s:
            state.on = False
            return AlarmOver(now_s, cause.value)
        return None

    def _judge(self, now_s: float, doing: Doing) -> None:
        """Report the causes that time brings."""
        limits = self.limits
        if doing.under_way and not self._under_way:
            self.hear("record", now_s)
            self.hear("map", now_s)
            self._battery.start(now_s)
            self._allowed_outside_m = min(self._around.outside_m, limits.max_entry_m)
            self._allowed_no_go_m = min(self._around.no_go_m, self._around.leaving_m)
        self._under_way = doing.under_way
        behind = doing.under_way and self._record_stamp_s > self._map_stamp_s
        fault = f" ({self.logger_fault})" if self.logger_fault else ""
        no_fix = f" ({self.fix_fault})" if self.fix_fault else ""
        for cause, name, missed, limit_s, what, why in (
            (Cause.FIX_OLD, "fix", True, limits.fix_old_s, "no plausible position for", no_fix),
            (Cause.RECORDS_OLD, "record", doing.under_way, limits.records_old_s, "no record for", fault),
            (Cause.MAP_OLD, "map", behind, limits.map_old_s, "the map has taken in no record for", ""),
            (Cause.WATCHDOG_SILENT, "watchdog", doing.under_way, limits.watchdog_silent_s, "no watchdog for", ""),
        ):
            silent_s = self._silent_s(name, now_s) if missed else 0.0
            self.report(cause, f"{what} {silent_s:.0f} s{why}" if silent_s > limit_s else "")
        self.report(Cause.OPERATOR_GONE, self._operator_fault(now_s, doing))
        self.report(Cause.MOVING, self._motion_fault(now_s, doing))
        self.report(Cause.COUNTS_BAD, self._trust.fault(now_s))
        self.report(Cause.BATTERY_SILENT, self._battery_fault(now_s, doing))
        self.report(Cause.FIX_FROZEN, self._frozen_fault(now_s, doing))
        self.report(Cause.OTHER_CLIENT, doing.other_client)
        self.report(Cause.NAVIGATION_SILENT, self._navigation_fault(now_s, doing))
        self.report(Cause.RESERVE, self._reserve_fault(now_s, doing))

    def _frozen_fault(self, now_s: float, doing: Doing) -> str:
        limit_s = self.limits.fix_frozen_s
        if "fix" not in self._heard or not limit_s:
            return ""
        heard_s, _ = self._heard["fix"]
        before_s, self._judged_s = self._judged_s, heard_s
        passed_s = heard_s - before_s
        if not doing.driving and self._stuck_s > limit_s:
            self._stuck_s, self._stuck_since_s = 0.0, math.inf  # it is stopped, and has a new trial
        elif doing.driving and not doing.near_corner and 0 < passed_s <= APART_S:
            # where it arrives it stands, and some receivers hold the place of a robot that stands
            self._stuck_s, self._stuck_since_s = self._stuck_s + passed_s, min(self._stuck_since_s, before_s)
        if self._stuck_s <= limit_s:
            return ""
        frozen_s = heard_s - self._stuck_since_s
        if self.places.doubt is None:
            self.motion.forget()  # what was repeated while the robot drove does not show that it stands
            self.places.distrust(frozen_s)
        return f"the place has not changed at all for {frozen_s:.0f} s"

    def _motion_fault(self, now_s: float, doing: Doing) -> str:
        """Motion of the robot since it should stand, in words; it begins anew when the robot stands again."""
        if not doing.still or doing.other_client:
            self._still_since_s = math.inf
            return ""
        self._still_since_s = min(self._still_since_s, now_s)
        settling = now_s - self._still_since_s < SETTLE_S
        motion = self._astray if self.places.rejected else self.motion
        shift = motion.moved(self._still_since_s + (0.0 if settling else SETTLE_S))
        if shift.certain_m <= self.limits.moving_m + (SETTLE_M if settling else 0.0):
            return ""
        if self._states[Cause.MOVING].on and motion.standing(STILL_S).for_s > 0:
            self._still_since_s = now_s
            return ""
        return f"the robot moves without a goal: {shift.length_m:.1f} m in {shift.span_s:.0f} s"

    def _battery_fault(self, now_s: float, doing: Doing) -> str:
        limit_s = self.limits.battery_silent_s
        silent_s = self._silent_s("battery", now_s) if doing.under_way else 0.0
        if not 0 < limit_s < silent_s:
            return ""
        return f"no state of the battery for {silent_s:.0f} s; the last one was {self._battery}"

    def _operator_fault(self, now_s: float, doing: Doing) -> str:
        """Absence of an operator: in a mission, and always where it keeps the robot from moving."""
        demanded = self.responses[Cause.OPERATOR_GONE] not in (Response.IGNORE, Response.WARN)
        if demanded and "operator" not in self._heard:
            return "no operator is present, and none was since the planner was started"
        silent_s = self._silent_s("operator", now_s) if demanded or doing.under_way else 0.0
        return f"no operator for {silent_s:.0f} s" if silent_s > self.limits.operator_gone_s else ""

    def _navigation_fault(self, now_s: float, doing: Doing) -> str:
        limit_s = self.limits.navigation_silent_s
        needed = doing.driving or self._states[Cause.NAVIGATION_SILENT].on
        if not (doing.under_way and needed and doing.waiting_for):
            self.hear("navigation", now_s)
        gone_s = self._silent_s("navigation", now_s)
        if gone_s > limit_s:
            return f"waiting for {doing.waiting_for} for {gone_s:.0f} s"
        silent = doing.driving and doing.feedback_age_s > limit_s
        return f"no feedback of the navigation for {doing.feedback_age_s:.0f} s" if silent else ""

    def _reserve_fault(self, now_s: float, doing: Doing) -> str:
        if not doing.under_way or doing.going_home or doing.way_home_s <= 0 or _LOST & set(self.on):
            return ""
        if doing.time_left_s < doing.way_home_s:
            return f"the way home takes {doing.way_home_s:.0f} s and {doing.time_left_s:.0f} s are left"
        charge, left = self._battery.charges(now_s, doing.way_home_s)
        if not left < self.limits.battery_empty:  # NaN while the use is not known
            return ""
        return f"the charge is {charge:.0%}, and {left:.0%} after the way home of {doing.way_home_s:.0f} s"

    def hear(self, name: str, now_s: float) -> None:
        """A source that can fall silent was heard, such as ``watchdog`` or ``operator``."""
        self._heard[name] = now_s, self._checks

    def _silent_s(self, name: str, now_s: float) -> float:
        """Time since something was heard [s]; 0 before, and while too few checks were made since then."""
        heard_s, check = self._heard.get(name, (now_s, self._checks))
        return now_s - heard_s if self._checks - check >= self.limits.min_checks else 0.0
