# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The properties in a bag: each has the records of a sensor, and is mapped with its mapper's settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import property_weights
from soilmoist_ros.foundation import IllConditionedError, InputError, finite_number
from soilmoist_ros.mapping import MapState
from soilmoist_ros.pipeline.comparison import Comparison, PublishedMap, compare
from soilmoist_ros.pipeline.topics import CLOUD, STATUS, TEXT, RunTopics
from soilmoist_ros.recording import read_parameters
from soilmoist_ros.reporting import FieldSurvey
from soilmoist_ros.sensing import CountRecord
from soilmoist_ros.simulation import MapErrors, SurrogateField, map_errors

Array = NDArray[np.float64]

FIRST = "moisture"
"""Name of the property with the topic ``counts`` in the robot's own namespace."""
_NUMBERS: Final = ("hours", "seed", "until_sd", "until_gain")
_TEXTS: Final = ("target", "preset")
"""Parameters of a planner that a report shows."""


@dataclass(frozen=True)
class PropertyTopic:
    """Topics of a property in a bag.

    :param name: name of the property, for files and options
    :param counts: full names of the topics with its records, one for each robot
    :param mapper: name of its mapper, below the robot's namespace
    :param weight: weight of its variation in the planner; 0 if the planner ignored it
    """

    name: str
    counts: tuple[str, ...]
    mapper: str
    weight: float


def team_properties(robots: Sequence[RunTopics], configuration: Path | None) -> list[PropertyTopic]:
    """The properties that robots measured together, see :func:`property_topics`.

    :param robots: topics of each robot, one at least
    :param configuration: folder with the parameters of their nodes, if any
    :raises InputError: if the properties of a planner are damaged
    """
    merged: dict[str, PropertyTopic] = {}
    for robot in robots:
        for found in property_topics(robot, configuration):
            known = merged.get(found.name)
            merged[found.name] = found if known is None else replace(known, counts=known.counts + found.counts)
    return list(merged.values())


def property_topics(topics: RunTopics, configuration: Path | None) -> list[PropertyTopic]:
    """The properties that a robot measured, in the order of its planner, then the others by name.

    A topic ``counts`` in a namespace below the robot's is a property, unless the namespace is another robot.

    :param topics: topics of the robot
    :param configuration: folder with the parameters of its nodes, if any
    :raises InputError: if the planner's properties are damaged
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
    found = [PropertyTopic(FIRST, (topics.counts,), "mapper", 1.0)]
    for path, name in paths.items():
        if path in clouds:
            whole = name.strip("/")
            taken = {one.name for one in found}
            own = Path(whole).name if Path(whole).name not in taken else whole.replace("/", "_")
            found.append(PropertyTopic(own, (path,), f"{whole}/mapper", planned.get(name, 0.0)))
    return found


def read_planner(configuration: Path | None, topics: RunTopics) -> dict[str, Any]:
    """Parameters of the planner of a robot, empty if there are none.

    :param configuration: folder of the configuration; the planner is named with or without its namespace
    :param topics: topics of the robot
    :raises InputError: if a parameter that the replay shows is not a number or text as planners have it
    """
    for node in (f"{topics.namespace}planner", "planner"):
        if had := read_parameters(configuration, node):
            assert configuration is not None
            _require_settings(had, configuration / f"{node}.yaml")
            return had
    return {}


def _require_settings(had: Mapping[str, Any], path: Path) -> None:
    """Check parameters before the work that would end with them."""
    for name in filter(had.__contains__, _NUMBERS):
        number = finite_number(had[name])
        if number is None or number < 0:
            message = f"{name} must be a number of at least 0, not {str(had[name])!r:.40}"
            raise InputError(message, "restore the recorded file", path)
    for name in filter(had.__contains__, _TEXTS):
        if not isinstance(had[name], str):
            message = f"{name} must be a text, not {str(had[name])!r:.40}"
            raise InputError(message, "restore the recorded file", path)


def _is_robot(topics: RunTopics, counts: str) -> bool:
    """Whether a namespace is another robot: it has a mission or the lines of a receiver."""
    space = counts.rpartition("/")[0]
    own = {"mission": STATUS, "raw/gnss": TEXT, "raw/logger": TEXT, "fix": "sensor_msgs/msg/NavSatFix"}
    return any(topics.reader.topics.get(f"{space}/{name}") == kind for name, kind in own.items())


@dataclass(frozen=True, eq=False)
class ReplayedProperty:
    """A property of a bag with the map of its records.

    :param name: its name
    :param weight: weight of its variation in the planner
    :param survey: makes its maps
    :param records: all its records
    :param states: states of its map after each record
    :param published: the last map that its mapper published
    :param truth: its truth, if known
    """

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

    def compared(self, several: bool = False) -> Comparison:
        """Comparison with the map that the mapper published.

        :param several: whether several robots sent the records
        """
        return compare(self.survey.map, self.states, self.published, several)

    def errors_at(self, stamp_s: float) -> MapErrors:
        """Errors of the map of all records up to a time, see :func:`map_errors`; NaN without map or truth."""
        unknown = MapErrors()
        # A record with a wrong clock must not hide earlier records.
        known = [state for state in self.states if state.stamp_s <= stamp_s]
        if self.truth is None or not known:
            return unknown
        field_map = self.survey.map
        try:
            soil_map = field_map.compute(known[-1])
        except IllConditionedError:  # the mapper had no map at this time either
            return unknown
        if soil_map is None:
            return unknown
        mask = field_map.grid.mask
        return map_errors(soil_map.rate[mask], soil_map.rate_sd[mask], self.true_rate, self.truth.curve)


def chosen_properties(found: Sequence[PropertyTopic], names: Sequence[str], bag: Path) -> list[PropertyTopic]:
    """The properties of these names in the order of the bag; all properties without names.

    :param bag: path for the message
    :raises InputError: if a name is not a property
    """
    for name in names:
        _require(name, found, bag)
    return [one for one in found if not names or one.name in names]


def named_truths(found: Sequence[PropertyTopic], truths: Mapping[str | int, str], bag: Path) -> dict[str, str]:
    """The truths by the names of their properties.

    :param truths: by name, or by the index of the property in the list, from 0
    :param bag: path for the message
    :raises InputError: if there is no such property
    """
    named = {}
    for key, field in truths.items():
        if isinstance(key, int) and key < len(found):
            key = found[key].name
        _require(str(key), found, bag)
        named[str(key)] = field
    return named


def _require(name: str, found: Sequence[PropertyTopic], bag: Path) -> None:
    if name not in {one.name for one in found}:
        raise InputError(f"has no property {name!r}", f"there are: {', '.join(one.name for one in found)}", bag)
