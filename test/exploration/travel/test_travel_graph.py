# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.travel import travel_graph
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation.errors import InputError

NODES = [Stop("a", 0, 0), Stop("b", 3, 0), Stop("c", 3, 4), Stop("d", 0, 4)]
RING = [("a", "b"), ("b", "c"), ("c", "d"), ("d", "a")]


@st.composite
def graphs(draw):
    """A ring, so that all nodes are connected, and random ways on top."""
    count = draw(st.integers(2, 12))
    place = st.integers(-50, 50)
    nodes = [Stop(f"n{i}", draw(place), draw(place)) for i in range(count)]
    pairs = draw(st.lists(st.tuples(st.integers(0, count - 1), st.integers(0, count - 1)), max_size=30))
    pairs += [(i, (i + 1) % count) for i in range(count)]
    return TravelGraph.from_edges(nodes, [(f"n{a}", f"n{b}") for a, b in pairs])


@settings(deadline=None, max_examples=60)
@given(graphs())
def test_shortest_ways_obey_the_triangle_inequality_and_paths_have_their_length(graph):
    distance = np.array([graph.distances_from(name) for name in graph.names])
    assert (distance[:, None, :] <= distance[:, :, None] + distance[None, :, :] + 1e-9).all()
    assert (np.diag(distance) == 0).all()
    ways = {(graph.names[a], graph.names[b]) for a, b in graph.edges.tolist()}
    for start in graph.names[:3]:
        for end in graph.names:
            path = graph.path(start, end)
            assert (path[0], path[-1]) == (start, end)
            assert set(pairwise(path)) <= ways
            steps = graph.xy[[graph.index(name) for name in path]]
            assert np.hypot(*np.diff(steps, axis=0).T).sum() == pytest.approx(graph.distance_m(start, end))


def test_edges_are_directed():
    graph = TravelGraph.from_edges(NODES, RING)
    assert graph.distance_m("a", "b") == 3
    assert graph.distance_m("b", "a") == 4 + 3 + 4
    assert graph.path("b", "a") == ("b", "c", "d", "a")
    assert graph.path("a", "a") == ("a",)


def test_the_shortest_of_parallel_ways_counts():
    edges = np.array([(0, 1), (0, 1), (1, 0)], np.intp)
    graph = TravelGraph(("a", "b"), np.array([(0.0, 0.0), (3.0, 0.0)]), edges, np.array([9.0, 7.0, 0.0]))
    assert graph.distance_m("a", "b") == 7
    assert graph.distance_m("b", "a") == 0


def test_nearest_is_the_first_of_equals():
    graph = TravelGraph.from_edges(NODES, RING)
    assert graph.nearest((2.5, 3.0)) == "c"
    assert graph.nearest((1.5, 2.0)) == "a"


def test_big_graphs_give_the_same_answers(monkeypatch):
    small = TravelGraph.from_edges(NODES, RING)
    monkeypatch.setattr(travel_graph, "ALL_PAIRS_UP_TO", 2)
    big = TravelGraph.from_edges(NODES, RING)
    for name in small.names:
        np.testing.assert_array_equal(small.distances_from(name), big.distances_from(name))
        assert small.path("b", name) == big.path("b", name)
    assert "_all_pairs" not in vars(big)


def test_mistakes_are_named_all_at_once():
    nodes = [*NODES, Stop("a", 1, 1), Stop("far", np.inf, 0)]
    with pytest.raises(InputError) as caught:
        TravelGraph.from_edges(nodes, [("a", "b"), ("a", "fa"), ("x", "b")])
    text = str(caught.value)
    assert "more than one node has the name a" in text
    assert "the place is not finite of far" in text
    assert "from 'a' to 'fa': there is no node 'fa' (did you mean 'far'?)" in text
    assert "there is no node 'x'" in text


def test_nodes_that_cannot_be_reached_or_not_be_left_are_named():
    nodes = [*NODES, Stop("source", 9, 9), Stop("trap", 8, 8)]
    edges = [*RING, ("source", "a"), ("a", "trap")]
    with pytest.raises(InputError) as caught:
        TravelGraph.from_edges(nodes, edges)
    messages = [mistake.message for mistake in caught.value.mistakes]
    assert messages == [
        "no way leads from the rest of the graph to source",
        "no way leads back to the rest of the graph from trap",
    ]
    graph = TravelGraph.from_edges(nodes, edges, connected=False)
    assert np.isfinite(graph.distances_from("a")).tolist() == [True] * 4 + [False, True]
    assert graph.path("a", "source") == ()
    assert graph.distance_m("a", "source") == np.inf
    part = graph.part(graph.components() == 0)
    assert part.names == ("a", "b", "c", "d")
    assert part.distance_m("b", "a") == graph.distance_m("b", "a")


def test_an_empty_graph_and_an_unknown_name_are_refused():
    with pytest.raises(InputError, match="no nodes"):
        TravelGraph.from_edges([], [])
    with pytest.raises(InputError, match="has no node 'e'"):
        TravelGraph.from_edges(NODES, RING).distances_from("e")


def test_a_node_is_reached_nearer_to_it_than_to_any_other():
    places = [("a", 0.0, 0.0), ("b", 2.0, 0.0), ("c", 2.0, 0.4), ("d", 20.0, 0.0)]
    graph = TravelGraph.from_edges([Stop(*each) for each in places], [], connected=False)
    assert [stop.reach_m for stop in graph.stops] == pytest.approx([1.0, 0.3, 0.3, 9.0], abs=0.01)
    assert graph.crowded().endswith("0.6 m: b, c")
    assert TravelGraph.from_edges([Stop("alone", 0.0, 0.0)], []).stops[0].reach_m == np.inf
