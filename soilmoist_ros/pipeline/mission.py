# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission: course, visits, and errors of its maps over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit, forecast_from_text
from soilmoist_ros.pipeline.properties import ReplayedProperty
from soilmoist_ros.pipeline.statuses import Status
from soilmoist_ros.recording import read_parameters
from soilmoist_ros.sensing import CountRecord
from soilmoist_ros.simulation import (
    MapErrors,
    MappedProperty,
    MissionResult,
    MissionSettings,
    PropertySettings,
    SeriesRow,
    TimedForecast,
)


@dataclass(frozen=True, eq=False)
class RobotMission:
    """The mission of one robot.

    :param number: number of the robot, from 1
    :param planner: parameters of its planner; empty if unknown
    :param statuses: statuses of one started mission, in order
    :param visits: visits of the mission, in order
    :param records: all records of the robot's own sensor
    """

    number: int
    planner: Mapping[str, Any]
    statuses: Sequence[Status]
    visits: Sequence[Visit]
    records: Sequence[CountRecord]

    @property
    def began_s(self) -> float:
        """Time at which the mission started [s]."""
        first = next(status for status in self.statuses if status.time_used_s > 0)
        return first.stamp_s - first.time_used_s

    @property
    def track(self) -> NDArray[np.float64]:
        """Places of the records, shape (n, 2) [m]."""
        placed = [(r.x_m, r.y_m) for r in self.records if math.isfinite(r.x_m) and math.isfinite(r.y_m)]
        return np.array(placed).reshape(-1, 2)

    @property
    def ended(self) -> str:
        """Why the mission ended."""
        last = self.statuses[-1]
        return last.reason if last.state == "finished" else f"the recording ends while {last.state}"


def replay_mission(
    properties: Sequence[ReplayedProperty],
    robots: Sequence[RobotMission],
    configuration: Path | None,
    progress: Callable[[str, float], None],
) -> MissionResult:
    """The mission with the map errors after each visit; without the maps.

    :param properties: the mapped properties
    :param robots: the robots of the mission, one at least; the mission starts with the first of them
    :param configuration: folder with the parameters of the nodes, if any
    :param progress: called during the work
    """
    began_s = min(robot.began_s for robot in robots)
    later_s = [robot.began_s - began_s for robot in robots]
    course = [
        (number, status, later_s[number] + status.time_used_s)
        for number, robot in enumerate(robots)
        for status in robot.statuses
    ]
    course.sort(key=lambda step: step[2])
    rows = [SeriesRow(0.0, 0.0, 0, 0.0, (MapErrors(),) * len(properties))]
    latest = [robot.statuses[0] for robot in robots]
    for done, (number, status, time_s) in enumerate(course):
        progress("the course of the mission", done / len(course))
        finished, latest[number] = status.samples > latest[number].samples, status
        if finished:
            rows.append(_row(time_s, status.stamp_s, latest, properties))
    _, status, time_s = course[-1]
    if rows[-1].time_s < time_s:
        rows.append(_row(time_s, status.stamp_s, latest, properties))
    visits = [
        (visit.arrived_s + later, replace(visit, robot=robot.number))
        for robot, later in zip(robots, later_s, strict=True)
        for visit in robot.visits
    ]
    visits.sort(key=lambda one: one[0])
    first, *others = properties
    survey = first.survey
    ends = [f"robot {robot.number}: {robot.ended}" if len(robots) > 1 else robot.ended for robot in robots]
    titles = [survey.field.name, *(one.name if one.truth is None else one.truth.title for one in others)]
    return MissionResult(
        settings=replace(_settings(configuration, robots[0].planner, status, others), robots=len(robots)),
        series=rows,
        visits=[visit for _, visit in visits],
        tracks=tuple(robot.track for robot in robots),
        properties=[_mapped(one, title) for one, title in zip(properties, titles, strict=True)],
        frame=survey.field.frame,
        ended="; ".join(ends),
        log=mission_log(robots, later_s),
        forecasts=tuple(_forecasts([(time_s, status.forecast_data) for _, status, time_s in course])),
    )


def _forecasts(course: Sequence[tuple[float, str]]) -> Iterator[TimedForecast]:
    """The forecasts of statuses, with the times at which they were new."""
    known = {""}
    for time_s, text in course:
        if text not in known:
            known.add(text)
            try:
                forecast = forecast_from_text(text)
            except ValueError:  # of another version
                continue
            assert forecast is not None
            yield TimedForecast(time_s, forecast)


def mission_log(robots: Sequence[RobotMission], later_s: Sequence[float]) -> list[str]:
    """Lines of the mission log: changes of the state, and who commanded what when.

    :param robots: the robots of the mission
    :param later_s: start of each after the start of the first [s]
    """
    lines = []
    for robot, later in zip(robots, later_s, strict=True):
        name = f"robot {robot.number}: " if len(robots) > 1 else ""
        said, commanded = ("", ""), ("", math.nan)
        for status in robot.statuses:
            time_s = status.time_used_s + later
            command = status.last_command, status.last_command_s
            if status.last_command and command != commanded:
                commanded = command
                lines.append((time_s, f"{name}{status.last_command}"))
            if (status.state, status.reason) != said:
                said = status.state, status.reason
                lines.append((time_s, f"{name}{status.state}: {status.reason}"))
    lines.sort(key=lambda line: line[0])
    return [f"{time_s:8.0f} s  {text}" for time_s, text in lines]


def _mapped(one: ReplayedProperty, title: str) -> MappedProperty:
    truth_rate = one.survey.map.grid.to_raster(one.true_rate)
    return MappedProperty(one.name, title, one.records, None, truth_rate, one.weight)


def _row(
    time_s: float, stamp_s: float, latest: Sequence[Status], properties: Sequence[ReplayedProperty]
) -> SeriesRow:
    """The mission at a time, with the errors of maps of all records up to this time.

    :param latest: latest status of each robot
    """
    return SeriesRow(
        time_s,
        sum(status.distance_m for status in latest),
        sum(status.samples for status in latest),
        sum(status.counting_s for status in latest),
        tuple(one.errors_at(stamp_s) for one in properties),
    )


def _settings(
    configuration: Path | None, had: Mapping[str, Any], last: Status, others: Sequence[ReplayedProperty]
) -> MissionSettings:
    """The settings of the mission that the planner's parameters contain."""
    mapper = read_parameters(configuration, "mapper")
    usual = MissionSettings()
    return replace(
        usual,
        field=str(had.get("field", "")),
        strategy=str(had.get("strategy", "unknown")),
        dwell=str(had.get("dwell", "unknown")),
        hours=float(had.get("hours", (last.time_used_s + last.time_left_s) / 3600)),
        seed=int(had.get("seed", 0)),
        target=had.get("target", usual.target),
        preset=had.get("preset", usual.preset),
        model=mapper.get("model", "matern32"),
        fit=mapper.get("fit", "reml"),
        noise=mapper.get("noise", "mean"),
        local=mapper.get("local", "off"),
        drift_model=mapper.get("drift_model", "off"),
        travel="free" if had.get("graph") == "free" else "graph",
        until_sd=float(had.get("until_sd", 0.0)),
        until_gain=float(had.get("until_gain", 0.0)),
        properties=tuple(PropertySettings(one.name, one.weight) for one in others),
    )
