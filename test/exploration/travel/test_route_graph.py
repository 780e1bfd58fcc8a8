# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Graphs of Nav2's Route Server: what is written is read back, and files as its loader takes them."""

import json

import numpy as np
import pytest

from soilmoist_ros.exploration import crop_rows, read_travel_map, route_graph_text
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field

FIELD = Field("meadow", LocalFrame(53.0, 0.0), np.array([[0, 0], [60, 0], [60, 40], [0, 40]], float))


def document(edges, frame="map", **more):
    points = {0: (10, 10), 1: (30, 10), 7: (30, 30)}
    features = [
        {"type": "Feature", "properties": {"id": number, "frame": frame, **more},
         "geometry": {"type": "Point", "coordinates": place}}
        for number, place in points.items()
    ]  # fmt: skip
    features += [
        {"type": "Feature", "properties": edge, "geometry": {"type": "MultiLineString"}} for edge in edges
    ]
    return {"type": "FeatureCollection", "name": "graph", "features": features}


def read(folder, content):
    path = folder / "graph.geojson"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_travel_map(path, FIELD)


def test_rows_are_written_as_the_loader_of_nav2_wants_them_and_read_back(tmp_path):
    graph = crop_rows(FIELD, 5.0, 10.0, 0.0, 5.0).graph
    content = json.loads(route_graph_text(graph))
    ids = [feature["properties"]["id"] for feature in content["features"]]
    assert len(set(ids)) == len(ids)
    assert all(type(one) is int and one >= 0 for one in ids)  # unsigned in nav2_route
    found = read(tmp_path, content).graph
    assert found.names == graph.names
    assert np.abs(found.xy - graph.xy).max() <= 1e-4
    assert sorted(map(tuple, found.edges.tolist())) == sorted(map(tuple, graph.edges.tolist()))


@pytest.mark.parametrize("keys", [("startid", "endid"), ("start_node", "end_node")], ids=["2025", "2023"])
def test_both_spellings_of_edges_are_read_one_way_and_in_metres(tmp_path, keys):
    edges = [{"id": 8, **dict(zip(keys, (0, 7), strict=True))}, {"id": 9, **dict(zip(keys, (7, 1), strict=True))}]
    found = read(tmp_path, document(edges, frame="odom"))
    assert (found.graph.names, found.frame, found.datum) == (("0", "1", "7"), "odom", None)
    assert found.graph.xy.tolist() == [[10, 10], [30, 10], [30, 30]]
    assert found.graph.path("0", "1") == ("0", "7", "1")
    assert found.graph.path("1", "0") == ()


def test_what_is_not_used_is_named(tmp_path, caplog):
    edge = {"id": 8, "startid": 0, "endid": 1, "cost": 4.0, "metadata": {"speed_limit": 0.5}}
    read(tmp_path, document([edge, {**edge, "id": 9, "operations": {"open_door": {}}}]))
    assert "cost, operations, speed_limit of the route graph" in caplog.text
    content = document([edge, {**edge, "metadata": {"closed": True}}])
    content["features"][3]["geometry"]["coordinates"] = [[[10, 10], [15, -20], [30, 10]]]
    read(tmp_path, content)
    assert "bends of lines, closed, cost" in caplog.text


@pytest.mark.parametrize(
    ("edge", "more", "message"),
    [
        ({"id": 8, "startid": 0, "endid": 99}, {}, "edges lead to nodes that are not there: feature 4"),
        ({"id": 8, "startid": 0, "endid": 1}, {"id": 3}, "the id 3 is that of another node"),
        (
            {"id": 8, "startid": 0, "endid": 1},
            {"metadata": {"name": "same"}},
            "more than one node has the name same",
        ),
    ],
)
def test_mistakes_are_named(tmp_path, edge, more, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, document([edge], **more))


def test_nodes_in_two_frames_are_refused(tmp_path):
    content = document([{"id": 8, "startid": 0, "endid": 1}])
    content["features"][1]["properties"]["frame"] = "odom"
    with pytest.raises(InputError, match="several frames: map, odom"):
        read(tmp_path, content)
