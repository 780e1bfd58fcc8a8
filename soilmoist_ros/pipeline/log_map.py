# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The steps of ``soilmoist map``: logs -> counts -> samples -> variogram -> kriging -> report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, distance_text, listing, resource
from soilmoist_ros.mapping import (
    MAX_EXACT_SAMPLES,
    Compute,
    CovariateSource,
    Drift,
    DriftModel,
    Field,
    FieldGrid,
    FieldMap,
    FieldMapSettings,
    FitMethod,
    Knowledge,
    LocalModel,
    ModelName,
    NoiseModel,
    PositionSource,
    load_field,
    read_covariates,
    require_covariates,
    require_near,
)
from soilmoist_ros.pipeline.earlier_runs import Target, find_runs, read_earlier_runs, require_other, same_survey
from soilmoist_ros.pipeline.field_survey import input_file, loss_rows_of, make_run, require_crs
from soilmoist_ros.pipeline.file_facts import far_from_site, looks_swapped, position_notes
from soilmoist_ros.pipeline.run import (
    REFERENCE,
    CorrectionRow,
    EarlierRun,
    InputFile,
    LossRow,
    MapRun,
    Note,
    NoteCode,
)
from soilmoist_ros.recording import is_bag, message_files
from soilmoist_ros.sensing import (
    CheckedTrack,
    Consequence,
    CountRecord,
    Fix,
    Kind,
    LogFile,
    LoggerFormat,
    Problem,
    Reference,
    Site,
    SurveyRecords,
    Track,
    UndecidedOrderError,
    detect_format,
    distance_m,
    fit_reference,
    format_of_lines,
    load_logger_format,
    load_site,
    log_files,
    parse_log,
    process_logs,
    read_log,
    read_positions,
    stationary_records,
    utc_text,
)

MAX_GAP_S = 60.0
"""Time between two fixes up to which a record counts as placed in the first check of the places [s]."""

MAX_MOVED_M = 100.0
"""Distance from its usual place within which nine in ten positions of a stationary sensor lie [m]."""
MAX_AWAY_M = 10_000.0
"""Greatest distance of a reference sensor from the survey [m]."""
REFERENCE_KNOTS = 25
"""Times at which the error of a reference sensor is known; it is linear between them."""
MAX_EXTENT_M = 300_000.0
"""Extent of a track beyond which some of its positions are wrong [m]."""
MAX_APART_M = 2.0
"""Greatest distance of the positions of two files at the same time [m]."""
MAX_APART_AT_ONCE_M = 10.0
"""Greatest distance of positions of one file with one time: a fast vehicle, with times in whole seconds [m]."""
MIN_COMMON = 5
"""Least number of common times at which two files are compared."""
COMMON_GAP_S = 10.0
"""Time between two fixes of a file up to which those of another file are compared with it [s]."""
Progress = Callable[[str, float], None]
"""Called with the current step and its finished share [0..1]."""


@dataclass(frozen=True)
class MapSettings:
    """Choices of a mapping run; ``None`` derives the value from the data.

    :param logger: logger format, a shipped name or a file
    :param site: site file, or the name of a shipped one
    :param field: field file, or the name of a shipped one; ``None`` maps the hull of the track
    :param nmea: GNSS logs, for loggers without positions
    :param model: variogram model
    :param fit: ``reml`` or ``soft_l1``
    :param noise: as :class:`FieldMapSettings`
    :param local: as :class:`FieldMapSettings`
    :param drift_model: as :class:`FieldMapSettings`
    :param keep_nugget: map the rate with its micro-scale variation, or the smooth part only
    :param cell_m: cell size of the map [m]
    :param merge_radius_m: records closer together than this become one sample [m]
    :param title: title of the report
    :param crs: coordinate reference system of the outputs, checked before the work; ``None`` for the UTM zone
    :param max_exact_samples: maximum number of samples for an exact map; larger maps are computed in tiles
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`
    :param covariates: files with covariates, in addition to those of the field
    :param reference: log of a stationary sensor that counted during the survey
    :param logger_topic: topic with the lines of the logger in bags; see :func:`.logger_topic` if empty
    :param fix_topic: topic with the positions in bags; see :func:`.fix_topic` if empty
    :param gnss_shift_s: time added to those of the positions, such as 1024 weeks after a roll-over [s]
    :param times_s: begin and end of the part of the logs that is mapped [s since 1970-01-01 UTC]
    """

    logger: str | None = None
    site: Path | str | None = None
    field: Path | str | None = None
    nmea: tuple[Path, ...] = ()
    model: ModelName = "matern32"
    fit: FitMethod = "reml"
    noise: NoiseModel = "local"
    local: LocalModel = "auto"
    drift_model: DriftModel = "auto"
    keep_nugget: bool = True
    cell_m: float | None = None
    merge_radius_m: float | None = None
    title: str | None = None
    crs: str | None = None
    max_exact_samples: int = MAX_EXACT_SAMPLES
    earlier: tuple[Path, ...] = ()
    covariates: tuple[CovariateSource, ...] = ()
    reference: Path | None = None
    logger_topic: str = ""
    fix_topic: str = ""
    gnss_shift_s: float = 0.0
    times_s: tuple[float, float] = (-math.inf, math.inf)


def map_logs(
    paths: Sequence[Path],
    settings: MapSettings,
    progress: Progress = lambda step, share: None,
    compute: Compute = map,
) -> MapRun:
    """Map the logs of a survey.

    :param paths: log files of one probe, folders and ZIP archives of them, or bags with the lines of its logger
    :param settings: choices
    :param progress: called during the work
    :param compute: computes the tiles of a large map, see :func:`shared_work`; writing the outputs needs it again
    :raises InputError: if a file cannot be used; lists all mistakes

    >>> import tempfile
    >>> from soilmoist_ros.simulation.robot.virtual_survey import write_survey
    >>> with tempfile.TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     _ = write_survey(folder, seed=2, spacing_m=30.0, dwell_s=60.0)
    ...     files = {"site": folder / "site.yaml", "field": folder / "field.yaml"}
    ...     run = map_logs([folder / "survey.log"], MapSettings(nmea=(folder / "survey.nmea",), **files))
    >>> run.soil_map.vwc.shape == run.soil_map.rate.shape == run.soil_map.grid.shape
    True
    """
    site_file = resource("sites", str(settings.site)) if settings.site else None
    field_file = resource("fields", str(settings.field)) if settings.field else None
    settings = replace(settings, site=site_file, field=field_file)
    site = load_site(site_file) if site_file else Site()
    field = load_field(field_file) if field_file else None
    require_crs(settings.crs, field.frame if field else None)
    sources = (*(field.covariates if field else ()), *settings.covariates)
    require_covariates(sources)  # before the logs, which may take long to read
    for path in settings.earlier:
        find_runs(path.expanduser())
    skipped: list[Mistake] = []
    logs = read_logs(paths, settings.logger, site, progress, settings.logger_topic, skipped)
    part = within(logs, settings.times_s)
    track, track_problems = read_track(
        settings.nmea,
        [] if settings.nmea else [log.path for log in logs],
        settings.fix_topic,
        log_times(part),
        settings.gnss_shift_s,
    )
    placement, places = None, log_positions(part, track, site)
    source = position_source(part, settings.nmea, site, field_file)
    if field is not None:
        reach_m = max(field.extent_m, site.footprint_radius_m)  # no variogram yet
        placement = require_near(field, places, reach_m, source)
    progress("correcting and placing records", 0.0)
    try:
        survey = process_logs(logs, site, field.frame if field else None, track, times_s=settings.times_s)
    except InputError as fault:
        doubts = (
            one.mistake for one in track_problems if one.kind in (Kind.DOUBTFUL_POSITIONS, Kind.ASSUMED_TIME)
        )
        raise InputError([*fault.mistakes, *doubts]) from None
    require_crs(settings.crs, survey.frame)
    radius_m = site.footprint_radius_m / 4 if settings.merge_radius_m is None else settings.merge_radius_m
    grid, simulated = _grid(field, survey, site, settings.cell_m), any(log.simulated for log in logs)
    map_settings = FieldMapSettings(
        settings.model,
        settings.fit,
        settings.keep_nugget,
        radius_m,
        curve=site.curve,
        footprint_radius_m=site.known_footprint_m,
        deconvolve=site.deconvolve_footprint,
        max_exact_samples=settings.max_exact_samples,
        noise=settings.noise,
        local=settings.local,
        drift_model=settings.drift_model,
    )
    earlier: tuple[EarlierRun, ...] = ()
    if settings.earlier:
        target = Target(survey.frame, grid, map_settings, simulated=simulated)
        earlier = read_earlier_runs(settings.earlier, target)
        require_other(earlier, survey.records)
    covariates = read_covariates(sources, survey.frame, grid)
    records = survey.records
    reference = error = None
    if settings.reference is not None:
        reference = read_reference(settings.reference, site, records, survey.frame)
        records, error = tuple(reference.corrected(records)), reference_error(reference)
    field_map = FieldMap(grid, map_settings, Knowledge(tuple(run.survey for run in earlier), covariates, error))
    field_map.set_records(records)
    progress(f"fitting the variogram of {len(field_map.samples)} samples", 0.0)
    kriging = f"kriging {np.count_nonzero(field_map.grid.mask)} cells"
    soil_map = field_map.compute(field_map.state, lambda share: progress(kriging, share), compute)
    if soil_map is None:
        raise InputError("there are too few samples for a map", "survey at two places at least, or use REML")
    if placement is not None and placement.nearest_m > max(
        range_m := soil_map.variogram.practical_range_m, radius_m
    ):
        message = f"{placement.words()}, beyond the correlation range of {range_m:.0f} m: the map would be a guess"
        raise InputError(message, "give the field file of the place that was surveyed", field_file)
    swapped = looks_swapped((survey.frame.latitude_deg, survey.frame.longitude_deg))
    run = make_run(
        soil_map,
        sorted([*field_map.track, *survey.quarantined], key=attrgetter("stamp_s")),
        site,
        survey.frame,
        field_name=field.name if field else "surroundings of the track",
        settings={
            "variogram_model": settings.model,
            "variogram_fit": settings.fit,
            "poisson_noise": settings.noise,
            "local_variance": settings.local,
            "drift_model": settings.drift_model,
            "nugget": "kept" if settings.keep_nugget else "filtered",
            "merge_radius_m": radius_m,
            "cell_m": field_map.grid.cell_m,
            "deconvolved_footprint_m": soil_map.deconvolved_m,
            **({"begin_utc": utc_text(settings.times_s[0])} if math.isfinite(settings.times_s[0]) else {}),
            **({"end_utc": utc_text(settings.times_s[1])} if math.isfinite(settings.times_s[1]) else {}),
            **({"gnss_shift_s": settings.gnss_shift_s} if settings.gnss_shift_s else {}),
            "tube_shares": ", ".join(f"{share:.3f}" for share in survey.tube_share),
            **{f"log: {key}": text for key, text in reading_of(logs).items()},
            **({"kriging": str(soil_map.accuracy)} if soil_map.accuracy else {}),
        },
        title=settings.title or ("Soil moisture over time" if site.curve and len(soil_map.samples) == 1 else None),
        inputs=_inputs(logs, settings, sources),
        logger_format=logs[0].format_title,
        losses=[*loss_rows([*survey.problems, *track_problems]), *loss_rows_of(field_map.snapshot())],
        simulated=simulated,
        earlier=earlier,
        covariates=covariates,
        notes=[
            *(Note(NoteCode.FAR_FROM_SITE, f"{one}.") for one in far_from_site(site, places, source)),
            *(Note(NoteCode.POSITIONS, f"{one}.") for one in position_notes(track_problems, track)),
            *([Note(NoteCode.POSITIONS, f"{swapped[0].upper()}{swapped[1:]}.")] if swapped else []),
            *([Note(NoteCode.SKIPPED_FILES, f"{skipped_text(skipped)}.")] if skipped else []),
            *count_notes(survey.problems, len(survey.records) + len(survey.quarantined)),
        ],
    )
    return run if reference is None else with_reference(run, reference)


def read_reference(path: Path, site: Site, records: Sequence[CountRecord], frame: LocalFrame) -> Reference:
    """The change of the rate during a survey, from the log of a stationary sensor.

    :param path: the log; its format is detected from its header
    :param site: its corrections, those of the survey
    :param records: records of the survey, at least one
    :param frame: their plane
    :raises InputError: if the log cannot be used, does not last for the survey, or is of a sensor that moved, that
        was elsewhere, or that is the one of the survey
    """
    logs = read_logs([path], None, site)
    require_standing(logs[0], frame, records)
    try:
        reference = stationary_records(logs, site)
    except InputError as error:
        raise InputError([replace(one, path=one.path or path) for one in error.mistakes]) from None
    if same_survey(reference, records):
        message = "is the log of the survey itself: what its sensor measured is not a change over time"
        raise InputError(message, "give the log of a second sensor, which stood still", path)
    start_s = min(record.stamp_s - record.exposure_s for record in records)
    return fit_reference(reference, start_s, max(record.stamp_s for record in records), path)


def require_standing(log: LogFile, frame: LocalFrame, records: Sequence[CountRecord]) -> None:
    """Check that a sensor stood still and near a survey, where its log has positions.

    :raises InputError: if it did not
    """
    places = [(one.position.latitude_deg, one.position.longitude_deg) for one in log.records if one.position]
    if not places:
        return
    xy = frame.to_local(*np.array(places).T)
    place = np.median(xy, axis=0)
    moved_m = float(np.quantile(np.hypot(*(xy - place).T), 0.9))
    if not moved_m <= MAX_MOVED_M:
        message = f"is of a sensor that moved, by {distance_text(moved_m)}: a reference sensor stands still"
        raise InputError(message, "give the log of a stationary sensor", log.path)
    away_m = float(np.nanmin([math.hypot(one.x_m - place[0], one.y_m - place[1]) for one in records]))
    if not away_m <= MAX_AWAY_M:
        message = f"is of a sensor that stood {distance_text(away_m)} from the survey"
        raise InputError(message, "give the log of a sensor in or next to the field", log.path)


def reference_error(reference: Reference) -> Drift:
    """The error of the correction by a reference sensor, which all samples of a time share."""
    times_s = np.linspace(reference.start_s, reference.end_s, REFERENCE_KNOTS)
    return Drift.of_error(times_s, reference.factor_covariance(times_s))


def with_reference(run: MapRun, reference: Reference) -> MapRun:
    """A run whose counts were corrected by a reference sensor: it says so."""
    stamps = np.array([record.stamp_s for record in run.track if not record.quarantine])
    factors = reference.factor(np.clip(stamps, reference.start_s, reference.end_s))
    change, sd = reference.change
    row = CorrectionRow(
        REFERENCE,
        "R(end) / R(t)",
        {"change during the survey [%]": round(100 * change, 1), "standard deviation [%]": round(100 * sd, 1)},
        float(factors.mean()),
        float(factors.min()),
        float(factors.max()),
        "the map is of the field at the end of the survey",
    )
    return replace(run, corrections=[*run.corrections, row])


def read_logs(
    paths: Sequence[Path],
    logger: str | None,
    site: Site,
    progress: Progress = lambda step, share: None,
    topic: str = "",
    skipped: list[Mistake] | None = None,
) -> list[LogFile]:
    """Read the logs of one probe.

    :param paths: log files, bags, or folders and ZIP archives with such files, at least one
    :param topic: topic with the lines in bags; see :func:`.logger_topic` if empty
    :param logger: format, a shipped name or a file; detected from the header of the first log if ``None``
    :param skipped: gets the faults of files that cannot be used; errors if ``None``, or if no file can be used
    :raises InputError: if a file cannot be used, or if none can
    """
    form = load_logger_format(logger) if logger else None
    files = [one for path in paths for one in ([path] if is_bag(path) else log_files([path]))]
    mistakes, undecided = list[Mistake](), list[Path]()
    logs: dict[Path, LogFile] = {}
    for index, path in enumerate(files):
        progress("reading logs", index / len(files))
        try:
            form = form or _format_of(path, topic)
            logs[path] = _read(path, form, site, topic)
        except UndecidedOrderError as error:
            undecided.append(path)
            mistakes += error.mistakes
        except InputError as error:
            first = next(iter(logs.values()), None)
            continued = None if first is None or form is None else _continued(path, form, site, first)
            if continued is None:
                mistakes += error.mistakes
            else:
                logs[path] = continued
    order = next(
        (log.logger.time.date_order for log in logs.values() if log.logger and log.logger.time.rivals), None
    )
    if undecided and form is not None and order not in (None, "auto"):
        ordered = form.model_copy(update={"time": form.time.model_copy(update={"date_order": order})})
        logs |= {path: _read(path, ordered, site, topic) for path in undecided}
        mistakes, undecided = [one for one in mistakes if one.path not in undecided], []
    if mistakes and (skipped is None or undecided or not logs):
        raise InputError(mistakes)
    if skipped is not None:
        skipped += mistakes
    return [logs[path] for path in files if path in logs]


def _read(path: Path, form: LoggerFormat, site: Site, topic: str) -> LogFile:
    """Read one log file or bag."""
    if not is_bag(path):
        return read_log(path, form, site.longitude, site.logger_clock)
    return parse_log(_lines_of_bag(path, topic), form.on_clock(site.logger_clock), site.longitude, path)


def _continued(path: Path, form: LoggerFormat, site: Site, first: LogFile) -> LogFile | None:
    """A file that continues another one without a header of its own; ``None`` if it does not."""
    named = form.header.model_copy(update={"columns": first.columns})
    try:
        log = read_log(path, form.model_copy(update={"header": named}), site.longitude, site.logger_clock)
    except InputError:
        return None
    first_line = 2 if form.live_time.from_stamps else 1  # the first record may lack its live time
    if log.columns != first.columns or not log.records or log.records[0].line > first_line:
        return None  # a header that the format does not know stands before the records
    choice = f"{path.name} has no header: its columns are those of {first.path.name}"
    return replace(log, choices=(*log.choices, choice))


def _format_of(path: Path, topic: str) -> LoggerFormat:
    return format_of_lines(_lines_of_bag(path, topic), path) if is_bag(path) else detect_format(path)


def _lines_of_bag(path: Path, topic: str) -> Sequence[bytes]:
    # logs of a logger are read without the extra with recordings
    from soilmoist_ros.pipeline.bag_lines import logger_topic, text_lines
    from soilmoist_ros.recording import BagReader

    with BagReader(path) as reader:
        return text_lines(reader, logger_topic(reader, topic))


def skipped_text(skipped: Sequence[Mistake]) -> str:
    """Files that were skipped, by reason."""
    reasons: dict[str, list[str]] = {}
    for one in skipped:
        reasons.setdefault(one.message, []).append(one.path.name if one.path else "a file")
    texts = [f"{listing(names)} ({reason})" for reason, names in reasons.items()]
    return f"{len(skipped)} of the files {'is' if len(skipped) == 1 else 'are'} skipped: {'; '.join(texts)}"


def reading_of(logs: Sequence[LogFile]) -> dict[str, str]:
    """How logs were read, for the user to check: tubes, clock, notation, columns without use."""
    texts: dict[str, dict[str, None]] = {"counts of": {}, "clock": {}, "notation": {}, "not used": {}}
    for log in logs:
        if (form := log.logger) is None:
            continue
        left = [name for number, name in log.tubes.items() if number in form.counts.left_out]
        used = [name for number, name in log.tubes.items() if number not in form.counts.left_out]
        unit = "" if form.counts.unit == "counts" else f" ({form.counts.unit.replace('_', ' ')})"
        out = f"; left out: {', '.join(left)}" if left else ""
        note = f". {form.counts.note.strip().rstrip('.')}" if form.counts.note else ""
        texts["counts of"][f"{listing(used)}{unit}{out}{note}"] = None
        texts["clock"][f"{form.time.clock_text}, stamped at the {form.time.marks} of the interval"] = None
        texts["notation"] |= dict.fromkeys(log.choices)
        texts["not used"] |= dict.fromkeys(log.unused)
    return {key: ("; " if key != "not used" else ", ").join(found) for key, found in texts.items() if found}


def log_positions(logs: Sequence[LogFile], track: Track | None, site: Site) -> NDArray[np.float64]:
    """Latitude and longitude of the records of logs, shape (n, 2) [deg]; records without a place are left out.

    :param track: positions of a separate receiver, if any
    :param site: site with the location of a stationary probe, if any
    """
    records = [record for log in logs for record in log.records]
    places = [record.position if track is None else track.at(record.stamp_s, MAX_GAP_S) for record in records]
    known = [(place.latitude_deg, place.longitude_deg) for place in places if place is not None]
    if not known and track is None and site.location is not None:
        known = [(site.location.latitude_deg, site.location.longitude_deg)] * len(records)
    return np.array(known, float).reshape(-1, 2)


def position_source(
    logs: Sequence[LogFile], nmea: Sequence[Path], site: Site, field_file: Path | None
) -> PositionSource:
    """Where the positions of logs come from, for advice.

    :param nmea: GNSS logs, if any
    :param site: site of the logs
    :param field_file: the field file, if any
    """
    if nmea:
        return PositionSource(nmea[0].name, field_file=field_file)
    if not any(record.position for log in logs for record in log.records):
        return PositionSource("'location' in the site file", field_file=field_file)
    side = site.longitude if any(log.unsigned_longitude for log in logs) else "signed"
    return PositionSource(logs[0].path.name, side, field_file)


def within(logs: Sequence[LogFile], times_s: tuple[float, float]) -> list[LogFile]:
    """Logs with the records that end after the first time, and at the latest at the second.

    :param times_s: begin and end [s since 1970-01-01 UTC]
    :raises InputError: if there are none
    """
    start_s, end_s = times_s
    if math.isinf(start_s) and math.isinf(end_s):
        return list(logs)
    found = [
        replace(log, records=tuple(one for one in log.records if start_s < one.stamp_s <= end_s)) for log in logs
    ]
    if not any(log.records for log in found) and (span := log_times(logs)) is not None:
        lasts = " to ".join(map(utc_text, span))
        raise InputError("has no record between these times", f"the log lasts from {lasts} UTC", logs[0].path)
    return [log for log in found if log.records]


def log_times(logs: Sequence[LogFile]) -> tuple[float, float] | None:
    """Times of the first and the last record [s since 1970-01-01 UTC], ``None`` without records."""
    stamps = [record.stamp_s for log in logs for record in log.records]
    return (min(stamps), max(stamps)) if stamps else None


def read_track(
    paths: Sequence[Path],
    others: Sequence[Path] = (),
    topic: str = "",
    log_s: tuple[float, float] | None = None,
    shift_s: float = 0.0,
) -> tuple[Track | None, list[Problem]]:
    """The positions of GNSS logs and the faults in them; ``None`` without positions.

    :param paths: GNSS logs, tracks or bags
    :param others: files among which bags may have positions
    :param topic: topic with the positions in bags; see :func:`.fix_topic` if empty
    :param log_s: first and last time of the records [s since 1970-01-01 UTC], for positions without a date
    :param shift_s: time added to those of the positions [s]
    :raises InputError: if the logs hold no position
    """
    fixes: list[Fix] = []
    problems: list[Problem] = []
    used: list[Path] = []
    for path in [*paths, *filter(is_bag, dict.fromkeys(others))]:
        if is_bag(path):
            from soilmoist_ros.pipeline.bag_lines import fix_topic, read_fixes, unread_positions
            from soilmoist_ros.recording import BagReader

            with BagReader(path) as reader:
                name = fix_topic(reader, topic)
                found, faults = (
                    read_fixes(reader, name, log_s, shift_s) if name else ([], unread_positions(reader))
                )
            if name is None and path in paths:
                missing = Mistake("has no topic with positions", "name one with --fix-topic", path)
                raise InputError([one.mistake for one in faults] or [missing])
            if name is None:
                problems += faults
                continue
        else:
            found, faults = read_positions(path, log_s)
        _require_one_place(fixes, found, used, path)
        fixes, problems, used = fixes + found, problems + faults, [*used, path]
    if not used:
        return None, problems
    track, noted = shifted_track(fixes, shift_s, used[0])
    problems += noted
    if (why := track.heard.why_none()) is not None:
        chosen = (one.mistake for one in problems if one.kind is Kind.CHOSEN_POSITIONS)
        raise InputError([replace(why, path=used[0]), *chosen])
    return track, problems


def _require_one_place(fixes: Sequence[Fix], found: Sequence[Fix], used: Sequence[Path], path: Path) -> None:
    """Check that positions of several files are of one receiver, where they are of the same time.

    :raises InputError: if they are not
    """
    if not fixes:
        return
    track = Track(fixes)
    pairs = [(fix.position, track.at(fix.stamp_s, COMMON_GAP_S)) for fix in found if fix.no_place is None]
    apart_m = [distance_m(one, other) for one, other in pairs if other is not None]
    if len(apart_m) >= MIN_COMMON and (median_m := float(np.median(apart_m))) > MAX_APART_M:
        names = ", ".join(one.name for one in used)
        message = f"its positions are {distance_text(median_m)} from those of {names} at the same times (median)"
        raise InputError(message, "give the positions of one receiver", path)


def shifted_track(fixes: Sequence[Fix], shift_s: float, path: Path) -> tuple[CheckedTrack, list[Problem]]:
    """A track whose times are later by ``shift_s``, and a note on that.

    :param path: what the fixes were read from
    :raises InputError: if it has several positions of one time, far apart
    """
    known = sorted((fix for fix in fixes if fix.no_place is None), key=attrgetter("stamp_s"))
    first, apart_m = next(iter(known), None), []
    for fix in known:
        if first is not None and fix.stamp_s == first.stamp_s and fix is not first:
            apart_m.append(distance_m(first.position, fix.position))
        else:
            first = fix
    if len(apart_m) >= MIN_COMMON and (median_m := float(np.median(apart_m))) > MAX_APART_AT_ONCE_M:
        message = f"has {len(apart_m)} times with several positions, {distance_text(median_m)} apart (median)"
        remedy = "give the positions of one receiver; or the times have no seconds: export them with seconds"
        raise InputError(message, remedy, path)
    track = CheckedTrack([replace(fix, stamp_s=fix.stamp_s + shift_s) for fix in fixes])
    track.heard.shifted_s = shift_s
    if not shift_s:
        return track, []
    message = f"the times of the positions are shifted by {shift_s:+.0f} s (--gnss-shift)"
    return track, [Problem(Kind.ASSUMED_TIME, Mistake(message, "", path))]


def _grid(field: Field | None, survey: SurveyRecords, site: Site, cell_m: float | None) -> FieldGrid:
    if field is not None:
        return field.grid(cell_m, site.footprint_radius_m)
    extent_m = float(np.ptp(survey.xy_m, axis=0).max())
    if extent_m > MAX_EXTENT_M:
        message = f"the records lie up to {distance_text(extent_m)} apart, further than a survey goes"
        raise InputError(message, "correct the positions, or say which field to map: --field")
    try:
        return FieldGrid.from_track(survey.xy_m, site.footprint_radius_m, cell_m)
    except ValueError as error:
        raise InputError(f"the track cannot be gridded: {error}", "change the cell size") from None


def _inputs(
    logs: Sequence[LogFile], settings: MapSettings, covariates: Sequence[CovariateSource]
) -> list[InputFile]:
    others = [("GNSS log", file) for path in settings.nmea for file in message_files(path)]
    others += [("site", Path(settings.site))] if settings.site else []
    others += [("field", Path(settings.field))] if settings.field else []
    others += [("reference sensor", settings.reference)] if settings.reference else []
    others += [("covariate", path) for path in dict.fromkeys(one.path for one in covariates)]
    return [
        *(input_file(path, "neutron log", len(log.records)) for log in logs for path in message_files(log.path)),
        *(input_file(path, role, None) for role, path in others),
    ]


def count_notes(problems: Sequence[Problem], records: int) -> list[Note]:
    """Notes on tubes that were left out, and on counts that scatter.

    :param problems: problems of the logs
    :param records: number of all records
    """
    kinds = (Kind.NOISY_TUBE, Kind.DEAD_TUBE, Kind.STUCK_TUBE, Kind.IMPOSSIBLE_COUNT)
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
    codes = {
        Kind.OVERDISPERSED: NoteCode.OVERDISPERSED,
        Kind.OVERLAP: NoteCode.DOUBTFUL_LOG,
        Kind.LIVE_TIME_UNIT: NoteCode.DOUBTFUL_LOG,
        Kind.NOT_COUNTS: NoteCode.DOUBTFUL_LOG,
        Kind.MONTHS_APART: NoteCode.DOUBTFUL_LOG,
        Kind.OTHER_TUBE: NoteCode.DOUBTFUL_LOG,
    }
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
            kind=kind.text,
            count=counts[kind, consequence],
            example=str(replace(examples[kind, consequence], remedy="")),
            consequence=consequence,
            remedy=examples[kind, consequence].remedy,
        )
        for kind, consequence in order
    ]
