# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Chooses stops in a thread, so that the mission never waits for a choice."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from queue import SimpleQueue
from typing import NamedTuple

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.control.mission_setup import ExplorerSettings, FieldAccess, make_explorer
from soilmoist_ros.exploration.control.planning_queue import PlanJob, answer
from soilmoist_ros.exploration.mission.events import PlanFailed, Planned
from soilmoist_ros.exploration.mission.types import MissionRules

_log = logging.getLogger(__name__)


class Terms(NamedTuple):
    """What a stop is chosen under.

    :param started_s: start of the mission [s]
    :param access: where the robot may go
    :param settings: how stops are chosen, with the changes of an operator
    :param rules: rules of the mission, with the changes of an operator
    """

    started_s: float | None
    access: FieldAccess
    settings: ExplorerSettings
    rules: MissionRules

    def same_explorer(self, other: Terms) -> bool:
        """Whether one explorer serves both."""
        return self._made_for == other._made_for

    @property
    def _made_for(self) -> tuple[object, ...]:
        return self.started_s, self.access, self.settings, self.rules.home


class PlanningThread:
    """One thread that chooses stops, one after the other.

    Strategies remember what they planned: each mission has an explorer, which adopts the changes of an operator.

    :param wake: called from the thread when an answer is ready
    :param executor: runs the choices instead of the thread
    """

    def __init__(self, wake: Callable[[], None], executor: Executor | None = None) -> None:
        self._wake = wake
        self._executor = executor or ThreadPoolExecutor(1, "planning")
        self._answers: SimpleQueue[Planned | PlanFailed] = SimpleQueue()
        self._explorer: tuple[Terms, Explorer] | None = None

    def submit(self, job: PlanJob, terms: Terms) -> None:
        """Choose a stop; the answer follows in :meth:`answers`."""
        self._executor.submit(self._choose, job, terms)

    def answers(self) -> Iterator[Planned | PlanFailed]:
        """The answers that are ready, once each; their time is 0."""
        while not self._answers.empty():
            yield self._answers.get()

    def close(self) -> None:
        """Drop the choices that have not begun."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _choose(self, job: PlanJob, terms: Terms) -> None:
        try:
            explorer = self._explorer_for(terms)
            if job.late:
                _log.warning("choosing the next stop without what was measured last: the mapper is late")
            event = answer(explorer, job, terms.settings.needs_map)
        except Exception as error:
            _log.exception("planning failed")
            event = PlanFailed(0.0, job.request.plan_id, f"{type(error).__name__}: {error}")
        self._answers.put(event)
        self._wake()

    def _explorer_for(self, terms: Terms) -> Explorer:
        if self._explorer is not None and self._explorer[0].same_explorer(terms):
            known, explorer = self._explorer
            if known.rules != terms.rules:
                explorer.keep_for_home(terms.rules.way_home_s)
                self._explorer = terms, explorer
            return explorer
        explorer = make_explorer(terms.access, terms.settings, terms.rules)
        if self._explorer is not None:
            old, before = self._explorer
            if old.started_s == terms.started_s and old.access.stops == terms.access.stops:
                explorer.go_on_from(before, old.settings.strategy == terms.settings.strategy)
        self._explorer = terms, explorer
        return explorer
