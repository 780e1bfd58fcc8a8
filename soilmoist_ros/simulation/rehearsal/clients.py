# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigators of a rehearsal: the rules of the package's clients, wired to simulated servers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import nan

from soilmoist_ros.exploration import (
    ANYBODYS,
    CancelAll,
    CancelSent,
    Ended,
    GoalClient,
    Listed,
    PoseClient,
    Request,
    SendGoal,
    SendPose,
    Stop,
    Track,
    Way,
    WayPoint,
    way_points,
)
from soilmoist_ros.simulation.rehearsal.servers import (
    ActionServer,
    Answered,
    CancelAnswered,
    GoalOver,
    PoseListener,
    Reply,
)

Place = tuple[float, float]
Sent = Callable[[Place, str], None]


class ActionNavigator:
    """Drives to nodes or poses by an action.

    :param client: the rules
    :param server: the navigation
    :param by_name: whether goals are names of nodes
    :param time_s: steady time [s]
    :param report: takes the end of each goal
    :param sent: hears of each goal that is sent
    :param track: recent places of the robot
    :param there_m: a robot that stands this close to a stop is there already [m]
    """

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
        track: Track,
        there_m: float,
    ) -> None:
        self._client, self._server, self._by_name = client, server, by_name
        self._time_s, self._report, self._sent = time_s, report, sent
        self._track, self._there_m = track, there_m
        self._heard_s = nan
        self._goals: dict[int, int] = {}

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        if goal := self._client.unended:
            return f"the end of {goal}"
        return "" if self._server.present(self._time_s()) else "the navigation"

    @property
    def other_client(self) -> str:
        """See :class:`Navigator`."""
        return "another client drives the robot" if self._server.others else ""

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`."""
        return self._time_s() - self._heard_s

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self.corners = [(float(x), float(y)) for x, y in way.corners]
        nodes = tuple(map(WayPoint, way.nodes)) or (WayPoint(stop),)
        ahead = nodes if self._by_name else way_points(way.corners, stop)
        there = self._track.standing_at(stop, self._there_m)
        self._heard_s = nan
        self._do(self._client.go(goal_id, ahead, self._time_s(), there))

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._do(self._client.cancel(goal_id, self._time_s()))

    def moved(self, place: Place, now_s: float, sd_m: float) -> None:
        """See :class:`Navigator`."""
        self._track.moved(place, now_s, sd_m)
        self._do(self._client.moved(place, self._time_s()))

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        self._track.tick(now_s)
        if self._server.active:  # it sends feedback all the time
            self._heard_s = self._time_s()
        server = self._server
        lives = frozenset((str(server.lives).encode(),)) if server.present(self._time_s()) else frozenset[bytes]()
        active = frozenset(goal_id for goal_id, number in self._goals.items() if server.lists(number))
        listed = Listed(lives, active, others=server.others)
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
    """Drives to poses that nobody answers.

    :param client: the rules
    :param listener: the navigation
    :param time_s: steady time [s]
    :param report: takes the end of each goal
    :param sent: hears of each pose that is sent
    :param stopped: hears of each pose that is to stop the robot
    """

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
        """See :class:`Navigator`."""
        return "" if self._listener.present(self._time_s()) else "a navigation"

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self.corners = [(float(x), float(y)) for x, y in way.corners]
        self._going = True
        self._do(self._client.go(goal_id, way_points(way.corners, stop)))

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._going = False
        self._do(self._client.cancel(goal_id))

    @property
    def other_client(self) -> str:
        """See :class:`Navigator`."""
        return "another client drives the robot" if self._client.other_client else ""

    def overhear(self) -> None:
        """Another client has sent a pose."""
        self._do(self._client.heard_other())

    def moved(self, place: Place, now_s: float, sd_m: float) -> None:
        """See :class:`Navigator`."""
        self._do(self._client.moved(place, now_s, sd_m))

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
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
