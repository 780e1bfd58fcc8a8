# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The steps of ``soilmoist map``: logs -> counts -> samples -> variogram -> kriging -> report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros import mapping
from soilmoist_ros.foundation import InputError, Mistake, distance_text, resource
from soilmoist_ros.pipeline.earlier_runs import EarlierTarget, find_runs, require_other
from soilmoist_ros.pipeline.field_survey import (
    field_map_settings,
    input_file,
    lacks_n0,
    loss_rows_of,
    make_run,
    open_map,
    require_crs,
    settings_of,
    with_general_calibration,
)
from soilmoist_ros.pipeline.file_facts import far_from_site, position_notes
from soilmoist_ros.pipeline.logs import (
    Progress,
    log_positions,
    log_times,
    position_source,
    read_logs,
    read_track,
    reading_of,
    skipped_text,
    with_position_doubts,
    within,
)
from soilmoist_ros.pipeline.run import InputFile, LossRow, MapRun, Note, NoteCode
from soilmoist_ros.recording import message_files
from soilmoist_ros.sensing import (
    Consequence,
    Kind,
    LogFile,
    Problem,
    SensorModel,
    Site,
    SurveyAir,
    SurveyRecords,
    Track,
    load_site,
    named_sensor,
    process_logs,
    utc_text,
)

MAX_EXTENT_M = 300_000.0  # extent of a track beyond which some of its positions are wrong [m]


@dataclass(frozen=True, kw_only=True)
class MapSettings(mapping.MappingSettings):
    """Choices of a mapping run; ``None`` derives the value from the data, and maps the hull of the track.

    :param field: field file, or the name of a shipped one
    :param site: site file, or the name of a shipped one
    :param logger: format of the lines of the logger; detected from their header if ``None``
    :param logger_topic: topic with the lines of the logger in bags; see :func:`.logger_topic` if empty
    :param fix_topic: topic with the positions in bags; see :func:`.fix_topic` if empty
    :param gnss_shift_s: time added to those of the positions, such as 1024 weeks after a roll-over [s]
    :param crs: coordinate reference system of the outputs, checked before the work; ``None`` for the UTM zone
    :param nmea: GNSS logs, for loggers without positions
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`
    :param covariates: files with covariates, in addition to those of the field
    :param sensor: model of the sensor or its sensitivity, for a site without N0, see :func:`general_calibration`
    :param times_s: begin and end of the part of the logs that is mapped [s since 1970-01-01 UTC]
    """

    field: Path | str | None = None
    site: Path | str | None = None
    logger: str | None = None
    logger_topic: str = ""
    fix_topic: str = ""
    gnss_shift_s: float = 0.0
    crs: str | None = None
    nmea: tuple[Path, ...] = ()
    title: str | None = None
    earlier: tuple[Path, ...] = ()
    covariates: tuple[mapping.CovariateSource, ...] = ()
    times_s: tuple[float, float] = (-math.inf, math.inf)
    sensor: str | float | None = None


@dataclass(frozen=True, eq=False)
class _Logs:
    """The files of a survey, read: all logs, faults of files that are not used, positions of a separate receiver.

    ``places`` are latitude and longitude of the records in the chosen time, shape (n, 2) [deg], from ``source``.
    ``named`` is the sensor where nothing but the header of a log says it.
    """

    site: Site
    site_file: Path | None
    field: mapping.Field | None
    field_file: Path | None
    covariates: Sequence[mapping.CovariateSource]
    logs: Sequence[LogFile]
    skipped: Sequence[Mistake]
    track: Track | None
    track_problems: Sequence[Problem]
    places: NDArray[np.float64]
    source: mapping.PositionSource
    named: SensorModel | None


def map_logs(
    paths: Sequence[Path], settings: MapSettings, progress: Progress = lambda step, share: None
) -> MapRun:
    """Map the logs of a survey.

    :param paths: log files of one probe, folders of them, or bags with the lines of its logger
    :raises InputError: if a file cannot be used; lists all mistakes
    """
    values = settings.values()
    read = _read_files(paths, settings, progress)
    site, field, logs = read.site, read.field, read.logs
    placement = None
    if field is not None:
        reach_m = max(field.extent_m, site.footprint_radius_m)  # no variogram yet
        placement = mapping.require_near(field, read.places, reach_m, read.source)
    progress("correcting and placing records", 0.0)
    try:
        frame = field.frame if field else None
        survey = process_logs(logs, site, frame, read.track, settings.times_s)
    except InputError as fault:
        raise with_position_doubts(fault, read.track_problems) from None
    require_crs(settings.crs, survey.frame)
    if values["merge_radius_m"] is None:
        values["merge_radius_m"] = site.footprint_radius_m / 4
    radius_m = values["merge_radius_m"]
    chosen = field_map_settings(values, site)
    simulated = any(log.simulated for log in logs)
    target = EarlierTarget(survey.frame, _grid(field, survey, site, settings.cell_m), chosen, simulated=simulated)
    field_map, earlier = open_map(target, settings.earlier, read.covariates)
    require_other(earlier, survey.records)
    field_map.set_records(survey.records)
    if lacks_n0(site):
        site = with_general_calibration(site, survey_air(read.logs, read.places), samples=field_map.samples)
        field_map.curve_of = lambda _: site.curve
    progress(f"fitting the variogram of {len(field_map.samples)} samples", 0.0)
    kriging = f"kriging {np.count_nonzero(field_map.grid.mask)} cells"
    soil_map = field_map.compute(field_map.state, lambda share: progress(kriging, share))
    if soil_map is None:
        raise InputError("there are too few samples for a map", "survey at two places at least, or use REML")
    range_m = soil_map.variogram.practical_range_m
    if placement is not None and placement.nearest_m > max(range_m, radius_m):
        message = f"{placement.words()}, beyond the correlation range of {range_m:.0f} m: the map would be a guess"
        raise InputError(message, "give the field file of the place that was surveyed", read.field_file)
    begin_s, end_s = settings.times_s
    unsigned = any(log.logger.position is not None and not log.logger.position.longitude_signed for log in logs)
    return make_run(
        soil_map, sorted([*field_map.track, *survey.quarantined], key=attrgetter("stamp_s")), site, survey.frame,
        field_name=field.name if field else "surroundings of the track",
        settings={
            **settings_of(field_map, soil_map, radius_m),
            **({"begin_utc": utc_text(begin_s)} if math.isfinite(begin_s) else {}),
            **({"end_utc": utc_text(end_s)} if math.isfinite(end_s) else {}),
            **({"gnss_shift_s": settings.gnss_shift_s} if settings.gnss_shift_s else {}),
            "tube_shares": ", ".join(f"{share:.3f}" for share in survey.tube_share),
            **{f"log: {key}": text for key, text in reading_of(logs).items()},
            **({"log: sensor": f"{read.named}, by the header of the log"} if read.named else {}),
            **({"log: longitudes": f"{site.longitude} of Greenwich: written without a sign"} if unsigned else {}),
            **({"kriging": soil_map.pooling} if soil_map.pooling else {}),
        },
        title=settings.title or ("Moisture at one place" if site.curve and len(soil_map.samples) == 1 else None),
        inputs=_inputs(read, settings), logger_format=logs[0].logger.title,
        losses=[*loss_rows([*survey.problems, *read.track_problems]), *loss_rows_of(field_map.snapshot())],
        simulated=simulated, earlier=earlier, covariates=field_map.knowledge.covariates,
        notes=_notes(read, survey),
    )  # fmt: skip


def _read_files(paths: Sequence[Path], settings: MapSettings, progress: Progress) -> _Logs:
    """Read the files of a survey; what can be checked comes before the logs, which may take long to read."""
    site_file = resource("sites", str(settings.site)) if settings.site else None
    field_file = resource("fields", str(settings.field)) if settings.field else None
    site = with_sensor(load_site(site_file) if site_file else Site(), settings.sensor, site_file)
    field = mapping.load_field(field_file) if field_file else None
    site = with_side(site, field)
    require_crs(settings.crs, field.frame if field else None)
    covariates = (*(field.covariates if field else ()), *settings.covariates)
    mapping.require_covariates(covariates)
    for path in settings.earlier:
        find_runs(path.expanduser())
    skipped: list[Mistake] = []
    logs = read_logs(paths, settings.logger, site, progress, settings.logger_topic, skipped)
    part = within(logs, settings.times_s)
    others = [] if settings.nmea else [log.path for log in logs]
    track, problems = read_track(settings.nmea, others, settings.fix_topic, log_times(part), settings.gnss_shift_s)
    places = log_positions(part, track, site)
    source = position_source(part, settings.nmea, site, field_file)
    named = None
    if lacks_n0(site) and site.sensor_sensitivity is None:
        named = named_sensor(
            text for log in logs for text in (*log.metadata, *log.metadata.values(), *log.columns)
        )
        site = site if named is None else site.model_copy(update={"sensor_sensitivity": named})
    if len(places):
        site = with_general_calibration(site, survey_air(part, places))
    return _Logs(
        site, site_file, field, field_file, covariates, logs, skipped, track, problems, places, source, named
    )  # fmt: skip


def with_side(site: Site, field: mapping.Field | None) -> Site:
    """Site on the side of Greenwich where the field is, for loggers that write longitudes without a sign; as given
    if it names the side, or the field is within a degree of Greenwich or of the date line.
    """
    east = 0.0 if field is None else field.frame.longitude_deg
    if "longitude" in site.model_fields_set or not 1 <= abs(east) <= 179:
        return site
    return site.model_copy(update={"longitude": "east" if east > 0 else "west"})


def with_sensor(site: Site, sensor: str | float | None, site_file: Path | None) -> Site:
    """Site whose sensor is that of an option; ``InputError`` if it has a calibration, or another sensor."""
    if sensor is None:
        return site
    if site.calibration is not None:
        message = "has a calibration, whose N0 is that of its own sensor"
        raise InputError(message, "leave --sensor out, or remove 'calibration' from the site file", site_file)
    if site.sensor_sensitivity not in (None, sensor):
        message = f"has the sensor_sensitivity {site.sensor_sensitivity}, not {sensor}"
        raise InputError(message, "leave --sensor out, or remove that of the site file", site_file)
    return site.model_copy(update={"sensor_sensitivity": sensor})


def write_sensor_site(site: str, sensor: str | float, path: Path) -> None:
    """Write the site file of a name or path, or of none, with the sensor of an option."""
    file = resource("sites", site) if site else None
    known = with_sensor(load_site(file) if file else Site(), sensor, file)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(known.model_dump_json(exclude_unset=True, indent=2) + "\n", encoding="utf-8")


def survey_air(logs: Sequence[LogFile], places: NDArray[np.float64]) -> SurveyAir:
    """Median place and air of logs; ``places``: latitude and longitude of the records, shape (n, 2) [deg]."""
    records = [record for log in logs for record in log.records]
    names = "pressure_hpa", "temperature_degc"
    air = (_median([getattr(record, name) for record in records]) for name in names)
    return SurveyAir(*np.median(places, axis=0).tolist(), *air)


def _median(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan


def _notes(read: _Logs, survey: SurveyRecords) -> list[Note]:
    """Notes of a run on its files: places, skipped files, tubes and counts."""
    positions = [f"{one}." for one in position_notes(read.track_problems, read.track)]
    return [
        *(Note(NoteCode.FAR_FROM_SITE, f"{one}.") for one in far_from_site(read.site, read.places, read.source)),
        *(Note(NoteCode.POSITIONS, one) for one in positions),
        *([Note(NoteCode.SKIPPED_FILES, f"{skipped_text(read.skipped)}.")] if read.skipped else []),
        *count_notes(survey.problems, len(survey.records) + len(survey.quarantined)),
    ]


def _grid(
    field: mapping.Field | None, survey: SurveyRecords, site: Site, cell_m: float | None
) -> mapping.FieldGrid:
    if field is not None:
        return field.grid(cell_m, site.footprint_radius_m)
    extent_m = float(np.ptp(survey.xy_m, axis=0).max())
    if extent_m > MAX_EXTENT_M:
        message = f"the records lie up to {distance_text(extent_m)} apart, further than a survey goes"
        raise InputError(message, "correct the positions, or say which field to map: --field")
    try:
        return mapping.FieldGrid.from_track(survey.xy_m, site.footprint_radius_m, cell_m)
    except ValueError as error:
        raise InputError(f"the track cannot be gridded: {error}", "change the cell size") from None


def _inputs(read: _Logs, settings: MapSettings) -> list[InputFile]:
    files = [
        *(("neutron log", file, len(log.records)) for log in read.logs for file in message_files(log.path)),
        *(("GNSS log", file, None) for path in settings.nmea for file in message_files(path)),
        ("site", read.site_file, None), ("field", read.field_file, None),
        *(("covariate", path, None) for path in dict.fromkeys(one.path for one in read.covariates)),
    ]  # fmt: skip
    return [input_file(path, role, count) for role, path, count in files if path is not None]


def count_notes(problems: Sequence[Problem], records: int) -> list[Note]:
    """Notes on tubes that were left out, and on counts that scatter."""
    kinds = (Kind.NOISY_TUBE, Kind.DEAD_TUBE, Kind.IMPOSSIBLE_COUNT)
    masked = Counter(problem.kind for problem in problems if problem.kind in kinds and not problem.quarantined)
    notes = []
    if masked:
        reasons = ", ".join(f"{kind.text} ({count})" for kind, count in masked.most_common())
        message = f"Bad tubes are left out {masked.total()} times in {records} records: {reasons}."
        notes.append(Note(NoteCode.BAD_TUBES, f"{message} The exposures cover the other tubes."))
    unread = [problem for problem in problems if problem.kind is Kind.BAD_POSITION]
    if unread:
        message = f"The positions of {len(unread)} lines cannot be read, the first: {unread[0].mistake}."
        notes.append(Note(NoteCode.DOUBTFUL_LOG, message))
    doubts = (Kind.OVERLAP, Kind.LIVE_TIME_UNIT, Kind.NOT_COUNTS, Kind.OTHER_TUBE)
    codes = {Kind.OVERDISPERSED: NoteCode.OVERDISPERSED, **dict.fromkeys(doubts, NoteCode.DOUBTFUL_LOG)}
    for problem in problems:
        if problem.kind in codes:
            message, remedy = problem.mistake.message, problem.mistake.remedy
            remedy = f": {remedy}" if remedy and problem.kind is not Kind.OVERDISPERSED else ""
            notes.append(Note(codes[problem.kind], f"{message[0].upper()}{message[1:]}{remedy}."))
    return notes


def loss_rows(problems: Sequence[Problem]) -> list[LossRow]:
    """One row per kind of problem: losses, quarantined records, then those kept; the most frequent first."""
    counts = Counter((problem.kind, problem.consequence) for problem in problems)
    examples = {(problem.kind, problem.consequence): problem.mistake for problem in reversed(problems)}
    ranks = get_args(Consequence)
    order = sorted(counts, key=lambda key: (ranks.index(key[1]), -counts[key], str(key[0])))
    return [
        LossRow(
            kind=kind.text, count=counts[kind, consequence],
            example=str(replace(examples[kind, consequence], remedy="")), consequence=consequence,
            remedy=examples[kind, consequence].remedy,
        )
        for kind, consequence in order
    ]  # fmt: skip
