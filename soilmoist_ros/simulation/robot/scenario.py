# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios: faults of navigation, sensors, loggers and receivers in a simulated mission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, model_validator

from soilmoist_ros.foundation import Section, load_model, resource

Number = Annotated[int, Field(ge=1)]
Seconds = Annotated[float, Field(ge=0)]
Duration = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
RAIN_S = 300.0  # time that rain takes to change the rate [s]


class Span(Section):
    """A period of a fault."""

    at_s: Seconds  # begin, in simulated time since the start [s]
    for_s: Duration  # duration [s]

    def covers(self, now_s: float) -> bool:
        """True if a time since the start lies in the period."""
        return self.at_s <= now_s < self.at_s + self.for_s

    @property
    def ends(self) -> tuple[float, float]:
        """Begin and end, since the start [s]."""
        return self.at_s, self.at_s + self.for_s


class Occasion(Section):
    """Numbers of the goals or messages that a fault affects."""

    nth: Number  # the first affected number, counted from 1
    every: Number | None = None  # interval between further affected numbers; without it only the first is affected

    def hits(self, number: int) -> bool:
        """True if the fault affects this number."""
        if number < self.nth:
            return False
        return number == self.nth if self.every is None else (number - self.nth) % self.every == 0


class GoalFault(Occasion):
    """A fault of a navigation goal."""

    kind: Literal["no_motion", "fails", "hangs", "rejects"]
    """``no_motion``: success is reported at once without motion; ``fails``: the goal is aborted on the way;
    ``hangs``: the robot does not move, and the goal never ends; ``rejects``: it is not accepted."""
    share_of_way: Share = 0.5  # for ``fails``: share of the route that the robot drives before the abort
    error_code: int = Field(default=105, ge=0, le=65535)
    """For ``fails`` of a goal pose: error code of Nav2 in the result (105: no progress)."""


class NavigationFaults(Section):
    """Faults of the navigation; none by default."""

    localisation_delay_s: tuple[Seconds, Seconds] = (0.0, 0.0)
    """Shortest and longest random delay of ``closest_node`` and ``current_node`` [s]."""
    cancel: Literal["accepted", "looks_rejected"] = "accepted"
    """``accepted``: the goal ends as cancelled; ``looks_rejected``: the response lists no goal, but the robot
    stops and the goal ends as aborted."""
    cancel_ignored_s: Seconds = 0.0
    """Time for which requests to cancel a goal are rejected without effect, from the first one [s]."""
    coast_s: Seconds = 0.0  # time for which the robot drives on after the end of a cancelled goal [s]
    superseded: Literal["aborted", "success"] = "aborted"
    """Result of a goal that a new one replaces; ``success``: success is reported wherever the robot is."""
    unknown_target: Literal["rejected", "aborted"] = "rejected"
    """Result of a goal for an unknown node; ``aborted``: the goal is accepted first."""
    goals: tuple[GoalFault, ...] = ()  # faults of goals, by number of the goal
    absent: tuple[Span, ...] = ()
    """Periods without a navigation server; an active goal is lost without a result, and the robot stops."""

    @model_validator(mode="after")
    def _delays_in_order(self) -> NavigationFaults:
        if self.localisation_delay_s[0] > self.localisation_delay_s[1]:
            raise ValueError("'localisation_delay_s' is the shortest and the longest delay, in this order")
        return self


class Outage(Span):
    """A period during which a connection does not deliver."""

    kind: Literal["cut", "silence", "stall"]
    """``cut``: connections are closed and new ones refused; ``silence``: connections stay open, but messages are
    lost; ``stall``: messages are delayed and arrive all at once afterwards."""


class Damage(Occasion):
    """Damage of a message (a record of the logger, an epoch of the receiver)."""

    kind: Literal["missing", "twice", "wrong_checksum", "no_checksum", "cut_short", "split", "garbage"]
    """``missing``: the message is lost; ``twice``: it arrives twice; ``wrong_checksum``: one digit is changed;
    ``no_checksum``: the line ends before the star; ``cut_short``: the line is truncated and lacks its line end;
    ``split``: the second half arrives 0.5 s later; ``garbage``: a line of random bytes precedes the message."""


class LinkFaults(Section):
    """Faults of one connection."""

    outages: tuple[Outage, ...] = ()  # periods without delivery
    damages: tuple[Damage, ...] = ()  # damages of single messages


class FixShift(Span):
    """A period in which the receiver reports a wrong place without a word."""

    east_m: float = 0.0  # distance from the true place to the east [m]
    north_m: float = 0.0  # distance from the true place to the north [m]


class GnssFaults(LinkFaults):
    """Faults of the GNSS receiver and its connection."""

    no_fix: tuple[Span, ...] = ()  # periods without a position fix
    shifts: tuple[FixShift, ...] = ()  # periods with wrong places


class TubeFault(Span):
    """A period during which a tube does not count as it should."""

    tube: Number  # number of the tube, counted from 1
    kind: Literal["factor", "noise", "stuck"]
    """``factor``: it counts ``value`` times its share; ``noise``: it counts ``value`` noise counts per second in
    addition; ``stuck``: it repeats the count ``value``."""
    value: Duration | Literal[0]  # factor [-], noise [counts/s] or number of counts


class CountFault(Occasion):
    """A count that a tube sends instead of its own."""

    tube: Number = 1  # number of the tube, counted from 1
    counts: Annotated[int, Field(ge=0)]  # what it sends


class WeatherFault(Span):
    """A period during which a weather sensor is wrong."""

    quantity: Literal["pressure_hpa", "temperature_degc", "relative_humidity"]  # which sensor
    value: float | None = None  # what it reads, in the unit of the quantity; without it, it repeats its last value


class SensorFaults(Section):
    """Faults of the neutron sensor itself; none by default."""

    tubes: tuple[TubeFault, ...] = ()  # periods of bad tubes
    counts: tuple[CountFault, ...] = ()  # single wrong counts, by number of the record
    weather: tuple[WeatherFault, ...] = ()  # periods of bad weather sensors


class RateChange(Span):
    """A period in which the true rate changes evenly, by the same share everywhere, and then stays changed."""

    share: Annotated[float, Field(gt=-1)]
    """Change, as a share of the rate before: -0.1 for rain that lowers it by 10 % [-]."""

    @property
    def drift(self) -> RateDrift:
        """As the sensors know it."""
        return RateDrift(self.share, *self.ends)


class Scenario(Section):
    """Faults in a mission; none by default."""

    title: str = "nothing goes wrong"  # title for the log
    navigation: NavigationFaults = NavigationFaults()  # behaviour of the navigation
    sensor: SensorFaults = SensorFaults()  # faults of the neutron sensor
    logger: LinkFaults = LinkFaults()  # faults of the connection to the neutron logger
    gnss: GnssFaults = GnssFaults()  # faults of the GNSS receiver and its connection
    rain: RateChange | None = None
    """Rain or drying, which changes the true rate; the truth that is written is that before."""


def load_scenario(name: str) -> Scenario:
    """Load a scenario by shipped name or path; an empty name means no faults.

    :raises InputError: if the file does not exist; otherwise with every mistake in it
    """
    return load_model(resource("scenarios", name), Scenario) if name else Scenario()


@dataclass(frozen=True)
class RateDrift:
    """A change of the true rate, by the same share everywhere, evenly in time.

    >>> drying = RateDrift(0.1, 0.0, 7200.0)
    >>> drying.factor(0.0), drying.factor(3600.0), drying.factor(9000.0)
    (1.0, 1.05, 1.1)
    """

    share: float = 0.0  # change, as a share of the rate before: 0.1 for drying by 10 %, negative for wetting [-]
    begin_s: float = 0.0  # when it begins [s]
    end_s: float = 1.0  # when it is complete [s], > ``begin_s``

    def factor(self, time_s: float) -> float:
        """Rate at a time [s], relative to the rate before the change; exactly 1 without a change."""
        done = min(max((time_s - self.begin_s) / (self.end_s - self.begin_s), 0.0), 1.0)
        return 1.0 + self.share * done


STEADY = RateDrift()  # no change
