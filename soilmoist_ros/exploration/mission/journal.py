# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A mission that survives the end of its process: a journal of its events, and how to resume from it."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from soilmoist_ros.exploration.mission.events import Command, Event, Moved, Tick
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import (
    Goal,
    MissionState,
    Todo,
    event_from_dict,
    event_to_dict,
    replace,
    shown,
    state_from_json,
    to_dict,
)
from soilmoist_ros.exploration.mission.types import MissionRules, Phase, Verb
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.travel.stop import Stop

EVENT = "event"  # kind of the entries that hold events
VISIT = "visit"
"""Kind of the entries that hold visits; they follow from the events, for those who read only the results."""
PROPERTY = "property"
"""Key of records of further properties, which earlier versions wrote; they are no events of the mission."""

_log = logging.getLogger(__name__)


class EventJournal(Protocol):
    """Store of the events and states of a mission."""

    def append(self, kind: str, payload: Mapping[str, Any], *, durable: bool = True) -> int:
        """Write an entry; with ``durable`` it is safely on the disk afterwards."""

    def sync(self) -> None:
        """Make sure that all entries are on the disk."""

    def snapshot(self, state_json: str) -> None:
        """Write the state after all entries so far; they are on the disk afterwards."""

    def turn_over(self, state_json: str) -> None:
        """Write the state, and begin anew; entries before may be deleted."""

    def doubt(self) -> None:
        """An entry is missing, until the next snapshot."""


class MissionJournal:
    """Writes a mission down. A disk that fails does not stop the mission; it is logged once.

    Entries reach the disk together, by :meth:`secure`: before anything that they set off is carried out.

    :param journal: where to; nowhere if ``None``
    """

    def __init__(self, journal: EventJournal | None) -> None:
        self._journal = journal
        self._pending = self._doubtful = False
        self._kept: tuple[object, ...] = ()
        self.problem = ""

    def note(self, mission: Mission, event: Event) -> None:
        """Write an event down before the mission takes it in; a tick only if something is due."""
        if self._doubtful:
            self._write(mission)
        if isinstance(event, Command) and event.verb is Verb.START and not mission.state.under_way:
            self._try(lambda journal: journal.turn_over(mission.snapshot()))  # a season's journal stays small
            if (place := mission.state.position) is not None:  # without it, these entries alone start nothing
                self._append(event_to_dict(Moved(event.now_s, *place, sd_m=mission.state.position_sd_m)))
        due_s = mission.next_deadline_s if isinstance(event, Tick) else event.now_s
        if due_s is not None and due_s <= event.now_s:
            self._append(event_to_dict(event))
            self._pending |= not isinstance(event, Moved)  # a place may be lost

    def visit(self, visit: Visit) -> None:
        """Write a visit down."""
        self._append(to_dict(visit), kind=VISIT)
        self._pending = True

    def secure(self) -> None:
        """Make sure that everything noted is on the disk; one disk sync, or none if nothing is new."""
        if self._pending:
            self._pending = False
            self._try(lambda journal: journal.sync())

    def keep(self, mission: Mission) -> None:
        """Write the state down if more has changed than the records at a stop, which are replayed."""
        worth = shown(replace(mission.state, counting=None))
        if worth != self._kept and self._write(mission):
            self._kept = worth

    def _write(self, mission: Mission) -> bool:
        if not self._try(lambda journal: journal.snapshot(mission.snapshot())):
            return False
        self._pending = self._doubtful = False
        return True

    def _append(self, payload: Mapping[str, Any], kind: str = EVENT) -> None:
        if self._try(lambda journal: journal.append(kind, payload, durable=False)):
            self.problem = ""

    def _try(self, write: Callable[[EventJournal], object]) -> bool:
        """Write, if there is a journal; whether the disk has taken it."""
        if self._journal is None:
            return False
        try:
            write(self._journal)
        except OSError as error:
            if not self.problem:
                _log.error("the mission goes on, but is not written down any more: %s", error)
            self._journal.doubt()  # a pause may be missing: after a crash only people may resume
            self._doubtful, self._kept = True, ()
            self.problem = f"the mission is not written down: {error.strerror or error}"
            return False
        return True


def interrupted_mission(
    rules: MissionRules, snapshot: str | None, events: Iterable[Mapping[str, Any]], complete: bool = True
) -> Mission | None:
    """The mission that was under way when its process ended.

    After a journal with missing events nobody knows what the navigation does: a goal is taken to be open.

    :returns: the mission as it was, or ``None`` if none was under way
    :raises InputError: if something was not written by a mission
    """
    mission = Mission(rules) if snapshot is None else Mission.restore(rules, snapshot)
    for event in events:
        if PROPERTY not in event:
            mission.step(event_from_dict(dict(event)))  # what it asks for has been done, or is too late
    if not mission.state.under_way:
        return None
    changes = mission.state.changes
    if changes is not None and changes.strategy == "ivr":
        _log.warning("the strategy ivr of the interrupted mission is gone: gcb, which replaces it, goes on")
        mission.state = replace(mission.state, changes=dataclasses.replace(changes, strategy="gcb"))
    if not complete:
        mission.state = _with_open_goal(mission.state)
    return mission


def _with_open_goal(state: MissionState) -> MissionState:
    """A state in which the robot may be driving, so that it is stopped first."""
    if state.goal is not None:
        return state
    stop = Stop("an unknown stop", *(state.position or (0.0, 0.0)))
    goal = Goal(state.goals + 1, stop, deadline_s=state.now_s or 0.0)
    state = replace(state, goal=goal, goals=goal.goal_id)
    if state.phase is Phase.PAUSED:
        goal = replace(goal, cancelled_s=state.now_s or 0.0, requests=1)
        state = replace(state, goal=goal, phase=Phase.CANCELLING, todo=Todo.PAUSE)
    return state


def is_under_way(snapshot: str | None, events: Iterable[Mapping[str, Any]]) -> bool:
    """True if a mission was under way when its process ended.

    :param snapshot: the last state written down; without one the last start or abort decides
    :raises InputError: if something was not written by a mission
    """
    if snapshot is not None:
        return state_from_json(snapshot).under_way
    commands = (event_from_dict(dict(event)) for event in events if event.get("event") == Command.__name__)
    turns = [one.verb for one in commands if isinstance(one, Command) and one.verb in (Verb.START, Verb.ABORT)]
    return turns[-1:] == [Verb.START]
