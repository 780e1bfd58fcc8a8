"""A recorded run, mapped again at a desk: with the settings that the robot had, bit for bit, or with others."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.errors import InputError
from soilmoist_ros.map_run import input_file
from soilmoist_ros.mapping.field_grid import FieldGrid
from soilmoist_ros.mapping.online_map import MapState
from soilmoist_ros.mapping.soil_map import SoilMap
from soilmoist_ros.online_survey import OnlineSurvey, open_survey
from soilmoist_ros.recording.bag_reader import BagReader
from soilmoist_ros.recording.point_cloud import points
from soilmoist_ros.reporting.run import MapRun
from soilmoist_ros.run_folder import bag_of, configuration_of, read_parameters
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.map_errors import map_errors
from soilmoist_ros.simulation.mission_run import MissionResult, MissionSettings, SeriesRow, Visit
from soilmoist_ros.simulation.surrogate_field import SurrogateField, surrogate_field

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

_STATUS, _CLOUD = "diagnostic_msgs/msg/DiagnosticStatus", "sensor_msgs/msg/PointCloud2"
_BANDS = ("rate", "rate_sd", "vwc", "vwc_sd")


@dataclass(frozen=True)
class ReplaySettings:
    """Choices of a replay; what is ``None`` is as the mapper had it on line.

    :param field: field file, or name of a shipped one
    :param site: site file, or name of a shipped one
    :param truth: surrogate field to compare with: a built-in name, or a field file with a truth
    :param model: variogram model
    :param fit: how the variogram is fitted
    :param keep_nugget: map the rate with its micro-scale variation, or the smooth part only
    :param merge_radius_m: records closer together than this become one sample [m]
    :param cell_m: cell size of the map [m]
    :param counts_topic: topic with the records
    """

    field: str | None = None
    site: str | None = None
    truth: str | None = None
    model: str | None = None
    fit: str | None = None
    keep_nugget: bool | None = None
    merge_radius_m: float | None = None
    cell_m: float | None = None
    counts_topic: str = "counts"


@dataclass(frozen=True, eq=False)
class Replay:
    """What a replay comes to.

    :param run: for the outputs
    :param as_on_line: whether the map equals the last one that the mapper published, bit for bit; ``None`` if
        the bag has none
    """

    run: MapRun
    as_on_line: bool | None


def replay_bag(
    bag: Path, settings: ReplaySettings | None = None, progress: Progress = lambda step, share: None
) -> Replay:
    """Map the records of a bag.

    :param bag: folder of a bag or of a run, or an MCAP or db3 file
    :param settings: choices
    :param progress: called as the work goes on
    :raises InputError: if the bag or a file cannot be used, or no map can be made
    """
    chosen = settings or ReplaySettings()
    bag = bag_of(bag)
    configuration = configuration_of(bag)
    survey = _survey(bag, configuration, chosen)
    truth = None if chosen.truth is None else surrogate_field(chosen.truth)
    progress("reading the bag", 0.0)
    with BagReader(bag) as reader:
        records = reader.read_counts(chosen.counts_topic)
        statuses = _statuses(reader)
        on_line = _last_map(reader)
    states = _take(survey, records)
    if not states:
        raise InputError("holds no record with a place in the field", "check the field and the GNSS", bag)
    progress("mapping", 0.0)
    run = survey.run(survey.online.snapshot())
    as_on_line = None if on_line is None else _equal(run.soil_map, on_line)
    files = sorted(bag.glob("*.mcap")) + sorted(bag.glob("*.db3")) if bag.is_dir() else [bag]
    run = replace(run, inputs=[*(input_file(path, "bag") for path in files), *run.inputs])
    if truth is not None:
        run = replace(run, truth_rate=_true_raster(truth, survey.online.grid))
    if statuses:
        mission = _mission(survey, states, statuses, truth, configuration, records, run.soil_map, progress)
        run = replace(run, mission=mission)
    return Replay(run, as_on_line)


def _survey(bag: Path, configuration: Path | None, chosen: ReplaySettings) -> OnlineSurvey:
    had = read_parameters(configuration, "mapper")
    field = chosen.field or had.get("field")
    if not field:
        raise InputError("does not say which field it is of", "give the field file with --field", bag)
    site = had.get("site", "") if chosen.site is None else chosen.site

    def pick(name: str, key: str, default: Any) -> Any:
        value = getattr(chosen, name)
        return had.get(key, default) if value is None else value

    return open_survey(
        field,
        site,
        cell_m=float(pick("cell_m", "cell_m", 0.0)),
        model=pick("model", "model", "matern32"),
        fit=pick("fit", "fit", "reml"),
        keep_nugget=bool(pick("keep_nugget", "keep_nugget", True)),
        merge_radius_m=float(pick("merge_radius_m", "merge_radius_m", 2.5)),
        simulated=bool(had.get("simulated", False)),
    )


def _take(survey: OnlineSurvey, records: Sequence[CountRecord]) -> list[MapState]:
    """The states of the map after each record that is in it."""
    return [survey.online.state for record in records if survey.online.take(record) is None]


def _statuses(reader: BagReader) -> list[dict[str, str]]:
    """Values of the mission's statuses, in order; none if the bag has no mission."""
    topics = [name for name, kind in reader.topics.items() if name.endswith("/mission") and kind == _STATUS]
    messages = reader.messages(topics[:1]) if topics else ()
    return [{item.key: item.value for item in reader.decode(message).values} for message in messages]


def _last_map(reader: BagReader) -> NDArray[Any] | None:
    topics = [name for name, kind in reader.topics.items() if name.endswith("/soil_map") and kind == _CLOUD]
    last = None
    for message in reader.messages(topics[:1]) if topics else ():
        last = message
    return None if last is None else points(reader.decode(last))


def _equal(soil_map: SoilMap, on_line: NDArray[Any]) -> bool:
    """Whether all bands are the same in the precision of the message."""
    for name in _BANDS:
        if name not in (on_line.dtype.names or ()):
            return False
        here = np.asarray(getattr(soil_map, name)).ravel().astype(on_line.dtype[name])
        if here.shape != on_line[name].ravel().shape or not np.array_equal(
            here, on_line[name].ravel(), equal_nan=True
        ):
            return False
    return True


def _true_raster(truth: SurrogateField, grid: FieldGrid) -> Array:
    return grid.to_raster(truth.rate_at(grid.cells))


def _mission(
    survey: OnlineSurvey,
    states: Sequence[MapState],
    statuses: Sequence[Mapping[str, str]],
    truth: SurrogateField | None,
    configuration: Path | None,
    records: Sequence[CountRecord],
    soil_map: SoilMap,
    progress: Progress,
) -> MissionResult:
    """The mission as its statuses tell it, with the errors of the map after each stop."""
    grid = survey.online.grid
    true_rate = None if truth is None else truth.rate_at(grid.cells)
    stamps = np.array([state.stamp_s for state in states])
    rows: list[SeriesRow] = []
    visits: list[Visit] = []
    before: Mapping[str, str] = {}
    counting: Mapping[str, str] = {}
    began_s = math.nan
    chosen_because = ""
    for number, status in enumerate(statuses):
        progress("the course of the mission", number / len(statuses))
        if math.isnan(began_s) and float(status["time_used_s"]) > 0:
            began_s = float(status["stamp_s"]) - float(status["time_used_s"])
        if status["state"] == "travelling":
            chosen_because = status["reason"].partition(": ")[2] or status["reason"]
        if before and int(status["samples"]) > int(before["samples"]) and counting:
            visits.append(_visit(counting, began_s, chosen_because))
            rows.append(_row(survey, states, stamps, status, true_rate, truth))
        counting = status if status["state"] == "counting" else counting
        before = status
    if not rows or rows[-1].time_s < float(before["time_used_s"]):
        rows.append(_row(survey, states, stamps, before, true_rate, truth))
    placed = [(r.x_m, r.y_m) for r in records if math.isfinite(r.x_m) and math.isfinite(r.y_m)]
    return MissionResult(
        settings=_settings(configuration),
        series=rows,
        visits=visits,
        track_xy=np.array(placed).reshape(-1, 2),
        records=records,
        soil_map=soil_map,
        truth_rate=np.full(grid.mask.shape, np.nan) if truth is None else _true_raster(truth, grid),
        frame=survey.field.frame,
        field_title=survey.field.name,
        ended=statuses[-1]["reason"],
    )


def _visit(status: Mapping[str, str], began_s: float, reason: str) -> Visit:
    dwell_s = float(status["elapsed_dwell_s"])
    return Visit(
        status["target"],
        float(status["target_x_m"]),
        float(status["target_y_m"]),
        float(status["stamp_s"]) - dwell_s - began_s,
        dwell_s,
        int(status["raw_counts"]),
        reason,
    )


def _row(
    survey: OnlineSurvey,
    states: Sequence[MapState],
    stamps: Array,
    status: Mapping[str, str],
    true_rate: Array | None,
    truth: SurrogateField | None,
) -> SeriesRow:
    """How the mission stood: the map is that of all records up to then."""
    mse, vwc_rmse, coverage = math.nan, math.nan, math.nan
    known = int(np.searchsorted(stamps, float(status["stamp_s"]), side="right"))
    soil_map = survey.online.compute(states[known - 1]) if known and true_rate is not None else None
    if soil_map is not None and true_rate is not None and truth is not None:
        mask = survey.online.grid.mask
        mse, vwc_rmse, coverage = map_errors(soil_map.rate[mask], soil_map.rate_sd[mask], true_rate, truth.curve)
    return SeriesRow(
        float(status["time_used_s"]),
        float(status["distance_m"]),
        int(status["samples"]),
        mse,
        100 * mse,
        vwc_rmse,
        coverage,
        float(status["counting_s"]),
    )


def _settings(configuration: Path | None) -> MissionSettings:
    """What the mission was run with, as far as the planner's parameters tell."""
    had = read_parameters(configuration, "planner")
    mapper = read_parameters(configuration, "mapper")
    usual = MissionSettings()
    return replace(
        usual,
        field=str(had.get("field", "")),
        strategy=str(had.get("strategy", "unknown")),
        dwell=str(had.get("dwell", "unknown")),
        hours=float(had.get("hours", usual.hours)),
        seed=int(had.get("seed", 0)),
        preset=had.get("preset", usual.preset),
        variogram=mapper.get("model", "matern32"),
        fit=mapper.get("fit", "reml"),
        travel="free" if had.get("graph") == "free" else "graph",
    )
