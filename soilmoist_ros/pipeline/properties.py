# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The properties in a bag: each has the records of a sensor, and is mapped with its mapper's settings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import property_weights
from soilmoist_ros.foundation import IllConditionedError, InputError, LocalFrame, finite_number, resource
from soilmoist_ros.mapping import MapState, PositionSource, load_field, require_near
from soilmoist_ros.pipeline.bag_lines import CLOUD, STATUS, TEXT, RunTopics
from soilmoist_ros.pipeline.field_survey import FieldSurvey
from soilmoist_ros.recording import BagReader, points, read_parameters
from soilmoist_ros.sensing import DOUBTS, CountRecord, Doubt, Doubts, stamp_of
from soilmoist_ros.simulation import MapErrors, SurrogateField, map_errors

_OF_RATE = ("rate", "rate_sd")
_OF_MOISTURE = ("vwc", "vwc_sd", "vwc_p05", "vwc_p95")
"""Compared if the map has all of them: in earlier versions moisture had no limits and no quantiles."""
_ROUNDING = 1e-4  # relative difference below which maps differ only by rounding
Array = NDArray[np.float64]

FIRST = "moisture"  # name of the property with the topic counts in the robot's own namespace
_NUMBERS: Final = ("hours", "seed", "until_sd", "until_gain", "certify")
_TEXTS: Final = ("target", "threshold", "preset", "until")  # parameters of a planner that a report shows


def recorded_frame(configuration: Path | None) -> LocalFrame | None:
    """The plane of a recording, by the field file of its driver; ``None`` if it is unknown."""
    for node in ("sensor_driver", "mapper"):
        if named := read_parameters(configuration, node).get("field"):
            with suppress(InputError):
                return load_field(resource("fields", str(named))).frame
    return None


def place_doubts(reader: BagReader, counts: str) -> Doubts:
    """Doubts of the planner of a robot about its place, of the nearest namespace; none if the bag has none."""
    doubts, parts = Doubts(), counts.split("/")
    names = ["/".join([*parts[:end], DOUBTS]) for end in range(len(parts) - 1, 0, -1)]
    found = next((name for name in names if reader.topics.get(name) == TEXT), None)
    for text in reader.read_texts(found) if found else ():
        with suppress(ValueError):
            doubts.take(Doubt.from_text(text))
    return doubts


def trusted_records(reader: BagReader, counts: Sequence[str], frame: str) -> list[tuple[str, CountRecord]]:
    """Records of topics, each with its topic, in the order of recording, as far as their places are trusted."""
    doubts = {name: place_doubts(reader, name) for name in counts}
    return [(name, doubts[name].placed(record)) for name, record in reader.read_counts_of(counts, frame)]


def why_nothing(survey: FieldSurvey, records: Sequence[CountRecord], path: Path) -> InputError:
    """Reason why none of the records is in the map: they lie elsewhere, or have other faults."""
    places = [(record.x_m, record.y_m) for record in records if np.isfinite(record.x_m + record.y_m)]
    field = survey.field
    source = PositionSource("the recording", field_file=dict(survey.files).get("field"))
    try:
        if places:
            require_near(field, field.frame.to_geographic(places), survey.map.settings.margin_m, source)
    except InputError as error:
        return error
    reasons = [
        f"{entry.count} {reason.value} (the last: {entry.example})" for reason, entry in survey.map.skipped.items()
    ]
    message = f"not one of {len(records)} records is in the field {field.name!r}: {'; '.join(reasons)}"
    return InputError(message, "check the field file and the GNSS", path)


@dataclass(frozen=True, eq=False)
class PublishedMap:
    """The last map that the mapper published."""

    stamp_s: float  # end of the last record in it [s since 1970-01-01 UTC]; 0 without records
    cells: NDArray[Any]  # its cells, shape (ny, nx)
    raw_counts: float | None  # counts of all records in it, None if the bag has no samples of that time


def read_published_map(topics: RunTopics) -> PublishedMap | None:
    """The last map in a bag, ``None`` if there is none; raises ``InputError`` if it cannot be read."""
    last = _last_cloud(topics, "soil_map")
    if last is None:
        return None
    try:
        samples = _last_cloud(topics, "samples", stamp_of(last))
        raw_counts = None if samples is None else float(points(samples)["raw_counts"].sum())
        return PublishedMap(stamp_of(last), points(last), raw_counts)
    except (KeyError, ValueError) as error:
        name = topics.find("soil_map", CLOUD)
        raise InputError(f"{name}: {error}", "was it recorded by soilmoist_ros?", topics.reader.path) from None


def _last_cloud(topics: RunTopics, named: str, stamp_s: float | None = None) -> Any:
    """The last message of a topic, or the last one with this stamp; ``None`` without one."""
    name, last = topics.find(named, CLOUD), None
    for message in topics.reader.messages([name]) if name else ():
        cloud = topics.reader.decode(message)
        if stamp_s in (None, stamp_of(cloud)):
            last = cloud
    return last


@dataclass(frozen=True)
class PropertyTopic:
    """Topics of a property in a bag."""

    name: str  # name of the property, for files and options
    counts: tuple[str, ...]  # full names of the topics with its records, one for each robot
    mapper: str  # name of its mapper, below the robot's namespace
    weight: float  # weight of its variation in the planner; 0 if the planner ignored it


def team_properties(robots: Sequence[RunTopics], configuration: Path | None) -> list[PropertyTopic]:
    """The properties that robots measured together, see :func:`property_topics`."""
    merged: dict[str, PropertyTopic] = {}
    for found in (one for robot in robots for one in property_topics(robot, configuration)):
        known = merged.get(found.name)
        merged[found.name] = found if known is None else replace(known, counts=known.counts + found.counts)
    return list(merged.values())


def property_topics(topics: RunTopics, configuration: Path | None) -> list[PropertyTopic]:
    """The properties that a robot measured, in the order of its planner, then the others by name.

    A topic ``counts`` in a namespace below the robot's is a property, unless the namespace is another robot.
    """
    space, _, last = topics.counts.rpartition("/")
    planner = read_planner(configuration, topics)
    planned = property_weights(planner.get("properties", ()))
    for name, weight in planned.items():
        if topics.counts.endswith(f"/{name.strip('/')}/{last}"):  # this property is replayed alone
            return [PropertyTopic(Path(name).name, (topics.counts,), f"{name.strip('/')}/mapper", weight)]
    clouds = {name for name, kind in topics.reader.topics.items() if kind == CLOUD and name.endswith(f"/{last}")}
    paths = {f"{name if name.startswith('/') else f'{space}/{name}'}/{last}": name for name in planned}
    for path in sorted(clouds - {topics.counts}):
        if path.startswith(f"{space}/") and not _is_robot(topics, path):
            paths.setdefault(path, path.removeprefix(f"{space}/").removesuffix(f"/{last}"))
    found = {FIRST: PropertyTopic(FIRST, (topics.counts,), "mapper", 1.0)}
    for path, name in paths.items():
        if path in clouds:
            whole = name.strip("/")
            own = whole.replace("/", "_") if Path(whole).name in found else Path(whole).name
            while own in found:  # "a_b" next to "a/b"
                own += "_2"
            found[own] = PropertyTopic(own, (path,), f"{whole}/mapper", planned.get(name, 0.0))
    return list(found.values())


def read_planner(configuration: Path | None, topics: RunTopics) -> dict[str, Any]:
    """Parameters of the planner of a robot, with or without its namespace; ``InputError`` for a wrong one."""
    nodes = (f"{topics.namespace}planner", "planner")
    node, had = next(((one, found) for one in nodes if (found := read_parameters(configuration, one))), ("", {}))
    for name in filter(had.__contains__, (*_NUMBERS, *_TEXTS)):
        number = finite_number(had[name])
        good = isinstance(had[name], str) if name in _TEXTS else number is not None and number >= 0
        if not good:
            kind = "a text" if name in _TEXTS else "a number of at least 0"
            message = f"{name} must be {kind}, not {str(had[name])!r:.40}"
            raise InputError(message, "restore the recorded file", (configuration or Path()) / f"{node}.yaml")
    return had


def _is_robot(topics: RunTopics, counts: str) -> bool:
    """True if a namespace is another robot: it has a mission or the lines of a receiver."""
    space = counts.rpartition("/")[0]
    own = {"mission": STATUS, "raw/gnss": TEXT, "raw/logger": TEXT, "fix": "sensor_msgs/msg/NavSatFix"}
    return any(topics.reader.topics.get(f"{space}/{name}") == kind for name, kind in own.items())


@dataclass(frozen=True, eq=False)
class ReplayedProperty:
    """A property of a bag, its weight in the planner, all its records, and the states of its map after each."""

    name: str
    weight: float
    survey: FieldSurvey
    records: Sequence[CountRecord]
    states: Sequence[MapState]
    published: PublishedMap | None
    truth: SurrogateField | None

    @cached_property
    def true_rate(self) -> Array:
        """True rate of the cells [counts/s]; NaN if unknown."""
        cells = self.survey.map.grid.cells
        return np.full(len(cells), np.nan) if self.truth is None else self.truth.rate_at(cells)

    @property
    def truth_rate(self) -> Array | None:
        """True rate on the map's grid, shape (ny, nx) [counts/s]; ``None`` if unknown."""
        return None if self.truth is None else self.survey.map.grid.to_raster(self.true_rate)

    def compared(self, several: bool = False) -> str:
        """Comparison of the map of the records up to the last one of the published map with that map, in words.

        :param several: whether records of several robots are in it
        """
        last, field_map = self.published, self.survey.map
        if last is None or last.stamp_s == 0:
            why = "the bag has no map" if last is None else "the robot's last map is empty"
            return f"not compared: {why}"
        # Records of several robots may have the same stamp; the counts say how many of these are in the map.
        alike = [
            state
            for state in self.states
            if state.stamp_s == last.stamp_s and last.raw_counts in (None, float(state.samples.counts.sum()))
        ]
        if not alike:
            why = "it was reset, or began before or went on after the recording"
            return f"not compared: the robot's last map is of other records than the bag: {why}"
        soil_map, cells = field_map.compute(alike[-1]), last.cells
        differs, shape = "differs from the robot's last one: ", field_map.grid.shape
        bands = [*_OF_RATE, *(_OF_MOISTURE if set(_OF_MOISTURE) <= set(cells.dtype.names or ()) else ())]
        if shape != cells.shape or not set(_OF_RATE) <= set(cells.dtype.names or ()):
            return (
                f"{differs}it has {shape[0]} x {shape[1]} cells, not {cells.shape[0]} x {cells.shape[1]}, or bands"
            )
        largest = 0.0
        for name in bands:
            there = cells[name]
            here = np.full(shape, np.nan) if soil_map is None else np.asarray(getattr(soil_map, name))
            here = here.astype(there.dtype)
            known = ~np.isnan(there)
            if not np.array_equal(np.isnan(here), ~known):
                return f"{differs}other cells have a {name}"
            error = np.abs(here[known].astype(float) - there[known]).max(initial=0.0)
            largest = max(largest, float(error) / max(float(np.abs(there[known]).max(initial=0.0)), 1e-30))
        if largest == 0:
            return "equals the robot's last one, bit for bit"
        why = ""
        if largest < _ROUNDING:
            why = ": rounding, as on another processor or with more threads"
        elif several:
            why = ": records of several robots reach mapper and recorder in different orders"
        return f"{differs}by up to {largest:.1e} of its largest values{why}"

    def errors_at(self, stamp_s: float) -> MapErrors:
        """Errors of the map of all records up to a time, see :func:`map_errors`; NaN without map or truth."""
        # A record with a wrong clock must not hide earlier records.
        known = [state for state in self.states if state.stamp_s <= stamp_s]
        if self.truth is None or not known:
            return MapErrors()
        field_map, soil_map = self.survey.map, None
        with suppress(IllConditionedError):  # the mapper had no map at this time either
            soil_map = field_map.compute(known[-1])
        if soil_map is None:
            return MapErrors()
        mask = field_map.grid.mask
        return map_errors(soil_map.rate[mask], soil_map.rate_sd[mask], self.true_rate, self.truth.curve)
