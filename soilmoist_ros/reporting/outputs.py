# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writes the output folder of a run: all files are replaced, or none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from soilmoist_ros.mapping import FALSE_SHARE, FieldChange
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.recording import SUMMARY, write_records
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, ILLUSTRATIVE, calibration_of
from soilmoist_ros.reporting.exports.qgis import write_run_project
from soilmoist_ros.reporting.exports.source import PropertyMap
from soilmoist_ros.reporting.files.cell_raster import CellBand, write_cell_raster
from soilmoist_ros.reporting.files.geojson import write_samples
from soilmoist_ros.reporting.files.geotiff import write_geotiff
from soilmoist_ros.reporting.files.mission_tables import write_series, write_visits
from soilmoist_ros.reporting.files.summary import write_summary
from soilmoist_ros.reporting.moisture_steps import at_one_place, write_moisture
from soilmoist_ros.reporting.opened_run import OpenedRun
from soilmoist_ros.reporting.output_folder import (
    MISSION_NAMES,
    NAMES,
    PROJECT_NAME,
    SERIES_NAME,
    replaced_together,
    writable,
)
from soilmoist_ros.reporting.page.report import write_report
from soilmoist_ros.reporting.page.statistics import resolution_m

if TYPE_CHECKING:
    from pyproj import CRS


GUESSED = (
    "Soil moisture map from cosmic-ray neutron counts, by Poisson kriging; illustrative calibration: the pattern "
    "is real, the level of the moisture is not"
)


def write_outputs(folder: Path, run: MapRun, crs: CRS | str | int | None = None) -> list[Path]:
    """Write summary, ``map.tif``, ``samples.geojson``, ``report.html``, ``records.csv`` and ``soilmoist.qgs``.

    Records that all lie at one place add ``moisture.csv``, a mission ``series.csv`` and ``visits.csv``. Each
    property after the first adds ``map_NAME.tif``, ``samples_NAME.geojson`` and ``records_NAME.csv``. Earlier
    surveys add ``change.tif``. Without the extra ``reports``, a warning names the GeoTIFFs, the report and the
    project, which are left out.

    The files are written to a hidden folder in ``folder`` and moved when all are complete. A reader never finds
    half a file, nor files of different runs after a failure.
    What a killed process left is removed, and results of an earlier run that this run has not.

    :param folder: output folder; made if missing
    :param run: the run
    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :returns: the paths, in the order above
    :raises InputError: if the folder cannot be written, or the field has no place in ``crs``
    """
    names: tuple[str, ...] = NAMES if run.mission is None else NAMES + MISSION_NAMES
    names += (SERIES_NAME,) if at_one_place(run) else ()
    names += tuple(name for other in run.others for name in property_names(other.name))
    names += tuple(_change_name(run, one) for one in run.properties if one.change is not None)
    names = writable(names)
    target = run.frame.export_crs(crs) if "map.tif" in names else None
    with replaced_together(folder, names) as workshop:
        for number, one in enumerate(run.properties):
            of_map, of_samples, of_records = property_names(one.name if number else "")
            if target is not None:
                write_geotiff(workshop / of_map, one.soil_map, one.frame, target, _tags(one))
            write_samples(workshop / of_samples, one)
            write_records(workshop / of_records, one.all_records)
            if one.change is not None and target is not None:
                bands = change_bands(one.change.change)
                tags = {**_tags(one), "SOILMOIST_CHANGE_SINCE": one.change.since.survey.name}
                write_cell_raster(workshop / _change_name(run, one), one.soil_map, one.frame, target, bands, tags)
        if PROJECT_NAME in names:
            write_run_project(workshop / PROJECT_NAME, run.field_name or run.title, _maps(workshop, run))
        if "report.html" in names:
            write_report(workshop / "report.html", run)
        if at_one_place(run):
            write_moisture(workshop / SERIES_NAME, run)
        if run.mission is not None:
            write_series(workshop / "series.csv", run.mission)
            write_visits(workshop / "visits.csv", run.mission)
        crs_name = "" if target is None else target.to_string()
        write_summary(workshop / SUMMARY, run, crs=crs_name, outputs=names)
    return [folder / name for name in names]


def property_names(name: str) -> tuple[str, str, str]:
    """Names of the files with the map, the samples and the records of a property.

    :param name: name of the property, empty for the first
    """
    end = f"_{name}" if name else ""
    return f"map{end}.tif", f"samples{end}.geojson", f"records{end}.csv"


def _maps(folder: Path, run: MapRun) -> list[PropertyMap]:
    """The maps of a run as its GeoTIFFs in a folder have them."""
    opened = OpenedRun(folder)
    names = ("", *(other.name for other in run.others))
    return [
        PropertyMap(name, one.label, *opened.raster(name), one.frame, {}, {})
        for name, one in zip(names, run.properties, strict=True)
    ]


def _change_name(run: MapRun, one: MapRun) -> str:
    """Name of the file with the change of a property."""
    return "change.tif" if one is run else f"change_{one.name}.tif"


def change_bands(change: FieldChange) -> dict[str, CellBand]:
    """Bands of the file with a change; those of the moisture need a calibration."""
    moisture = {
        "vwc_change": CellBand(change.vwc, "m3/m3", "change of the volumetric water content"),
        "vwc_change_sd": CellBand(change.vwc_sd, "m3/m3", "its standard deviation"),
    }
    return {
        **(moisture if change.mean_vwc is not None else {}),
        "rate_change": CellBand(change.rate, "counts/s", "change of the corrected neutron count rate"),
        "rate_change_sd": CellBand(change.rate_sd, "counts/s", "its standard deviation"),
        "significant": CellBand(
            change.significant,
            "1",
            f"1 drier, -1 wetter, 0 not significant at a false discovery rate of {FALSE_SHARE:g}",
        ),
    }


def _tags(run: MapRun) -> dict[str, str]:
    return {
        "SOILMOIST_SIMULATED": "yes" if run.simulated else "no",
        CALIBRATION_TAG: calibration_of(run),
        "SOILMOIST_CREATED_UTC": run.created,
        "SOILMOIST_FIELD": run.field_name,
        "SOILMOIST_SUPPORT": run.support_text,
        "SOILMOIST_RESOLUTION_M": f"{resolution_m(run.soil_map, run.footprint_radius_m or 0.0):.1f}",
        **({"SOILMOIST_PROPERTY": run.name} if run.name else {}),
        **_survey_tags(run),
        **({"TIFFTAG_IMAGEDESCRIPTION": GUESSED} if calibration_of(run) == ILLUSTRATIVE else {}),
    }


def _survey_tags(run: MapRun) -> dict[str, str]:
    """Begin and end of the survey; none for a clock without a date."""
    begin, end = run.survey_start_utc, run.survey_end_utc
    if begin is None or end is None:
        return {}
    return {
        "TIFFTAG_DATETIME": f"{begin:%Y:%m:%d %H:%M:%S}",
        "SOILMOIST_SURVEY_START_UTC": f"{begin:%Y-%m-%dT%H:%M:%SZ}",
        "SOILMOIST_SURVEY_END_UTC": f"{end:%Y-%m-%dT%H:%M:%SZ}",
    }
