# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import copy
import json
from datetime import datetime
from itertools import pairwise

import numpy as np
import pytest

from soilmoist_ros.exploration import GraphTravel, RobotMotion, Stop, TravelGraph
from soilmoist_ros.exploration.travel.topological_map import (
    TopologicalMap,
    make_topological_map,
    parse_topological_map,
    read_topological_map,
)
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.simulation.robot.virtual_navigation import VirtualRobot

NOON = datetime(2024, 5, 17, 12, 0, 3)


def graph():
    nodes = [Stop("gate", 0, 0), Stop("row 1", 3.14159, -2), Stop("row_2", 3, 4)]
    return TravelGraph.from_edges(nodes, [("gate", "row 1"), ("row 1", "row_2"), ("row_2", "gate")])


def document():
    return copy.deepcopy(dict(make_topological_map(graph(), "farm", NOON).document))


def parse(content):
    return parse_topological_map(json.dumps(content))


def test_a_map_made_of_a_graph_holds_the_graph():
    made = make_topological_map(graph(), "farm", NOON)
    assert made.name == made.document["metric_map"] == made.document["pointset"] == "farm"
    assert made.graph.names == graph().names
    np.testing.assert_allclose(made.graph.xy, graph().xy, atol=5e-5)
    np.testing.assert_array_equal(made.graph.edges, graph().edges)
    assert made.document["meta"]["last_updated"] == "2024-05-17_12-00-03"
    node = made.document["nodes"][0]
    assert node["meta"] == {"map": "farm", "node": "gate", "pointset": "farm"}
    edge = node["node"]["edges"][0]
    assert (edge["edge_id"], edge["node"], edge["fail_policy"]) == ("gate_row 1", "row 1", "fail")
    assert node["node"]["properties"]["xy_goal_tolerance"] == 0.3
    assert len(node["node"]["verts"]) == 8
    close = TravelGraph.from_edges([Stop("a", 0, 0), Stop("b", 0.5, 0)], [("a", "b"), ("b", "a")])
    zone = make_topological_map(close, "m", NOON).document["nodes"][0]["node"]["verts"]
    assert 0.1 < max(vertex["x"] for vertex in zone) < 0.25, "zones do not overlap"


def test_a_map_is_written_and_read_exactly_and_means_the_same_to_the_navigations_parser(tmp_path):
    content = document()
    content["unknown"] = {"yes": [1, 2.5, None, True, "no", "1:30", "012", " ä\n", {"list": [[], {}]}]}
    made = parse(content)
    text = made.to_json(indent=1)
    yaml = pytest.importorskip("yaml")
    assert yaml.safe_load(text) == content
    for published in (made.to_json(), yaml.safe_dump(content)):  # by older and by newer servers
        assert parse_topological_map(published).document == content
    for name in ("m.json", "m.tmap2.yaml"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        again = read_topological_map(tmp_path / name)
        assert json.dumps(again.document) == json.dumps(content), "same order and types of numbers, too"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda node: node.pop("name"), "node 2: has no name"),
        (lambda node: node.pop("pose"), "node 2: row 1 has no pose with a position"),
        (lambda node: node["pose"]["position"].update(x="far"), "row 1: position x is not a number, but 'far'"),
        (lambda node: node["edges"][0].pop("node"), "row 1 has an edge without 'node'"),
        (lambda node: node["edges"].append(node["edges"][0]), "row 1 has more than one edge row 1_row_2"),
        (lambda node: node.update(edges="all"), "row 1: 'edges' is not a list of edges"),
        (
            lambda node: node.update(name="row\x1b[2J1"),
            r"node 2: has the name 'row\x1b[2J1', with signs that cannot",
        ),
        (lambda node: node["edges"][0].update(node="r\u202e"), r"has the name 'r\u202e', with signs that cannot"),
    ],
)
def test_a_spoilt_node_is_named_once_and_with_its_line(tmp_path, spoil, message):
    content = document()
    spoil(content["nodes"][1]["node"])
    with pytest.raises(InputError) as caught:
        parse(content)
    assert len(caught.value.mistakes) == 1
    assert message in str(caught.value)
    path = tmp_path / "map.yaml"
    path.write_text(TopologicalMap(content, graph()).to_json(indent=1))
    with pytest.raises(InputError) as caught:
        read_topological_map(path)
    line = caught.value.mistakes[0].line
    assert path.read_text().splitlines()[line].strip() == '"meta": {'


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"nodes": 3}', '{"nodes": []}', '{"nodes": [1]}', "3", "a: [", "map"]
)
def test_what_is_no_map_is_refused(text):
    with pytest.raises(InputError):
        parse_topological_map(text)


def test_a_map_of_the_oldest_form_is_refused(tmp_path):
    (tmp_path / "old.tmap").write_text("node: \n\tgate\n\twaypoint:\n\t\t0,0,0,0,0,0,1\n")
    with pytest.raises(InputError, match="a map of the oldest form"):
        read_topological_map(tmp_path / "old.tmap")


def newer(nav_frame=None, child="farm", x=50.0, key="topo_frame_id"):
    """A map in the form of newer releases: a transformation with topo_frame_id, nodes without parent_frame."""
    content = document()
    content["transformation"] = {key: child, "parent": "map", "translation": {"x": x, "y": 0.0}}
    for entry in content["nodes"]:
        del entry["node"]["parent_frame"]
        entry["node"] |= {"nav_frame": nav_frame} if nav_frame is not None else {}
    return content


@pytest.mark.parametrize(
    ("nav_frame", "shift_m"),
    [(None, 50.0), ("", 50.0), ("farm", 50.0), ("${transformation.topo_frame_id}", 50.0),
     ("map", 0.0), ("${transformation.parent}", 0.0)],
)  # fmt: skip
def test_a_node_is_in_the_frame_in_which_the_navigation_sends_its_goals(nav_frame, shift_m):
    for key in ("topo_frame_id", "topological_frame_id"):
        content = newer(nav_frame, key=key)
        if key == "topo_frame_id" or not str(nav_frame).startswith("${transformation.t"):
            np.testing.assert_allclose(parse(content).graph.xy - graph().xy, [(shift_m, 0.0)] * 3, atol=5e-5)


def test_frames_that_leave_the_place_of_a_node_open_are_refused():
    with pytest.raises(InputError, match="gate is in the frame 'odom', but the map has 'map' and 'farm'"):
        parse(newer("odom"))
    with pytest.raises(InputError, match="moves the frame 'map' to itself"):
        parse(newer(child="map"))
    np.testing.assert_allclose(parse(newer(child="map", x=0.0)).graph.xy, graph().xy, atol=5e-5)
    content = newer()
    content["nodes"][1]["node"]["parent_frame"] = "map"
    with pytest.raises(InputError, match=r"row 1 has parent_frame 'map', which newer .* write nav_frame"):
        parse(content)
    content["nodes"][1]["node"]["nav_frame"] = "farm"  # it decides
    assert parse(content).graph.xy[1, 0] == pytest.approx(graph().xy[1, 0] + 50, abs=5e-5)
    content["transformation"]["rotation"] = {"w": 0.0, "x": 1.0, "y": 0.0, "z": 0.0}
    with pytest.raises(InputError, match="tilts the map"):
        parse(content)
    content = newer()
    content["transformation"] = {"child": "farm", "translation": {"x": 50.0}}  # an older map: its parent is meant
    np.testing.assert_allclose(parse(content).graph.xy, graph().xy, atol=5e-5)
    content["transformation"] = None
    content["nodes"][0]["node"]["nav_frame"] = "elsewhere"
    content["nodes"][1]["node"]["parent_frame"] = "map"
    with pytest.raises(InputError, match="row 1 is in the frame 'map', but the map has 'elsewhere'"):
        parse(content)


def test_the_transformation_applies_to_nodes_in_the_maps_own_frame():
    content = document()
    half = np.sqrt(0.5)
    content["transformation"]["rotation"] = {"w": half, "x": 0.0, "y": 0.0, "z": half}
    content["transformation"]["translation"] = {"x": 10.0, "y": 20.0, "z": 0.0}
    np.testing.assert_allclose(parse(content).graph.xy, make_topological_map(graph(), "m", NOON).graph.xy)
    content["nodes"][2]["node"]["parent_frame"] = "topo_map"
    np.testing.assert_allclose(parse(content).graph.xy[2], [10 - 4, 20 + 3])


@pytest.mark.parametrize(
    "meta",
    [
        {"datum_latitude": 53.268617, "datum_longitude": "-0.525699"},
        {"origin": {"latitude": 53.268617, "longitude": -0.525699, "altitude": 0}},
        {"datum": {"latitude": 53.268617, "longitude": -0.525699}, "origin": {"latitude": 0.0, "longitude": 0.0}},
    ],
)
def test_the_datum_of_a_map_has_several_spellings(meta):
    assert parse({**document(), "meta": meta}).datum == LocalFrame(53.268617, -0.525699)
    assert parse({**document(), "definitions": meta}).datum == LocalFrame(53.268617, -0.525699)
    twice = {"meta": meta, "definitions": {"origin": {"latitude": 53.268617, "longitude": -0.52}}}
    with pytest.raises(InputError, match=r"two datums, 380\.\d m apart: meta"):
        parse({**document(), **twice})
    assert parse({**document(), **twice, "definitions": meta}).datum == LocalFrame(53.268617, -0.525699)


@pytest.mark.slow
def test_a_large_map_is_read_and_a_wrong_one_gets_a_fitting_text(tmp_path):
    content = document() | {"values": list(range(101_000))}  # as many as 3,506 edges have
    path = tmp_path / "map.yaml"
    path.write_text(TopologicalMap(content, graph()).to_json(indent=1))
    assert read_topological_map(path).document == content
    levels = "".join(f"{one}: &{one} [{', '.join([f'*{above}'] * 20)}]\n" for above, one in pairwise("abcdefg"))
    path.write_text("a: &a 1\n" + levels)
    with pytest.raises(InputError, match=r"holds more than 3000000 values -> give a smaller file"):
        read_topological_map(path)


def test_edges_with_actions_that_the_navigation_does_not_know_are_named():
    content, known = document(), ["NavigateToPose"]
    assert parse(content).doubts(known) == []
    edge = content["nodes"][0]["node"]["edges"][0]
    edge["action"] = "move_base"
    (found,) = parse(content).doubts(known)
    assert "may refuse to drive: 1 of" in found
    assert f"(move_base): {edge['edge_id']}; describe those that it has under 'actions'" in found
    named = [{"move_base": {}}, ["move_base"], [{"name": "move_base"}], [{"action_name": "move_base"}]]
    described = [
        keys for actions in named for keys in ({"actions": actions}, {"definitions": {"actions": actions}})
    ]
    for keys in (*described, {"navigation_config_file": "actions.yaml"}):
        assert parse({**content, **keys}).doubts(known) == [], "the map describes it"
    assert parse(content).doubts([]) == []


def test_ways_are_the_same_whatever_the_map_is_called():
    found = parse(document())
    assert parse({**document(), "name": "another"}).has_ways_of(found)
    fewer, odom = document(), newer()
    fewer["nodes"][0]["node"]["edges"].pop()
    odom["transformation"]["parent"] = "odom"
    located = {**document(), "meta": {"datum_latitude": 1.0, "datum_longitude": 2.0}}
    assert not any(parse(other).has_ways_of(found) for other in (fewer, located))
    assert not any(parse(other).has_ways_of(parse(newer())) for other in (newer(x=8.0), odom))


def test_a_map_whose_nodes_name_no_frame_has_none():
    nodes = [{"node": {"name": 0, "pose": {"position": {"x": 1, "y": 2}}, "edges": []}}]
    assert parse({"nodes": nodes}).frame == ""
    assert parse({"nodes": nodes, "transformation": {"rotation": {"w": 1}}}).frame == "map"
    nodes[0]["node"]["parent_frame"] = "farm"
    assert parse({"nodes": nodes}).frame == "farm"


def test_restrictions_are_named_and_a_message_is_read():
    content = document()
    assert parse(content).restrictions() == ""
    content["nodes"][1]["node"]["restrictions_planning"] = "robot_tall"
    content["nodes"][0]["node"]["edges"][0]["restrictions_runtime"] = "False"
    message = parse({"data": json.dumps(content)})
    assert "False of gate_row 1; robot_tall of row 1 (set robot_properties" in message.restrictions()
    for part, key, mark in (("node", "properties", {"no_go": True}), ("meta", "tag", ["no_go", "barn"])):
        content = document()
        content["nodes"][2][part][key] = mark
        found = parse(content)
        assert found.restrictions().endswith("no_go of row_2 (list its area under 'no_go' in the field file)")
        assert all("row_2" in ends for ends in barred_ends(found))


def barred_ends(found):
    """Names of the ends of the edges that the robot may not use."""
    return {
        tuple(found.graph.names[end] for end in found.graph.edges[one])
        for one in np.flatnonzero(found.graph.barred)
    }


@pytest.mark.parametrize(
    ("text", "robot", "may"),
    [
        ("robot", (), True), ("obstacleFree_1", (), True), ("True", (), True), (None, (), True),
        ("False", ("robot_short",), False), ("robot_short", (), False), ("robot_short", ("robot_tall",), False),
        ("robot_short | robot_hunter", ("robot_hunter",), True), ("allowedside_a", ("robot_short",), False),
        ("~allowedside_a", ("robot_short",), False), ("['robot_short', 'robot_tall']", ("robot_tall",), True),
        # names of other kinds are unknown: only what is true whatever they are is permitted
        ("robot_short | side_a", ("robot_short",), True), ("robot_tall | side_a", ("robot_short",), False),
        ("robot_short & ~(robot_tall & side_a)", ("robot_short",), True),
        ("robot_short & ~(robot_tall | side_a)", ("robot_short",), False),
        ("robot_short & ~side_a", ("robot_short",), False), ("robot_short & ~robot_tall", ("robot_short",), True),
        ("~robot_tall", (), False), ("robot_short and not robot_tall", ("robot_short",), True),
        ("__import__('os').system('true')", ("robot_short",), False), ("robot_short &", ("robot_short",), False),
    ],
)  # fmt: skip
def test_restrictions_of_public_maps(text, robot, may):
    content = document()
    content["nodes"][0]["node"]["edges"][0]["restrictions_planning"] = text
    found = parse(content).for_robot(robot)
    assert (found.graph.barred is None) == may
    if not may:
        assert str(text) in found.restrictions()


def test_a_misspelt_property_opens_nothing_and_is_named():
    content = document()
    content["nodes"][0]["node"]["edges"][0]["restrictions_planning"] = "~robot_tall"
    assert parse(content).for_robot(["robot_tal"]).graph.barred is not None
    assert "robot_tal: check the spelling" in parse(content).for_robot(["robot_tal"]).restrictions()
    content["nodes"][1]["node"]["edges"][0]["restrictions_planning"] = "robot_short"
    found = parse(content).for_robot(["robot_short"])
    assert (found.graph.barred, found.restrictions()) == (None, "")


def test_a_closed_node_closes_its_edges_and_one_of_two_edges_leaves_the_other():
    content = document()
    content["nodes"][1]["node"]["restrictions_runtime"] = "robot_tall"
    name = content["nodes"][1]["node"]["name"]
    ends = {tuple(parse(content).graph.names[end] for end in pair) for pair in parse(content).graph.edges}
    assert barred_ends(parse(content)) == {pair for pair in ends if name in pair}
    content = document()
    edges = content["nodes"][0]["node"]["edges"]
    edges.append({**edges[0], "edge_id": "another way", "restrictions_planning": "robot_tall"})
    assert parse(content).graph.barred is None
    assert "another way" in parse(content).restrictions()


@pytest.mark.parametrize(
    "keys",
    [{"properties": {"max_speed": "0.5"}}, {"properties": {"navigation": {"max_speed": 0.5}}}, {"top_vel": 0.5}],
)
def test_times_of_the_planner_and_of_the_robot_keep_the_speeds_of_edges(keys):
    content = document()
    content["nodes"][0]["node"]["edges"][0].update(keys)  # from the gate to row 1
    content["nodes"][1]["node"]["edges"][0]["properties"] = {"max_speed": 0.0}  # none
    found = parse(content).graph
    stops, motion = found.stops, RobotMotion(speed_mps=1.0, stop_overhead_s=2.0)
    slow_m, fast_m = found.length_m[:2].tolist()
    travel = GraphTravel(found.part(np.ones(3, bool)), motion)
    times = [2 * slow_m + 2, 2 * slow_m + fast_m + 2]
    assert travel.travel_s(stops[0].xy, stops[1:]) == pytest.approx(times)
    assert travel.between_s(stops, np.array([0, 2]))[0, 1] == pytest.approx(times[1])
    assert travel.legs_s(stops, np.array([0, 2])) == pytest.approx(times[1:])
    way = travel.route(stops[0].xy, stops[2])
    arrival_s = VirtualRobot(motion, stops[0].xy).go(0.0, way, travel.slower_m(way, 1.0))
    assert arrival_s == pytest.approx(times[1])
    assert travel.slower_m(way, 0.4) == 0, "the robot is slower than that"
    assert parse(document()).graph.limit_mps is None
    content["nodes"][0]["node"]["edges"][0].update(properties={"max_speed": "fast"})
    with pytest.raises(InputError, match="gate: the speed of the edge to row 1 is not a number"):
        parse(content)


def test_wide_nodes_edges_of_no_speed_and_marks_that_are_nearly_no_go_are_named():
    content = document()
    content["nodes"][0]["node"]["properties"]["xy_goal_tolerance"] = 3.0
    content["nodes"][0]["node"]["edges"][0]["properties"] = {"max_speed": 0.0001, "noGo": True}
    content["nodes"][1]["node"]["no_go"] = True  # outside of the properties it is not read
    content["nodes"][2]["meta"]["tag"] = ["no-go", "barn"]
    wide, slow, near = parse(content).doubts([])
    assert "half the distance to the next node at gate (3 m)" in wide
    assert "below 0.02 m/s on edges: gate to row 1 (0.0001 m/s)" in slow
    assert "noGo of gate_row 1, no_go of row 1, no-go of row_2; write no_go among the properties" in near
