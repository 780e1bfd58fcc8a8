# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The topological map of Thorvald's navigation: read it from a topic or file, write one for a travel graph."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.stop import PLACE_DIGITS, Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation.configuration import read_limited, read_yaml
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.plain_values import finite_number, read_json
from soilmoist_ros.foundation.suggestions import listing

ZONE_RADIUS_M = 0.75
"""Radius of a node's influence zone, unless the nodes are closer together [m]."""
ANY_HEADING_RAD = 6.283
"""Goal tolerance that lets the robot arrive at any heading [rad]."""

PLAIN_WORD = re.compile(r"[A-Za-z_/][\w/.$-]*")
YAML_WORDS = {"yes", "no", "on", "off", "true", "false", "null"}
_PLAIN = frozenset({str, int, float, bool, type(None)})


@dataclass(frozen=True, eq=False)
class TopologicalMap:
    """A topological map: the document as it is, and the travel graph it describes.

    :param document: the whole content, unknown keys included; not to be changed
    :param graph: its nodes and directed edges, in the map frame [m]
    """

    document: Mapping[str, Any]
    graph: TravelGraph

    @property
    def name(self) -> str:
        """Name of the map."""
        return str(self.document.get("name", ""))

    @property
    def metric_map(self) -> str:
        """Name of the metric map it belongs to."""
        return str(self.document.get("metric_map", ""))

    @property
    def pointset(self) -> str:
        """Name of its set of nodes."""
        return str(self.document.get("pointset", ""))

    @property
    def datum(self) -> LocalFrame | None:
        """Origin of the places on the earth: ``datum_latitude`` and ``datum_longitude`` in the map's meta."""
        meta = self.document.get("meta")
        try:
            return LocalFrame(*(float(meta[f"datum_{name}"]) for name in ("latitude", "longitude")))  # type: ignore[index]
        except (TypeError, KeyError, ValueError, OverflowError):
            return None

    def has_ways_of(self, other: TopologicalMap) -> bool:
        """Whether nodes, their places, edges and datum are those of another map; names and dates may differ."""
        same = bool(self.document["nodes"] == other.document["nodes"]) and self.datum == other.datum
        return same and np.array_equal(self.graph.xy, other.graph.xy)  # the map's transformation moves nodes

    def unknown_actions(self, known: Sequence[str]) -> str:
        """Which edges a navigation refuses since it does not know their action; empty if there are none.

        :param known: actions that the navigation knows
        """
        edges = [edge for entry in self.document["nodes"] for edge in entry["node"].get("edges") or []]
        refused = [edge for edge in edges if edge.get("action") and edge["action"] not in known]
        if not refused:
            return ""
        actions = listing(sorted({str(edge["action"]) for edge in refused}))
        names = listing(str(edge.get("edge_id", edge["node"])) for edge in refused)
        return f"{len(refused)} of {len(edges)} edges have an action that is not known ({actions}): {names}"

    def to_json(self) -> str:
        """The document as it goes on the topic ``topological_map_2``."""
        return json.dumps(self.document, allow_nan=False)

    def to_yaml(self) -> str:
        """The document as a map file, read alike by YAML 1.1 (which the navigation uses) and 1.2."""
        return "".join(f"{line}\n" for line in _yaml_lines(self.document))


def read_topological_map(path: Path) -> TopologicalMap:
    """Read a map file, YAML or JSON.

    :raises InputError: with every mistake in it, as :func:`parse_topological_map`
    """
    if path.suffix.lower() == ".json":
        try:
            return parse_topological_map(read_limited(path).decode("utf-8-sig"), path)
        except UnicodeDecodeError as error:
            raise InputError(f"is not UTF-8 text (byte {error.start})", "save it as UTF-8", path) from None
    found = _checked(read_yaml(path), path)
    return replace(found, document=_plain(found.document))


def parse_topological_map(text: str, path: Path | None = None) -> TopologicalMap:
    """Read the JSON text that comes on the topic ``topological_map_2``.

    Unknown keys are kept and not looked at.

    :param text: the JSON text
    :param path: file to name in messages
    :raises InputError: with the names of all nodes without a name or place, duplicate nodes and edges, and unknown
        edge targets. Nodes that cannot be reached are kept: which part is used depends on where the robot stands
    """
    try:
        content = read_json(text)
    except ValueError as error:
        raise InputError(
            f"the topological map is not valid JSON: {error}", "check what publishes it", path
        ) from None
    return _checked(content, path)


def make_topological_map(
    graph: TravelGraph,
    name: str,
    updated: datetime,
    *,
    metric_map: str | None = None,
    pointset: str | None = None,
    frame: str = "map",
    action: str = "NavigateToPose",
    action_type: str = "geometry_msgs/PoseStamped",
    xy_goal_tolerance_m: float = 0.3,
) -> TopologicalMap:
    """Map of a travel graph, with what the navigation expects in the other keys.

    Places are rounded to 0.1 mm. The influence zones are octagons that do not overlap; any heading will do
    at a node, since the sensor has none.

    :param graph: nodes and directed edges, in the frame ``frame`` [m]
    :param name: name of the map
    :param updated: time written as ``last_updated``
    :param metric_map: name of the metric map; the map's own if left out
    :param pointset: name of the set of nodes; the map's own if left out
    :param frame: frame of the places
    :param action: navigation action of every edge
    :param action_type: type of its goal
    :param xy_goal_tolerance_m: distance at which a node counts as reached [m], > 0
    """
    if not (math.isfinite(xy_goal_tolerance_m) and xy_goal_tolerance_m > 0):
        raise ValueError(f"xy_goal_tolerance_m must be > 0 and finite, got {xy_goal_tolerance_m}")
    place = {"map": metric_map or name, "pointset": pointset or name}
    zone = _octagon(zone_radius_m(graph))
    properties = {"xy_goal_tolerance": float(xy_goal_tolerance_m), "yaw_goal_tolerance": ANY_HEADING_RAD}
    targets: list[list[str]] = [[] for _ in graph.names]
    for start, end in graph.edges.tolist():
        targets[start].append(graph.names[end])
    nodes = []
    for stop, ends in zip(graph.stops, targets, strict=True):
        position = {"x": round(stop.x_m, PLACE_DIGITS) + 0.0, "y": round(stop.y_m, PLACE_DIGITS) + 0.0, "z": 0.0}
        node = {
            "edges": [_edge(stop.name, end, action, action_type) for end in ends],
            "localise_by_topic": "",
            "name": stop.name,
            "parent_frame": frame,
            "pose": {"orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, "position": position},
            "properties": dict(properties),
            "restrictions_planning": "True",
            "restrictions_runtime": "True",
            "verts": [dict(vertex) for vertex in zone],
        }
        nodes.append(
            {"meta": {"map": place["map"], "node": stop.name, "pointset": place["pointset"]}, "node": node}
        )
    document = {
        "meta": {"last_updated": updated.strftime("%Y-%m-%d_%H-%M-%S")},
        "metric_map": place["map"],
        "name": name,
        "nodes": nodes,
        "pointset": place["pointset"],
        "transformation": {
            "child": "topo_map",
            "parent": frame,
            "rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
            "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
        },
    }
    return _checked(document, None)


def _edge(start: str, end: str, action: str, action_type: str) -> dict[str, Any]:
    return {
        "action": action,
        "action_type": action_type,
        "config": [],
        "edge_id": f"{start}_{end}",
        "fail_policy": "fail",
        "fluid_navigation": True,
        "goal": {"target_pose": {"header": {"frame_id": "$node.parent_frame"}, "pose": "$node.pose"}},
        "node": end,
        "properties": {},
        "recovery_behaviours_config": "",
        "restrictions_planning": "True",
        "restrictions_runtime": "True",
    }


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
    entries = content.get("nodes") if isinstance(content, Mapping) else None
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise InputError(
            "is not a topological map: there is no list 'nodes'",
            "give the map that topological_map_2 publishes, or its YAML file",
            path,
        )
    mistakes: list[Mistake] = []
    move = _transformation(content)
    stops: list[Stop] = []
    edges: list[tuple[str, str]] = []
    for number, entry in enumerate(entries):
        line = _line(entries, number)
        try:
            stop, ends = _read_node(entry, move)
        except ValueError as error:
            mistakes.append(Mistake(f"node {number + 1}: {error}", "correct it", path, line))
            continue
        stops.append(stop)
        edges += [(stop.name, end) for end in ends]
    try:
        graph = TravelGraph.from_edges(stops, edges, connected=False, path=path)
    except InputError as error:
        # an edge to a faulty node would only repeat the mistake of the node
        raise InputError(mistakes or error.mistakes) from None
    if mistakes:
        raise InputError(mistakes)
    return TopologicalMap(content, graph)


def _read_node(entry: Any, move: _Move) -> tuple[Stop, list[str]]:
    """A node and the names to which its edges lead.

    :raises ValueError: if something is missing
    """
    node = entry.get("node") if isinstance(entry, Mapping) else None
    if not isinstance(node, Mapping):
        raise ValueError("has no key 'node'")
    name = node.get("name")
    if name is None or isinstance(name, (Mapping, list)) or not str(name):
        raise ValueError("has no name")
    pose = node.get("pose")
    position = pose.get("position") if isinstance(pose, Mapping) else None
    if not isinstance(position, Mapping):
        raise ValueError(f"{name} has no pose with a position")
    place = [_number(position.get(axis), f"{name}: position {axis}") for axis in ("x", "y")]
    edges = node.get("edges") or []
    if not isinstance(edges, list) or not all(isinstance(edge, Mapping) for edge in edges):
        raise ValueError(f"{name}: 'edges' is not a list of edges")
    if not all(edge.get("node") for edge in edges):
        raise ValueError(f"{name} has an edge without 'node', the place it leads to")
    double = _double(str(edge["edge_id"]) for edge in edges if "edge_id" in edge)
    if double:
        raise ValueError(f"{name} has more than one edge {listing(double)}")
    x, y = move.apply(place, str(node.get("parent_frame") or node.get("nav_frame") or ""))
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"{name} has no finite place after the map's transformation")
    return Stop(str(name), x, y), [str(edge["node"]) for edge in edges]


@dataclass(frozen=True)
class _Move:
    """The map's transformation: a turn and a shift for the nodes whose places are in the map's own frame."""

    child: str = ""
    turn: NDArray[np.float64] | None = None
    shift: tuple[float, float] = (0.0, 0.0)

    def apply(self, place: Sequence[float], frame: str) -> tuple[float, float]:
        if self.turn is None or frame not in (self.child, "${transformation.topo_frame_id}"):
            return place[0], place[1]
        x, y = (self.turn @ np.array(place)).tolist()
        return x + self.shift[0], y + self.shift[1]


def _transformation(content: Mapping[str, Any]) -> _Move:
    """The transformation of a map; none if it is left out or cannot be understood."""
    found = content.get("transformation")
    try:
        w, x, y, z = (float(found["rotation"][key]) for key in "wxyz")  # type: ignore[index]
        shift = tuple(float(found["translation"][key]) for key in "xy")  # type: ignore[index]
        child = str(found.get("child") or found.get("topo_frame_id") or "")  # type: ignore[union-attr]
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError):
        return _Move()
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return _Move(child, turn, (shift[0], shift[1]))


def _number(value: Any, what: str) -> float:
    number = finite_number(value)
    if number is None:
        raise ValueError(f"{what} is not a number, but {value!r:.80}")
    return number


def _double(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]


def _line(entries: Any, number: int) -> int:
    """Line of an entry of a list in a YAML file, 0 if unknown."""
    try:
        return int(entries.lc.item(number)[0]) + 1
    except (AttributeError, KeyError, TypeError, IndexError):
        return 0


def _plain(node: Any) -> Any:
    """The content with ordinary dicts, lists, strings and numbers instead of the YAML parser's types."""
    if type(node) in _PLAIN:  # fast path: the check for a Mapping is slow
        return node
    if isinstance(node, Mapping):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_plain(value) for value in node]
    return next((kind(node) for kind in (int, float, str) if isinstance(node, kind)), str(node))


def _yaml_lines(node: Any, indent: str = "") -> Iterator[str]:
    """The lines of a block of YAML whose words and numbers mean the same in YAML 1.1 and 1.2."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _yaml_entry(f"{indent}{_scalar(key)}:", value, indent)
    else:
        for value in node:
            if isinstance(value, (Mapping, list)) and value:
                first, *rest = _yaml_lines(value, indent + "  ")
                yield f"{indent}- {first[len(indent) + 2 :]}"
                yield from rest
            else:
                yield f"{indent}- {_scalar(value)}"


def _yaml_entry(key: str, value: Any, indent: str) -> Iterator[str]:
    if isinstance(value, (Mapping, list)) and value:
        yield key
        yield from _yaml_lines(value, indent if isinstance(value, list) else indent + "  ")
    else:
        yield f"{key} {_scalar(value)}"


def _scalar(value: Any) -> str:
    if isinstance(value, str):
        plain = PLAIN_WORD.fullmatch(value) and value.lower() not in YAML_WORDS
        if plain:
            return value
        quoted = json.dumps(value, ensure_ascii=False)  # a double-quoted YAML string, but for line breaks
        return "".join(sign if sign.isprintable() else f"\\U{ord(sign):08x}" for sign in quoted)
    if isinstance(value, float) and "." not in repr(value):
        return repr(value).replace("e", ".0e")  # 1e-05 is a string in YAML 1.1
    return json.dumps(value, allow_nan=False)
