# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The graph of Nav2's Route Server: a GeoJSON file with metres instead of degrees, read and written.

Nodes are points with an ``id`` and a ``frame``, edges are lines with ``startid`` and ``endid``; the geometry of an
edge is for display, the robot drives straight. Source: GeoJsonGraphFileLoader and GeoJsonGraphFileSaver of
nav2_route (ros-navigation/navigation2, 2026). Older graphs have ``edge_id``, ``start_node`` and ``end_node``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.exploration.travel.stop import PLACE_DIGITS, Stop
from soilmoist_ros.exploration.travel.topological_map import MAX_MAP_BYTES
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import (
    InputError,
    Mistake,
    finite_number,
    foreign_text,
    listing,
    read_json,
    read_limited,
)

LINES: Final = ("LineString", "MultiLineString")
_ENDS: Final = (("startid", "endid"), ("start_node", "end_node"))


def is_route_graph(features: list[Any]) -> bool:
    """True if the features of a GeoJSON file are a graph of Nav2: a line has the numbers of its ends."""
    return any(
        isinstance(about := one.get("properties") if isinstance(one, Mapping) else None, Mapping)
        and any({start, end} <= about.keys() for start, end in _ENDS)
        for one in features
    )


def geojson_features(path: Path) -> list[Any]:
    """Features of a GeoJSON file, none if it has no list of them; ``InputError`` if it is no JSON."""
    try:
        content = read_json(read_limited(path, limit=MAX_MAP_BYTES).decode("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"is not valid JSON: {error}", "save it again as GeoJSON", path) from None
    features = content.get("features") if isinstance(content, Mapping) else None
    return features if isinstance(features, list) else []


def read_route_graph(path: Path, features: list[Any]) -> tuple[TravelGraph, str, str]:
    """Graph, name of its frame (``map`` if it names none) and what of the file is not used, empty for nothing.

    The name of a node is its ``metadata`` ``name``, as :func:`route_graph_text` writes it, or else its ``id``.

    :raises InputError: with every feature that cannot be used, also for nodes in more than one frame
    """
    names, nodes, edges = dict[int, str](), list[Stop](), list[tuple[int, int, int]]()
    frames, mistakes, unused = set[str](), list[Mistake](), set[str]()
    for number, feature in enumerate(features, 1):
        try:
            about, shape = feature["properties"], feature["geometry"]
            unused |= {key for key in ("operations", "cost") if about.get(key)}
            more = about.get("metadata") or {}
            unused |= {str(key) for key in more if key != "name" and shape["type"] in LINES}
            if shape["type"] == "Point":
                x_m, y_m = (finite_number(one) for one in shape["coordinates"][:2])
                if x_m is None or y_m is None:
                    raise ValueError("has no finite place")
                name = str(more.get("name") or about["id"])
                if type(about["id"]) is not int:
                    raise ValueError(f"the id {about['id']!r} is no whole number")
                if about["id"] in names:
                    raise ValueError(f"the id {about['id']} is that of another node")
                names[about["id"]] = foreign_text(name)
                frames.add(str(about.get("frame") or "map"))
                nodes.append(Stop(names[about["id"]], x_m, y_m))
            elif shape["type"] in LINES:
                start, end = next(ends for ends in _ENDS if ends[0] in about)
                edges.append((number, about[start], about[end]))
                parts = shape.get("coordinates") or []
                if sum(map(len, [parts] if shape["type"] == "LineString" else parts)) > 2:
                    unused.add("bends of lines")
        except (AttributeError, KeyError, TypeError, ValueError, StopIteration) as error:
            what = f"lacks {error}" if isinstance(error, KeyError) else str(error) or "has no ends"
            mistakes.append(Mistake(f"feature {number}: {what}", "correct it", path))
    lost = [f"feature {number}" for number, *ends in edges if not set(ends) <= names.keys()]
    if lost:
        mistakes.append(Mistake(f"edges lead to nodes that are not there: {listing(lost)}", "add the nodes", path))
    if len(frames) > 1:
        remedy = "write all places in one frame"
        mistakes.append(Mistake(f"its nodes are in several frames: {listing(sorted(frames))}", remedy, path))
    if mistakes:
        raise InputError(mistakes)
    graph = TravelGraph.from_edges(nodes, dict.fromkeys((names[one], names[two]) for _, one, two in edges), path)
    ignored = f"{listing(sorted(unused))} of the route graph are for Nav2: travel times do not know them"
    return graph, next(iter(frames), "map"), ignored if unused else ""


def route_graph_text(graph: TravelGraph, frame: str = "map") -> str:
    """The graph as Nav2's Route Server loads it: places in metres of a frame, names of nodes as ``metadata``."""
    xy = graph.xy.round(PLACE_DIGITS).tolist()
    features = [
        _feature({"id": number, "frame": frame, "metadata": {"name": name}}, "Point", xy[number])
        for number, name in enumerate(graph.names)
    ]
    features += [
        _feature(
            {"id": number, "startid": start, "endid": end, "cost": 0.0, "overridable": True},
            "MultiLineString",
            [[xy[start], xy[end]]],
        )
        for number, (start, end) in enumerate(graph.edges.tolist(), len(features))
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}  # as Nav2 writes it; not used
    return json.dumps({"type": "FeatureCollection", "name": "graph", "crs": crs, "features": features}, indent=1)


def _feature(properties: dict[str, Any], kind: str, coordinates: list[Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
