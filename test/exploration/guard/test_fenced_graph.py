# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The part of a map that the fence allows, and goals that stay inside it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stand_in import MEADOW, PLACES, POND, SQUARE, graph

from soilmoist_ros.exploration import Fence, FencedGraph, Outside, Stop, TravelGraph
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import Field

FRAME = LocalFrame(53.0, 0.0)


def pond_map(**more):
    return graph({**PLACES, **more.get("places", {})}, "a p b", "a s t u b", *more.get("ways", ()))


def test_nodes_in_a_pond_and_edges_across_it_are_dropped_by_name_in_one_sentence():
    fenced = FencedGraph(graph({**PLACES, "far": (90, 6)}, "a p b", "a s t u b", "a b", "u far"), Fence(MEADOW))
    assert set(fenced.graph.names) == {"a", "b", "s", "t", "u"}
    assert [stop.name for stop in fenced.stops] == ["a", "b", "s", "t", "u"]
    assert fenced.graph.path("a", "b") == ("a", "s", "t", "u", "b")
    assert fenced.warning == (
        "not used of the topological map: 1 in a no-go area (p); 1 outside the field (far); "
        "1 edge across the border or a no-go area (a - b)"
    )
    assert FencedGraph(graph(PLACES, "a s t u b"), Fence(MEADOW)).warning.endswith("1 in a no-go area (p)")


def test_a_passage_that_the_robots_width_closes_is_named():
    whole = graph({"a": (10, 11.5), "b": (50, 11.5)}, "a b")
    assert FencedGraph(whole, Fence(MEADOW)).warning == ""
    narrow = FencedGraph(whole, Fence(MEADOW, 0.75, 0.1))
    assert narrow.warning.endswith("(a - b); 1 of them only for robot_radius_m, 0.75 m")
    assert FencedGraph(pond_map(), Fence(MEADOW, 0.75, 0.1)).warning.endswith("1 in a no-go area (p)")


def test_a_goal_behind_the_pond_is_sent_node_by_node():
    fenced = FencedGraph(pond_map(), Fence(MEADOW))
    sent = fenced.nodes_to_send((10.2, 20.1), Stop("b", 50, 20), 5.0)
    assert sent[-1] == "b"
    assert len(sent) > 1
    assert driven(fenced.whole, ("a", *sent)) == ["a", "s", "t", "u", "b"]
    assert fenced.nodes_to_send((10, 20), Stop("t", 30, 6), 5.0) == ("t",), "no route through the pond is as short"


def test_equally_long_routes_of_which_one_is_forbidden_are_not_left_to_the_navigation():
    pond = Field("tie", FRAME, SQUARE, (np.array([[25, 25], [35, 25], [35, 35], [25, 35]], float),))
    places = {"w": (20, 20), "n": (30, 30), "e": (40, 20), "s": (30, 10)}
    fenced = FencedGraph(graph(places, "w n e", "w s e"), Fence(pond))
    assert fenced.nodes_to_send((20, 20), Stop("e", 40, 20), 5.0) == ("s", "e")


def test_an_edge_that_the_map_closes_for_the_robot_is_never_driven_and_the_fence_does_not_name_it():
    whole = graph({"w": (10, 5), "m": (30, 5), "e": (50, 5), "s": (30, 10)}, "w m e", "w s e")
    ends = np.array(whole.names)[whole.edges]
    barred = (ends == "m").any(axis=1)
    fenced = FencedGraph(replace(whole, barred=barred), Fence(MEADOW))
    assert [stop.name for stop in fenced.stops] == ["w", "e", "s"]
    assert fenced.nodes_to_send((10, 5), Stop("e", 50, 5), 5.0) == ("s", "e"), "the server would drive through m"
    assert "m" in fenced.warning
    assert "edge" not in fenced.warning
    announced = np.array([[10, 5], [30, 5], [50, 5]], float)
    assert fenced.refusal(announced) == "it takes the edge w - m, which is not for this robot"
    assert fenced.refusal(np.array([[10, 5], [30.2, 10], [50, 5]], float)) == ""


def test_a_navigation_may_take_every_route_that_is_about_the_shortest():
    places = {"w": (20, 10), "n": (30, 12), "e": (40, 10), "s": (30, 8), "far": (30, 30)}
    fenced = FencedGraph(graph(places, "w n e", "w s e", "w far e"), Fence(Field("open", FRAME, SQUARE)))
    lines = {tuple(map(tuple, line)) for line in fenced.choices((19.0, 10.0), ("e",)).tolist()}
    assert {((20, 10), (30, 12)), ((30, 8), (40, 10)), ((19, 10), (20, 10))} <= lines
    assert not [line for line in lines if (30, 30) in line]


def test_a_robot_near_a_forbidden_node_is_not_sent():
    fenced = FencedGraph(pond_map(places={"q": (30, 13)}, ways=("t q",)), Fence(MEADOW))
    with pytest.raises(InputError, match="may plan from q, which is near the robot but not allowed: it enters"):
        fenced.nodes_to_send((30, 11), Stop("s", 10, 6), 5.0)


def test_the_straight_way_to_the_first_node_is_validated_too():
    fenced = FencedGraph(graph({"a": (18, 6), "t": (50, 9)}, "a t"), Fence(MEADOW))
    assert fenced.nodes_to_send((10, 6), Stop("t", 50, 9), 5.0) == ("t",)
    assert fenced.nodes_to_send((10, 30), Stop("t", 50, 9), 5.0) == ("a", "t"), "straight to t is across the pond"
    with pytest.raises(InputError, match=r"robot stands 10\.0 m outside"):
        fenced.nodes_to_send((10, 50), Stop("t", 50, 9), 5.0)


def test_islands_and_one_way_parts_are_named_and_not_refused():
    places = {**PLACES, "i": (5, 35), "j": (15, 35), "out": (45, 35), "sink": (55, 35)}
    whole = graph(places, "a s t u b", "i j", one_way=("out b", "b sink"))
    fenced = FencedGraph(whole, Fence(MEADOW))
    assert set(fenced.graph.names) == {"a", "s", "t", "u", "b"}
    assert "4 without a way there and back from the others (i, j, out, sink)" in fenced.warning
    island = FencedGraph(whole, Fence(MEADOW), place=(6, 34))
    assert set(island.graph.names) == {"i", "j"}
    assert not fenced.serves((6, 34))
    assert island.serves((6, 34))
    assert fenced.serves((49, 7))


def test_a_robot_at_a_node_that_can_only_be_left_gets_to_the_others():
    whole = graph({**PLACES, "out": (45, 35)}, "a s t u b", one_way=("out b",))
    fenced = FencedGraph(whole, Fence(MEADOW), place=(45, 35))
    assert {stop.name for stop in fenced.stops} == {"a", "s", "t", "u", "b"}
    assert fenced.nodes_to_send((45, 35), Stop("b", 50, 20), 5.0) == ("b",)
    with pytest.raises(InputError, match="the home sink and the nodes"):
        FencedGraph(
            graph({**PLACES, "sink": (5, 35)}, "a s t u b", one_way=("b sink",)), Fence(MEADOW), home="sink"
        )


SHED = {"gate": (-10, 6), "shed": (-20, 6), "yard": (-10, 25)}


def test_nodes_outside_are_the_way_home_only():
    places = {**PLACES, **SHED}
    whole = graph(places, "a s t u b", "s gate shed", "gate yard a")
    fenced = FencedGraph(whole, Fence(MEADOW), Outside.HOME, "shed")
    assert set(fenced.graph.names) == {"a", "s", "t", "u", "b", "gate", "shed"}
    assert {stop.name for stop in fenced.stops} == {"a", "s", "t", "u", "b"}
    assert "1 outside the field (yard)" in fenced.warning
    assert fenced.fence.allows([(10, 6), (-20, 6)])
    assert not fenced.fence.allows([(10, 20), (-10, 25)])
    assert fenced.fence.outside_m((-15, 6.5)) == 0
    assert fenced.nodes_to_send((-20, 6), Stop("t", 30, 6), 5.0)[-1] == "t"
    assert fenced.warning.endswith(
        "the home shed lies 20 m outside the field: the robot drives there and back outside"
    )
    with pytest.raises(InputError, match="the home shed, 20 m outside the field, and"):
        FencedGraph(whole, Fence(MEADOW), Outside.NEVER, "shed")
    far = graph({**places, "farm": (-9000, 6)}, "a s t u b", "s gate farm")
    with pytest.raises(
        InputError, match=r"the home farm lies 9\.0 km from the field 'meadow' -> choose a node near"
    ):
        FencedGraph(far, Fence(MEADOW), Outside.WAY, "farm")
    with pytest.raises(InputError, match=r"the home p is not allowed: it is in no-go area 1 at \(30.0, 20.0\)"):
        FencedGraph(pond_map(), Fence(MEADOW), Outside.HOME, "p")
    whole_way = FencedGraph(whole, Fence(MEADOW), Outside.WAY)
    assert set(whole_way.graph.names) >= {"yard", "gate", "shed"}
    assert {stop.name for stop in whole_way.stops} == {"a", "s", "t", "u", "b"}


def test_no_way_home_leads_through_a_no_go_area():
    ditch = np.array([[-8, -5], [-4, -5], [-4, 45], [-8, 45]], float)
    field = Field("ditch", FRAME, SQUARE, (POND, ditch))
    whole = graph({**PLACES, **SHED}, "a s t u b", "s gate shed")
    with pytest.raises(InputError, match="no way that is allowed leads between the home shed"):
        FencedGraph(whole, Fence(field), Outside.WAY, "shed")
    one_way = graph({**PLACES, **SHED}, "a s t u b", one_way=["s gate", "gate shed"])
    with pytest.raises(InputError, match=r"the home shed, .* in the field; only the way from it is missing"):
        FencedGraph(one_way, Fence(MEADOW), Outside.WAY, "shed")


@pytest.mark.parametrize(
    ("places", "message"),
    [
        ({"p": (0.0001, 53.0001), "q": (0.0002, 53.0002)}, "places of its nodes are degrees"),
        ({"p": (53.0001, 0.0001), "q": (53.0002, 0.0002)}, "places of its nodes are degrees"),
        ({"p": (-10, 50), "q": (-10, 55)}, "14 m away -> the map's places"),
        ({"p": (190, 130), "q": (170, 130)}, "142 m away -> .* read as feet, nodes are in the field"),
        ({"p": (35, 59), "q": (35, 58)}, "18 m away -> with x and y swapped nodes are in the field"),
        (
            {"p": (500_030, 5_900_020), "q": (500_035, 5_900_020)},
            "5,921 km away -> its places are those of a map pro",
        ),
    ],
)
def test_a_map_of_another_place_gets_its_distance_and_the_likely_cause(places, message):
    with pytest.raises(InputError, match=message):
        FencedGraph(graph(places, "p q"), Fence(Field("meadow", FRAME, SQUARE)))


def driven(whole, goals):
    """Nodes that a navigation passes which takes the shortest route of the whole map to each goal."""
    passed = [goals[0]]
    for start, end in pairwise(goals):
        passed += whole.path(start, end)[1:]
    return passed


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_whatever_shortest_route_the_navigation_takes_it_stays_inside(seed):
    rng = np.random.default_rng(seed)
    centre = rng.uniform((15, 10), (45, 30))
    pond = centre + rng.uniform(4, 9, 6)[:, None] * np.column_stack(
        [np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)]
    )
    fence = Fence(Field("random", FRAME, SQUARE, (pond,)), float(rng.uniform(0, 1)), float(rng.uniform(0, 2)))
    places = {f"n{i}": tuple(np.round(rng.uniform((-8, -8), (68, 48)), rng.integers(0, 2))) for i in range(18)}
    names = list(places)
    pairs = [(a, b) for a in names for b in names if a != b and rng.uniform() < 0.25]
    whole = TravelGraph.from_edges([Stop(n, *map(float, p)) for n, p in places.items()], pairs)
    outside = list(Outside)[int(rng.integers(3))]
    try:
        fenced = FencedGraph(whole, fence, outside, place=tuple(rng.uniform((0, 0), (60, 40))))
    except InputError:
        return
    for start, end in fenced.graph.edges.tolist():
        assert fenced.fence.allows(fenced.graph.xy[[start, end]])
    at = fenced.stops[0]
    for stop in fenced.stops[1:]:
        try:
            sent = fenced.nodes_to_send((at.x_m, at.y_m), stop, 5.0)
        except InputError:
            continue  # two nodes at one place, of which the other is not allowed
        assert sent[-1] == stop.name
        origin = whole.names[fenced.origins((at.x_m, at.y_m))[0]]
        for goal_from, goal in pairwise((origin, *sent)):
            length_m = whole.distance_m(goal_from, goal)
            for through in names:  # all shortest routes, also equally long ones
                via_m = whole.distance_m(goal_from, through) + whole.distance_m(through, goal)
                if via_m <= length_m + 1e-6:
                    route = [*whole.path(goal_from, through), *whole.path(through, goal)]
                    assert fenced.fence.allows(whole.xy[[whole.index(name) for name in route]])
        at = stop
