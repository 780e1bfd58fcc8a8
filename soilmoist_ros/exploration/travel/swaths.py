# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Swaths of a coverage planner as a travel graph: they are its lanes, joined through the headland.

Two files are read, as their programs write them (Fields2Cover/Fields2Cover and open-navigation/opennav_coverage,
2026):

* swaths of Fields2Cover as GeoJSON, one line each. Its reader takes any numbers, so degrees and metres are tried
* the message ``PathComponents`` of opennav_coverage as YAML or JSON: swaths and turns
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.route_graph import LINES
from soilmoist_ros.exploration.travel.stop import DrivableArea, Stop, stops_xy
from soilmoist_ros.exploration.travel.topological_map import MAX_MAP_BYTES, MAX_MAP_VALUES
from soilmoist_ros.exploration.travel.travel_graph import BuiltGraph, allowed_ways, connected, node, require
from soilmoist_ros.foundation import (
    InputError,
    distance_text,
    finite_number,
    foreign_text,
    listing,
    parse_yaml,
    read_json,
    read_limited,
)
from soilmoist_ros.mapping import Field

Array = NDArray[np.float64]

NEAREST: Final = 2  # an end is joined to so many nearest ends of other swaths: the neighbours on both sides
TURN_M: Final = 1.0  # a turn belongs to the end of a swath within this distance [m]
BEND_M: Final = 0.1  # turns and bent swaths are simplified to this error [m]
_REMEDY = "give swaths of Fields2Cover as GeoJSON, or PathComponents of opennav_coverage"


@dataclass(frozen=True)
class SwathFile:
    """Swaths of a file, in the coordinates of the file."""

    swaths: tuple[tuple[str, Array], ...]  # name, and places of shape (k, 2)
    turns: tuple[Array, ...]  # places of each turn, shape (k, 2); empty if the file has none
    kind: str  # what the file is, in words
    may_be_degrees: bool = False


def read_swaths(path: Path) -> SwathFile:
    """Swaths and turns of a file.

    :raises InputError: if it is neither of the two, or has no swath
    """
    try:
        text = read_limited(path, limit=MAX_MAP_BYTES).decode("utf-8-sig")
        text = text.partition("\n---")[0]  # ros2 topic echo writes it after a message
        is_json = text.lstrip().startswith("{")
        content = read_json(text) if is_json else parse_yaml(text, path, "safe", MAX_MAP_BYTES, MAX_MAP_VALUES)
    except ValueError as error:
        raise InputError(f"is not valid JSON or YAML: {error}", _REMEDY, path) from None
    found = _of_content(content, path)
    if not found.swaths:
        raise InputError("has no swath", _REMEDY, path)
    return found


def _of_content(content: Any, path: Path) -> SwathFile:
    content = content if isinstance(content, Mapping) else {}
    try:
        if isinstance(content.get("features"), list):
            lines = tuple(_geojson_lines(content["features"]))
            return SwathFile(lines, (), "GeoJSON of Fields2Cover", True)
        for key in ("result", "coverage_path"):
            content = content.get(key) or content
        given = enumerate(content.get("swaths") or [], 1)
        frame = str((content.get("header") or {}).get("frame_id", ""))
        swaths = tuple((str(number), _xy([one["start"], one["end"]])) for number, one in given)
        paths = (turn["poses"] for turn in content.get("turns") or [])
        turns = tuple(_xy([one["pose"]["position"] for one in poses]) for poses in paths if poses)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        what = f"lacks {error}" if isinstance(error, KeyError) else f"is bad: {error}"
        raise InputError(f"a swath or turn {what}", _REMEDY, path) from None
    if _in_degrees(frame):
        what = f"has places in degrees: its header.frame_id is {frame!r}"
        raise InputError(what, "give PathComponents in metres from the field's datum", path)
    return SwathFile(swaths, turns, "PathComponents of opennav_coverage")


def _in_degrees(frame: str) -> bool:
    """True if the name of a frame is that of a reference system with longitude and latitude."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if code := re.search(r"epsg\W*(\d+)", frame, re.IGNORECASE):
        try:
            return CRS.from_epsg(int(code[1])).is_geographic
        except CRSError:
            return False
    return bool(re.fullmatch(r"(.*[:/])?(wgs.?84|crs.?84|lon.?lat|lat.?lon)", frame.strip(), re.IGNORECASE))


def _geojson_lines(features: list[Any]) -> Iterator[tuple[str, Array]]:
    for number, one in enumerate(features, 1):
        shape, about = one["geometry"], one.get("properties") or {}
        if shape["type"] in LINES:
            parts = [shape["coordinates"]] if shape["type"] == "LineString" else shape["coordinates"]
            name = foreign_text(str(about.get("path_id", number)))
            for part, places in enumerate(parts):
                yield name + (f".{part + 1}" if len(parts) > 1 else ""), _xy(places)


def _xy(places: list[Any]) -> Array:
    """Places of mappings with x and y, or of lists, shape (k, 2)."""
    xy = [(at["x"], at["y"]) if isinstance(at, Mapping) else at[:2] for at in places]
    numbers = [[finite_number(value) for value in pair] for pair in xy]
    if any(value is None for pair in numbers for value in pair):
        raise ValueError("a place is not finite")
    return np.array(numbers, float).reshape(-1, 2)


def swath_graph(field: Field, path: Path, spacing_m: float, margin_m: float) -> tuple[BuiltGraph, str]:
    """Travel graph of a file of swaths, and what was done in words.

    Nodes stand along each swath. Turns of the file join the swaths; without any, each end is joined straight to
    the nearest ends of others, where that stays in the field, out of no-go areas and crosses no swath.

    :param spacing_m: largest distance between nodes of a swath [m]
    :param margin_m: distance to keep from border and no-go areas [m]
    :raises InputError: if the file cannot be read, misses the field, or leaves nowhere to drive
    """
    import shapely

    file = read_swaths(path)
    lines, unit = _placed(file, field, path)
    length_m = sum(float(shapely.LineString(line).length) for _, line in lines)
    require(length_m / spacing_m, spacing_m=spacing_m)
    area = DrivableArea((field.polygon,), field.no_go, margin_m)
    names = Counter[str]()
    swaths = list[tuple[Stop, ...]]()
    for name, line in lines:
        names[name] += 1
        swaths.append(_swath(f"swath{name}{f'-{names[name]}' if names[name] > 1 else ''}", line, spacing_m))
    ends = [(number, stop) for number, swath in enumerate(swaths) for stop in (swath[0], swath[-1])]
    chains = _turns(file.turns, [stop for _, stop in ends]) if file.turns else _joins(ends, lines)
    stops = list(dict.fromkeys(stop for line in (*swaths, *chains) for stop in line))
    inside = area.contains(stops_xy(stops))
    kept = {stop for stop, is_inside in zip(stops, inside, strict=True) if is_inside}
    ways = list(dict.fromkeys(way for line in (*swaths, *chains) for way in pairwise(line)))
    good = allowed_ways([way for way in ways if kept.issuperset(way)], area)
    lost = [chain for chain in chains if not set(good).issuperset(pairwise(chain))]
    how = "turns of the file" if file.turns else "straight ways between ends, as the file has no turns"
    used = [not {*pairwise(swath)}.isdisjoint(good) for swath in swaths]
    said = f"{sum(used)} swaths ({file.kind}, {unit}), joined by {len(chains) - len(lost)} {how}"
    if lost:
        which = listing(f"{chain[0].name} - {chain[-1].name}" for chain in lost)
        said += f"; {len(lost)} others would leave the field or cross a no-go area ({which})"
    if unused := max(0, len(file.turns) - len(chains)):
        said += f"; {unused} turns do not begin and end at swaths"
    border = shapely.Polygon(field.polygon)
    for (name, line), is_used in zip(lines, used, strict=True):
        if not is_used:
            is_outside = border.disjoint(shapely.LineString(line))
            where = "outside the field" if is_outside else "in no-go areas or the margin"
            said += f"; swath {name} lies {where}: not used"
    remedy = "check the swaths and the headland, or use a smaller margin"
    return connected([stop for stop in stops if stop in kept], good, remedy), said


def _placed(file: SwathFile, field: Field, path: Path) -> tuple[list[tuple[str, Array]], str]:
    """Swaths in metres of the field's plane, and the unit they were read in.

    :raises InputError: if less than half of the places are in the field
    """
    import shapely

    outline, missed = shapely.Polygon(field.polygon).buffer(TURN_M), list[str]()
    for unit in ("degrees", "metres") if file.may_be_degrees else ("metres",):
        lines = list(file.swaths)
        if unit == "degrees":
            lines = [(name, field.frame.to_local(line[:, 1], line[:, 0])) for name, line in lines]
        xy = np.concatenate([line for _, line in lines])
        if np.isfinite(xy).all():
            if shapely.intersects_xy(outline, *xy.T).mean() >= 0.5:
                return lines, unit
            missed.append(f"{distance_text(float(outline.distance(shapely.MultiPoint(xy))))} away as {unit}")
    what = f"most of its places are not in the field {field.name!r}: the nearest is {listing(missed)}"
    remedy = "give the field of these swaths; places are metres from its datum, or longitude and latitude"
    raise InputError(what, remedy, path)


def _swath(name: str, line: Array, spacing_m: float) -> tuple[Stop, ...]:
    """Nodes along a swath, its bends included; the first and the last are its ends."""
    import shapely

    corners = shapely.get_coordinates(shapely.LineString(line).simplify(BEND_M))
    steps = np.ceil(np.hypot(*np.diff(corners, axis=0).T) / spacing_m - 1e-6).astype(int).tolist()
    pieces = zip(pairwise(corners), steps, strict=True)
    parts = [np.linspace(a, b, count, endpoint=False) for (a, b), count in pieces]
    places = np.concatenate([*parts, corners[-1:]]).tolist()
    digits = len(str(len(places)))
    labels = ["start", *(f"{number:0{digits}d}" for number in range(1, len(places) - 1)), "end"]
    return tuple(node(f"{name}-{label}", *place) for label, place in zip(labels, places, strict=True))


def _turns(turns: tuple[Array, ...], ends: list[Stop]) -> list[list[Stop]]:
    """Chains of nodes along the turns, each from the end of a swath to that of another one."""
    import shapely

    chains, places = [], stops_xy(ends)
    for number, turn in enumerate(turns, 1):
        away_m = np.hypot(*(places[:, None] - turn[[0, -1]]).T)  # of each end, from begin and end of the turn
        first, last = (ends[nearest] for nearest in away_m.argmin(axis=1).tolist())
        if away_m.min(axis=1).max() <= TURN_M and first != last:
            line = shapely.LineString([first.xy, *turn, last.xy]).simplify(BEND_M)
            bends = enumerate(shapely.get_coordinates(line)[1:-1].tolist(), 1)
            chains.append([first, *(node(f"turn{number}-{bend}", *place) for bend, place in bends), last])
    return chains


def _joins(ends: list[tuple[int, Stop]], lines: list[tuple[str, Array]]) -> list[list[Stop]]:
    """Straight ways from each end of a swath to the nearest ends of others that touch no third swath."""
    import shapely

    found = dict[frozenset[str], list[Stop]]()
    swaths = shapely.multilinestrings([shapely.LineString(line) for _, line in lines])
    for number, stop in ends:
        others = [other for n, other in ends if n != number]
        others.sort(key=lambda other, at=stop: math.dist(at.xy, other.xy))  # type: ignore[misc]
        for other in others[:NEAREST]:
            way = shapely.LineString([stop.xy, other.xy])
            if shapely.get_num_geometries(swaths.intersection(way.buffer(BEND_M))) <= 2:  # its own two
                found.setdefault(frozenset((stop.name, other.name)), [stop, other])
    return list(found.values())
