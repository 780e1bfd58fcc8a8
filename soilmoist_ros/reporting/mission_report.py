"""The output folder of one simulated mission."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from soilmoist_ros.exploration.planning.property_names import property_name
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.version import __version__
from soilmoist_ros.reporting.files.mission_tables import write_series, write_visits
from soilmoist_ros.reporting.files.strict_json import write_json
from soilmoist_ros.reporting.files.summary import SCHEMA, mission_summary, settings_summary
from soilmoist_ros.reporting.output_folder import earlier_outputs, remove_earlier
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.run import LossRow, MapRun, Note, NoteCode
from soilmoist_ros.simulation.mission.result import MissionResult

if TYPE_CHECKING:
    from pyproj import CRS

NO_MAP = Note(NoteCode.NO_MAP, "The mission ended before its first map.")
UNUSED_COUNTS = 0.01
"""Share of the counts outside the stops up to which there is no note."""


def write_mission(
    folder: Path, result: MissionResult, crs: CRS | str | int | None = None, created_utc: datetime | None = None
) -> list[Path]:
    """Write ``summary.json``, ``map.tif``, ``samples.geojson``, ``report.html``, ``records.csv``,
    ``series.csv``, ``visits.csv``.

    A mission without a map leaves only ``summary.json``, ``series.csv`` and ``visits.csv``; other files of an
    older mission in the folder are removed.

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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        remove_earlier(folder, earlier_outputs(folder), ())
        about = {
            "schema": SCHEMA,
            "software": "soilmoist_ros",
            "version": __version__,
            "created_utc": created.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "simulated": True,
            "map": None,
            "mission": mission_summary(result),
            "warnings": [NO_MAP.message],
            "warning_codes": [NO_MAP.code],
            "outputs": ["summary.json", "series.csv", "visits.csv"],
        }
        return [
            write_json(folder / "summary.json", about),
            write_series(folder / "series.csv", result),
            write_visits(folder / "visits.csv", result),
        ]
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None


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
