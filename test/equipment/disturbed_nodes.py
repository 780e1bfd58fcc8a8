# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faults of a rehearsal put into effect on real nodes, people who answer, and the judgement afterwards."""

from __future__ import annotations

import math
import time
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

from real_nodes import UNLIMITED, RealNodes

from rehearsal.cases import OF_MOTION, Fault, Ground, Span
from rehearsal.judge import Judge, Limits, Violation
from soilmoist_ros.exploration import MissionStatus, OperatorRequest, Phase, Verb
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.recording.map_sources import DRIVER, OWN, RecordTail
from soilmoist_ros.recording.stored_records import stored_counts
from soilmoist_ros.sensing.records import CountRecord

ANSWER_S = 40.0
"""Time after which people answer a mission that asks for them [s]."""
BACK_AFTER_S = 1.5
"""Time after which a killed node is started again [s of the wall clock], as by a launch file."""
LATE_S = 0.5
"""How late messages may be on a busy machine [s of the wall clock]."""
AGAIN_S = 10.0
"""Time after which people try again [s]."""
ROUNDING_S = 1e-6
"""How much later than it was a time that was heard may seem [s]: seconds since 1970 are known to 1.2e-7."""
LEFT_BYTES = 3000
"""What a disk that is nearly full still takes."""
PLAIN = {Fault.PAUSE: Verb.PAUSE, Fault.ABORT: Verb.ABORT, Fault.SKIP: Verb.SKIP}
KILLED = {
    Fault.KILL_PLANNER: "planner", Fault.KILL_MAPPER: "mapper", Fault.KILL_DRIVER: "sensor_driver",
    Fault.KILL_RECORDER: "recorder",
}  # fmt: skip
STEPS_S = {Fault.CLOCK_BACK: -3600.0, Fault.CLOCK_FORWARD: 6 * 3600.0}
OF_NAVIGATION = {Fault.SERVER_ABORTS: "fails", Fault.SERVER_LIES: "no_motion", Fault.SERVER_HANGS: "hangs"}
OF_THE_WORLD = (
    Fault.FIX_JUMP, Fault.FIX_SILENT, Fault.SERVER_DEAD, Fault.SERVER_DEAF, Fault.RUNS_ON, *OF_NAVIGATION,
    Fault.SENSOR_SILENT, Fault.SENSOR_ZERO, Fault.LINK_CUT, Fault.LINK_STALL, Fault.LINK_GARBAGE,
)  # fmt: skip
"""Faults that are part of the simulator's scenario."""
ON_NODES = tuple(
    fault
    for fault in Fault
    if fault not in (Fault.FIX_FROZEN, Fault.FIX_RUNS, Fault.RUNAWAY, Fault.PLANNER_SLOW, *OF_MOTION)
)
"""Faults that real nodes can be put through; the simulator does not know the others."""
SPOIL_BAGS = (Fault.KILL_RECORDER, Fault.DISK_FULL, Fault.BAG_DELETED)
"""Faults with which a bag need not have everything."""
TUBES = 12


def scenario_of(spans: Iterable[Span], navigator: str = "goto_node") -> dict[str, Any]:
    """The scenario of the simulator that has the faults of the world.

    :param spans: all faults
    :param navigator: kind of the navigation
    """
    navigation: dict[str, Any] = {"goals": [], "absent": []}
    sensor: dict[str, Any] = {"tubes": []}
    logger: dict[str, Any] = {"outages": [], "damages": []}
    gnss: dict[str, Any] = {"outages": [], "damages": [], "no_fix": [], "shifts": []}
    for span in spans:
        when = {"at_s": span.at_s, "for_s": span.for_s}
        match span.fault:
            case Fault.FIX_JUMP:
                far_m, angle = 15.0 * 200.0**span.size, 100 * span.size
                gnss["shifts"].append(
                    when | {"east_m": far_m * math.cos(angle), "north_m": far_m * math.sin(angle)}
                )
            case Fault.FIX_SILENT:
                gnss["no_fix"].append(when)
            case Fault.SERVER_DEAD:
                navigation["absent"].append(when)
            case Fault.SERVER_DEAF:
                navigation["cancel_ignored_s"] = min(span.for_s, 8.0)
            case Fault.RUNS_ON:
                navigation["coast_s"] = 8.0
            case Fault.SERVER_ABORTS | Fault.SERVER_LIES | Fault.SERVER_HANGS:
                poses = navigator == "navigate_to_pose"
                kind = "rejects" if poses and span.fault is Fault.SERVER_LIES else OF_NAVIGATION[span.fault]
                nth = {"nth": 1 + int(6 * span.size), "every": 9 + int(span.for_s) % 5}
                navigation["goals"].append(nth | {"kind": kind})
            case Fault.SENSOR_SILENT:
                logger["outages"].append(when | {"kind": "silence"})
            case Fault.SENSOR_ZERO:
                dead = {"kind": "factor", "value": 0}
                sensor["tubes"] += [when | dead | {"tube": tube + 1} for tube in range(TUBES)]
            case Fault.LINK_CUT | Fault.LINK_STALL:
                kind = "cut" if span.fault is Fault.LINK_CUT else "stall"
                for link in (logger, gnss):
                    link["outages"].append(when | {"kind": kind})
            case Fault.LINK_GARBAGE:
                for link, cadence_s in ((logger, 10.0), (gnss, 1.0)):
                    first = 1 + int(span.at_s / cadence_s)
                    for number in range(first, first + max(4, int(span.for_s / cadence_s)), 2):
                        kind = ("garbage", "wrong_checksum", "cut_short", "no_checksum")[number // 2 % 4]
                        link["damages"].append({"nth": number, "kind": kind})
    return {"title": "chaos", "navigation": navigation, "sensor": sensor, "logger": logger, "gnss": gnss}


class Disturber:
    """Puts the faults of the robot's computer and of people into effect as simulated time passes.

    :param nodes: the nodes
    :param spans: all faults; those of the world are in the scenario
    :param budget_s: time of a mission [s]
    """

    def __init__(self, nodes: RealNodes, spans: Sequence[Span], budget_s: float) -> None:
        self.acts: list[tuple[float, str]] = []
        """What people did, in its order: the time [s], and what stopped the robot; nothing for a resume."""
        self.log: list[str] = []
        self._nodes, self._operator, self._budget_s = nodes, nodes.operator, budget_s
        self._todo = sorted((span for span in spans if span.fault not in OF_THE_WORLD), key=lambda one: one.at_s)
        self._later: list[tuple[float, Callable[[], object]]] = []
        self._back: list[tuple[float, str]] = []
        self._asked_s = math.inf
        self._charge, self._battery = 0.6, True
        self._low_s = math.inf

    @property
    def busy(self) -> bool:
        """Whether something is still to be put back."""
        return bool(self._later or self._back)

    def step(self) -> None:
        now_s = self._operator.now_s
        while self._todo and self._todo[0].at_s <= now_s:
            span = self._todo.pop(0)
            self._note(str(span))
            self._begin(span)
        due = [do for at_s, do in self._later if at_s <= now_s]
        self._later = [(at_s, do) for at_s, do in self._later if at_s > now_s]
        for do in due:
            do()
        for one in [one for one in self._back if one[0] <= time.monotonic()]:
            self._back.remove(one)
            self._nodes.start(one[1])
        if self._battery:
            charge = self._charge if now_s < self._low_s else max(0.0, 0.24 - (now_s - self._low_s) / 2000)
            self._operator.charge(charge)
        self._answer(now_s)

    def put_back(self) -> None:
        for _, do in self._later:
            do()
        self._later.clear()
        for _, name in self._back:
            self._nodes.start(name)
        self._back.clear()

    def _note(self, text: str) -> None:
        self.log.append(f"{self._operator.now_s:.0f} s: {text}")

    def _begin(self, span: Span) -> None:
        nodes, after = self._nodes, partial(self._at, span.end_s)
        if span.fault in KILLED:
            name = KILLED[span.fault]
            if name not in [one for _, one in self._back]:
                nodes.kill(name)
                self._back.append((time.monotonic() + BACK_AFTER_S, name))
        elif span.fault in PLAIN:
            self._stop(PLAIN[span.fault])
            if span.fault is Fault.PAUSE:
                after(self._go_on)
        elif span.fault in STEPS_S:
            nodes.spoil(step_s=STEPS_S[span.fault] * (0.2 + span.size))
        match span.fault:
            case Fault.MAPPER_SILENT:
                nodes.freeze("mapper", True)
                after(lambda: nodes.freeze("mapper", False))
            case Fault.DISK_FULL:
                nodes.spoil(left_bytes=LEFT_BYTES)
                after(lambda: nodes.spoil(left_bytes=UNLIMITED))
            case Fault.BAG_DELETED:
                nodes.delete_bag()
            case Fault.LOW_BATTERY:
                self._low_s = span.at_s
            case Fault.BATTERY_STALE:
                self._battery = False
            case Fault.EMERGENCY:
                self._operator.press(True)
                self.acts.append((self._operator.now_s, "an emergency stop"))
                after(lambda: self._operator.press(False))
                self._at(span.end_s + 8.0, self._resume)
            case Fault.RETURN:
                self._resume(Verb.RETURN)
            case Fault.MEASURE | Fault.RULE_OUT | Fault.CHANGE | Fault.REORDER:
                for request in self._requests(span):
                    self._operator.ask(request)

    def _requests(self, span: Span) -> list[OperatorRequest]:
        ring = self._nodes.field.field.polygon
        low, high = ring.min(axis=0) - 10, ring.max(axis=0) + 10
        x, y = (low + (high - low) * ((7 * span.size) % 1, (31 * span.size) % 1)).tolist()
        match span.fault:
            case Fault.MEASURE:
                return [OperatorRequest("measure", place=(x, y), dwell="30")]
            case Fault.RULE_OUT:
                return [OperatorRequest("rule_out", polygon=((x, y), (x + 15, y), (x, y + 15)))]
            case Fault.CHANGE:
                return [OperatorRequest("change", strategy="random", hours=0.9 * self._budget_s / 3600)]
        status = self._operator.status
        queue = tuple(reversed(status.queue)) if status is not None else ()
        middle = ((low + high) / 2).tolist()
        asked = [OperatorRequest("measure", place=tuple(place), dwell="20") for place in (middle, (x, y))]
        return [*asked, OperatorRequest("order", stops=queue)]

    def _at(self, at_s: float, do: Callable[[], object]) -> None:
        self._later.append((at_s, do))

    def _answer(self, now_s: float) -> None:
        status = self._operator.status
        waits = status is not None and status.phase is Phase.PAUSED and status.needs_operator
        self._asked_s = min(self._asked_s, now_s) if waits else math.inf
        if now_s > self._asked_s + ANSWER_S:
            self._asked_s = math.inf
            self._resume()

    def _resume(self, verb: str = Verb.RESUME) -> bool:
        asked_s = self._operator.now_s - ROUNDING_S  # a goal that follows at once is not before it
        reply = self._operator.ask(OperatorRequest(verb))
        self._note(f"{verb}: {'no answer' if reply is None else reply.message}")
        if reply is None or reply.accepted:  # the answer may be lost, or late
            self.acts.append((asked_s, ""))
        return reply is not None and reply.accepted

    def _go_on(self) -> None:
        """Resume a paused mission, and try again while an alarm forbids it."""
        accepted, status = self._resume(), self._operator.status
        if not accepted and status is not None and status.phase is Phase.PAUSED:
            self._at(self._operator.now_s + AGAIN_S, self._go_on)

    def _stop(self, verb: Verb) -> None:
        reply = self._operator.ask(OperatorRequest(verb))
        self._note(f"{verb}: {'no answer' if reply is None else reply.message}")
        if reply is not None and reply.accepted and verb is not Verb.SKIP:
            self.acts.append((self._operator.now_s, verb))


def judged(
    nodes: RealNodes, spans: Sequence[Span], acts: Sequence[tuple[float, str]], budget_s: float
) -> list[Violation]:
    """Let the judge of the rehearsals see all that was heard and witnessed, in the order of time.

    Messages take their time: a state counts if it lasts from before to after.

    :param nodes: nodes that have ended
    :param spans: faults of the run
    :param acts: what people did, see :class:`Disturber`
    :param budget_s: time of a mission [s]
    """
    heard, late_s = nodes.operator.heard, max(3.0, LATE_S * nodes.settings.time_factor)
    field_ = nodes.field.field
    ground = Ground("", field_, None, (math.nan, math.nan))
    limits = Limits(beyond_m=3.0, stopping_s=10.0 + 2 * late_s, still_m=1.0, same_m=0.001, late_s=60.0 + late_s)
    judge = Judge(ground, budget_s, limits)
    disobedient = [one for one in spans if one.fault in (Fault.SERVER_DEAF, Fault.RUNS_ON, Fault.SERVER_DEAD)]
    witnessed = nodes.witnessed()
    timeline = Timeline(heard.statuses, late_s)
    events: list[tuple[float, int, Callable[[], object]]] = []
    for (_, before), (at_s, place) in pairwise(witnessed.places):
        status = timeline.at(at_s)
        if status is not None:
            events.append((at_s, 3, partial(judge.drove, at_s, before, [place], status, not disobedient)))
    for number, (at_s, what) in enumerate(acts):  # what is done at one time keeps its order
        if what:  # goals that were on their way come later
            resumed_s = next((then_s for then_s, other in acts[number:] if not other), math.inf)
            events.append((min(at_s + late_s, resumed_s), 1, partial(judge.stopped, at_s, what)))
        else:
            events.append((at_s, 1, partial(judge.resumes, at_s, lambda: True)))
    begun = next((at_s for at_s, status in heard.statuses if status.phase is not Phase.IDLE), None)
    if begun is not None:
        events.append((begun - late_s, 0, partial(judge.resumes, begun, lambda: True)))
    for at_s, place, name in witnessed.goals:
        events.append((at_s, 2, partial(judge.sent, at_s, place, name)))
    for at_s, status in heard.statuses:
        events.append((at_s, 4, partial(judge.said, at_s, status, 0.0)))
    for at_s, visit in heard.visits:
        events.append((at_s, 5, partial(judge.visited, at_s, visit)))
    events.sort(key=lambda event: event[:2])
    for _, _, happen in events:
        happen()
    end_s = nodes.operator.now_s
    judge.ended(end_s, nodes.operator.status)
    _judge_records(judge, nodes, spans)
    return judge.violations


def _judge_records(judge: Judge, nodes: RealNodes, spans: Sequence[Span]) -> None:
    """No record may be lost, and the map must be that of what was published, by the logs and by the recording."""
    heard, end_s = nodes.operator.heard, nodes.operator.now_s
    logs = {name: RecordTail(nodes.session / name, "map").read().records for name in (DRIVER, OWN)}
    stored = [record for records in logs.values() for record in records]
    judge.kept(end_s, [*heard.records, *heard.quarantined], stored, "the logs")
    judge.mapped(end_s, heard.samples, _samples(nodes, logs))
    bags = {bag.name: stored_counts(bag, ["/counts"], "map") for bag in nodes.bags}
    for name, records in bags.items():
        judge.known(end_s, records, stored, f"the bag {name}")
    if not any(one.fault in SPOIL_BAGS for one in spans):
        recorded = [record for records in bags.values() for record in records]
        judge.kept(end_s, [*heard.records, *heard.quarantined], recorded, "the bags")
        # A driver may be killed after it has stored a record and before it publishes it: the map has it, no bag.
        if not any(one.fault is Fault.KILL_DRIVER for one in spans):
            judge.mapped(end_s, heard.samples, _samples(nodes, bags))


def _samples(nodes: RealNodes, sources: Mapping[str, Sequence[CountRecord]]) -> Samples:
    whole = MapRecords(open_survey(str(nodes.configuration / "field.yaml")).map)
    for name, records in sources.items():
        whole.take(name, records)
    return whole.map.samples


class Timeline:
    """What the mission said when; a state counts if it lasts. A starved listener misses some states.

    :param said: states with their times [s]
    :param late_s: how late messages may be [s]
    """

    def __init__(self, said: Sequence[tuple[float, MissionStatus]], late_s: float) -> None:
        self._said = sorted(said, key=lambda one: one[0])
        self._times = [at_s for at_s, _ in self._said]
        self._late_s = late_s

    def at(self, at_s: float) -> MissionStatus | None:
        """What it said from before a time until after it; a neutral phase if phase or target changed."""
        first = bisect_left(self._times, at_s - self._late_s)
        last = bisect_right(self._times, at_s + self._late_s)
        if last == 0:
            return None
        latest = self._said[last - 1][1]
        around = [status for _, status in self._said[max(first - 1, 0) : last + 1]]
        same = all((one.phase, one.target) == (latest.phase, latest.target) for one in around)
        return latest if same else replace(latest, phase=Phase.PLANNING)
