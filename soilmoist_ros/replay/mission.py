"""A recorded mission: course, visits, and errors of its maps over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.recording.run_folder import read_parameters
from soilmoist_ros.replay.properties import ReplayedProperty
from soilmoist_ros.replay.statuses import Status
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.mission.map_errors import MapErrors
from soilmoist_ros.simulation.mission.result import MappedProperty, MissionResult, SeriesRow
from soilmoist_ros.simulation.mission.settings import MissionSettings, PropertySettings


def replay_mission(
    properties: Sequence[ReplayedProperty],
    statuses: Sequence[Status],
    visits: Sequence[Visit],
    configuration: Path | None,
    records: Sequence[CountRecord],
    progress: Callable[[str, float], None],
) -> MissionResult:
    """The mission with the map errors after each visit; without the maps.

    :param properties: the mapped properties
    :param statuses: statuses of one started mission, in order
    :param visits: visits of the mission, in order
    :param configuration: folder with the parameters of the nodes, if any
    :param records: all records of the robot's own sensor
    :param progress: called during the work
    """
    rows = [SeriesRow(0.0, 0.0, 0, 0.0, (MapErrors(),) * len(properties))]
    before = statuses[0]
    for number, status in enumerate(statuses):
        progress("the course of the mission", number / len(statuses))
        if status.samples > before.samples:
            rows.append(_row(status, properties))
        before = status
    if rows[-1].time_s < before.time_used_s:
        rows.append(_row(before, properties))
    first, *others = properties
    placed = [(r.x_m, r.y_m) for r in records if math.isfinite(r.x_m) and math.isfinite(r.y_m)]
    survey = first.survey
    end = before.reason if before.state == "finished" else f"the recording ends while {before.state}"
    titles = [survey.field.name, *(one.name if one.truth is None else one.truth.title for one in others)]
    return MissionResult(
        settings=_settings(configuration, before, others),
        series=rows,
        visits=visits,
        tracks=(np.array(placed).reshape(-1, 2),),
        properties=[_mapped(one, title) for one, title in zip(properties, titles, strict=True)],
        frame=survey.field.frame,
        ended=end,
    )


def _mapped(one: ReplayedProperty, title: str) -> MappedProperty:
    truth_rate = one.survey.map.grid.to_raster(one.true_rate)
    return MappedProperty(one.name, title, one.records, None, truth_rate, one.weight)


def _row(status: Status, properties: Sequence[ReplayedProperty]) -> SeriesRow:
    """The mission at a time, with the errors of maps of all records up to this time."""
    return SeriesRow(
        status.time_used_s,
        status.distance_m,
        status.samples,
        status.counting_s,
        tuple(one.errors_at(status.stamp_s) for one in properties),
    )


def _settings(configuration: Path | None, last: Status, others: Sequence[ReplayedProperty]) -> MissionSettings:
    """The settings of the mission that the planner's parameters contain."""
    had, mapper = read_parameters(configuration, "planner"), read_parameters(configuration, "mapper")
    usual = MissionSettings()
    return replace(
        usual,
        field=str(had.get("field", "")),
        strategy=str(had.get("strategy", "unknown")),
        dwell=str(had.get("dwell", "unknown")),
        hours=float(had.get("hours", (last.time_used_s + last.time_left_s) / 3600)),
        seed=int(had.get("seed", 0)),
        preset=had.get("preset", usual.preset),
        model=mapper.get("model", "matern32"),
        fit=mapper.get("fit", "reml"),
        travel="free" if had.get("graph") == "free" else "graph",
        properties=tuple(PropertySettings(one.name, one.weight) for one in others),
    )
