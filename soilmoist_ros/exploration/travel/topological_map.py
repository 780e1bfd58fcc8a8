# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The topological map of Thorvald's navigation: read it from a topic or file, write one for a travel graph."""

from __future__ import annotations

import ast
import json
import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from soilmoist_ros.exploration.travel.stop import PLACE_DIGITS, Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import (
    InputError,
    LocalFrame,
    Mistake,
    PlaneMove,
    distance_and_bearing,
    finite_number,
    foreign_text,
    line_of,
    listing,
    parse_yaml,
    read_json,
    read_limited,
    read_quickly,
)

ZONE_RADIUS_M = 0.75  # radius of a node's influence zone, unless the nodes are closer together [m]
MAX_MAP_BYTES, MAX_MAP_VALUES = 20_000_000, 3_000_000
"""Size of a map file, and values in it, beyond which it is a mistake. An edge has about 30 values."""
MAX_TILT = 0.05
"""Sine of the angle between the vertical axes of a map and its parent frame beyond which it is a mistake."""
_SAME_DATUM_M = 0.1  # distance between two spellings of a datum from which they contradict each other [m]
KNOWN_ACTIONS = (
    "NavigateToPose", "NavigateThroughPoses", "DriveOnHeading", "row_traversal", "row_change", "goal_align",
    "navigate_to_pose", "navigate_to_poses", "GoalAlign", "RowTraversal",
)  # fmt: skip
"""Actions of edges that a release of the topological navigation has without a map that describes them."""
_SPEEDS = ("max_speed", "max_vel", "top_vel", "speed_limit")
"""Names of the highest speed on an edge, among its properties or its own keys [m/s]."""
_RESTRICTIONS = ("restrictions_planning", "restrictions_runtime")
SLOW_MPS = 0.02  # highest speed of an edge below which it is taken for a mistake [m/s]
_WORD, _SIGNS = re.compile(r"\w+"), re.compile(r"[\W_]")
_QUOTED = re.compile(r"\s*-?\d*\.?\d+\s*")  # a number that stands in quotes
NO_GO = "no_go"
"""Tag of a node, and property of nodes and edges, that robots must keep away from."""
XY_TOLERANCE_M = 0.3  # distance at which a node of a map that is made here counts as reached [m]
ANY_HEADING_RAD = 6.283  # goal tolerance that lets the robot arrive at any heading [rad]

_PLAIN = frozenset({str, int, float, bool, type(None)})


@dataclass(frozen=True, eq=False)
class TopologicalMap:
    """A topological map: the document as it is, and the travel graph it describes.

    :param graph: its nodes and directed edges, in the frame that the map's transformation names as its parent [m]
    """

    document: Mapping[str, Any]  # the whole content, unknown keys included; not to be changed
    graph: TravelGraph
    datum: LocalFrame | None = None  # origin of the places on the earth; ``None`` if the map names none
    frame: str = ""  # name of the frame of the graph; empty if the map names none
    closed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # nodes and edges by what closes them
    unknown: tuple[str, ...] = ()  # properties of the robot that no restriction of the map has

    @property
    def name(self) -> str:
        """Name of the map."""
        return foreign_text(str(self.document.get("name", "")))

    def has_ways_of(self, other: TopologicalMap) -> bool:
        """True if nodes, places, edges, frame and datum are those of another map; names and dates may differ."""
        one, two = ((each.document["nodes"], each.datum, each.frame) for each in (self, other))
        return one == two and np.array_equal(self.graph.xy, other.graph.xy)  # the transformation moves nodes

    def doubts(self, known_actions: Sequence[str]) -> list[str]:
        """Properties of the map that may keep a robot from driving, in words.

        :param known_actions: actions of edges that the navigation knows, in addition to those that the map itself
            describes; without any, actions are not looked at
        """
        elsewhere = self.document.get("navigation_config_file")  # a file that describes further actions
        unknown = self._unknown_actions(known_actions) if known_actions and not elsewhere else ""
        doubts = unknown, self.restrictions(), self._wide_nodes(), self._slow_edges(), self._nearly_no_go()
        return list(filter(None, doubts))

    def _wide_nodes(self) -> str:
        """Nodes at which the navigation may stop before the robot counts as arrived, in words."""
        wide = []
        for entry, stop in zip(self.document["nodes"], self.graph.stops, strict=True):
            keys = entry["node"].get("properties")
            tolerance_m = finite_number(keys.get("xy_goal_tolerance")) if isinstance(keys, Mapping) else None
            if tolerance_m is not None and tolerance_m > stop.reach_m:
                wide.append(f"{stop.name} ({tolerance_m:g} m)")
        text = f"xy_goal_tolerance is more than half the distance to the next node at {listing(wide)}"
        return f"the robot may stop too far from nodes to count there: {text}" if wide else ""

    def _slow_edges(self) -> str:
        """Edges on which the robot would hardly move, in words."""
        if (limit_mps := self.graph.limit_mps) is None:
            return ""
        slow = np.flatnonzero(limit_mps < SLOW_MPS)
        ends = (" to ".join(self.graph.names[end] for end in self.graph.edges[one]) for one in slow)
        edges = listing(f"{way} ({limit_mps[one]:g} m/s)" for way, one in zip(ends, slow, strict=True))
        text = f"the highest speed is below {SLOW_MPS:g} m/s on edges: {edges} (speeds of edges are in m/s)"
        return text if len(slow) else ""

    def _nearly_no_go(self) -> str:
        """Marks that look like :data:`NO_GO`, and close nothing, in words."""
        found = []
        for name, _, part, marks in self._parts():
            properties = part.get("properties")
            read = properties if isinstance(properties, Mapping) else {}
            unread = [part, *(one for one in read.values() if isinstance(one, Mapping))]
            words = [key for one in unread for key in one if one[key]]
            words += [one for one in (*(key for key in read if read[key]), *marks) if one != NO_GO]
            near = [word for word in map(str, words) if _SIGNS.sub("", word).lower().startswith("nogo")]
            found += [f"{word} of {name}" for word in near]
        text = f"without effect: {listing(found)}; write {NO_GO} among the properties of the node or edge"
        return text if found else ""

    def _unknown_actions(self, known: Sequence[str]) -> str:
        definitions = self.document.get("definitions")
        understood = [*known]
        for holder in (self.document, definitions if isinstance(definitions, Mapping) else {}):
            actions = holder.get("actions")
            understood += (
                str(next((one[key] for key in ("name", "action_name", "action") if key in one), ""))
                if isinstance(one, Mapping)
                else str(one)
                for one in (actions if isinstance(actions, (Mapping, list)) else ())
            )
        edges = [edge for entry in self.document["nodes"] for edge in entry["node"].get("edges") or []]
        refused = [edge for edge in edges if edge.get("action") and edge["action"] not in understood]
        actions = listing(sorted({str(edge["action"]) for edge in refused}))
        names = listing(str(edge.get("edge_id", edge["node"])) for edge in refused)
        text = f"{len(refused)} of {len(edges)} edges have an action that is not known ({actions}): {names}"
        remedy = "describe those that it has under 'actions' in the map"
        return f"the navigation may refuse to drive: {text}; {remedy}" if refused else ""

    def for_robot(self, properties: Iterable[str]) -> TopologicalMap:
        """The map for a robot with these properties, such as ``robot_short``; other edges are barred."""
        given, barred, free = frozenset(properties), set[tuple[str, str]](), set[tuple[str, str]]()
        words = {word for *_, texts in self._restricted() for text in texts for word in _WORD.findall(text)}
        robot = given & words  # a misspelt property would make the others of its kind false
        closed: dict[str, dict[str, None]] = {}
        for name, ends, texts in self._restricted():
            against = [text for text in texts if text == NO_GO or not permitted(text, robot)]
            for text in against:
                closed.setdefault(text, {})[name] = None
            (barred if against else free).add(ends)
        barred -= free  # two edges may lead the same way
        names = np.array(self.graph.names)[self.graph.edges].tolist()
        flags = np.array([not barred.isdisjoint({(a, b), (a, ""), (b, "")}) for a, b in names], np.bool_)
        graph = replace(self.graph, barred=flags if flags.any() else None)
        closed_by = {text: tuple(found) for text, found in closed.items()}
        return replace(self, graph=graph, closed=closed_by, unknown=tuple(sorted(given - words)))

    def restrictions(self) -> str:
        """Nodes and edges that the robot may not use, with the restriction; empty if there are none."""
        of = (f"{text} of {listing(names)}" for text, names in self.closed.items())
        remedy = "list its area under 'no_go' in the field file; " if NO_GO in self.closed else ""
        if set(self.closed) - {NO_GO}:
            remedy += "set robot_properties to what this robot is"
        text = f"not used, as the map restricts them: {'; '.join(of)} ({remedy.removesuffix('; ')})"
        if self.unknown and self._has_restrictions:
            spelling = f"the map has no robot_properties {listing(self.unknown)}: check the spelling"
            return f"{text}; {spelling}" if self.closed else spelling
        return text if self.closed else ""

    @property
    def _has_restrictions(self) -> bool:
        return any(text != NO_GO and not permitted(text, ()) for *_, texts in self._restricted() for text in texts)

    def _restricted(self) -> Iterator[tuple[str, tuple[str, str], list[str]]]:
        """Name, ends (a node has one) and restrictions of all nodes and edges."""
        for name, ends, part, marks in self._parts():
            texts = [str(part.get(key)) for key in _RESTRICTIONS if part.get(key) is not None]
            properties = part.get("properties")
            if (isinstance(properties, Mapping) and properties.get(NO_GO)) or NO_GO in marks:
                texts.append(NO_GO)
            yield name, ends, texts

    def _parts(self) -> Iterator[tuple[str, tuple[str, str], Mapping[str, Any], Collection[str]]]:
        """Name, ends (a node has one), content and tags of all nodes and edges."""
        for entry in self.document["nodes"]:
            node, meta = entry["node"], entry.get("meta")
            tags = (meta.get("tag") if isinstance(meta, Mapping) else None) or ()
            parts = [(node, (node["name"], ""), tags)]
            parts += [(edge, (node["name"], edge["node"]), ()) for edge in node.get("edges") or []]
            for part, (start, end), marks in parts:
                name = str(part.get("edge_id", f"{start}_{end}") if end else start)
                yield name, (str(start), str(end)), part, [marks] if isinstance(marks, str) else marks

    def to_json(self, indent: int | None = None) -> str:
        """The document as on the topic ``topological_map_2``; with indents as a map file, which is YAML, too."""
        return json.dumps(self.document, allow_nan=False, indent=indent)


def permitted(text: str, robot: Collection[str]) -> bool:
    """True if a restriction surely permits a robot of these properties.

    A restriction is a name such as ``robot_tall``, or names joined by ``|``, ``&`` and ``~``. A name that the
    robot has is true, and another one of its kind (what stands before the underscore) is false. Names of other
    kinds are unknown, and so is what depends on them: it is not permitted. ``robot`` alone stands for any robot,
    and ``obstacleFree_1`` for places that are free of other robots, which is seen to at run time.

    >>> permitted("robot_short | robot_hunter", {"robot_short"}), permitted("~robot_short", {"robot_short"})
    (True, False)
    >>> permitted("~side_a", {"robot_short"}), permitted("side_a | robot_short", {"robot_short"})
    (False, True)
    """
    if text.strip().lower() in ("", "none", "true"):
        return True
    try:
        return _truth(ast.parse(text.strip(), mode="eval").body, robot) is True
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False


def _truth(part: ast.expr, robot: Collection[str]) -> bool | None:
    """Truth of a part of a restriction in Kleene's logic; ``None`` if it is unknown."""
    match part:
        case ast.Constant(bool() as known):
            return known
        case ast.Constant(str() as name) | ast.Name(name):
            kind = name.partition("_")[0]
            if name in robot or name == "robot" or kind == "obstacleFree":
                return True
            return False if any(one.partition("_")[0] == kind for one in robot) else None
        case ast.UnaryOp(ast.Invert() | ast.Not(), inner):
            found = _truth(inner, robot)
            return None if found is None else not found
        case ast.BinOp(left, ast.BitAnd() | ast.BitOr() as sign, right):
            values, decisive = [_truth(left, robot), _truth(right, robot)], isinstance(sign, ast.BitOr)
        case ast.BoolOp(sign, parts):
            values, decisive = [_truth(one, robot) for one in parts], isinstance(sign, ast.Or)
        case ast.List(parts) | ast.Tuple(parts):
            values, decisive = [_truth(one, robot) for one in parts], True
        case _:
            return None
    return decisive if decisive in values else None if None in values else not decisive


def read_topological_map(path: Path) -> TopologicalMap:
    """Read a map file, YAML or JSON.

    :raises InputError: with every mistake in it, as :func:`parse_topological_map`
    """
    try:
        text = read_limited(path, limit=MAX_MAP_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", "save it as UTF-8", path) from None
    if path.suffix.lower() == ".json":
        return parse_topological_map(text, path)
    if re.match(r"node:\s*\n\t", text):
        remedy = "load it in its navigation, and save what topological_map_2 publishes"
        raise InputError("is a map of the oldest form: text with tabs", remedy, path)
    return _of_yaml(text, path)


def _of_yaml(text: str, path: Path | None) -> TopologicalMap:
    try:
        found = _checked(read_quickly(text, MAX_MAP_VALUES), path)
    except InputError:  # the slow parser knows the lines of mistakes
        found = _checked(parse_yaml(text, path, "rt", MAX_MAP_BYTES, MAX_MAP_VALUES), path)
    return replace(found, document=_plain(found.document))


def parse_topological_map(text: str, path: Path | None = None) -> TopologicalMap:
    """Read the text that comes on the topic ``topological_map_2``: JSON, or YAML of newer servers.

    Unknown keys are kept and not looked at.

    :raises InputError: with the names of all nodes without a name or place, duplicate nodes and edges, and unknown
        edge targets. Nodes that cannot be reached are kept: which part is used depends on where the robot stands
    """
    if text.lstrip()[:1] not in ("", "{", "["):
        return _of_yaml(text, path)
    try:
        content = read_json(text)
    except ValueError as error:
        raise InputError(
            f"the topological map is not valid JSON: {error}", "check what publishes it", path
        ) from None
    return _checked(content, path)


def make_topological_map(graph: TravelGraph, name: str, updated: datetime) -> TopologicalMap:
    """Map of a travel graph, with what the navigation expects in the other keys.

    Places are rounded to 0.1 mm. The influence zones are octagons that do not overlap; any heading will do
    at a node, since the sensor has none.
    """
    zone, unrestricted = _octagon(zone_radius_m(graph)), dict.fromkeys(_RESTRICTIONS, "True")
    turn = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
    edges: list[list[dict[str, Any]]] = [[] for _ in graph.names]
    for start, end in graph.edges.tolist():
        edges[start].append(
            {
                "action": KNOWN_ACTIONS[0],
                "action_type": "geometry_msgs/PoseStamped",
                "config": [],
                "edge_id": f"{graph.names[start]}_{graph.names[end]}",
                "fail_policy": "fail",
                "fluid_navigation": True,
                "goal": {"target_pose": {"header": {"frame_id": "$node.parent_frame"}, "pose": "$node.pose"}},
                "node": graph.names[end],
                "properties": {},
                "recovery_behaviours_config": "",
                **unrestricted,
            }
        )
    nodes = []
    for stop, ways in zip(graph.stops, edges, strict=True):
        position = {"x": round(stop.x_m, PLACE_DIGITS) + 0.0, "y": round(stop.y_m, PLACE_DIGITS) + 0.0, "z": 0.0}
        node = {
            "edges": ways,
            "localise_by_topic": "",
            "name": stop.name,
            "parent_frame": "map",
            "pose": {"orientation": dict(turn), "position": position},
            "properties": {"xy_goal_tolerance": XY_TOLERANCE_M, "yaw_goal_tolerance": ANY_HEADING_RAD},
            **unrestricted,
            "verts": [dict(vertex) for vertex in zone],
        }
        nodes.append({"meta": {"map": name, "node": stop.name, "pointset": name}, "node": node})
    document = {
        "meta": {"last_updated": updated.strftime("%Y-%m-%d_%H-%M-%S")},
        "metric_map": name,
        "name": name,
        "nodes": nodes,
        "pointset": name,
        "transformation": {
            "child": "topo_map",
            "parent": "map",
            "rotation": turn,
            "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
        },
    }
    return _checked(document, None)


def zone_radius_m(graph: TravelGraph) -> float:
    """Radius of the influence zones of nodes, such that no two touch [m]."""
    from scipy.spatial import KDTree

    if len(graph.names) < 2:
        return ZONE_RADIUS_M
    distance, _ = KDTree(graph.xy).query(graph.xy, k=2)
    nearest = float(distance[:, 1].min())
    return min(ZONE_RADIUS_M, 0.45 * nearest) if nearest > 0 else ZONE_RADIUS_M


def _octagon(radius_m: float) -> list[dict[str, float]]:
    angles = np.radians(22.5 + 45 * np.arange(8))
    corners = np.round(radius_m * np.column_stack([np.cos(angles), np.sin(angles)]), 4)
    return [{"x": x, "y": y} for x, y in corners.tolist()]


def _checked(content: Any, path: Path | None) -> TopologicalMap:
    """The map in a document, if it has no mistakes."""
    if isinstance(content, Mapping) and isinstance(content.get("data"), str):  # the message of the topic
        return parse_topological_map(content["data"], path)
    entries = content.get("nodes") if isinstance(content, Mapping) else None
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise InputError(
            "is not a topological map: there is no list 'nodes'",
            "give the map that topological_map_2 publishes, or its YAML file; convert a .tmap to .tmap2.yaml",
            path,
        )
    mistakes: list[Mistake] = []
    datum, move = _datum(content, path), _transformation(content, path)
    stops: list[Stop] = []
    edges: list[tuple[str, str]] = []
    limits: list[float] = []
    for number, entry in enumerate(entries):
        try:
            stop, ends, speeds = _read_node(entry, move)
        except ValueError as error:
            line = line_of(entries, (number,))
            mistakes.append(Mistake(f"node {number + 1}: {error}", "correct it", path, line))
            continue
        stops.append(stop)
        edges += [(stop.name, end) for end in ends]
        limits += speeds
    try:
        graph = TravelGraph.from_edges(stops, edges, path)
    except InputError as error:
        # an edge to a faulty node would only repeat the mistake of the node
        raise InputError(mistakes or error.mistakes) from None
    if mistakes:
        raise InputError(mistakes)
    if min(limits, default=math.inf) < math.inf:
        graph = replace(graph, limit_mps=np.array(limits))
    return TopologicalMap(content, graph, datum, move.frame).for_robot(())


def _read_node(entry: Any, move: _Move) -> tuple[Stop, list[str], list[float]]:
    """A node, the names to which its edges lead, and the highest speeds on these [m/s]."""
    node = entry.get("node") if isinstance(entry, Mapping) else None
    if not isinstance(node, Mapping):
        raise ValueError("has no key 'node'")
    name = node.get("name")
    if not _is_name(name):
        raise ValueError("has no name")
    for word in (name, *(edge.get("node") for edge in node.get("edges") or () if isinstance(edge, Mapping))):
        if not str(word).isprintable():
            raise ValueError(f"has the name {str(word)!r:.80}, with signs that cannot be printed: rename it")
    pose = node.get("pose")
    position = pose.get("position") if isinstance(pose, Mapping) else None
    if not isinstance(position, Mapping):
        raise ValueError(f"{name} has no pose with a position")
    place = [_number(position.get(axis), f"{name}: position {axis}") for axis in ("x", "y")]
    edges = node.get("edges") or []
    if not isinstance(edges, list) or not all(isinstance(edge, Mapping) for edge in edges):
        raise ValueError(f"{name}: 'edges' is not a list of edges")
    if not all(_is_name(edge.get("node")) for edge in edges):
        raise ValueError(f"{name} has an edge without 'node', the place it leads to")
    given = Counter(str(edge["edge_id"]) for edge in edges if "edge_id" in edge)
    if double := [one for one, count in given.items() if count > 1]:
        raise ValueError(f"{name} has more than one edge {listing(double)}")
    try:
        x, y = move.apply(place, node)
    except ValueError as error:
        raise ValueError(f"{name} {error}") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"{name} has no finite place after the map's transformation")
    return Stop(str(name), x, y), [str(edge["node"]) for edge in edges], [_limit(name, edge) for edge in edges]


def _limit(name: Any, edge: Mapping[str, Any]) -> float:
    """Highest speed on an edge, inf without a limit [m/s]; zeros are what editors of maps fill in."""
    holders, properties = [edge], edge.get("properties")
    if isinstance(properties, Mapping):  # a map may group them by who uses them
        holders += [properties, *(one for one in properties.values() if isinstance(one, Mapping))]
    given = [one[key] for one in holders for key in _SPEEDS if one.get(key) is not None]
    given = [float(one) if isinstance(one, str) and _QUOTED.fullmatch(one) else one for one in given]
    speeds = [_number(value, f"{name}: the speed of the edge to {edge['node']}") for value in given]
    if any(speed < 0 for speed in speeds):
        raise ValueError(f"{name}: the speed of the edge to {edge['node']} is negative")
    return min((speed for speed in speeds if speed > 0), default=math.inf)


@dataclass(frozen=True)
class _Move:
    """The map's transformation: a turn and a shift for the nodes whose places are in the map's own frame.

    The frame of a node that names none is that of the navigation: ``topo_frame_id``, or else the parent. Older
    releases send goals in ``parent_frame``, newer ones in ``nav_frame``.
    """

    keys: Mapping[str, Any]
    parent: str
    child: str
    yaw_rad: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    is_named: bool = True

    @property
    def frame(self) -> str:
        """Name of the frame of the places; empty if the map names none."""
        return self.parent if self.is_named else ""

    def apply(self, place: Sequence[float], node: Mapping[str, Any]) -> tuple[float, float]:
        """Place of a node in the parent frame."""
        named = _own_frame(self.keys)
        usual = named or self.parent
        newer, older = self._name(node.get("nav_frame")), self._name(node.get("parent_frame"))
        frame = newer or older or usual
        here, moved = (place[0], place[1]), PlaneMove(self.yaw_rad, self.shift).place((place[0], place[1]))
        if frame not in (self.parent, self.child):
            raise ValueError(f"is in the frame {frame!r}, but the map has {self.parent!r} and {self.child!r}")
        if older and not newer and named and older != usual and here != moved:
            raise ValueError(
                f"has parent_frame {older!r}, which newer releases of the navigation ignore: they take its place "
                f"to be in topo_frame_id {usual!r}; write nav_frame"
            )
        return moved if frame == self.child else here

    def _name(self, value: Any) -> str:
        """Name of a frame, which may refer to a key of the transformation."""
        text = "" if value is None else str(value)
        found = re.fullmatch(r"\$\{transformation\.(\w+)\}", text)
        return str(self.keys.get(found[1], text)) if found else text


def _own_frame(keys: Mapping[str, Any]) -> str:
    """The map's own frame as newer releases name it; empty if they do not."""
    return str(keys.get("topo_frame_id") or keys.get("topological_frame_id") or "")


def _transformation(content: Mapping[str, Any], path: Path | None) -> _Move:
    """The transformation of a map; without one, the frame of the nodes is the navigation's."""
    found = content.get("transformation")
    if not found:
        frames = [entry["node"] for entry in content["nodes"] if isinstance(entry, Mapping) and "node" in entry]
        named = [one.get("nav_frame") or one.get("parent_frame") for one in frames if isinstance(one, Mapping)]
        frame = str(next(filter(None, named), "map"))
        return _Move({}, frame, frame, is_named=any(named))
    try:
        rotation, translation = found.get("rotation") or {}, found.get("translation") or {}
        w, x, y, z = (float(rotation.get(key, key == "w")) for key in "wxyz")
        shift_x, shift_y = (float(translation.get(key, 0.0)) for key in "xy")
        norm = math.hypot(w, x, y, z)
        if not (math.isfinite(norm) and norm > 0.5 and math.isfinite(shift_x + shift_y)):
            raise ValueError("it is not finite, or its rotation is zero")
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        message = f"the transformation of the map cannot be understood: {error!s:.200}"
        raise InputError(
            message, "give rotation (w, x, y, z) and translation (x, y, z) as numbers", path
        ) from None
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    if 1 - 2 * (x * x + y * y) < math.sqrt(1 - MAX_TILT**2):
        raise InputError("the transformation tilts the map out of the plane", "correct its rotation", path)
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    parent = str(found.get("parent") or "map")
    child = _own_frame(found) or str(found.get("child") or "topo_map")
    if parent == child and (abs(yaw) > 1e-9 or math.hypot(shift_x, shift_y) > 1e-6):
        raise InputError(f"the transformation moves the frame {parent!r} to itself", "name two frames", path)
    return _Move(found, parent, child, yaw, (shift_x, shift_y))


def _datum(content: Mapping[str, Any], path: Path | None) -> LocalFrame | None:
    """Origin of a map on the earth, under each spelling of ``meta`` and ``definitions``."""
    found = dict[str, LocalFrame]()
    for section in ("meta", "definitions"):
        keys = content.get(section)
        if not isinstance(keys, Mapping):
            continue
        inner = ((name, keys.get(name), "") for name in ("origin", "datum", "gnss_origin"))
        for key, about, prefix in (("datum_latitude", keys, "datum_"), *inner):
            if not isinstance(about, Mapping) or about.get(f"{prefix}latitude") is None:
                continue
            name, given = f"{section}.{key}", [about.get(f"{prefix}{axis}") for axis in ("latitude", "longitude")]
            try:
                datum = LocalFrame(*(float(value) for value in given))  # type: ignore[arg-type]
            except (TypeError, ValueError, OverflowError):
                message = f"the datum of the map, {name} {given!s:.80}, is no place"
                raise InputError(message, "give latitude and longitude in degrees", path) from None
            # Zeros are what editors of maps fill in where nothing is known.
            if (datum.latitude_deg, datum.longitude_deg) != (0.0, 0.0):
                found[name] = datum
    places = {name: (datum.latitude_deg, datum.longitude_deg) for name, datum in found.items()}
    first = next(iter(found), "")
    for name, place in places.items():
        away_m, _ = distance_and_bearing(places[first], place)
        if away_m > _SAME_DATUM_M:
            message = f"the map has two datums, {away_m:.1f} m apart: {first} {places[first]}, {name} {place}"
            raise InputError(message, "remove the wrong one", path)
    return found.get(first)


def _is_name(value: Any) -> bool:
    """True if a value names a node: a text, or a number such as 0."""
    return value is not None and not isinstance(value, (Mapping, list)) and bool(str(value))


def _number(value: Any, what: str) -> float:
    number = finite_number(value)
    if number is None:
        raise ValueError(f"{what} is not a number, but {value!r:.80}")
    return number


def _plain(node: Any) -> Any:
    """The content with ordinary dicts, lists, strings and numbers instead of the YAML parser's types."""
    if type(node) in _PLAIN:  # fast path: the check for a Mapping is slow
        return node
    if isinstance(node, Mapping):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_plain(value) for value in node]
    return next((kind(node) for kind in (int, float, str) if isinstance(node, kind)), str(node))
