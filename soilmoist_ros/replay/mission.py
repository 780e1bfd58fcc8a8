"""The course of a recorded mission, as its statuses tell it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.errors import IllConditionedError
from soilmoist_ros.mapping.field_map import MapState
from soilmoist_ros.recording.run_folder import read_parameters
from soilmoist_ros.replay.online_survey import OnlineSurvey
from soilmoist_ros.replay.second import Second
from soilmoist_ros.replay.topics import STATUS, RunTopics
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.map_errors import map_errors
from soilmoist_ros.simulation.mission.mission_run import MissionResult, MissionSettings, SeriesRow

Array = NDArray[np.float64]
Status = Mapping[str, str]

_CLOCK_S = 1e-3
_TEXTS = ("state", "reason", "target")
_NUMBERS = (
    "target_x_m", "target_y_m", "elapsed_dwell_s", "time_used_s", "time_left_s", "distance_m", "samples",
    "counting_s", "raw_counts", "stamp_s",
)  # fmt: skip


def read_statuses(topics: RunTopics) -> list[dict[str, str]]:
    """Values of the mission's statuses, in order; none if the bag has no mission."""
    name = topics.find("mission", STATUS)
    statuses = [
        {item.key: item.value for item in topics.reader.decode(message).values}
        for message in (topics.reader.messages([name]) if name else ())
    ]
    return [status for status in statuses if _is_whole(status)]


def last_mission(statuses: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """The statuses of the last mission that was started; none if none was."""
    missions: list[list[dict[str, str]]] = [[]]
    for status in statuses:
        if missions[-1] and float(status["time_used_s"]) < float(missions[-1][-1]["time_used_s"]):
            missions.append([])
        missions[-1].append(status)
    started = [mission for mission in missions if any(float(status["time_used_s"]) > 0 for status in mission)]
    return started[-1] if started else []


def replay_mission(
    survey: OnlineSurvey,
    states: Sequence[MapState],
    statuses: Sequence[Status],
    truth: SurrogateField | None,
    configuration: Path | None,
    records: Sequence[CountRecord],
    progress: Callable[[str, float], None],
    second: Second | None = None,
) -> MissionResult:
    """The mission as its statuses tell it, with the errors of the maps after each stop; without its maps.

    :param survey: makes the maps
    :param states: states of the map after each record
    :param statuses: of one mission that was started, in order
    :param truth: what the errors are told from; they are NaN without
    :param configuration: folder with the parameters of the nodes, if there is one
    :param records: all records
    :param progress: called as the work goes on
    :param second: a second property
    """
    errors = _Errors(survey, states, truth)
    beside = None if second is None else _Errors(second.survey, second.states, second.truth)
    first = next(status for status in statuses if float(status["time_used_s"]) > 0)
    began_s = float(first["stamp_s"]) - float(first["time_used_s"])
    rows = [SeriesRow(0.0, 0.0, 0, math.nan, math.nan, math.nan, math.nan, 0.0)]
    visits: list[Visit] = []
    stop: list[Status] = []
    chosen_because = ""
    before = statuses[0]
    for number, status in enumerate(statuses):
        progress("the course of the mission", number / len(statuses))
        if int(status["samples"]) > int(before["samples"]):
            if stop:
                visits.append(_visit(stop, status, began_s, chosen_because, records))
            rows.append(errors.row(status, beside))
        if (
            status["state"] == "travelling"
        ):  # maybe of the status that tells of a finished stop: not that one's reason
            chosen_because = status["reason"].partition(": ")[2] or status["reason"]
        if status["state"] == "counting":
            stop = [*stop, status] if stop and stop[-1]["target"] == status["target"] else [status]
        elif status["state"] != "paused":  # a pause does not end a stop
            stop = []
        before = status
    if rows[-1].time_s < float(before["time_used_s"]):
        rows.append(errors.row(before, beside))
    placed = [(r.x_m, r.y_m) for r in records if math.isfinite(r.x_m) and math.isfinite(r.y_m)]
    mask = survey.online.grid.mask
    end = before["reason"] if before["state"] == "finished" else f"the recording ends while {before['state']}"
    return MissionResult(
        settings=_settings(configuration, before, second),
        series=rows,
        visits=visits,
        tracks=(np.array(placed).reshape(-1, 2),),
        records=records,
        soil_map=None,
        truth_rate=np.full(mask.shape, np.nan) if errors.true_rate is None else errors.raster,
        frame=survey.field.frame,
        field_title=survey.field.name,
        ended=end,
    )


def _is_whole(status: Status) -> bool:
    """Whether a status says all that is needed: another node may publish something of this name."""
    try:
        numbers = [float(status[name]) for name in _NUMBERS]
        int(status["samples"]), int(status["raw_counts"])
    except (KeyError, ValueError):
        return False
    known = numbers[_NUMBERS.index("elapsed_dwell_s") :]
    return all(name in status for name in _TEXTS) and all(map(math.isfinite, known[:-1]))


def _visit(
    stop: Sequence[Status], done: Status, began_s: float, reason: str, records: Sequence[CountRecord]
) -> Visit:
    """A stop; its last record ends it at once, so that no status tells of the stop with that."""
    first, last = stop[0], stop[-1]
    arrived_s = float(first["stamp_s"]) - float(first["elapsed_dwell_s"])
    heard_s, ended_s = float(last["stamp_s"]), float(done["stamp_s"])
    more = sum(
        record.raw_counts
        for record in records
        if heard_s < record.stamp_s <= ended_s and record.stamp_s - record.exposure_s >= arrived_s - _CLOCK_S
    )
    return Visit(
        last["target"],
        float(last["target_x_m"]),
        float(last["target_y_m"]),
        arrived_s - began_s,
        float(last["elapsed_dwell_s"]) + float(done["counting_s"]) - float(last["counting_s"]),
        int(last["raw_counts"]) + more,
        reason,
    )


@dataclass(frozen=True)
class _Errors:
    """How far the map was from the truth at any time of the mission."""

    survey: OnlineSurvey
    states: Sequence[MapState]
    truth: SurrogateField | None

    @property
    def true_rate(self) -> Array | None:
        """True rate of the cells [counts/s]."""
        return None if self.truth is None else self.truth.rate_at(self.survey.online.grid.cells)

    @property
    def raster(self) -> Array:
        """The same as a raster."""
        assert self.true_rate is not None
        return self.survey.online.grid.to_raster(self.true_rate)

    def row(self, status: Status, beside: _Errors | None) -> SeriesRow:
        """How the mission stood: the maps are those of all records up to then."""
        mse, vwc_rmse, coverage = self._at(float(status["stamp_s"]))
        also = (math.nan,) * 3 if beside is None else beside._at(float(status["stamp_s"]))
        return SeriesRow(
            float(status["time_used_s"]),
            float(status["distance_m"]),
            int(status["samples"]),
            mse,
            100 * mse,
            vwc_rmse,
            coverage,
            float(status["counting_s"]),
            also_mse=also[0],
            also_coverage95=also[2],
        )

    def _at(self, stamp_s: float) -> tuple[float, float, float]:
        unknown = math.nan, math.nan, math.nan
        # A record with a clock gone wrong must not hide those before it.
        known = [state for state in self.states if state.stamp_s <= stamp_s]
        if self.truth is None or self.true_rate is None or not known:
            return unknown
        online = self.survey.online
        try:
            soil_map = online.compute(known[-1])
        except IllConditionedError:  # on line there was no map then, either
            return unknown
        if soil_map is None:
            return unknown
        mask = online.grid.mask
        return map_errors(soil_map.rate[mask], soil_map.rate_sd[mask], self.true_rate, self.truth.curve)


def _settings(configuration: Path | None, last: Status, second: Second | None) -> MissionSettings:
    """What the mission was run with, as far as the planner's parameters tell."""
    had, mapper = read_parameters(configuration, "planner"), read_parameters(configuration, "mapper")
    usual = MissionSettings()
    budget_h = (float(last["time_used_s"]) + float(last["time_left_s"])) / 3600
    return replace(
        usual,
        field=str(had.get("field", "")),
        strategy=str(had.get("strategy", "unknown")),
        dwell=str(had.get("dwell", "unknown")),
        hours=float(had.get("hours", budget_h)),
        seed=int(had.get("seed", 0)),
        preset=had.get("preset", usual.preset),
        variogram=mapper.get("model", "matern32"),
        fit=mapper.get("fit", "reml"),
        travel="free" if had.get("graph") == "free" else "graph",
        also="" if second is None else second.name,
        also_weight=usual.also_weight if second is None else second.weight,
    )
