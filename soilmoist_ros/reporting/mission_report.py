"""The output folder of one simulated mission."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from soilmoist_ros.exploration.planning.property_names import property_name
from soilmoist_ros.foundation.version import __version__
from soilmoist_ros.reporting.failed_outputs import write_failed
from soilmoist_ros.reporting.failed_run import FailedRun
from soilmoist_ros.reporting.files.summary import settings_summary
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.run import LossRow, MapRun
from soilmoist_ros.simulation.mission.result import MissionResult

if TYPE_CHECKING:
    from pyproj import CRS

UNUSED_COUNTS = 0.01
"""Share of the counts outside the stops up to which there is no note."""


def write_mission(
    folder: Path, result: MissionResult, crs: CRS | str | int | None = None, created_utc: datetime | None = None
) -> list[Path]:
    """Write ``summary.json``, ``map.tif``, ``samples.geojson``, ``report.html``, ``records.csv``,
    ``series.csv``, ``visits.csv``.

    A mission without a map leaves only ``summary.json``, ``report.html``, ``records.csv``, ``series.csv`` and
    ``visits.csv``; other results of an earlier mission in the folder are removed.

    :param folder: output folder; made if missing
    :param result: the mission
    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :param created_utc: creation time of the outputs; default now
    :returns: the paths written
    :raises InputError: if the folder cannot be written
    """
    created = created_utc or datetime.now(UTC)
    if result.soil_map is not None:
        return write_outputs(folder, mission_run(result, created), crs)
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


def mission_run(result: MissionResult, created_utc: datetime) -> MapRun:
    """A simulated mission as a mapping run.

    :raises ValueError: if the mission has no map
    """
    if result.soil_map is None:
        raise ValueError("the mission ended before its first map")
    settings = result.settings
    run = MapRun(
        soil_map=result.soil_map,
        frame=result.frame,
        created_utc=created_utc,
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
        name=property_name(settings.field_name),
        label=result.field_title or settings.field_name,
    )
    others = [
        replace(
            run, soil_map=other.soil_map, track=other.records, truth_rate=other.known_truth, losses=(),
            mission=None, field_name=other.title, name=other.name, label=other.title,
        )
        for other in result.properties[1:]
        if other.soil_map is not None
    ]  # fmt: skip
    return replace(run, others=others)


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
