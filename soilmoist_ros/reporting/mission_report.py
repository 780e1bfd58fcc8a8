# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The output folder of one simulated mission."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from soilmoist_ros.exploration import property_name
from soilmoist_ros.foundation import __version__
from soilmoist_ros.mapping import FieldMap, FieldMapSettings
from soilmoist_ros.pipeline import (
    EARLIER,
    EarlierRun,
    FailedRun,
    LossRow,
    MapRun,
    RunChange,
    run_change,
    simulated_runs,
)
from soilmoist_ros.reporting.failed_outputs import write_failed
from soilmoist_ros.reporting.files.summary import settings_summary
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.simulation import MissionResult

if TYPE_CHECKING:
    from pyproj import CRS

_NO_RUNS: Mapping[str, Sequence[EarlierRun]] = MappingProxyType({})
UNUSED_COUNTS = 0.01
"""Share of the counts outside the stops up to which there is no note."""


def write_mission(
    folder: Path,
    result: MissionResult,
    crs: CRS | str | int | None = None,
    created_utc: datetime | None = None,
    run: MapRun | None = None,
) -> list[Path]:
    """Write ``summary.json``, ``map.tif``, ``samples.geojson``, ``report.html``, ``records.csv``,
    ``series.csv``, ``visits.csv``.

    A mission without a map leaves only ``summary.json``, ``report.html``, ``records.csv``, ``series.csv`` and
    ``visits.csv``; other results of an earlier mission in the folder are removed.

    :param folder: output folder; made if missing
    :param result: the mission
    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :param created_utc: creation time of the outputs; default now
    :param run: what :func:`mission_run` made of the mission, if known
    :returns: the paths written; those of simulated earlier surveys are folders of runs
    :raises InputError: if the folder cannot be written
    """
    created = created_utc or (run.created_utc if run else datetime.now(UTC))
    if result.soil_map is not None:
        written = write_outputs(folder, run or mission_run(result, created), crs)
        return [*written, *_write_series(folder, result, crs, created)]
    return write_failed(folder, failed_mission(result, created))


def failed_mission(result: MissionResult, created_utc: datetime) -> FailedRun:
    """A simulated mission without a map."""
    settings, stops = result.settings, len(result.visits)
    time_s = result.series[-1].time_s if result.series else 0.0
    counted = f"{stops or 'no'} {'stop was' if stops < 2 else 'stops were'} finished"
    todo = ["Give the mission more time: --hours.", "Count for a shorter time at each stop: --dwell."]
    if settings.map_from != "records":
        todo.append("Map what is counted while driving, too: --map-from records.")
    return FailedRun(
        why=f"The mission ended after {time_s / 60:.0f} min, before its first map: {counted}. "
        f"Its end: {result.ended}.",
        todo=todo,
        created_utc=created_utc,
        track=result.records,
        title="Simulated mission without a map",
        field_name=result.field_title or settings.field_name,
        mission=result,
        simulated=True,
        settings=settings_summary(settings),
    )


def _write_series(
    folder: Path, result: MissionResult, crs: CRS | str | int | None, created_utc: datetime
) -> Iterator[Path]:
    """Write a run folder for each simulated earlier survey of the mission field; yields the folders."""
    mapped, settings = result.properties[0], result.settings
    assert mapped.soil_map is not None
    grid = mapped.soil_map.grid
    choices = FieldMapSettings(
        settings.model,
        settings.fit,
        curve=mapped.soil_map.curve,
        noise=settings.noise,
        local=settings.local,
        drift_model=settings.drift_model,
        footprint_radius_m=settings.footprint_m,
    )
    for back, survey in enumerate(mapped.series, 1):
        field_map = FieldMap(grid, choices)
        field_map.set_records(survey.records)
        soil_map = field_map.update()
        assert soil_map is not None  # there are a hundred samples
        name = property_name(settings.field_name)
        run = MapRun(
            soil_map=soil_map,
            frame=result.frame,
            created_utc=created_utc,
            track=survey.records,
            title=f"Simulated survey {survey.name}",
            field_name=result.field_title,
            simulated=True,
            version=__version__,
            truth_rate=grid.to_raster(survey.field.rate_at(grid.cells)),
            footprint_radius_m=settings.footprint_m,
            name=name,
            label=result.field_title or name,
        )
        home = folder / EARLIER / f"survey_{back}"
        write_outputs(home, run, crs)
        yield home


def mission_run(
    result: MissionResult,
    created_utc: datetime | None = None,
    earlier: Mapping[str, Sequence[EarlierRun]] = _NO_RUNS,
) -> MapRun:
    """A simulated mission as a mapping run.

    :param created_utc: creation time of its outputs; default now
    :param earlier: finished runs that informed the maps, by name of the property
    :raises ValueError: if the mission has no map
    """
    if result.soil_map is None:
        raise ValueError("the mission ended before its first map")
    settings = result.settings
    first, name = result.properties[0], property_name(settings.field_name)
    run = MapRun(
        soil_map=result.soil_map,
        frame=result.frame,
        created_utc=created_utc or datetime.now(UTC),
        track=result.records,
        title="Simulated soil moisture mission",
        field_name=result.field_title or settings.field_name,
        losses=list(_left_out(result)),
        simulated=True,
        version=__version__,
        settings=settings_summary(settings),
        truth_rate=result.truth_rate,
        footprint_radius_m=settings.footprint_m,
        mission=result,
        name=name,
        label=result.field_title or settings.field_name,
        covariates=first.covariates,
        earlier=[*simulated_runs(first, result.soil_map), *earlier.get(name, ())],
    )
    run = replace(run, change=_change(result, run))
    others = [
        replace(
            run, soil_map=other.soil_map, track=other.records, truth_rate=other.known_truth, losses=(),
            mission=None, field_name=other.title, name=other.name, label=other.title,
            covariates=other.covariates,
            earlier=[*simulated_runs(other, other.soil_map), *earlier.get(other.name, ())],
        )
        for other in result.properties[1:]
        if other.soil_map is not None
    ]  # fmt: skip
    others = [replace(one, change=_change(result, one)) for one in others]
    return replace(run, others=others)


def _change(result: MissionResult, run: MapRun) -> RunChange | None:
    """What has changed since the latest earlier survey."""
    end_s = result.series[-1].time_s if result.series else 0.0
    return run_change(run.soil_map, end_s, run.earlier)


def _left_out(result: MissionResult) -> Iterator[LossRow]:
    """Loss row of the records outside the stops; their number is estimated from the exposure."""
    total = sum(record.raw_counts for record in result.records)
    left = total - sum(visit.raw_counts for visit in result.visits)
    if left > UNUSED_COUNTS * total:
        period_s = float(np.median([record.exposure_s for record in result.records]))
        at_stops_s = sum(visit.dwell_s for visit in result.visits)
        count = round((sum(record.exposure_s for record in result.records) - at_stops_s) / period_s)
        yield LossRow(
            "counted on the way", max(count, 1), "records while the robot drove between stops", "lost",
            "none is needed: this mission maps what was counted at stops",
        )  # fmt: skip
