# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The planner's process in a rehearsal: as its node makes it, from its settings and its journal alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from functools import partial
from typing import Any, Protocol

from soilmoist_ros.exploration import (
    POSES_FROZEN_S,
    AccessRules,
    Ended,
    ExplorerSettings,
    FieldAccess,
    Finish,
    GoalClient,
    Journal,
    MissionClock,
    MissionControl,
    MissionJournal,
    MissionRules,
    MissionStatus,
    Navigator,
    Outside,
    PoseClient,
    RobotMotion,
    Stop,
    Track,
    Visit,
    Watch,
    WatchLimits,
    interrupted_mission,
    parse_dwell,
)
from soilmoist_ros.mapping import FieldMap
from soilmoist_ros.sensing import CountRecord, Doubt
from soilmoist_ros.simulation.rehearsal.clients import ActionNavigator, PoseNavigator
from soilmoist_ros.simulation.rehearsal.faults import Fault
from soilmoist_ros.simulation.rehearsal.ground import ROBOT_RADIUS_M, Ground
from soilmoist_ros.simulation.rehearsal.judge import Judge
from soilmoist_ros.simulation.rehearsal.world import SPEED_MPS, World

Place = tuple[float, float]

STOP_OVERHEAD_S = 5.0
THINKING_S = {False: 1.0, True: 120.0}
"""Time to choose a stop, and when the planner is slow [s]."""


class MapStore(Protocol):
    """Brings records into the map of one mapper process."""

    def received(self, records: Sequence[CountRecord]) -> None:
        """Records have come as a message."""
        ...

    def doubt(self, doubt: Doubt) -> None:
        """A doubt about the place has begun or ended."""
        ...

    def second(self, age_s: float) -> None:
        """A second has passed; the process is so old [s]."""
        ...

    def close(self) -> None:
        """The process has been killed."""
        ...


class Store(Protocol):
    """The disk, which survives all processes."""

    def open_journal(self) -> tuple[Journal, str | None, Iterable[Mapping[str, Any]], bool]:
        """The planner's journal, its last snapshot, the events after it, and whether none is missing."""
        ...

    def close_journal(self) -> None:
        """The planner has been killed."""
        ...

    def publish(self, records: Sequence[CountRecord]) -> None:
        """The driver publishes records."""
        ...

    def full(self, is_full: bool) -> None:
        """The disk has no space left, or has space again."""
        ...

    def stored(self) -> Mapping[str, Sequence[CountRecord]]:
        """At the end, the records of each place that must have all of them."""
        ...

    def open_map(self, field_map: FieldMap) -> MapStore:
        """A mapper has started, with an empty map."""
        ...


class PlannerProcess:
    """Everything that a kill ends; it is the :class:`Outputs` of its mission.

    :param world: where it runs
    :param store: where it writes its journal, and finds it again
    :param judge: hears what it sends and says
    :param doubted: hears of doubts about the place that begin or end
    :raises InputError: if the mission refuses field or graph
    """

    def __init__(self, world: World, store: Store, judge: Judge, doubted: Callable[[Doubt], None]) -> None:
        self.doubted = doubted
        case = world.case
        self._world, self._judge = world, judge
        access = AccessRules(robot_radius_m=ROBOT_RADIUS_M, outside=Outside.NEVER, by_name=world.by_name)
        self.home = home_stop(case.ground, access) if case.home else None
        self._later = _Later(lambda: world.time_s + THINKING_S[world.faults.on(Fault.PLANNER_SLOW, world.time_s)])
        self.status: MissionStatus | None = None
        self.visits = 0
        self.finished = False
        journal, snapshot, events, complete = store.open_journal()
        settings = ExplorerSettings(
            strategy=case.strategy,
            preset="paper",
            seed=case.seed,
            motion=RobotMotion(SPEED_MPS, STOP_OVERHEAD_S),
            access=access,
        )
        rules = MissionRules(
            budget_s=case.budget_s,
            dwell=parse_dwell("fmi:60", 240.0),
            warm_up_stops=settings.warm_up_stops,
            min_dwell_s=30.0,
            speed_mps=SPEED_MPS,
            stop_overhead_s=STOP_OVERHEAD_S,
            arrival_radius_m=case.radius_m,
            blacklist_s=300.0,
        )
        frozen_s = POSES_FROZEN_S if case.navigator == "goal_pose" else WatchLimits().fix_frozen_s
        self.control = MissionControl(
            case.ground.field,
            settings,
            rules,
            self.home.name if self.home else "",
            20.0,
            self._navigator,
            self,
            MissionJournal(journal),
            executor=self._later,
            watch=Watch(WatchLimits(fix_frozen_s=frozen_s)),
            clock=MissionClock(self.now_s, lambda: world.time_s, "this computer"),
        )
        mission = interrupted_mission(rules, snapshot, events, complete)
        if mission is not None:
            self.control.take_up(mission, auto=complete)
        self.control.use_graph(case.ground.graph)
        self.control.show()

    def _navigator(self, report: Callable[[Ended], None]) -> Navigator:
        world = self._world
        self.link: ActionNavigator | PoseNavigator
        now_s, radius_m = partial(getattr, world, "time_s"), world.case.radius_m
        if world.case.navigator == "goal_pose":
            poses = PoseClient(radius_m, 5.0, SPEED_MPS)
            self.link = PoseNavigator(poses, world.listener, now_s, report, self._sent, self._stopped)
        else:
            client, track = GoalClient(radius_m), Track(SPEED_MPS, radius_m)
            there_m = radius_m if world.by_name else track.still_m
            self.link = ActionNavigator(
                client, world.server, world.by_name, now_s, report, self._sent, track, there_m
            )
        return self.link

    def _sent(self, place: Place, what: str) -> None:
        if self._world.server.active:
            self._judge.replaced(self._world.time_s, what)
        home = None if self.home is None else (self.home.x_m, self.home.y_m)
        self._judge.sent(self._world.time_s, place, what, home)

    def _stopped(self, place: Place) -> None:
        self._judge.stop_sent(self._world.time_s, place, self._world.robot.place)

    def second(self) -> None:
        """What the node's timers do."""
        self._later.run_due(self._world.time_s)
        self.control.hand_on()
        self.control.tick()
        self.control.check()
        for doubt in self.control.doubts():
            self._world.doubts.take(doubt)
            self.doubted(doubt)
        self.control.show()

    # Outputs

    def now_s(self) -> float:
        """See :class:`Outputs`."""
        return self._world.now_s

    def show(self, status: MissionStatus, ahead: tuple[Stop, ...], more: Mapping[str, str]) -> None:
        """See :class:`Outputs`."""
        self.status = status

    def visit(self, visit: Visit) -> None:
        """See :class:`Outputs`."""
        self.visits += 1
        self._judge.visited(self._world.time_s, visit)

    def save(self, reason: str) -> None:
        """See :class:`Outputs`."""
        self._judge.saved()

    def finish(self, finish: Finish) -> None:
        """See :class:`Outputs`."""
        self.finished = True
        self._judge.finished(self._world.time_s, finish)

    def wake(self) -> None:
        """See :class:`Outputs`; plans are handed on each second."""


def home_stop(ground: Ground, access: AccessRules) -> Stop:
    """The stop nearest to where the robot begins.

    :raises InputError: if the robot cannot leave its place
    """
    stops = FieldAccess(ground.field, RobotMotion(), ground.graph, access, place=ground.start).stops
    return min(stops, key=lambda stop: math.dist(ground.start, (stop.x_m, stop.y_m)))


class _Later(Executor):
    """Carries out work when its time has come, in the thread that asks for it."""

    def __init__(self, due_s: Callable[[], float]) -> None:
        self._due_s = due_s
        self._work: list[tuple[float, Callable[[], object]]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self._work.append((self._due_s(), partial(fn, *args, **kwargs)))
        return Future()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._work = []

    def run_due(self, now_s: float) -> None:
        due = [work for due_s, work in self._work if due_s <= now_s]
        self._work = [(due_s, work) for due_s, work in self._work if due_s > now_s]
        for work in due:
            work()
