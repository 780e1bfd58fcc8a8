# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The planner's process in a rehearsal: as its node makes it, from its settings and its journal alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from functools import partial
from math import nan
from typing import Any

from rehearsal.cases import ROBOT_RADIUS_M, Fault, Ground, Place
from rehearsal.disk import Disk
from rehearsal.judge import Judge
from rehearsal.servers import ActionServer, Answered, CancelAnswered, GoalOver, PoseListener, Reply
from rehearsal.world import SPEED_MPS, World
from soilmoist_ros.exploration import (
    ANYBODYS,
    POSES_FROZEN_S,
    AccessRules,
    CancelAll,
    CancelSent,
    Ended,
    ExplorerSettings,
    FieldAccess,
    Finish,
    GoalClient,
    Listed,
    MissionClock,
    MissionControl,
    MissionJournal,
    MissionRules,
    MissionSetup,
    MissionStatus,
    Navigator,
    Outside,
    PoseClient,
    Request,
    RobotMotion,
    RobotTrack,
    SendGoal,
    SendPose,
    Stop,
    Visit,
    Watch,
    WatchLimits,
    Way,
    WayPoint,
    interrupted_mission,
    parse_dwell,
    way_points,
)
from soilmoist_ros.sensing import Doubt

STOP_OVERHEAD_S = 5.0
THINKING_S = {False: 1.0, True: 120.0}  # time to choose a stop, and when the planner is slow [s]


class PlannerProcess:
    """Everything that a kill ends; it is the :class:`Outputs` of its mission.

    :param world: where it runs
    :param store: where it writes its journal, and finds it again
    :param judge: hears what it sends and says
    :param doubted: hears of doubts about the place that begin or end
    :raises InputError: if the mission refuses field or graph
    """

    def __init__(self, world: World, store: Disk, judge: Judge, doubted: Callable[[Doubt], None]) -> None:
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
            strategy=case.strategy, preset="paper", seed=case.seed, motion=RobotMotion(SPEED_MPS, STOP_OVERHEAD_S),
            access=access,
        )  # fmt: skip
        rules = MissionRules(
            budget_s=case.budget_s, dwell=parse_dwell("fmi:60", 240.0), warm_up_stops=settings.warm_up_stops,
            min_dwell_s=30.0, speed_mps=SPEED_MPS, stop_overhead_s=STOP_OVERHEAD_S, arrival_radius_m=case.radius_m,
            blacklist_s=300.0,
        )  # fmt: skip
        frozen_s = POSES_FROZEN_S if case.navigator == "goal_pose" else WatchLimits().fix_frozen_s
        self.control = MissionControl(
            MissionSetup(
                field=case.ground.field, settings=settings, rules=rules, home=self.home.name if self.home else ""
            ),
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
            client, track = GoalClient(radius_m), RobotTrack(SPEED_MPS, radius_m)
            there_m = radius_m if world.by_name else track.still_m
            self.link = ActionNavigator(
                client, world.server, world.by_name, now_s, report, self._sent, track, there_m
            )
        return self.link

    def _sent(self, place: Place, what: str) -> None:
        if self._world.server.is_known(self._world.time_s):
            self._judge.replaced(self._world.time_s, what)
        home = None if self.home is None else (self.home.x_m, self.home.y_m)
        self._judge.sent(self._world.time_s, place, what, home)

    def _stopped(self, place: Place) -> None:
        self._judge.stop_sent(self._world.time_s, place, self._world.robot.place)

    def second(self) -> None:
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
        return self._world.now_s

    def show(self, status: MissionStatus, ahead: tuple[Stop, ...], more: Mapping[str, str]) -> None:
        self.status = status

    def visit(self, visit: Visit) -> None:
        self.visits += 1
        self._judge.visited(self._world.time_s, visit)

    def finish(self, finish: Finish) -> None:
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


# Navigators of a rehearsal: the rules of the package's clients, wired to simulated servers ----------------------

Sent = Callable[[Place, str], None]


class ActionNavigator:
    """Drives to nodes or poses by an action."""

    on_the_way = caution = ""
    corners: Sequence[Place] = ()  # of the last route
    stop_unheard = False  # rehearsals end with the world

    def __init__(
        self,
        client: GoalClient,
        server: ActionServer,
        by_name: bool,
        time_s: Callable[[], float],
        report: Callable[[Ended], None],
        sent: Sent,
        track: RobotTrack,
        there_m: float,
    ) -> None:
        self._client, self._server, self._by_name = client, server, by_name
        self._time_s, self._report, self._sent = time_s, report, sent
        self._track, self._there_m = track, there_m
        self._heard_s = nan
        self._goals: dict[int, int] = {}

    @property
    def waiting_for(self) -> str:
        if goal := self._client.unended:
            return f"the end of {goal}"
        return "" if self._server.present(self._time_s()) else "the navigation"

    @property
    def other_client(self) -> str:
        return "another client drives the robot" if self._server.others or self._before else ""

    @property
    def _before(self) -> bool:
        """True while the server works on a goal of a killed planner that nobody cancels: it lists whose it is."""
        ours = any(map(self._server.lists, self._goals.values()))
        return self._server.active and not (self._server.others or ours or self._client.cancels_before)

    @property
    def feedback_age_s(self) -> float:
        return self._time_s() - self._heard_s

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        self.corners = [(float(x), float(y)) for x, y in way.corners]
        nodes = tuple(map(WayPoint, way.nodes)) or (WayPoint(stop),)
        ahead = nodes if self._by_name else way_points(way.corners, stop)
        there = self._track.standing_at(stop, self._there_m)
        self._heard_s = nan
        self._do(self._client.go(goal_id, ahead, self._time_s(), there))

    def cancel(self, goal_id: int) -> None:
        self._do(self._client.cancel(goal_id, self._time_s()))

    def moved(self, place: Place, now_s: float, sd_m: float) -> None:
        self._track.moved(place, now_s, sd_m)
        self._do(self._client.moved(place, self._time_s()))

    def tick(self, now_s: float) -> None:
        self._track.tick(now_s)
        if self._server.active:  # it sends feedback all the time
            self._heard_s = self._time_s()
        server = self._server
        lives = frozenset((str(server.lives).encode(),)) if server.present(self._time_s()) else frozenset[bytes]()
        active = frozenset(goal_id for goal_id, number in self._goals.items() if server.lists(number))
        listed = Listed(lives, active, others=server.others or self._before)
        self._do(self._client.tick(server.present(self._time_s()), self._time_s(), listed))

    def heard(self, reply: Reply) -> None:
        """The server has said something; goals of an earlier process are not known here."""
        ours = {number: goal_id for goal_id, number in self._goals.items()}
        goal_id, now_s = ours.get(reply.goal), self._time_s()
        match reply:
            case Answered(accepted=accepted) if goal_id is not None:
                self._do(self._client.answered(goal_id, accepted, now_s))
            case GoalOver(status=status, success=success) if goal_id is not None:
                self._do(self._client.ended(goal_id, int(status), success, now_s))
            case CancelAnswered(code=code):
                self._do(
                    self._client.cancel_answered(goal_id if goal_id is not None else self._cancelled, code, now_s)
                )

    _cancelled = 0

    def _do(self, requests: Iterable[Request]) -> None:
        for request in requests:
            match request:
                case SendGoal(goal_id=goal_id, point=point):
                    stop = point.stop
                    place = (stop.x_m, stop.y_m)
                    self._sent(place, stop.name)
                    self._goals[goal_id] = self._server.send(stop.name if self._by_name else place, self._time_s())
                case CancelSent(goal_id=goal_id, ours=ours):
                    self._cancelled = goal_id
                    number = self._goals.get(goal_id) if ours else None
                    self._server.cancel(number, self._time_s(), goal_id == ANYBODYS)
                case Ended():
                    self._heard_s = nan
                    self._report(request)


class PoseNavigator:
    """Drives to poses that nobody answers."""

    on_the_way = caution = ""
    corners: Sequence[Place] = ()  # of the last route
    stop_unheard = False  # rehearsals end with the world
    feedback_age_s = nan

    def __init__(
        self,
        client: PoseClient,
        listener: PoseListener,
        time_s: Callable[[], float],
        report: Callable[[Ended], None],
        sent: Sent,
        stopped: Callable[[Place], None],
    ) -> None:
        self._client, self._listener, self._time_s = client, listener, time_s
        self._report, self._sent, self._stopped = report, sent, stopped
        self._going = False

    @property
    def waiting_for(self) -> str:
        return "" if self._listener.present(self._time_s()) else "a navigation"

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        self.corners = [(float(x), float(y)) for x, y in way.corners]
        self._going = True
        self._do(self._client.go(goal_id, way_points(way.corners, stop)))

    def cancel(self, goal_id: int) -> None:
        self._going = False
        self._do(self._client.cancel(goal_id))

    @property
    def other_client(self) -> str:
        return "another client drives the robot" if self._client.other_client else ""

    def overhear(self) -> None:
        self._do(self._client.heard_other())

    def moved(self, place: Place, now_s: float, sd_m: float) -> None:
        self._do(self._client.moved(place, now_s, sd_m))

    def tick(self, now_s: float) -> None:
        self._do(self._client.tick(False, now_s))

    def heard(self, reply: Reply) -> None:
        """Nothing answers."""

    def _do(self, requests: Iterable[SendPose | CancelAll | Ended]) -> None:
        for request in requests:
            match request:
                case SendPose(x_m=x_m, y_m=y_m):
                    if self._going:
                        self._sent((x_m, y_m), "pose")
                    else:
                        self._stopped((x_m, y_m))
                    self._listener.send((x_m, y_m), self._time_s())
                case Ended():
                    self._report(request)
