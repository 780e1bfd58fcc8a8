"""A second property in a bag: what another sensor counted beside, mapped again by the mapper's settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilmoist_ros.exploration.planning.property_names import property_weights
from soilmoist_ros.mapping.field_map import MapState
from soilmoist_ros.recording.run_folder import read_parameters
from soilmoist_ros.replay.comparison import OnLine, compare, read_on_line
from soilmoist_ros.replay.online_survey import OnlineSurvey
from soilmoist_ros.replay.topics import CLOUD, RunTopics
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.mission_run import Mapped


@dataclass(frozen=True, eq=False)
class Second:
    """A property that was mapped beside the first.

    :param name: its name
    :param weight: what it was worth to the planner
    :param survey: makes its maps
    :param records: all its records
    :param states: states of its map after each record
    :param on_line: the last map that its mapper published
    :param truth: its truth, if known
    """

    name: str
    weight: float
    survey: OnlineSurvey
    records: Sequence[CountRecord]
    states: Sequence[MapState]
    on_line: OnLine | None
    truth: SurrogateField | None

    def mapped(self) -> Mapped:
        """Its map, as a mission has it; there is none of too few samples."""
        online = self.survey.online
        soil_map = online.compute(self.states[-1]) if self.states else None
        truth = np.full(online.grid.mask.shape, np.nan)
        if self.truth is not None:
            truth = online.grid.to_raster(self.truth.rate_at(online.grid.cells))
        title = self.name if self.truth is None else self.truth.title
        return Mapped(self.name, title, self.records, soil_map, truth)

    def compared(self) -> str:
        """Whether the map is the one that its mapper had, in words."""
        return compare(self.survey.online, self.states, self.on_line)[1]


def read_second(
    topics: RunTopics,
    configuration: Path | None,
    survey_of: Callable[[Mapping[str, Any]], OnlineSurvey],
    truth: str | None,
) -> Second | None:
    """The first of the further properties that the planner had, ``None`` without any in the bag.

    :param topics: of the robot
    :param configuration: folder with the parameters of its nodes, if there is one
    :param survey_of: the map of a mapper with these parameters, without records
    :param truth: surrogate field to compare with
    :raises InputError: if its records cannot be read
    """
    reader, weights = topics.reader, _weights(configuration)
    for name, topic in _beside(topics, configuration).items():
        if reader.topics.get(topic) != CLOUD or not (records := reader.read_counts(topic)):
            continue
        had = read_parameters(configuration, f"{name.strip('/')}/mapper")
        # Of a bag that lacks them: as the mapper of the first property, whose calibration is not its own.
        survey = survey_of(had or {**read_parameters(configuration, "mapper"), "site": ""})
        states = [survey.online.state for record in records if survey.online.add(record) is None]
        on_line = read_on_line(RunTopics(reader, topic, alone=False))
        known = None if truth is None else surrogate_field(truth)
        return Second(Path(name).name, weights[name], survey, records, states, on_line, known)
    return None


def not_mapped(topics: RunTopics, configuration: Path | None, second: Second | None) -> list[str]:
    """What the user should know of counts in the bag that are left out."""
    space, _, last = topics.counts.rpartition("/")
    counts = {name for name, kind in topics.reader.topics.items() if kind == CLOUD and name.endswith(f"/{last}")}
    below = {name for name in counts - {topics.counts} if name.startswith(f"{space}/")}
    done = {
        topic
        for name, topic in _beside(topics, configuration).items()
        if second and Path(name).name == second.name
    }
    return [
        f"{topic} is in the bag, too, and not mapped here; replay --counts-topic {topic} maps it."
        for topic in sorted(below - done)
    ]


def _beside(topics: RunTopics, configuration: Path | None) -> dict[str, str]:
    """Topics with the records of further properties, by the names that the planner knows these by."""
    space, _, last = topics.counts.rpartition("/")
    names = _weights(configuration)
    found = {name: f"{name if name.startswith('/') else f'{space}/{name}'}/{last}" for name in names}
    return {} if topics.counts in found.values() else found


def _weights(configuration: Path | None) -> dict[str, float]:
    """Names and weights of the further properties that the planner had."""
    return property_weights(read_parameters(configuration, "planner").get("properties", ()))
