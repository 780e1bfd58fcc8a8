"""A recorded mission: its course, its visits, and the errors of its maps over time."""

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
from soilmoist_ros.simulation.mission.mission_run import Mapped, MissionResult, MissionSettings, SeriesRow


def replay_mission(
    properties: Sequence[ReplayedProperty],
    statuses: Sequence[Status],
    visits: Sequence[Visit],
    configuration: Path | None,
    records: Sequence[CountRecord],
    progress: Callable[[str, float], None],
) -> MissionResult:
    """The mission with the errors of its maps after each visit; without its maps.

    :param properties: what is mapped
    :param statuses: statuses of one mission that was started, in order
    :param visits: visits of the mission, in order
    :param configuration: folder with the parameters of the nodes, if there is one
    :param records: all records of the robot's own sensor
    :param progress: called as the work goes on
    """
    rows = [SeriesRow(0.0, 0.0, 0, math.nan, math.nan, math.nan, math.nan, 0.0)]
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
    return MissionResult(
        settings=_settings(configuration, before, others),
        series=rows,
        visits=visits,
        tracks=(np.array(placed).reshape(-1, 2),),
        records=first.records,
        soil_map=None,
        truth_rate=survey.map.grid.to_raster(first.true_rate),
        frame=survey.field.frame,
        field_title=survey.field.name,
        ended=end,
        also=_mapped(others[0]) if others else None,
    )


def _mapped(other: ReplayedProperty) -> Mapped:
    """A further property, as a mission has it."""
    field_map = other.survey.map
    soil_map = field_map.compute(other.states[-1]) if other.states else None
    title = other.name if other.truth is None else other.truth.title
    return Mapped(other.name, title, other.records, soil_map, field_map.grid.to_raster(other.true_rate))


def _row(status: Status, properties: Sequence[ReplayedProperty]) -> SeriesRow:
    """The mission at a time, with maps of all records up to then."""
    (mse, vwc_rmse, coverage), *others = (one.errors_at(status.stamp_s) for one in properties)
    also = others[0] if others else (math.nan,) * 3
    return SeriesRow(
        status.time_used_s,
        status.distance_m,
        status.samples,
        mse,
        100 * mse,
        vwc_rmse,
        coverage,
        status.counting_s,
        also_mse=also[0],
        also_coverage95=also[2],
    )


def _settings(configuration: Path | None, last: Status, others: Sequence[ReplayedProperty]) -> MissionSettings:
    """The settings of the mission, as far as the planner's parameters have them."""
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
        variogram=mapper.get("model", "matern32"),
        fit=mapper.get("fit", "reml"),
        travel="free" if had.get("graph") == "free" else "graph",
        also=others[0].name if others else "",
        also_weight=others[0].weight if others else usual.also_weight,
    )
