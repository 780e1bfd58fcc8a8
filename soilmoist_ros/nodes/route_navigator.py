# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Nav2's Route Server and controller: one announces a route on its graph, the other drives the robot along it.

``ComputeAndTrackRoute`` moves nothing: it announces the route in its feedback, once more when it plans anew, and
follows the robot, for the operations of the graph such as speed limits. ``FollowPath`` drives. So the fence judges
each route before the robot follows it. Goals are poses: with ids the begin would be an id, too, and a robot
between two nodes would be sent back to one.

Source: nav2_route and nav2_simple_commander (ros-navigation/navigation2, 2026; jazzy, kilted, lyrical).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from action_msgs.srv import CancelGoal
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.action import ActionClient
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from msg_adapters import pose_stamped
from soilmoist_ros.exploration import (
    ANYBODYS,
    ActionStatus,
    CancelSent,
    SendGoal,
    Stop,
    Way,
    WayPoint,
    failure,
    progress,
)
from soilmoist_ros.foundation import foreign_text
from soilmoist_ros.nodes.action_navigator import ActionNavigator
from soilmoist_ros.nodes.topics import ros_now_s

ANNOUNCED_S: Final = 8.0  # time in which a route is announced [s]; the Route Server itself allows 2 s by default
GONE_S: Final = 2.0  # a Route Server that is not there for this time has gone [s]
LEG_M: Final = 0.1  # spacing of the poses from the robot to the begin of a path [m], as in Nav2's paths
_ABORTED: Final = 6

Array = NDArray[np.float64]


@dataclass(eq=False)
class _Trip:
    """A goal of the planner: a goal for the Route Server, and the paths that the controller was given for it."""

    goal_id: int
    point: WayPoint
    route: UUID
    since_s: float
    route_over: bool = False
    path: UUID | None = None  # the newest one
    path_over: bool = False
    stopped: bool = False  # whether it is cancelled, so that no path is sent any more
    end: tuple[int, bool, str] = (_ABORTED, False, "")  # status, success and reason of the end


class FollowRouteNavigator(ActionNavigator):
    """A client of ``FollowPath``, along routes that ``ComputeAndTrackRoute`` announces and the fence allows.

    :param routes: name of the action of the Route Server, and its class
    :param reach_m: a route ends within this distance of its stop [m]
    """

    def __init__(self, *given: Any, routes: tuple[str, Any], reach_m: float, **named: Any) -> None:
        super().__init__(*given, **named)
        name, self._route_kind = routes
        self._reach_m, self._way = reach_m, Way(np.empty((0, 2)))
        self._trip: _Trip | None = None
        self._route_name, self._along = self._node.resolve_service_name(name), ""
        self._planner = ActionClient(self._node, self._route_kind, name)
        self._seen_s = -math.inf
        above = f"{self._route_name.rpartition('/')[0]}/navigate_to_pose"
        self._other_cancels = {}
        for other in (self._route_name, above):  # who drives by the behaviour trees of Nav2 is another client, too
            self._lists[other] = ActionStatus(self._client_name)
            self._other_cancels[other] = self._node.create_client(CancelGoal, f"{other}/_action/cancel_goal")

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        has_routes = self._planner.server_is_ready()
        return super().waiting_for if has_routes else f"the Route Server {self._route_name}"

    @property
    def _servers(self) -> int:
        """Number of controllers; none to send a goal to without the Route Server."""
        return super()._servers if self._trip is not None or self._planner.server_is_ready() else 0

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        self._way = way
        super().go(goal_id, stop, way)

    def goals(self, stop: Stop, way: Way) -> tuple[WayPoint, ...]:
        """The stop alone: its route is the server's."""
        return (WayPoint(stop),)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        super().tick(now_s)
        trip, steady_s = self._trip, time.monotonic()
        if self._planner.server_is_ready() or trip is None:
            self._seen_s = steady_s
        if trip is None:
            return
        if not trip.route_over and steady_s - self._seen_s > GONE_S:
            trip.route_over, trip.end = True, (_ABORTED, False, "the Route Server has gone away")
            self._refuse(trip, trip.end[2])
            self._settle(trip)
        elif trip.path is None and not trip.stopped and steady_s - trip.since_s > ANNOUNCED_S:
            self._refuse(trip, f"the Route Server has announced no route in {ANNOUNCED_S:.0f} s")

    # Messages ------------------------------------------------------------------------------------------------

    def goal_message(self, point: WayPoint) -> Any:
        """Goal for the Route Server: from the robot's pose by TF to the node nearest to the stop."""
        goal = self._route_kind.Goal(use_poses=True, use_start=False)
        goal.goal = pose_stamped(point.stop.x_m, point.stop.y_m, ros_now_s(self._node), self._frame)
        return goal

    def heard(self, message: Any) -> str:
        """Rest of the path; since Lyrical it is a part of the tracking."""
        content = message.feedback
        tracking = getattr(content, "tracking_feedback", content)
        rest_m = getattr(tracking, "distance_to_goal", getattr(tracking, "remaining_path_length", math.nan))
        return ", ".join(filter(None, (self._along, progress(float(rest_m), 0))))

    def verdict(self, result: Any) -> tuple[bool, str]:
        """The error code in words."""
        code, text = int(result.error_code), foreign_text(str(getattr(result, "error_msg", "")))
        return code == 0, failure(code, text)

    # A trip --------------------------------------------------------------------------------------------------

    def _send(self, request: SendGoal) -> None:
        self._heard = None
        self._ids.pop(request.goal_id, None)
        identity = UUID(uuid=list(self._status.new_identity()))
        trip = self._trip = _Trip(request.goal_id, request.point, identity, time.monotonic())
        message, take = self.goal_message(request.point), partial(self._on_route, trip)
        self._planner.send_goal_async(message, take, identity).add_done_callback(
            partial(self._route_answered, trip)
        )

    def _route_answered(self, trip: _Trip, future: Future) -> None:
        handle = future.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._route_ended, trip))
        else:
            trip.route_over, trip.end = True, (_ABORTED, False, "the Route Server rejected the goal")
            self._settle(trip)

    def _on_route(self, trip: _Trip, message: Any) -> None:
        """Feedback of the Route Server: at its begin, at each node, and with each new route."""
        content = message.feedback
        self._heard = time.monotonic(), self._track.now_s
        self._along = f"edge {content.current_edge_id} to node {content.next_node_id}"
        if content.operations_triggered:
            self._along += f", {foreign_text(', '.join(content.operations_triggered))}"
        if trip.stopped or trip.path_over or not (content.rerouted or trip.path is None):
            return
        if refusal := self._refusal(trip, content):
            self._refuse(trip, f"the route of the navigation is not allowed: {refusal}")
        else:
            self._follow(trip, content.path)

    def _refusal(self, trip: _Trip, content: Any) -> str:
        """Reason why an announced route is not allowed: its path, its nodes and edges, and its end."""
        path = _places(pose.pose.position for pose in content.path.poses)
        edges = [at for edge in content.route.edges for at in (edge.start, edge.end)]
        nodes = _places(edges or [node.position for node in content.route.nodes])
        if content.path.header.frame_id not in ("", self._frame):
            return f"it is in the frame {foreign_text(content.path.header.frame_id)!r}, not in {self._frame!r}"
        if refusal := self._way.judge(path, nodes):
            return refusal
        stop, away_m = trip.point.stop, math.dist(path[-1], trip.point.stop.xy)
        if away_m <= min(self._reach_m, stop.reach_m):
            return ""
        return f"it ends {away_m:.1f} m from {stop.name}: does the Route Server have this graph?"

    def _follow(self, trip: _Trip, path: Path) -> None:
        """Let the controller drive along a path, which replaces the one before; it begins where the robot is."""
        begin = path.poses[0].pose.position
        here = self._track.place or (float(self._way.corners[0][0]), float(self._way.corners[0][1]))
        steps = int(math.dist(here, (begin.x, begin.y)) / LEG_M)
        heading_rad = math.atan2(begin.y - here[1], begin.x - here[0])
        now_s = ros_now_s(self._node)
        leg = [
            pose_stamped(x, y, now_s, self._frame, heading_rad)
            for x, y in np.linspace(here, (begin.x, begin.y), steps, endpoint=False).tolist()
        ]
        goal = self._kind.Goal(path=Path(header=path.header, poses=[*leg, *path.poses]))
        identity = trip.path = UUID(uuid=list(self._status.new_identity()))
        self._ids[trip.goal_id] = identity
        future = self._actions.send_goal_async(goal, self._on_feedback, identity)
        future.add_done_callback(partial(self._path_answered, trip, identity))

    def _path_answered(self, trip: _Trip, identity: UUID, future: Future) -> None:
        handle = future.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._path_ended, trip, identity))
            self._step(self._client.answered, trip.goal_id, True)
        elif identity is trip.path:
            self._end(trip, _ABORTED, False, "the controller rejected the path")

    def _path_ended(self, trip: _Trip, identity: UUID, future: Future) -> None:
        answer = future.result()
        if answer is not None and identity is trip.path:  # otherwise a new path has replaced it
            self._end(trip, int(answer.status), *self.verdict(answer.result))

    def _end(self, trip: _Trip, status: int, success: bool, why: str) -> None:
        """The controller has ended: nothing needs to be tracked any more."""
        trip.path_over, trip.end = True, (status, success, why)
        if not trip.route_over:
            self._cancel(self._route_name, trip.route)
        self._settle(trip)

    def _route_ended(self, trip: _Trip, future: Future) -> None:
        answer = future.result()
        if answer is None:
            return
        trip.route_over = True
        success, why = self.verdict(answer.result)
        if trip.path is None:
            trip.end = int(answer.status), success, why
        elif not (trip.path_over or trip.stopped or success):
            self._refuse(trip, f"the Route Server does not track the route any more: {why}")
        self._settle(trip)

    def _refuse(self, trip: _Trip, why: str) -> None:
        """Stop a trip: it has failed."""
        trip.stopped = True
        self._step(self._client.refuse, trip.goal_id, why)

    def _settle(self, trip: _Trip) -> None:
        """Report the end of a trip once both servers have ended it."""
        if trip.route_over and (trip.path is None or trip.path_over):
            self._trip = None if self._trip is trip else self._trip
            status, success, why = trip.end
            self._step(self._client.ended, trip.goal_id, status, success, then=(why,))

    def _ask_to_cancel(self, request: CancelSent) -> None:
        trip = self._trip
        if trip is not None and trip.goal_id == request.goal_id:
            trip.stopped = True
            if not trip.route_over:
                self._cancel(self._route_name, trip.route, request)
            if trip.path is None or trip.path_over:
                return
        elif request.goal_id == ANYBODYS:
            for name in self._other_cancels:
                self._cancel(name, UUID())
        else:
            for goal in self._lists[self._route_name].before:
                self._cancel(self._route_name, UUID(uuid=list(goal)))
        super()._ask_to_cancel(request)

    def _cancel(self, name: str, identity: UUID, request: CancelSent | None = None) -> None:
        """Cancel a goal of another action, or all without an identity; nothing if its server is not there."""
        client, question = self._other_cancels[name], CancelGoal.Request()
        question.goal_info.goal_id = identity
        if client.service_is_ready():
            future = client.call_async(question)
            if request is not None:  # heard: a process that ends need not wait
                future.add_done_callback(partial(self._cancel_answered, request, CancelGoal.Response.ERROR_NONE))


def _places(points: Iterable[Any]) -> Array:
    return np.array([(at.x, at.y) for at in points], float).reshape(-1, 2)
