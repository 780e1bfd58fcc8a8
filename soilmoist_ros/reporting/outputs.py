"""The output folder of a run: all files complete, or as they were before."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.files.geojson import write_samples
from soilmoist_ros.reporting.files.geotiff import export_crs, write_geotiff
from soilmoist_ros.reporting.files.mission_tables import write_series, write_visits
from soilmoist_ros.reporting.files.summary import write_summary
from soilmoist_ros.reporting.page.properties_section import second_run
from soilmoist_ros.reporting.page.report import write_report
from soilmoist_ros.reporting.run import MapRun

if TYPE_CHECKING:
    from pyproj import CRS

    from soilmoist_ros.simulation.mission.mission_run import MissionResult

NAMES = ("summary.json", "map.tif", "samples.geojson", "report.html")
MISSION_NAMES = ("series.csv", "visits.csv")


def write_outputs(folder: Path, run: MapRun, crs: CRS | str | int | None = None) -> list[Path]:
    """Write ``summary.json``, ``map.tif``, ``samples.geojson`` and ``report.html``.

    For a mission also ``series.csv`` and ``visits.csv``, and for a second property ``map_NAME.tif`` and
    ``samples_NAME.geojson`` with its name.

    All are first written to a hidden folder beside their place and moved only when every one is complete,
    so that a reader never meets half a file, nor a map with another run's report after a failure.

    :param folder: output folder; made if missing
    :param run: the run
    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :returns: the paths, in the order above
    :raises InputError: if the folder cannot be written, or the field has no place in ``crs``
    """
    target = export_crs(run.frame, crs)
    second = second_run(run)
    names: tuple[str, ...] = NAMES if run.mission is None else NAMES + MISSION_NAMES
    if second is not None:
        names += second_names(run.mission)
    tags = {
        "SOILMOIST_SIMULATED": "yes" if run.simulated else "no",
        "SOILMOIST_CREATED_UTC": run.created,
        "SOILMOIST_FIELD": run.field_name,
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        workshop = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    try:
        write_geotiff(workshop / "map.tif", run.soil_map, run.frame, target, tags)
        write_samples(workshop / "samples.geojson", run)
        write_report(workshop / "report.html", run)
        if run.mission is not None:
            write_series(workshop / "series.csv", run.mission)
            write_visits(workshop / "visits.csv", run.mission)
        if second is not None:
            of_map, of_samples = (workshop / name for name in second_names(run.mission))
            write_geotiff(
                of_map, second.soil_map, run.frame, target, {**tags, "SOILMOIST_FIELD": second.field_name}
            )
            write_samples(of_samples, second)
        write_summary(workshop / "summary.json", run, crs=target.to_string(), outputs=names)
        for name in names:
            os.replace(workshop / name, folder / name)
    finally:
        shutil.rmtree(workshop, ignore_errors=True)
    return [folder / name for name in names]


def second_names(mission: MissionResult | None) -> tuple[str, ...]:
    """Names of the files of a mission's second property, none without one."""
    also = None if mission is None else mission.also
    return () if also is None else (f"map_{also.name}.tif", f"samples_{also.name}.geojson")
