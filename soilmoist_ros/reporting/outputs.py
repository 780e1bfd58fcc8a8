# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Output folders of runs, of runs without a map, and of simulated missions: all files are replaced, or none."""

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
    run_change,
    simulated_runs,
    site_facts,
)
from soilmoist_ros.recording import RECORDS, SUMMARY, write_records
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, ILLUSTRATIVE, NO_LEVEL, calibration_of
from soilmoist_ros.reporting.certified import certificate_content
from soilmoist_ros.reporting.exports.qgis import write_run_project
from soilmoist_ros.reporting.exports.source import ExportedProperty
from soilmoist_ros.reporting.geotiff import CHANGES, write_cell_raster, write_geotiff
from soilmoist_ros.reporting.opened_run import OpenedRun
from soilmoist_ros.reporting.output_folder import (
    CERTIFICATE_NAME,
    MISSION_NAMES,
    NAMES,
    PROJECT_NAME,
    replaced_together,
    writable,
)
from soilmoist_ros.reporting.page.report import render_failed, render_report
from soilmoist_ros.reporting.page.statistics import resolution_m
from soilmoist_ros.reporting.run_summary import failed_summary, settings_summary, summary
from soilmoist_ros.reporting.text_files import write_json, write_samples, write_series, write_visits
from soilmoist_ros.sensing import Irrigation
from soilmoist_ros.simulation import MissionResult, simulated_site, surrogate_field

if TYPE_CHECKING:
    from pyproj import CRS

GUESSED = (
    "Soil moisture map from cosmic-ray neutron counts, by Poisson kriging; calibration: {}: the pattern "
    "is real, the level of the moisture is not"
)
_NO_RUNS: Mapping[str, Sequence[EarlierRun]] = MappingProxyType({})
UNUSED_COUNTS = 0.01
"""Share of the counts outside the stops up to which there is no note."""


def write_outputs(folder: Path, run: MapRun, crs: CRS | str | int | None = None) -> list[Path]:
    """Write summary, ``map.tif``, ``samples.geojson``, ``report.html``, ``records.csv`` and ``soilmoist.qgs``.

    A mission adds ``series.csv`` and ``visits.csv``. Each property after the first adds ``map_NAME.tif``,
    ``samples_NAME.geojson`` and ``records_NAME.csv``. Earlier surveys add ``change.tif``. Without the extra
    ``reports``, a warning names the GeoTIFFs, the report and the project, which are left out. See
    :func:`replaced_together`.

    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :raises InputError: if the folder cannot be written, or the field has no place in ``crs``
    """
    names = writable((
        *NAMES, *(MISSION_NAMES if run.mission else ()),
        *((CERTIFICATE_NAME,) if run.mission and run.mission.certificate else ()),
        *(name for other in run.others for name in property_names(other.name)),
        *(_change_name(run, one) for one in run.properties if one.change is not None),
    ))  # fmt: skip
    target = run.frame.export_crs(crs) if "map.tif" in names else None
    with replaced_together(folder, names) as workshop:
        for number, one in enumerate(run.properties):
            of_map, of_samples, of_records = property_names(one.name if number else "")
            if target is not None:
                write_geotiff(workshop / of_map, one.soil_map, one.frame, target, _tags(one))
            write_samples(workshop / of_samples, one)
            write_records(workshop / of_records, one.all_records)
            if one.change is not None and target is not None:
                change = one.change.change
                bands = {name: np.asarray(getattr(change, name.replace("_change", ""))) for name in CHANGES
                         if change.mean_vwc is not None or name[:3] != "vwc"}  # fmt: skip
                tags = {**_tags(one), "SOILMOIST_CHANGE_SINCE": one.change.since.survey.name}
                write_cell_raster(
                    workshop / _change_name(run, one), one.soil_map.grid, one.frame, target, bands, tags
                )
        if PROJECT_NAME in names:
            names_of = ("", *(other.name for other in run.others))
            maps = [
                ExportedProperty(name, one.label, *OpenedRun(workshop).raster(name), one.frame, {}, {})
                for name, one in zip(names_of, run.properties, strict=True)
            ]
            write_run_project(workshop / PROJECT_NAME, run.field_name or run.title, maps)
        if "report.html" in names:
            (workshop / "report.html").write_text(render_report(run), encoding="utf-8")
        if run.mission is not None:
            write_series(workshop / "series.csv", run.mission)
            write_visits(workshop / "visits.csv", run.mission)
            if run.mission.certificate:
                write_json(workshop / CERTIFICATE_NAME, certificate_content(run))
        write_json(workshop / SUMMARY, summary(run, "" if target is None else target.to_string(), names))
    return [folder / name for name in names]


def property_names(name: str) -> tuple[str, str, str]:
    """Names of the files with the map, the samples and the records of a property."""
    end = f"_{name}" if name else ""
    return f"map{end}.tif", f"samples{end}.geojson", f"records{end}.csv"


def _change_name(run: MapRun, one: MapRun) -> str:
    """Name of the file with the change of a property."""
    return "change.tif" if one is run else f"change_{one.name}.tif"


def _tags(run: MapRun) -> dict[str, str]:
    """Origin of a map; begin and end of the survey unless the clock has no date."""
    begin, end = run.survey_start_utc, run.survey_end_utc
    tags = {
        "SOILMOIST_SIMULATED": "yes" if run.simulated else "no", CALIBRATION_TAG: calibration_of(run),
        "SOILMOIST_CREATED_UTC": run.created, "SOILMOIST_FIELD": run.field_name,
        "SOILMOIST_SUPPORT": run.support_text,
        "SOILMOIST_RESOLUTION_M": f"{resolution_m(run.soil_map, run.footprint_radius_m or 0.0):.1f}",
    }  # fmt: skip
    if run.name:
        tags["SOILMOIST_PROPERTY"] = run.name
    if begin is not None and end is not None:
        tags["TIFFTAG_DATETIME"] = f"{begin:%Y:%m:%d %H:%M:%S}"
        tags["SOILMOIST_SURVEY_START_UTC"] = f"{begin:%Y-%m-%dT%H:%M:%SZ}"
        tags["SOILMOIST_SURVEY_END_UTC"] = f"{end:%Y-%m-%dT%H:%M:%SZ}"
    if (state := calibration_of(run)) in NO_LEVEL:
        tags["TIFFTAG_IMAGEDESCRIPTION"] = GUESSED.format(state)
    if state == ILLUSTRATIVE:
        tags["SOILMOIST_INTERVAL"] = (
            "level not known (illustrative N0): vwc_p05 to vwc_p95 contains counting and interpolation only"
        )
    return tags


# The output folder of a run without a map: report, summary and tables -------------------------------------------


def write_failed(folder: Path, failed: FailedRun) -> list[Path]:
    """Write ``summary.json``, ``report.html``, ``records.csv``; a mission adds ``series.csv``, ``visits.csv``.

    Without the extra ``reports``, a warning names the report, which is left out.

    :raises InputError: if the folder cannot be written
    """
    names = writable((SUMMARY, "report.html", RECORDS, *(MISSION_NAMES if failed.mission is not None else ())))
    with replaced_together(folder, names) as workshop:
        if "report.html" in names:
            (workshop / "report.html").write_text(render_failed(failed), encoding="utf-8")
        write_records(workshop / RECORDS, failed.track)
        if failed.mission is not None:
            write_series(workshop / "series.csv", failed.mission)
            write_visits(workshop / "visits.csv", failed.mission)
        write_json(workshop / SUMMARY, failed_summary(failed, names))
    return [folder / name for name in names]


# The output folder of one simulated mission ---------------------------------------------------------------------


def write_mission(
    folder: Path,
    result: MissionResult,
    crs: CRS | str | int | None = None,
    created_utc: datetime | None = None,
    run: MapRun | None = None,
) -> list[Path]:
    """Write the files of :func:`write_outputs`; without a map those of :func:`write_failed`.

    :param crs: coordinate reference system of ``map.tif``; default the UTM zone of the datum
    :param created_utc: creation time of the outputs; default now
    :param run: what :func:`mission_run` made of the mission, if known
    :raises InputError: if the folder cannot be written
    """
    created = created_utc or (run.created_utc if run else datetime.now(UTC))
    if result.soil_map is not None:
        run = run or mission_run(result, created)
        return [*write_outputs(folder, run, crs), *_write_series(folder, result, run, crs)]
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
    folder: Path, result: MissionResult, mission: MapRun, crs: CRS | str | int | None
) -> Iterator[Path]:
    """Write a run folder for each simulated earlier survey of the mission field; yields the folders."""
    mapped, settings = result.properties[0], result.settings
    assert mapped.soil_map is not None
    grid, curve, name = mapped.soil_map.grid, mission.soil_map.curve, property_name(settings.field_name)
    choices = FieldMapSettings.chosen(settings, curve=curve, footprint_radius_m=settings.footprint_m)
    for back, survey in enumerate(mapped.series, 1):
        field_map = FieldMap(grid, choices)
        field_map.set_records(survey.records)
        soil_map = field_map.update()
        assert soil_map is not None  # there are a hundred samples
        run = MapRun(
            soil_map=soil_map, frame=result.frame, created_utc=mission.created_utc, track=survey.records,
            title=f"Simulated survey {survey.name}", field_name=result.field_title, simulated=True,
            version=__version__, truth_rate=grid.to_raster(survey.field.rate_at(grid.cells)),
            footprint_radius_m=settings.footprint_m, name=name, label=result.field_title or name,
            calibration=mission.calibration, irrigation=mission.irrigation,
        )  # fmt: skip
        home = folder / EARLIER / f"survey_{back}"
        write_outputs(home, run, crs)
        yield home


def mission_run(
    result: MissionResult,
    created_utc: datetime | None = None,
    earlier: Mapping[str, Sequence[EarlierRun]] = _NO_RUNS,
    irrigation: Irrigation | None = None,
) -> MapRun:
    """A simulated mission as a mapping run: its moistures have the calibration of :func:`simulated_site`.

    :param created_utc: creation time of its outputs; default now
    :param earlier: finished runs that informed the maps, by name of the property
    :param irrigation: irrigation keys instead of those of the simulated site
    :raises ValueError: if the mission has no map
    """
    if result.soil_map is None:
        raise ValueError("the mission ended before its first map")
    settings = result.settings
    first, name = result.properties[0], property_name(settings.field_name)
    site = simulated_site(surrogate_field(settings.field_name), irrigation=irrigation)
    run = MapRun(
        soil_map=replace(result.soil_map, curve=site.curve), **site_facts(site), frame=result.frame,
        created_utc=created_utc or datetime.now(UTC), track=result.records,
        title="Simulated soil moisture mission", field_name=result.field_title or settings.field_name,
        losses=list(_left_out(result)), simulated=True, version=__version__, settings=settings_summary(settings),
        truth_rate=result.truth_rate, footprint_radius_m=settings.footprint_m, mission=result, name=name,
        label=result.field_title or settings.field_name, covariates=first.covariates,
        earlier=[*simulated_runs(first, result.soil_map), *earlier.get(name, ())],
    )  # fmt: skip
    end_s = result.series[-1].time_s if result.series else 0.0
    run = replace(run, change=run_change(run.soil_map, end_s, run.earlier))
    others = [
        replace(
            run, soil_map=other.soil_map, track=other.records, truth_rate=other.known_truth, losses=(),
            mission=None, field_name=other.title, name=other.name, label=other.title, covariates=other.covariates,
            earlier=[*simulated_runs(other, other.soil_map), *earlier.get(other.name, ())],
        )
        for other in result.properties[1:]
        if other.soil_map is not None
    ]  # fmt: skip
    others = [replace(one, change=run_change(one.soil_map, end_s, one.earlier)) for one in others]
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
