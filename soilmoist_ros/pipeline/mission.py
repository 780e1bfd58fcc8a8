# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission: course, visits, and errors of its maps over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from soilmoist_ros.exploration import Visit, forecast_from_text
from soilmoist_ros.mapping import FIT_SETTINGS, MappingSettings
from soilmoist_ros.pipeline.bag_lines import STATUS, RunTopics
from soilmoist_ros.pipeline.properties import ReplayedProperty
from soilmoist_ros.pipeline.run import track_xy
from soilmoist_ros.recording import VISIT, read_parameters
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

_CLOCK_S = 1e-3
_WITHOUT_TIME = {"idle", "finished"}


class Status(NamedTuple):
    """The mission at one time; the fields are named like the values of the message, see docs/topics.md.

    ``last_command_s`` is on the clock of ``stamp_s``; places and times that are unknown are NaN.
    """

    state: str
    reason: str
    target: str
    target_x_m: float
    target_y_m: float
    elapsed_dwell_s: float
    time_used_s: float
    time_left_s: float
    distance_m: float
    samples: int
    counting_s: float
    raw_counts: int
    stamp_s: float
    last_command: str = ""
    last_command_s: float = math.nan
    forecast_data: str = ""
    certificate: str = ""


_MAY_BE_UNKNOWN = {"target_x_m", "target_y_m", "stamp_s", "last_command_s"}
_TYPES = get_type_hints(Status)
_OF_LATER_VERSIONS = {name: str(value) for name, value in Status._field_defaults.items()}


def read_statuses(topics: RunTopics) -> list[Status]:
    """Statuses of a robot's missions in order; empty if the bag has no mission.

    The order is that of writing: times go back where the clock was set.
    """
    name = topics.find("mission", STATUS)
    found = [
        _status({item.key: item.value for item in topics.reader.decode(message).values})
        for message in (topics.reader.messages([name], by_time=False) if name else ())
    ]
    return [status for status in found if status is not None]


def last_mission(statuses: Sequence[Status]) -> list[Status]:
    """Statuses of the last started mission; empty if none was started."""
    missions: list[list[Status]] = [[]]
    for status in statuses:
        if missions[-1] and status.time_used_s < missions[-1][-1].time_used_s:
            missions.append([])
        missions[-1].append(status)
    started = [mission for mission in missions if any(status.time_used_s > 0 for status in mission)]
    return started[-1] if started else []


def _status(values: dict[str, str]) -> Status | None:
    """The status of a message; ``None`` if the message lacks a value: another node may use the topic."""
    try:
        values = {**_OF_LATER_VERSIONS, **values}
        status = Status(**{name: kind(values[name]) for name, kind in _TYPES.items()})
    except (KeyError, ValueError):
        return None
    known = (value for name, value in status._asdict().items() if name not in _MAY_BE_UNKNOWN)
    return status if all(math.isfinite(value) for value in known if isinstance(value, float)) else None


def read_visits(topics: RunTopics, robot: int = 1) -> list[Visit] | None:
    """The visits that a robot's planner published; ``None`` if the bag lacks the topic."""
    name = topics.find("visits", VISIT)
    return None if name is None else topics.reader.read_visits(name, robot)


def mission_visits(
    statuses: Sequence[Status], visits: Sequence[Visit] | None, records: Sequence[CountRecord]
) -> list[Visit]:
    """Visits of one mission, in order, from all visits in the bag; estimated if the bag has none."""
    if visits is None:
        return estimate_visits(statuses, records)
    # Where the clock was set, the mission has a start on each clock. Its time stands still before and after it.
    began_s = {round(one.stamp_s - one.time_used_s, 3) for one in statuses if one.state not in _WITHOUT_TIME}
    return [
        visit
        for visit in visits
        if any(abs(visit.arrival_stamp_s - visit.arrived_s - start_s) <= _CLOCK_S for start_s in began_s)
    ]


def estimate_visits(statuses: Sequence[Status], records: Sequence[CountRecord]) -> list[Visit]:
    """Estimate the visits of one mission from its statuses, in order."""
    visits: list[Visit] = []
    stop: list[Status] = []
    chosen_because = ""
    before = statuses[0]
    for status in statuses:
        if status.samples > before.samples and stop:
            visits.append(_visit(stop, status, chosen_because, records))
        if status.state == "travelling":  # it may end a stop too: its reason is about the next stop
            chosen_because = status.reason.partition(": ")[2] or status.reason
        if status.state == "counting":
            stop = [*stop, status] if stop and stop[-1].target == status.target else [status]
        elif status.state != "paused":  # a pause does not end a stop
            stop = []
        before = status
    return visits


def _visit(stop: Sequence[Status], done: Status, reason: str, records: Sequence[CountRecord]) -> Visit:
    first, last = stop[0], stop[-1]
    return Visit(
        last.target, last.target_x_m, last.target_y_m, first.time_used_s - first.elapsed_dwell_s,
        last.elapsed_dwell_s + done.counting_s - last.counting_s,
        _raw_counts(last, done, first.stamp_s - first.elapsed_dwell_s, records), reason,
    )  # fmt: skip


def _raw_counts(last: Status, done: Status, arrived_s: float, records: Sequence[CountRecord]) -> int:
    """Counts of a stop: the counts of its last status plus the counts of later records.

    The last record ends a stop at once, so no status at the stop includes its counts. A record with an earlier
    stamp than the last status may arrive later. Counts, not stamps, therefore decide which records the status
    includes. After a pause the stop has more records than the mission counted, and stamps decide.
    """
    begin_s = arrived_s - _CLOCK_S
    there = [one for one in records if one.stamp_s <= done.stamp_s and one.stamp_s - one.exposure_s >= begin_s]
    counts = sum(record.raw_counts for record in there)
    if last.raw_counts in accumulate((record.raw_counts for record in there), initial=0):
        return counts
    return last.raw_counts + sum(record.raw_counts for record in there if record.stamp_s > last.stamp_s)


@dataclass(frozen=True, eq=False)
class RobotMission:
    """The mission of one robot (numbered from 1): statuses, visits and records of its own sensor in order."""

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
    def ended(self) -> str:
        """Reason why the mission ended."""
        last = self.statuses[-1]
        return last.reason if last.state == "finished" else f"the recording ends while {last.state}"


def replay_mission(
    properties: Sequence[ReplayedProperty],
    robots: Sequence[RobotMission],
    configuration: Path | None,
    progress: Callable[[str, float], None],
) -> MissionResult:
    """The mission with the map errors after each visit; without the maps. It starts with the first robot."""
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
    for done, (number, status, time_s) in enumerate(course, 1):
        progress("the course of the mission", (done - 1) / len(course))
        finished, latest[number] = status.samples > latest[number].samples, status
        if finished or (done == len(course) and rows[-1].time_s < time_s):
            errors = tuple(one.errors_at(status.stamp_s) for one in properties)
            samples = sum(one.samples for one in latest)
            driven_m, counting_s = sum(one.distance_m for one in latest), sum(one.counting_s for one in latest)
            rows.append(SeriesRow(time_s, driven_m, samples, counting_s, errors))
    visits = [
        (visit.arrived_s + later, replace(visit, robot=robot.number))
        for robot, later in zip(robots, later_s, strict=True)
        for visit in robot.visits
    ]
    visits.sort(key=lambda one: one[0])
    survey, others = properties[0].survey, properties[1:]
    ends = [f"robot {robot.number}: {robot.ended}" if len(robots) > 1 else robot.ended for robot in robots]
    rasters = [one.survey.map.grid.to_raster(one.true_rate) for one in properties]
    titles = [survey.field.name, *(one.name if one.truth is None else one.truth.title for one in others)]
    settings = _settings(configuration, robots[0].planner, course[-1][1], others)
    return MissionResult(
        settings=replace(settings, robots=len(robots)), series=rows, visits=[visit for _, visit in visits],
        tracks=tuple(track_xy(robot.records) for robot in robots),
        properties=[
            MappedProperty(one.name, title, one.records, None, truth, one.weight)
            for one, title, truth in zip(properties, titles, rasters, strict=True)
        ],
        frame=survey.field.frame, ended="; ".join(ends), log=mission_log(robots, later_s),
        forecasts=tuple(_forecasts([(time_s, status.forecast_data) for _, status, time_s in course])),
        certificate=next((one.certificate for one in reversed(robots[0].statuses) if one.certificate), ""),
    )  # fmt: skip


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
    """Lines of the mission log: changes of the state, and who commanded what; robots start ``later_s``."""
    lines = []
    for robot, later in zip(robots, later_s, strict=True):
        name = f"robot {robot.number}: " if len(robots) > 1 else ""
        said, commanded = ("", ""), ("", math.nan)
        for status in robot.statuses:
            time_s = status.time_used_s + later
            command, state = (status.last_command, status.last_command_s), (status.state, status.reason)
            if status.last_command and command != commanded:
                lines.append((time_s, f"{name}{status.last_command}"))
                commanded = command
            if state != said:
                lines.append((time_s, f"{name}{status.state}: {status.reason}"))
                said = state
    lines.sort(key=lambda line: line[0])
    return [f"{time_s:8.0f} s  {text}" for time_s, text in lines]


def _settings(
    configuration: Path | None, had: Mapping[str, Any], last: Status, others: Sequence[ReplayedProperty]
) -> MissionSettings:
    """The settings of the mission that the planner's parameters contain."""
    made = MappingSettings().values(read_parameters(configuration, "mapper"))
    usual = MissionSettings()
    return replace(
        usual, field=str(had.get("field", "")), strategy=str(had.get("strategy", "unknown")),
        dwell=str(had.get("dwell", "unknown")),
        hours=float(had.get("hours", (last.time_used_s + last.time_left_s) / 3600)), seed=int(had.get("seed", 0)),
        target=had.get("target", usual.target), threshold=had.get("threshold") or None,
        preset=had.get("preset", usual.preset),
        **{name: made[name] for name in FIT_SETTINGS},
        travel="free" if had.get("graph") == "free" else "graph", until_sd=float(had.get("until_sd", 0.0)),
        until_gain=float(had.get("until_gain", 0.0)), certify=int(had.get("certify", 0)),
        until=str(had.get("until", "")),
        properties=tuple(PropertySettings(one.name, one.weight) for one in others),
    )  # fmt: skip
