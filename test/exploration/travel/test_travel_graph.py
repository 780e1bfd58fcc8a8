# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The travel graph: its routes and mistakes, and graphs built from the outline of a field."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import Stop, TravelGraph, crop_rows, open_lattice
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import Field

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


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(graphs())
def test_shortest_ways_obey_the_triangle_inequality_and_paths_have_their_length(graph):
    distance = np.array([[graph.distance_m(start, end) for end in graph.names] for start in graph.names])
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


def test_edges_are_directed_and_the_shortest_of_parallel_ones_counts():
    graph = TravelGraph.from_edges(NODES, RING)
    assert graph.distance_m("a", "b") == 3
    assert graph.path("b", "a") == ("b", "c", "d", "a")
    with pytest.raises(InputError, match="has no node 'e'"):
        graph.distance_m("e", "a")
    edges = np.array([(0, 1), (0, 1), (1, 0)], np.intp)
    graph = TravelGraph(("a", "b"), np.array([(0.0, 0.0), (3.0, 0.0)]), edges, np.array([9.0, 7.0, 0.0]))
    assert (graph.distance_m("a", "b"), graph.distance_m("b", "a")) == (7, 0)


def test_mistakes_are_named_all_at_once():
    nodes = [*NODES, Stop("a", 1, 1), Stop("far", np.inf, 0)]
    with pytest.raises(InputError) as caught:
        TravelGraph.from_edges(nodes, [("a", "b"), ("a", "fa"), ("x", "b")])
    text = str(caught.value)
    assert "more than one node has the name a" in text
    assert "the place is not finite of far" in text
    assert "from 'a' to 'fa': there is no node 'fa' (did you mean 'far'?)" in text
    assert "there is no node 'x'" in text


def test_nodes_that_cannot_be_reached_or_not_be_left_are_of_other_parts():
    nodes = [*NODES, Stop("source", 9, 9), Stop("trap", 8, 8)]
    edges = [*RING, ("source", "a"), ("a", "trap")]
    graph = TravelGraph.from_edges(nodes, edges)
    assert [bool(graph.path("a", name)) for name in graph.names] == [True] * 4 + [False, True]
    assert graph.path("a", "source") == ()
    assert graph.distance_m("a", "source") == np.inf
    part = graph.part(graph.components() == 0)
    assert part.names == ("a", "b", "c", "d")
    assert part.distance_m("b", "a") == graph.distance_m("b", "a")


def test_a_node_is_reached_nearer_to_it_than_to_any_other():
    places = [("a", 0.0, 0.0), ("b", 2.0, 0.0), ("c", 2.0, 0.4), ("d", 20.0, 0.0)]
    graph = TravelGraph.from_edges([Stop(*each) for each in places], [])
    assert [stop.reach_m for stop in graph.stops] == pytest.approx([1.0, 0.3, 0.3, 9.0], abs=0.01)
    assert graph.crowded().endswith("0.6 m: b, c")
    assert TravelGraph.from_edges([Stop("alone", 0.0, 0.0)], []).stops[0].reach_m == np.inf


# Graphs built from a field --------------------------------------------------------------------------------------


def field_of(polygon, *no_go):
    frame = LocalFrame(53.0, -0.5)
    return Field("test", frame, np.array(polygon, float), tuple(np.array(ring, float) for ring in no_go))


def box(left, bottom, right, top):
    return [[left, bottom], [right, bottom], [right, top], [left, top]]


def lines_of(graph):
    return shapely.linestrings(graph.xy[graph.edges])


def is_symmetric(graph):
    ways = {tuple(pair) for pair in graph.edges.tolist()}
    return ways == {(b, a) for a, b in ways}


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(st.floats(4, 30), st.sampled_from([0, 0.5, 3]), st.tuples(st.integers(5, 60), st.integers(5, 60)))
def test_a_lattice_is_symmetric_connected_and_stays_off_no_go_areas(spacing, margin, corner):
    no_go = box(*corner, corner[0] + 25, corner[1] + 13)
    field = field_of([[0, 0], [100, 0], [120, 70], [40, 100], [0, 60]], no_go)
    graph = open_lattice(field, spacing, margin_m=margin).graph
    assert is_symmetric(graph)
    assert not graph.components().any()
    area = shapely.Polygon(field.polygon).difference(shapely.Polygon(no_go)).buffer(-margin).buffer(0.01)
    if len(graph.edges):
        assert shapely.covers(area, lines_of(graph)).all()
        assert graph.length_m.max() <= 1.5 * spacing + 2e-4, "places are rounded"


def test_a_full_lattice_has_all_its_ways():
    built = open_lattice(field_of(box(0, 0, 30, 30)), 10)
    assert (len(built.graph.names), len(built.graph.edges)) == (16, 2 * (2 * 3 * 4 + 2 * 9))
    assert built.dropped == ()
    assert built.graph.names[:2] == ("r1c1", "r1c2")


def test_what_a_wall_cuts_off_is_reported():
    built = open_lattice(field_of(box(0, 0, 60, 20), box(41, -1, 44, 21)), 10)
    assert built.graph.xy[:, 0].max() == 40
    assert {stop.x_m for stop in built.dropped} == {50, 60}
    assert "left out, since no way leads there: r1c6" in built.summary


@pytest.mark.parametrize(
    ("field", "spacing", "margin", "said"),
    [
        (box(0, 0, 30, 30), 0, 0, "spacing_m must be > 0"),
        (box(0, 0, 30, 30), 0.01, 0, "at most"),
        (box(0, 0, 30, 30), 40, 0, "only one node.* -> use a spacing smaller than 40 m"),
        (box(0, 0, 30, 30), 5, 15, "-> a margin of 15 m leaves nothing of the field: use a smaller one"),
    ],
)
def test_a_lattice_that_cannot_be_is_refused(field, spacing, margin, said):
    with pytest.raises(InputError, match=said):
        open_lattice(field_of(field), spacing, margin_m=margin)


def test_a_graph_that_leads_nowhere_is_refused():
    with pytest.raises(InputError, match="2 nodes, but no way between them"):
        open_lattice(field_of(box(0, 0, 30, 10), box(14, -1, 16, 11)), 30)


def rows_without_headlands(graph):
    keep = np.array([not name.endswith(("-start", "-end")) for name in graph.names])
    return graph.part(keep)


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(st.floats(0, 360), st.floats(3, 12), st.floats(4, 20), st.floats(3, 8))
def test_rows_are_left_only_at_their_ends(heading, row_spacing, node_spacing, headland):
    field = field_of([[0, 0], [100, 0], [120, 70], [40, 100], [0, 60]])
    graph = crop_rows(field, row_spacing, node_spacing, heading, headland).graph
    assert is_symmetric(graph)
    assert not graph.components().any()
    assert shapely.covers(shapely.Polygon(field.polygon).buffer(0.01), lines_of(graph)).all()
    rows = rows_without_headlands(graph)
    part = rows.components()
    row_of = np.array([name.split("-")[0] for name in rows.names])
    for number in range(part.max() + 1):
        assert len(set(row_of[part == number])) == 1
    assert len(set(row_of)) == part.max() + 1
    within = row_of[rows.edges[:, 0]] == row_of[rows.edges[:, 1]]
    assert within.all()
    assert rows.length_m.max(initial=0) <= node_spacing + 1e-6
    direction = np.array([np.sin(np.radians(heading)), np.cos(np.radians(heading))])
    legs = rows.xy[rows.edges[:, 1]] - rows.xy[rows.edges[:, 0]]
    np.testing.assert_allclose(abs(legs @ direction), rows.length_m, atol=1e-6)


def test_rows_of_a_rectangle():
    built = crop_rows(field_of(box(0, 0, 20, 100)), 5, 30, 0, 10)
    assert built.dropped == ()
    assert [name for name in built.graph.names if name.startswith("row2")] == [
        "row2-start", "row2-1", "row2-2", "row2-3", "row2-4", "row2-end",
    ]  # fmt: skip
    row = built.graph.xy[[built.graph.index(f"row2-{k}") for k in ("start", "1", "4", "end")]]
    np.testing.assert_allclose(row, [[7.5, 5], [7.5, 10], [7.5, 90], [7.5, 95]])
    assert built.graph.distance_m("row2-2", "row3-2") == pytest.approx(2 * 31.67 + 5, abs=0.01)


def test_a_row_cut_by_a_no_go_area_is_left_backwards():
    built = crop_rows(field_of(box(0, 0, 20, 100), box(6, 40, 9, 60)), 5, 10, 0, 10)
    graph = built.graph
    assert graph.path("row2-3", "row2-7")[0:4] == ("row2-3", "row2-2", "row2-1", "row2-start")
    assert graph.path("row2-3", "row2-7")[-2:] == ("row2-8", "row2-7")
    two = crop_rows(field_of(box(0, 0, 20, 100), box(6, 20, 9, 25), box(6, 70, 9, 75)), 5, 10, 0, 10)
    assert {stop.name for stop in two.dropped} == {f"row2-{k}" for k in range(3, 8)}


def test_a_row_met_twice_has_two_parts():
    hook = [[0, 0], [40, 0], [40, 100], [0, 100], [0, 70], [20, 70], [20, 30], [0, 30]]
    graph = crop_rows(field_of(hook), 10, 10, 0, 5).graph
    assert {"row1-start", "row1b-start", "row3-start"} <= set(graph.names)
    assert "row3b-start" not in graph.names
    parts = rows_without_headlands(graph).components()
    assert parts.max() + 1 == 6


def test_a_field_without_room_for_rows_is_refused():
    with pytest.raises(InputError, match="no node"):
        crop_rows(field_of(box(0, 0, 20, 9)), 5, 10, 0, 10)
    with pytest.raises(InputError, match="headland_m must be > 0"):
        crop_rows(field_of(box(0, 0, 20, 9)), 5, 10, 0, 0)
