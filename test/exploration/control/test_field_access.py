# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where a mission sends the robot: never where the fence refuses it, whatever changes."""

import contextlib
import logging

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from stand_in import MEADOW, PLACES, POND, SQUARE, graph
from test_mission_control import Around

from rehearsal.cases import GRAPHS, OUTLINES, random_ground
from soilmoist_ros.exploration import ExplorerSettings, OperatorRequest, RobotMotion, Stop, parse_dwell
from soilmoist_ros.exploration.control.field_access import AccessRules, CurrentAccess, FieldAccess
from soilmoist_ros.exploration.control.mission_control import MissionSetup
from soilmoist_ros.exploration.mission.types import MissionRules, Phase, Verb
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import Field

RADIUS = AccessRules(robot_radius_m=0.75)


MAP = graph(PLACES, "a p b", "a s t u b")


OLD = graph({name: PLACES[name] for name in "astub"}, "a s t u b")
NEW = graph({**{name: PLACES[name] for name in "stu"}, "a": PLACES["b"], "b": PLACES["a"]}, "b s t u a")


def test_free_travel_keeps_the_robots_radius():
    access = FieldAccess(MEADOW, RobotMotion(), None, RADIUS)
    way = access.way((10.0, 30.0), Stop("b", 50.0, 30.0))
    assert way.nodes == ()
    assert len(way.corners) == 4, "around the pond"
    assert shapely.LineString(way.corners).distance(shapely.Polygon(POND)) == pytest.approx(0.75)
    assert shapely.LineString(way.corners).distance(shapely.LinearRing(SQUARE)) >= 0.75
    assert access.fence.contains([(stop.x_m, stop.y_m) for stop in access.stops]).all()
    with pytest.raises(
        InputError, match=r"b is not allowed: it is in no-go area 1 at \(39\.5, 20\.0\), 1\.2 m deep"
    ):
        access.way((10.0, 30.0), Stop("b", 39.5, 20.0))


def test_a_robot_a_little_outside_drives_straight_back_in_and_one_far_outside_is_not_sent():
    access = FieldAccess(MEADOW, RobotMotion(), None, RADIUS)
    assert access.way((-3.0, 6.0), Stop("s", 10.0, 6.0)).corners.tolist() == [[-3, 6], [0.75, 6], [10, 6]]
    with pytest.raises(InputError, match=r"the robot stands 2000\.0 m outside, more than 10 m"):
        access.way((-2000.0, 6.0), Stop("s", 10.0, 6.0))
    assert len(access.way((20.1, 20.0), Stop("s", 10.0, 6.0)).corners) == 3, "out of the pond it stands in"


DITCH = np.array([[28, 0], [30, 0], [30, 36], [28, 36]], float)
BANKS = {"w": (24, 20), "e": (31, 20), "nw": (24, 38), "ne": (34, 38)}
BESIDE = Field("beside a ditch", LocalFrame(53.0, 0.0), SQUARE, (DITCH,), 4.0)


@pytest.mark.parametrize("by_name", [False, True])
@pytest.mark.parametrize("radius_m", [0.75, 0.0])
def test_a_robot_that_fixes_place_a_little_beyond_its_row_goes_on_along_the_row(radius_m, by_name):
    """The row is as close to the ditch as it may be; navigation and receiver have errors."""
    row = 28.0 - radius_m
    ways = graph({"s": (row, 6), "m": (row, 20), "n": (row, 38), "far": (20, 6)}, "far s m n")
    rules = AccessRules(robot_radius_m=radius_m, by_name=by_name)
    access = FieldAccess(BESIDE, RobotMotion(), ways, rules)
    for off_m in (0.0, 0.04, 0.09, 0.4 * radius_m):
        for y_m in (19.0, 20.5, 13.0):
            way = access.way((row + off_m, y_m), Stop("far", 20.0, 6.0)).corners
            assert {row, row + off_m} >= set(way[:-1, 0])


@pytest.mark.parametrize("by_name", [False, True])
def test_a_robot_deep_in_a_no_go_area_is_left_to_people(by_name):
    rules = AccessRules(robot_radius_m=0.75, by_name=by_name)
    access = FieldAccess(BESIDE, RobotMotion(), graph(BANKS, "w nw ne e"), rules)
    for x_m in (28.8, 29.0, 29.2):
        with pytest.raises(InputError, match=r"the robot stands (0\.8|1\.0) m deep in no-go area 1"):
            access.way((x_m, 20.0), Stop("w", 24.0, 20.0))


WALL = np.array(
    [
        *([20, 29.4], [20, 20], [40, 20], [40, 40], [20, 40], [20, 30.6]),
        *([20.3, 30.6], [20.3, 39.7], [39.7, 39.7], [39.7, 20.3], [20.3, 20.3], [20.3, 29.4]),
    ]
)


@pytest.mark.parametrize("ways", ["in mid", None], ids=["graph", "free"])
def test_a_robot_at_the_wall_of_a_pen_is_not_sent_through_it(ways):
    """The gate is narrower than the robot: the wall and its margin enclose the pen."""
    pen = Field("pen", LocalFrame(53.0, 0.0), SQUARE, (WALL,), 4.0)
    places = {"out": (43, 30), "far": (50, 30), "in": (36, 30), "mid": (30, 30)}
    both = graph(places, "out far", "in mid")
    access = FieldAccess(pen, RobotMotion(), ways and both, RADIUS, place=(36.0, 30.0))
    for x_m in (39.0, 39.3, 39.6):
        with contextlib.suppress(InputError):
            way = access.way((x_m, 30.0), Stop("mid", 30.0, 30.0)).corners
            assert not shapely.LineString(way).intersects(shapely.Polygon(WALL))
        assert access.fence.refusal_of_entry((x_m, 30.0), (45.0, 30.0), 10.0)
        assert not access.fence.refusal_of_entry((x_m, 30.0), (35.0, 30.0), 10.0)


def test_a_stop_that_a_new_map_has_moved_is_not_driven_to():
    """The robot would go to the node's new place, then straight to the old one, through the pond."""
    chosen = FieldAccess(MEADOW, RobotMotion(), OLD, RADIUS).stop("b")
    with pytest.raises(
        InputError, match=r"b is at \(10\.0, 20\.0\) now, not at \(50\.0, 20\.0\) -> choose it again"
    ):
        FieldAccess(MEADOW, RobotMotion(), NEW, RADIUS).way((10.0, 8.0), chosen)
    nearly = graph({"s": (10, 6), "t": (30, 6), "u": (50, 6), "b": (51.5, 20)}, "s t u b")
    assert FieldAccess(MEADOW, RobotMotion(), nearly, RADIUS).way((10.0, 8.0), chosen).nodes == (chosen,)


def test_routes_on_a_graph_are_sent_by_name_only_where_the_navigation_takes_them_too():
    access = FieldAccess(MEADOW, RobotMotion(), MAP, AccessRules(robot_radius_m=0.75, by_name=True))
    assert "1 in a no-go area (p)" in access.warning
    way = access.way((10.0, 20.0), Stop("b", 50.0, 20.0))
    assert way.nodes[-1].name == "b"
    assert len(way.nodes) > 1
    assert [tuple(corner) for corner in way.corners[1:3]] == [(10, 6), (30, 6)]
    posed = FieldAccess(MEADOW, RobotMotion(), MAP, RADIUS).way((10.0, 20.0), Stop("b", 50.0, 20.0))
    assert posed.nodes == (Stop("b", 50.0, 20.0),)
    assert posed.corners.tolist() == way.corners.tolist()
    with pytest.raises(InputError, match="p is not allowed: it is in no-go area 1"):
        access.way((10.0, 20.0), Stop("p", 30.0, 20.0))


def test_the_graph_is_entered_where_nothing_is_in_the_way():
    access = FieldAccess(MEADOW, RobotMotion(), graph({"a": (18, 36), "b": (42, 36), "t": (45, 5)}, "t b"))
    assert [stop.name for stop in access.stops] == ["b", "t"]
    assert access.way((15.0, 8.0), Stop("b", 42.0, 36.0)).corners[1].tolist() == [45, 5]
    blocked = FieldAccess(MEADOW, RobotMotion(), graph({"b": (42, 36), "c": (42, 30)}, "b c"))
    with pytest.raises(InputError, match="the route to b is not allowed: it enters no-go area 1"):
        blocked.way((15.0, 36.0), Stop("b", 42.0, 36.0))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(OUTLINES), st.sampled_from([*GRAPHS, None]), st.booleans())
def test_all_that_is_sent_is_inside(seed, outline, kind, by_name):
    rng = np.random.default_rng(seed)
    ground = random_ground(rng, outline, kind)
    rules = AccessRules(robot_radius_m=0.75, beyond_m=3.0, by_name=by_name)
    try:
        access = FieldAccess(ground.field, RobotMotion(), ground.graph, rules, place=ground.start)
    except InputError:
        assume(False)
    no_go = shapely.union_all([shapely.Polygon(ring).buffer(0.7499) for ring in ground.field.no_go])
    border = shapely.Polygon(ground.field.polygon).buffer(-0.7499 if ground.graph is None else 3.0001)
    place, sent = ground.start, 0
    for number in rng.integers(len(access.stops), size=6):
        stop = access.stops[number]
        place = tuple(np.add(place, rng.uniform(-1.5, 1.5, 2) * (rng.random() < 0.5)))
        try:
            way = access.way(place, stop)
        except InputError:
            continue
        first = shapely.LineString([place, *way.corners[:2]][-2:])
        for ring in ground.field.no_go:
            wide, here = shapely.Polygon(ring).buffer(0.7499, join_style="mitre"), shapely.Point(place)
            out_m = wide.exterior.distance(here) if wide.contains(here) else 0.0
            inside = first.intersection(wide)
            assert inside.length <= 2 * out_m + 1e-3 or not shapely.Polygon(ring).buffer(-0.1).contains(here)
            along = shapely.points(shapely.get_coordinates(shapely.segmentize(inside, 0.1)))
            assert np.max(shapely.distance(wide.exterior, along), initial=0.0) <= out_m + 1e-3
        driven = shapely.LineString([*way.corners, way.corners[-1]][1:])
        assert driven.length == 0 or driven.intersection(no_go).length == 0
        assert driven.length == 0 or driven.difference(border).length == 0
        assert way.corners[0].tolist() == list(place)
        assert way.corners[-1].tolist() == [stop.x_m, stop.y_m]
        place, sent = (stop.x_m, stop.y_m), sent + 1
    assert sent or by_name or ground.graph is None or len(access.stops) < 2


def stand(around, place):
    for _ in range(8):
        around.time_s += 1.0
        around.control.fix(place)
        around.control.tick()
    return around


def started(graph, place):
    """A mission around the pond, of a robot that stands."""
    chosen = ExplorerSettings(strategy="random", preset="paper", seed=1, motion=RobotMotion(), access=RADIUS)
    rules = MissionRules(
        budget_s=3600.0, dwell=parse_dwell("fmi:60"), warm_up_stops=1, backoff_s=0.0, standstill_s=0.0,
        failures_to_pause=100,
    )  # fmt: skip
    around = Around(setup=MissionSetup(field=MEADOW, settings=chosen, rules=rules))
    around.time_s = 1000.0
    around.control.use_graph(graph)
    around.answer = stand(around, place).control.command(Verb.START)
    return around


def test_a_goal_that_the_fence_refuses_is_never_sent_and_its_stop_ruled_out():
    around = started(graph({"b": (42, 36), "c": (42, 30)}, "b c"), (15.0, 36.0))
    while around.status.phase is not Phase.FINISHED:
        around.planned()
        around.time_s += 1.0
        around.control.tick()
    assert around.goals == []
    reasons = [status.reason for status, _ in around.shown]
    assert any("is ruled out for now: not sent: the route to" in reason for reason in reasons)


@pytest.mark.parametrize("verb", ["measure", "home"])
def test_after_a_new_map_in_a_pause_the_robot_is_sent_only_to_places_of_that_map(verb):
    around = started(OLD, (30.0, 6.0))
    if verb == "measure":
        assert around.control.request(OperatorRequest("measure", stops=("b",))).accepted
    else:
        assert around.control.request(OperatorRequest("change", home="b")).accepted
        assert around.control.request(OperatorRequest("return_home")).accepted
    around.planned()
    goal_id, stop = around.goals[-1]
    assert stop == Stop("b", 50.0, 20.0)
    assert around.control.command(Verb.PAUSE).accepted
    around.control.ended(Ended(goal_id, Outcome.CANCELED, ""))
    stand(around, (30.0, 6.0)).control.use_graph(NEW)
    around.goals.clear()
    assert around.control.command(Verb.RESUME).accepted
    for _ in range(3):
        stand(around, (30.0, 6.0)).planned()
    sent = [stop for _, stop in around.goals if stop is not None]
    assert sent
    places = {stop.name: (stop.x_m, stop.y_m) for stop in NEW.stops}
    assert all(places[stop.name] == (stop.x_m, stop.y_m) for stop in sent)
    assert verb != "home" or sent[-1].name == "b"


def test_a_robot_in_another_part_of_the_map_uses_that_part(caplog):
    islands = graph({**PLACES, "i": (3, 36), "j": (14, 36)}, "a s t u b", "i j")
    with caplog.at_level(logging.INFO):
        around = started(islands, (4.0, 35.0))
        assert around.answer.accepted
        around.planned()
    assert {stop.name for _, stop in around.goals} <= {"i", "j"}
    assert around.goals
    assert sum("no-go area (p), i" in r.message or "i, j" in r.message for r in caplog.records) == 1
    counted = [r.message for r in caplog.records if r.levelno == logging.INFO]
    assert counted == [f"{n} of 8 nodes of the topological map are stops" for n in (5, 2)]
    stuck = started(graph({**PLACES, "i": (3, 36)}, "a s t u b"), (4.0, 35.0))
    assert not stuck.answer.accepted
    assert "no way that is allowed leads between i, where the robot stands" in stuck.answer.message


# The access to a field follows its graph, cells, home and the robot; an error leaves it as it is ----------------


class Used:
    """An access, and what was used."""

    def __init__(self, home=""):
        self.home, self.used = home, []
        self.current = CurrentAccess(MEADOW, RobotMotion(), RADIUS, lambda: self.home, self.used.append)


def test_a_map_that_cannot_be_used_is_named_and_changes_nothing():
    around = Used(home="a")
    assert "the map of the navigation" in around.current.waiting_for
    with pytest.raises(InputError, match="there is no stop 'a'"):
        around.current.use_graph(graph({"t": (30, 6), "u": (50, 6)}, "t u"))
    assert "there is no stop 'a'" in around.current.waiting_for
    assert (around.current.access, around.used) == (None, [])
    around.current.use_graph(MAP)
    around.home = "barn"
    with pytest.raises(InputError, match="there is no stop 'barn'"):
        around.current.use_home(None)
    assert around.used == [around.current.access]


def test_the_part_of_the_map_is_looked_for_again_only_after_a_move():
    around = Used()
    around.current.use_graph(graph({**PLACES, "i": (3, 36), "j": (14, 36)}, "a s t u b", "i j"))
    around.current.moved((4.0, 35.0), 3.0)
    around.current.moved((5.0, 35.0), 3.0)
    assert [len(access.stops) for access in around.used] == [5, 2]
    around.current.moved((30.0, 5.0), 3.0)
    assert [len(access.stops) for access in around.used] == [5, 2, 5]
