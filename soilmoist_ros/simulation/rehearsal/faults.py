# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faults in a rehearsal: which one is on at which time, drawn from a seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np


class Fault(StrEnum):
    """What goes wrong."""

    FIX_JUMP = "fix_jump"
    """Fixes jump to somewhere else, by 15 m to 3 km."""
    FIX_FROZEN = "fix_frozen"
    """Fixes repeat the place at which the fault began."""
    FIX_SILENT = "fix_silent"
    """No fix comes."""
    FIX_RUNS = "fix_runs"
    """Fixes move away at 20 to 200 m/s."""
    SERVER_DEAD = "server_dead"
    """The navigation server is gone; the robot stops."""
    RUNAWAY = "runaway"
    """The navigation server is gone, and the robot drives on to its last goal."""
    SERVER_DEAF = "server_deaf"
    """The server rejects each cancellation and goes on."""
    RUNS_ON = "runs_on"
    """The server confirms a cancellation, and the robot drives on for 8 s."""
    SERVER_ABORTS = "server_aborts"
    """The server aborts each goal at once."""
    SERVER_LIES = "server_lies"
    """The server reports success without motion."""
    SERVER_HANGS = "server_hangs"
    """The server accepts goals and does nothing."""
    CLOCK_BACK = "clock_back"
    """The clock steps back by an hour."""
    CLOCK_FORWARD = "clock_forward"
    """The clock steps forward by six hours."""
    SENSOR_SILENT = "sensor_silent"
    """No record comes."""
    SENSOR_ZERO = "sensor_zero"
    """Records hold no counts."""
    MAPPER_SILENT = "mapper_silent"
    """The mapper publishes nothing."""
    PLANNER_SLOW = "planner_slow"
    """Choosing a stop takes two minutes."""
    LOW_BATTERY = "low_battery"
    """The battery runs down."""
    KILL_PLANNER = "kill_planner"
    """The planner is killed, and comes back."""
    KILL_MAPPER = "kill_mapper"
    """The mapper is killed, and comes back."""
    EMERGENCY = "emergency"
    """Somebody presses the emergency stop, and releases it later."""
    PAUSE = "pause"
    """The operator pauses, and resumes later."""
    ABORT = "abort"
    """The operator aborts."""
    SKIP = "skip"
    """The operator skips a stop."""
    RETURN = "return_home"
    """The operator sends the robot home."""
    MEASURE = "measure"
    """The operator asks for a measurement anywhere, also outside the field."""
    RULE_OUT = "rule_out"
    """The operator rules out an area anywhere."""
    CHANGE = "change"
    """The operator changes strategy and time."""
    REORDER = "reorder"
    """The operator asks for two measurements, and then for the other order of the queue."""
    LINK_CUT = "link_cut"
    """Logger and receiver are cut off: what they send meanwhile is lost."""
    LINK_STALL = "link_stall"
    """What logger and receiver send is held back, and comes all at once."""
    LINK_GARBAGE = "link_garbage"
    """Half of the lines of logger and receiver are damaged, with garbage between them."""
    KILL_DRIVER = "kill_driver"
    """The driver is killed, and comes back."""
    KILL_RECORDER = "kill_recorder"
    """The recorder is killed, and comes back."""
    DISK_FULL = "disk_full"
    """No space is left on the disk."""
    BAG_DELETED = "bag_deleted"
    """Somebody deletes the bag that is being recorded."""
    BATTERY_STALE = "battery_stale"
    """The state of the battery is no longer published."""
    DETOUR = "detour"
    """The navigation drives into the nearest no-go area, and stays in it for half a minute."""
    STRAY = "stray"
    """The navigation leaves its route by 3 to 20 m."""
    OTHER_MAP = "other_map"
    """The navigation's map is shifted by 4 to 60 m or turned, as with another datum or frame."""
    NEIGHBOUR = "neighbour"
    """The navigation reports the arrival one node, or 2.5 m, before the goal."""
    NO_RESULT = "no_result"
    """The server confirms each cancellation, drives on, and never reports an end."""
    OTHER_CLIENT = "other_client"
    """Somebody else sends the robot to another place, by the server of the mission."""
    CREEP = "creep"
    """A robot that should stand creeps at 0.06 to 0.3 m/s."""
    SLIDE = "slide"
    """A robot that stands slips by 1 to 8 m, once."""
    FIX_STEP = "fix_step"
    """Fixes of a robot that stands jump by 3.5 to 15 m."""
    FIX_DRIFT = "fix_drift"
    """Fixes of a robot that stands drift away at 0.1 to 2 m/s."""


OF_MOTION = tuple(list(Fault)[-10:])
"""Faults in which the robot, or its place, moves otherwise than the mission asked for."""


@dataclass(frozen=True, slots=True)
class Span:
    """One fault, from a time on [s]; ``size`` in 0..1 says how bad it is."""

    fault: Fault
    at_s: float
    for_s: float
    size: float

    @property
    def end_s(self) -> float:
        """When it is over [s]."""
        return self.at_s + self.for_s

    def __str__(self) -> str:
        return f"{self.fault} {self.at_s:.0f}..{self.end_s:.0f} s"


class Faults:
    """All faults of a rehearsal.

    :param spans: in order of time
    """

    def __init__(self, spans: Sequence[Span] = ()) -> None:
        self.spans = tuple(sorted(spans, key=lambda span: span.at_s))

    def span(self, fault: Fault, now_s: float) -> Span | None:
        """The span of a fault that is on now."""
        for span in self.spans:
            if span.fault is fault and span.at_s <= now_s < span.end_s:
                return span
        return None

    def on(self, fault: Fault, now_s: float) -> bool:
        """Whether a fault is on now; a runaway robot has no server either."""
        if fault is Fault.SERVER_DEAD and self.span(Fault.RUNAWAY, now_s) is not None:
            return True
        return self.span(fault, now_s) is not None

    def begin(self, from_s: float, to_s: float) -> list[Span]:
        """Faults that begin after one time, and not after another."""
        return [span for span in self.spans if from_s < span.at_s <= to_s]

    def __str__(self) -> str:
        return ", ".join(map(str, self.spans)) or "none"


_STOPPING = (Fault.PAUSE, Fault.ABORT, Fault.EMERGENCY, Fault.SKIP)
_AT_A_STOP = (
    Fault.SERVER_DEAF, Fault.RUNS_ON, Fault.RUNAWAY, Fault.SERVER_DEAD, Fault.FIX_JUMP, Fault.FIX_SILENT,
    Fault.CREEP, Fault.NO_RESULT, Fault.OTHER_CLIENT,
)  # fmt: skip
"""These matter most when the robot is to be stopped meanwhile."""


def random_faults(rng: np.random.Generator, first: Fault | None, more: int, until_s: float) -> Faults:
    """Some faults of a rehearsal.

    Half of them are short. A fault that matters when the robot is to be stopped often comes with such a command.

    :param rng: source of all randomness
    :param first: a fault that must be among them, if any
    :param more: number of further faults
    :param until_s: all begin before this time [s]
    """
    kinds = list(Fault)
    chosen = [] if first is None else [first]
    chosen += [kinds[int(number)] for number in rng.integers(len(kinds), size=more)]
    spans = []
    for kind in chosen:
        for_s = float(np.exp(rng.uniform(0.0, np.log(150.0)))) + 60.0 * (kind in OF_MOTION)
        span = Span(kind, float(rng.uniform(15, until_s)), for_s, float(rng.uniform()))
        if kind is Fault.OTHER_MAP:  # a map is wrong from the start
            span = replace(span, at_s=0.0, for_s=math.inf)
        spans.append(span)
        if kind in (Fault.PAUSE, Fault.EMERGENCY) and rng.uniform() < 0.4:  # it must survive a kill
            spans.append(Span(Fault.KILL_PLANNER, span.at_s + float(rng.uniform(0, for_s)), 1.0, 0.0))
        if kind in _AT_A_STOP and rng.uniform() < 0.6:
            stop = _STOPPING[int(rng.integers(len(_STOPPING)))]
            at_s = span.at_s + float(rng.uniform(0, min(for_s, 20.0)))
            spans.append(Span(stop, at_s, float(rng.uniform(10, 90)), 0.0))
    return Faults(spans)
