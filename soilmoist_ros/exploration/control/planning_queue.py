# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plan requests wait here until the map has what was just measured; then a thread answers them."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from queue import SimpleQueue
from typing import NamedTuple

from soilmoist_ros.exploration.control.certified_stops import CertifiedStops
from soilmoist_ros.exploration.control.explorer import (
    Explorer,
    ExplorerSettings,
    nominal_rate_cps,
    strategy_stream,
)
from soilmoist_ros.exploration.control.field_access import FieldAccess
from soilmoist_ros.exploration.control.team import PendingMeasurement
from soilmoist_ros.exploration.mission.events import PlanFailed, Planned, RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import make_strategy, strategy_kind, warm_up
from soilmoist_ros.foundation import SoilmoistError
from soilmoist_ros.mapping import Changing, FieldMap, Samples, VariogramFit

SAME_TIME_S = 1e-3  # times that differ by less are the same: they have been through messages [s]
OTHER_SENSOR_S = 10.0  # the last record of another sensor at a stop may have ended this much earlier [s]

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class PropertyMap:
    """The newest map of a property, as far as it has come."""

    name: str  # namespace of its mapper, empty for the robot's own
    weight: float = 1.0  # worth of a share of its variation, relative to the weights of other properties
    required: bool = False  # whether its counts decide the mission: stops are not chosen by maps that lack them
    factor: float = 1.0  # product of the correction factors of its last record [-]
    samples: tuple[Samples, float] | None = None  # merged samples, with the time of the last record in them [s]
    fit: tuple[VariogramFit, float] | None = None  # their variogram, with the time of the last record in it [s]
    changing: Changing | None = (
        None  # drift of the map and its samples by place and time; ``None`` without a drift
    )
    late: bool = False  # whether it was waited for in vain, and nothing has come since

    @property
    def is_complete(self) -> bool:
        """True if samples and variogram have come."""
        return self.samples is not None and self.fit is not None

    def lacks(self, measured_s: float, kind: PlanKind) -> bool:
        """True if a stop that ended at a time [s] is not yet in it, and it is worth waiting for.

        Before the first stop nothing can be; samples are all that a warm-up stop needs of a required map.
        """
        if math.isinf(measured_s) or not (self.required or (self.is_complete and not self.late)):
            return False
        if not self.required and kind is PlanKind.WARM_UP:
            return False
        parts = (self.samples,) if kind is PlanKind.WARM_UP else (self.samples, self.fit)
        since_s = measured_s - (SAME_TIME_S if self.required else OTHER_SENSOR_S)
        return any(part is None or part[1] < since_s for part in parts)


@dataclass(frozen=True, eq=False)
class PlanJob:
    """A request that can be answered now."""

    request: RequestPlan  # request of the mission
    place: tuple[float, float]  # place of the robot [m]
    maps: tuple[PropertyMap, ...]  # the newest map of each property, in the order in which they were announced
    late: bool = False  # whether a required map lacks what was measured last, because it did not come in time
    others: tuple[PendingMeasurement, ...] = ()  # pending measurements of other robots on the field


OWN = PropertyMap("", required=True)  # the property of the robot's own namespace, which the mission counts


class PlanningQueue:
    """Holds the newest plan request and the newest map of each property.

    :param wait_s: longest time to wait for maps [s]
    :param properties: the properties that are mapped, that whose counts decide the mission first
    """

    def __init__(self, wait_s: float, properties: Sequence[PropertyMap] = (OWN,)) -> None:
        self._wait_s = wait_s
        self._open: tuple[RequestPlan, float] | None = None
        self._measured_s = -math.inf
        self._maps = {each.name: replace(each) for each in properties}
        self._others: dict[str, PendingMeasurement] = {}
        self.weighed: tuple[str, ...] = ()
        """Further properties whose maps the last plan takes into account."""

    def measured(self, stamp_s: float) -> None:
        """A stop is complete; its last record ended then [s]."""
        self._measured_s = stamp_s

    def ask(self, request: RequestPlan, now_s: float) -> None:
        """A plan is wanted; an earlier request is dropped."""
        self._open = (request, now_s)

    def take_factor(self, name: str, factor: float) -> None:
        """A record of a property has come, with this product of its correction factors [-]."""
        self._maps[name].factor = factor

    def take_samples(self, name: str, samples: Samples, stamp_s: float) -> None:
        """Samples of a property have come, with the time of the last record in them [s]."""
        held = self._maps[name]
        held.samples, held.late = (samples, stamp_s), False

    def take_fit(
        self, name: str, fit: VariogramFit | None, stamp_s: float, changing: Changing | None = None
    ) -> None:
        """A variogram and a drift have come, with the time of the last record in them [s].

        :param fit: ``None``: there is none now
        """
        held = self._maps[name]
        held.fit, held.changing, held.late = (None if fit is None else (fit, stamp_s)), changing, False

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults of the maps of properties that are not required, in words."""
        optional = [each for each in self._maps.values() if not each.required]
        missing = ", ".join(each.name for each in optional if not each.is_complete)
        late = ", ".join(each.name for each in optional if each.is_complete and each.late)
        return (
            *([f"no map of {missing}: stops are chosen without it"] if missing else []),
            *([f"the map of {late} is stale: stops are chosen with the old one"] if late else []),
        )

    def take_other(self, name: str, pending: PendingMeasurement | None) -> None:
        """Pending measurement of another robot, ``None`` for none."""
        self._others.pop(name, None)
        if pending is not None:
            self._others[name] = pending

    def due(self, now_s: float, place: tuple[float, float] | None) -> PlanJob | None:
        """The request, once, when it can be answered: the maps are up to date, or do not come in time."""
        if self._open is None or place is None:
            return None
        request, since_s = self._open
        lacking = [each for each in self._maps.values() if each.lacks(self._measured_s, request.kind)]
        if lacking and now_s - since_s < self._wait_s:
            return None
        self._open = None
        for each in lacking:
            each.late = True
        self.weighed = tuple(
            each.name for each in self._maps.values() if each.is_complete and each.weight > 0 and not each.required
        )
        late = any(each.required for each in lacking)
        maps = tuple(replace(each) for each in self._maps.values())
        return PlanJob(request, place, maps, late, tuple(self._others.values()))


def answer(make: Callable[[], Explorer], job: PlanJob, strategy: str) -> Planned | PlanFailed:
    """Answer to a request, whose time is 0. It never fails: what goes wrong becomes a :class:`PlanFailed`.

    :param make: gives the explorer that chooses; its maps are brought up to date
    :param strategy: name of its strategy
    """
    plan_id = job.request.plan_id
    try:
        explorer = make()
        bring_up_to_date(explorer, job.maps)
        mapped = {each.name for each in explorer.properties if each.field_map.soil_map is not None}
        missing = any(each.required and each.name not in mapped for each in job.maps)
        if strategy_kind(strategy).needs_map and job.request.kind is PlanKind.EXPLORE and missing:
            return PlanFailed(0.0, plan_id, "no map has come: is the mapper running?")
        planned = explorer.plan(job.request, job.place, job.others)
        if planned.choice is None:
            planned = replace(planned, reason="no stop that is left fits into the time")
        return planned
    except (SoilmoistError, ValueError, ArithmeticError) as error:
        return PlanFailed(0.0, plan_id, str(error))
    except Exception as error:  # a mistake of ours: the mission asks the operator in the end
        _log.exception("planning failed")
        return PlanFailed(0.0, plan_id, f"{type(error).__name__}: {error}")


def bring_up_to_date(explorer: Explorer, maps: Sequence[PropertyMap]) -> None:
    """Give an explorer the newest maps; a property whose map has gone keeps none, a required one its last.

    :raises IllConditionedError: if a map cannot be computed
    """
    known = {each.name: each for each in explorer.properties}
    properties = []
    for each in maps:
        samples = each.samples[0] if each.samples is not None else Samples.none()
        held = known.get(each.name) if each.required else None
        held = held or Property(FieldMap(explorer.grid), name=each.name)
        held.weight, held.factor = each.weight, each.factor
        properties.append(held)
        if len(samples):  # the places are known without a map, too
            held.field_map.set_samples(samples, each.fit[0] if each.fit is not None else None, each.changing)
        if len(samples) and each.fit is not None:
            held.field_map.update()
    explorer.properties = properties


# The thread that chooses stops, so that the mission never waits for a choice ------------------------------------


class Terms(NamedTuple):
    """Terms under which a stop is chosen: start of the mission, access to the field, settings and rules."""

    started_s: float | None  # start of the mission [s]
    access: FieldAccess  # region for the robot, with its stops
    settings: ExplorerSettings  # settings of the choice of stops, with the changes of an operator
    rules: MissionRules  # rules of the mission, with the changes of an operator

    def same_explorer(self, other: Terms) -> bool:
        """True if one explorer serves both."""
        rules, others = self.rules, other.rules
        return self[:3] == other[:3] and (rules.home, rules.dwell) == (others.home, others.dwell)


def make_explorer(access: FieldAccess, settings: ExplorerSettings, rules: MissionRules) -> Explorer:
    """An explorer for one mission."""
    field_map = FieldMap(access.grid, knowledge=settings.knowledge)
    return Explorer(
        [Property(field_map, curve=settings.curve, thresholds=settings.thresholds)],
        access.stops,
        access.travel,
        make_strategy(settings.strategy, settings.preset),
        warm_up(settings.strategy, settings.preset)[1],
        rules,
        strategy_stream(settings.seed),
        nominal_rate_cps(settings.calibration),
        certified=CertifiedStops(settings.certify).plan if settings.certify else None,
    )


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
        self._begun_s = math.nan  # steady time [s]; NaN while nothing is chosen

    @property
    def busy_s(self) -> float:
        """Time for which the present choice has been made [s]; NaN without one."""
        return time.monotonic() - self._begun_s

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
        if job.late:
            _log.warning("choosing the next stop without what was measured last: the mapper is late")
        self._begun_s = time.monotonic()
        self._answers.put(answer(lambda: self._explorer_for(terms), job, terms.settings.strategy))
        self._begun_s = math.nan
        self._wake()

    def _explorer_for(self, terms: Terms) -> Explorer:
        if self._explorer is not None and self._explorer[0].same_explorer(terms):
            known, explorer = self._explorer
            if known.rules != terms.rules:
                explorer.use_rules(terms.rules)
                self._explorer = terms, explorer
            return explorer
        explorer = make_explorer(terms.access, terms.settings, terms.rules)
        if self._explorer is not None:
            old, before = self._explorer
            if old.started_s == terms.started_s and old.access.stops == terms.access.stops:
                explorer.go_on_from(before, old.settings.strategy == terms.settings.strategy)
        self._explorer = terms, explorer
        return explorer
